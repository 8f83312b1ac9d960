// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "die.h"
#include "die_loader.h"
#include "number_on_top.h"
#include "table_loader.h"
#include "throw_dice.h"

using diorama::Affine;
using diorama::NodeId;
using diorama::Rng;
using diorama::Scene;
using diorama::Vec3;

namespace {

void check(bool holds, const std::string& what) {
  if (holds) return;
  std::fprintf(stderr, "failed: %s\n", what.c_str());
  std::exit(1);
}

/// The least that these components need of a host.
class TestHost final : public diorama::Host {
 public:
  void log(diorama::LogLevel, std::string_view message) override { last_message = message; }
  std::filesystem::path resolve(std::string_view asset) const override { return asset; }
  std::vector<std::filesystem::path> list_assets(std::string_view,
                                                 std::span<const std::string>) const override {
    return {};
  }
  NodeId load_asset(std::string_view, Scene&, NodeId) override { std::abort(); }
  std::shared_ptr<const diorama::Texture> decode_texture(std::span<const std::byte>,
                                                         std::string_view) const override {
    std::abort();
  }
  std::shared_ptr<const diorama::Texture> read_texture(
      const std::filesystem::path&) const override {
    std::abort();
  }
  std::vector<std::byte> encode_image(const diorama::ImageView&,
                                      diorama::ImageFormat) const override {
    std::abort();
  }
  void parallel_for(std::size_t count, const std::function<void(std::size_t)>& body) override {
    for (std::size_t i = 0; i < count; ++i) body(i);
  }
  int thread_count() const override { return 1; }

  std::string last_message;
};

TestHost host;

NodeId add_die(Scene& scene, const std::string& asset) {
  const NodeId parent =
      scene.find("/Assets") ? scene.find("/Assets") : scene.create(scene.root(), "Assets");
  const NodeId die = scene.create(parent, "die");
  dice::DieLoader({}, host).load(asset, scene, die);
  return die;
}

void label(Scene& scene) {
  dice::NumberOnTop({}, host).randomize(scene, {"landed", 0, Vec3::Zero(), 0, {}}, Rng(1));
}

/// Counts what is painted on the part of a two-coloured die that faces upwards: vertices whose
/// normal looks up (those of other faces are off by 42 degrees at least) tell which part of the
/// picture that is, and spots in it are counted by filling.
int spots_on_top(const Scene& scene, NodeId die) {
  const NodeId body = scene[die].children.front();
  const diorama::Mesh& mesh = *scene[body].mesh;
  const diorama::Texture& picture = *scene[body].materials.front()->base_color_texture.texture;
  const diorama::Mat3 turn = scene.world_from_node(body).linear();
  Eigen::AlignedBox2d seen;
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    if ((turn * mesh.normals[i].cast<double>()).z() > 0.76) seen.extend(mesh.uvs[i].cast<double>());
  }
  const int x_min = int(std::lround(seen.min().x() * picture.width));
  const int x_max = int(std::lround(seen.max().x() * picture.width));
  const int y_min = int(std::lround((1.0 - seen.max().y()) * picture.height));
  const int y_max = int(std::lround((1.0 - seen.min().y()) * picture.height));
  const auto texel = [&](int x, int y) {
    const std::uint8_t* at = &picture.bytes[std::size_t(3 * (y * picture.width + x))];
    return Vec3(at[0], at[1], at[2]);
  };
  const Vec3 ground = texel(x_min, y_min);  // no pip reaches into the corner of a face
  const int width = x_max - x_min, height = y_max - y_min;
  std::vector<char> is_spot(std::size_t(width * height));
  for (int i = 0; i < width * height; ++i) {
    const Vec3 color = texel(x_min + i % width, y_min + i / width);
    is_spot[std::size_t(i)] = (color - ground).norm() > 100.0;
  }
  int spots = 0;
  for (int start = 0; start < width * height; ++start) {
    if (!is_spot[std::size_t(start)]) continue;
    ++spots;
    std::vector<int> open{start};
    while (!open.empty()) {
      const int i = open.back();
      open.pop_back();
      if (!is_spot[std::size_t(i)]) continue;
      is_spot[std::size_t(i)] = 0;
      if (i % width > 0) open.push_back(i - 1);
      if (i % width < width - 1) open.push_back(i + 1);
      if (i >= width) open.push_back(i - width);
      if (i < width * (height - 1)) open.push_back(i + width);
    }
  }
  return spots;
}

/// One of the 24 ways to stand on a face, turned about the vertical and leaning a little.
diorama::Quat standing(Rng& rng, double lean_deg) {
  const std::array<Vec3, 6> axes{Vec3::UnitX(),  -Vec3::UnitX(), Vec3::UnitY(),
                                 -Vec3::UnitY(), Vec3::UnitZ(),  -Vec3::UnitZ()};
  const Vec3 up = axes[rng.index(6)];
  const Eigen::AngleAxisd yaw(rng.uniform(0.0, 2.0 * diorama::kPi), Vec3::UnitZ());
  const Eigen::AngleAxisd lean(lean_deg * diorama::kPi / 180.0, Vec3::UnitX());
  return diorama::Quat(lean * yaw) * diorama::Quat::FromTwoVectors(up, Vec3::UnitZ());
}

