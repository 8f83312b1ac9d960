// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <set>
#include <vector>

#include "diorama/error.h"
#include "diorama/rng.h"
#include "plugins/loader_assimp/loaded_file.h"
#include "support/catch.h"
#include "support/shared_data.h"
#include "support/temporary_folder.h"

namespace diorama::loader_assimp {

using test::LoadedFile;

namespace {

struct Counts {
  std::size_t meshes = 0;
  std::size_t triangles = 0;
  std::set<const Mesh*> different;
  std::size_t textured = 0;

  explicit Counts(const LoadedFile& loaded) {
    for (const NodeId id : loaded.scene.subtree(loaded.root)) {
      const Node& node = loaded.scene[id];
      if (!node.mesh) continue;
      ++meshes;
      triangles += node.mesh->triangles.size();
      different.insert(node.mesh.get());
      for (const auto& material : node.materials) {
        textured += material && material->base_color_texture ? 1 : 0;
      }
    }
  }
};

std::optional<std::filesystem::path> shared_file(const std::string& name) {
  const auto folder = test::shared_folder();
  if (folder && std::filesystem::exists(*folder / name)) return *folder / name;
  WARN(name + " is not here");
  return std::nullopt;
}

std::vector<std::filesystem::path> models_below(const std::filesystem::path& folder) {
  const std::set<std::string> kModels{".fbx", ".obj", ".ply", ".stl", ".gltf", ".glb", ".dae"};
  std::vector<std::filesystem::path> models;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    std::string ending = entry.path().extension().string();
    for (char& c : ending) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    if (kModels.contains(ending)) models.push_back(entry.path());
  }
  std::sort(models.begin(), models.end());
  return models;
}

std::string content_of(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

}  // namespace

TEST_CASE("the bench room is what its description says", "[loader_assimp]") {
  const auto file = shared_file("bench/scene.glb");
  const auto description = shared_file("bench/scene.json");
  if (!file || !description) return;
  const auto json = nlohmann::json::parse(std::ifstream(*description));
  const LoadedFile loaded(file->string());
  CHECK(loaded.host.messages.empty());
  const Counts counts(loaded);
  CHECK(counts.meshes == json["objects"].size());
  CHECK(counts.triangles == json["triangles"].get<std::size_t>());
  // Six chairs share one mesh, two curtains another one.
  CHECK(counts.different.size() == counts.meshes - 6);
  CHECK(loaded.node("chair.0").mesh == loaded.node("chair.5").mesh);
  CHECK(loaded.node("curtain.0").mesh == loaded.node("curtain.1").mesh);

  const Camera& camera = *loaded.node("camera").camera;
  const double scale = double(camera.width) / json["camera"]["width"].get<double>();
  CHECK(camera.fx == Approx(scale * json["camera"]["fx"].get<double>()).epsilon(1e-4));
  const Affine pose = loaded.scene.world_from_node(loaded.id("camera"));
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column) {
      CHECK(pose(row, column) ==
            Approx(json["camera"]["cam2world_blender"][row][column].get<double>()).margin(1e-5));
    }
  }
  for (std::size_t i = 0; i < json["lights"].size(); ++i) {
    const auto& stated = json["lights"][i];
    const std::string name = "lamp." + std::to_string(i);
    const Vec3 at = loaded.scene.world_from_node(loaded.id(name)).translation();
    const Light& light = *loaded.node(name).light;
    for (int axis = 0; axis < 3; ++axis) {
      CHECK(at[axis] == Approx(stated["position_blender"][axis].get<double>()).margin(1e-5));
      // Watts over the whole sphere.
      const double intensity =
          stated["color"][axis].get<double>() * stated["power_watt"].get<double>() / (4 * kPi);
      CHECK(double(light.color[axis]) * kPi * light.radius_m * light.radius_m ==
            Approx(intensity).epsilon(1e-3));
    }
  }
}

TEST_CASE("a scanned OBJ has the size of the thing", "[loader_assimp]") {
  const auto file = shared_file("data/ycb_obj/003_cracker_box/textured.obj");
  if (!file) return;
  const LoadedFile loaded(file->string());
  CHECK(loaded.host.messages.empty());
  const Counts counts(loaded);
  CHECK(counts.triangles == 16384);
  CHECK(counts.textured == 1);
  // A box of crackers: 6 x 16 x 21 cm, standing.
  const Vec3 size = loaded.bounds().size();
  CHECK(size.x() == Approx(0.07).margin(0.02));
  CHECK(size.y() == Approx(0.165).margin(0.02));
  CHECK(size.z() == Approx(0.213).margin(0.02));
}

TEST_CASE("furniture in centimetres is as large as furniture", "[loader_assimp]") {
  const auto file = shared_file(
      "data/scenes/aws_small_house/models/aws_robomaker_residential_ChairA_01/meshes/"
      "aws_ChairA_01_visual.DAE");
  if (!file) return;
  const LoadedFile loaded(file->string());
  CHECK(loaded.host.messages.empty());
  CHECK(Counts(loaded).textured == 1);
  const Aabb bounds = loaded.bounds();
  CHECK(bounds.min.z() == Approx(0.0).margin(0.02));
  CHECK(bounds.size().z() == Approx(0.9).margin(0.3));
}

TEST_CASE("all shared models load", "[loader_assimp]") {
  const auto folder = shared_file("data/scenes");
  if (!folder) return;
  const auto models = models_below(*folder);
  CHECK(models.size() > 20);
  for (const std::filesystem::path& model : models) {
    INFO(model.string());
    const LoadedFile loaded(model.string());
    CHECK(Counts(loaded).triangles > 0);
    CHECK_FALSE(loaded.bounds().is_empty());
  }
}

TEST_CASE("cut and damaged copies of real files are read or refused", "[loader_assimp][slow]") {
  const auto folder = shared_file("data/scenes");
  if (!folder) return;
  const test::TemporaryFolder copies;
  int refused = 0;
  int read = 0;
  for (const std::filesystem::path& model : models_below(*folder)) {
    if (std::filesystem::file_size(model) > 100'000) continue;
    const std::string whole = content_of(model);
    const Rng chance = Rng(7).fork(model.filename().string());
    for (std::uint64_t i = 0; i < 6; ++i) {
      Rng rng = chance.fork(i);
      const auto place = [&] { return std::size_t(rng.uniform() * double(whole.size())); };
      std::string damaged = whole;
      if (i < 2) {
        damaged.resize(place());
      } else {
        for (std::uint64_t k = 0; k + 1 < i; ++k) damaged[place()] = char(place() & 255);
      }
      const std::string file = copies.write("damaged" + model.extension().string(), damaged);
      INFO(model.string() << ", copy " << i);
      try {
        const LoadedFile loaded(file);
        CHECK(loaded.scene.subtree(loaded.root).size() > 0);
        ++read;
      } catch (const Error& error) {
        CHECK(error.kind() == ErrorKind::Asset);
        CHECK(std::string(error.what()).starts_with(file));
        ++refused;
      }
    }
  }
  CHECK(refused > 10);
  CHECK(read > 5);
}

}  // namespace diorama::loader_assimp