void labels_are_what_is_painted_on_top() {
  std::array<int, 7> seen{};
  for (int model = 1; model <= 90; ++model) {
    Scene scene;
    const NodeId die = add_die(scene, "plain_die:" + std::to_string(model));
    Rng rng = Rng(7).fork(std::uint64_t(model));
    scene.set_pose(die, Affine(Eigen::Translation3d(0.1, 0.2, 0.3) * standing(rng, 3.0)));
    label(scene);
    const int spots = spots_on_top(scene, die);
    const std::string& found = scene[die].labels.at("class");
    check(found == std::to_string(spots), "model " + std::to_string(model) + ": " +
                                              std::to_string(spots) +
                                              " spots are painted on top, the label is " + found);
    ++seen[std::size_t(spots)];
  }
  for (int number = 1; number <= 6; ++number) {
    check(seen[std::size_t(number)] > 5, "every number comes up");
  }
}

void what_has_no_number_on_top_is_hidden() {
  Rng rng(3);
  Scene scene;
  const NodeId leaning = add_die(scene, "die:1");
  const NodeId flat = add_die(scene, "die:2");
  const NodeId upper = add_die(scene, "die:3");
  scene.set_pose(leaning, Affine(Eigen::Translation3d(1.0, 0.0, 0.0) * standing(rng, 8.0)));
  scene.set_pose(flat, Affine(standing(rng, 4.0)));
  scene.set_pose(upper, Affine(Eigen::Translation3d(0.004, 0.0, 0.016) * standing(rng, 0.0)));
  label(scene);
  check(!scene[leaning].is_visible && scene[leaning].labels.empty(), "what leans is hidden");
  check(scene[flat].is_visible && scene[flat].labels.size() == 1, "what lies flat has a label");
  check(!scene[upper].is_visible, "what lies on another die is hidden");
  label(scene);
  check(!scene[leaning].is_visible, "and stays hidden in the next picture");
}

void dice_are_as_dice_are() {
  int left = 0, right = 0;
  for (int model = 1; model <= 50; ++model) {
    Scene scene;
    const NodeId die = add_die(scene, "die:" + std::to_string(model));
    std::array<Vec3, 6> normals;
    for (int number = 1; number <= 6; ++number) {
      const NodeId face = scene.require(scene.path(die) + "/face_" + std::to_string(number));
      normals[std::size_t(number - 1)] = scene.world_from_node(face).linear().col(2);
    }
    for (std::size_t i = 0; i < 3; ++i) {
      check((normals[i] + normals[5 - i]).norm() < 1e-9, "opposite faces add up to seven");
    }
    (normals[0].cross(normals[1]).dot(normals[2]) > 0.0 ? right : left) += 1;
    const diorama::Mesh& mesh = *scene[scene[die].children.front()].mesh;
    mesh.validate("die:" + std::to_string(model));
    for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
      check(mesh.normals[i].dot(mesh.positions[i]) > 0.0f, "normals look outwards");
    }
  }
  check(left > 12 && right > 12, "dice of both hands are made");
}

void throws_start_apart_and_within() {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Scene scene;
    dice::TableLoader({}, host).load("dice_table:" + std::to_string(seed), scene,
                                     scene.create(scene.create(scene.root(), "Environment"), "t"));
    std::vector<NodeId> thrown;
    for (int i = 1; i <= 12; ++i) thrown.push_back(add_die(scene, "die:" + std::to_string(i)));
    dice::ThrowDice({}, host).randomize(scene, {"environment", -1, Vec3::Zero(), 0, {}}, Rng(seed));
    const NodeId area = scene.require("/Environment/t/area");
    for (const NodeId die : thrown) {
      const Vec3 at = scene.world_from_node(die).translation();
      const Vec3 inside = scene.world_from_node(area).inverse() * at;
      check(std::abs(inside.x()) <= 1.0 && std::abs(inside.y()) <= 1.0, "dice start over the area");
      check(at.z() > 0.02, "and above its floor");
      for (const NodeId other : thrown) {
        const double apart = (scene.world_from_node(other).translation() - at).norm();
        check(other == die || apart > 0.017, "and apart from each other");
      }
    }
  }
}

void wrong_names_are_explained() {
  Scene scene;
  try {
    add_die(scene, "die:six");
    check(false, "a die without a number is refused");
  } catch (const diorama::Error& error) {
    check(std::string(error.what()) == "die:six: 'six' is no number; write die:7, for example",
          error.what());
  }
  Scene empty;
  label(empty);
  check(host.last_message.find("number_on_top: nothing that matches '/Assets/*'") == 0,
        host.last_message);
}

}  // namespace

int main() {
  labels_are_what_is_painted_on_top();
  what_has_no_number_on_top_is_hidden();
  dice_are_as_dice_are();
  throws_start_apart_and_within();
  wrong_names_are_explained();
}
