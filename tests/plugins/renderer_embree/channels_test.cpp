// SPDX-License-Identifier: Apache-2.0
#include "channels.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "diorama/rng.h"
#include "embree_renderer.h"
#include "null_renderer.h"
#include "support/catch.h"
#include "support/render_host/render_host.h"
#include "test_world.h"

namespace diorama {
namespace {

using test::at;
using test::matte;
using test::RenderHost;
using test::TestWorld;

NameSet all_channels() { return geometry_channels(); }

/// Shapes in front of each other, one with holes by texture, one mirrored and sheared.
TestWorld shapes() {
  TestWorld world;
  world.add("floor", make_plane(8, 8), matte(0.4f), at(0, 0, -0.6));
  world.add("ball", make_sphere(0.5, 64), matte(0.7f), at(0.3, 0.1, 0.2));
  Transform bent;
  bent.scale = Vec3(-0.8, 1.3, 0.6);
  bent.rotation = Quat(Eigen::AngleAxisd(0.7, Vec3(0.2, 0.4, 0.9).normalized()));
  bent.translation = Vec3(-0.7, 0.5, 0.0);
  world.add("box", make_box(Vec3(0.6, 0.5, 0.8)), matte(0.2f), bent.affine());
  auto holes = std::make_shared<Texture>();
  holes->width = holes->height = 4;
  holes->channels = 1;
  for (int i = 0; i < 16; ++i) holes->bytes.push_back((i + i / 4) % 2 ? 255 : 0);
  Material fence = matte(0.5f);
  fence.opacity_texture.texture = holes;
  fence.opacity_threshold = 0.5f;
  Affine upright = at(0.1, -0.9, 0.1) * Affine(Eigen::AngleAxisd(1.4, Vec3::UnitX()));
  world.add("fence", make_plane(1.5, 1.2), fence, upright);
  return world;
}

NodeId shapes_camera(TestWorld& world) {
  return world.add_camera(120, 90, 95.0, Vec3(-0.6, -3.2, 1.1), Vec3(0, 0, 0));
}

void set_lens(Camera& camera, LensModel lens) {
  camera.lens = lens;
  camera.distortion = {-0.08, 0.02, 0.001, -0.002, 0.0, 0.0, 0.0, 0.0};
  camera.fisheye_polynomial = {0.0, 1.0 / 90.0, 0.0, 1e-8, 0.0, 0.0};
}

}  // namespace

TEST_CASE("every geometry channel of a sphere is what geometry says", "[channels]") {
  TestWorld world;
  const double radius = 0.8;
  const Vec3 centre(0.2, -0.1, 0.3);
  const NodeId ball = world.add("ball", make_sphere(radius, 256), matte(0.35f),
                                at(centre.x(), centre.y(), centre.z()));
  const NodeId camera = world.add_camera(101, 76, 90.0, Vec3(2.5, -1.5, 1.2), Vec3(0.3, 0, 0.2));
  RenderHost host(2);
  EmbreeRenderer renderer({}, host);
  renderer.prepare(world.scene);
  const Frame frame = renderer.render({camera, all_channels(), 1});

  const Camera& lens = frame.camera;
  const Affine world_from_camera = frame.world_from_camera;
  const Vec3 middle = world.scene.world_from_node(ball).translation();
  int hits = 0;
  for (int y = 0; y < lens.height; ++y) {
    for (int x = 0; x < lens.width; ++x) {
      const Vec3 d = world_from_camera.linear() * *ray_direction(lens, Vec2(x + 0.5, y + 0.5));
      const Vec3 o = world_from_camera.translation() - middle;
      const double b = o.dot(d);
      const double disc = b * b - o.squaredNorm() + radius * radius;
      if (std::abs(disc) < 0.02) continue;  // the rim of a polygonal sphere
      CAPTURE(x, y);
      if (disc < 0.0) {
        CHECK(frame.get(kLeafId).at(x, y) == 0);
        CHECK(std::isinf(frame.get(kDistanceToCamera).at(x, y)));
        CHECK(frame.get(kNormals).at(x, y).isZero());
        continue;
      }
      ++hits;
      const double t = -b - std::sqrt(disc);
      const Vec3 p = world_from_camera.translation() + t * d;
      CHECK(frame.get(kLeafId).at(x, y) == ball.index);
      CHECK(frame.get(kDistanceToCamera).at(x, y) == Approx(t).margin(2e-3));
      const double depth = -(world_from_camera.inverse() * p).z();
      CHECK(frame.get(kDistanceToImagePlane).at(x, y) == Approx(depth).margin(2e-3));
      CHECK((frame.get(kPosition).at(x, y).cast<double>() - p).norm() < 3e-3);
      CHECK(frame.get(kNormals).at(x, y).cast<double>().dot((p - middle) / radius) > 0.999);
      CHECK((frame.get(kAlbedo).at(x, y) - Vec3f::Constant(0.35f)).norm() < 1e-5f);
    }
  }
  CHECK(hits > 800);
}

TEST_CASE("channels agree with the null renderer's, which shares no code", "[channels]") {
  TestWorld world = shapes();
  const NodeId camera = shapes_camera(world);
  for (const LensModel lens :
       {LensModel::Pinhole, LensModel::OpencvPinhole, LensModel::FisheyePolynomial}) {
    set_lens(*world.scene.edit(camera).camera, lens);
    RenderHost host(2);
    EmbreeRenderer embree({}, host);
    NullRenderer null({}, host);
    embree.prepare(world.scene);
    null.prepare(world.scene);
    const Frame a = embree.render({camera, all_channels(), 1});
    const Frame b = null.render({camera, all_channels(), 1});
    int differing = 0;
    int surfaces = 0;
    for (int y = 0; y < 90; ++y) {
      for (int x = 0; x < 120; ++x) {
        if (a.get(kLeafId).at(x, y) != b.get(kLeafId).at(x, y)) {
          ++differing;
          continue;
        }
        if (a.get(kLeafId).at(x, y) == 0) continue;
        ++surfaces;
        const float depth = a.get(kDistanceToImagePlane).at(x, y);
        differing += std::abs(depth - b.get(kDistanceToImagePlane).at(x, y)) > 1e-3f;
        differing += (a.get(kNormals).at(x, y) - b.get(kNormals).at(x, y)).norm() > 0.02f;
        differing += (a.get(kPosition).at(x, y) - b.get(kPosition).at(x, y)).norm() > 2e-3f;
        differing += (a.get(kUv).at(x, y) - b.get(kUv).at(x, y)).norm() > 2e-3f;
      }
    }
    CAPTURE(int(lens));
    CHECK(surfaces > 4000);
    CHECK(differing <= 12);  // rays along an edge may fall to either side
    CHECK(a.leaf_paths == b.leaf_paths);
  }
}

TEST_CASE("nothing nearer than the near plane is seen", "[channels]") {
  TestWorld world;
  world.add("near", make_plane(4, 4), matte(0.5f), at(0, 0, 0.5));
  const NodeId far = world.add("far", make_plane(9, 9), matte(0.5f), at(0, 0, -1.0));
  const NodeId camera = world.add_camera(30, 24, 15.0, Vec3(0, 0, 1), Vec3(0, 0.001, 0));
  world.scene.edit(camera).camera->near_m = 0.6;
  RenderHost host(1);
  EmbreeRenderer renderer({}, host);
  renderer.prepare(world.scene);
  const Frame frame = renderer.render({camera, all_channels(), 1});
  for (int y = 0; y < 24; ++y) {
    for (int x = 0; x < 30; ++x) {
      CHECK(frame.get(kLeafId).at(x, y) == far.index);
      CHECK(frame.get(kDistanceToImagePlane).at(x, y) == Approx(2.0).margin(0.01));
    }
  }
}

TEST_CASE("a coverage mask is what the object covers alone, also beyond the image", "[channels]") {
  const LensModel lens =
      GENERATE(LensModel::Pinhole, LensModel::OpencvPinhole, LensModel::FisheyePolynomial);
  CAPTURE(int(lens));
  TestWorld world = shapes();
  const NodeId group = world.scene.create(world.base, "group");
  const NodeId left = world.add("left", make_sphere(0.3), matte(0.5f), at(-1.9, 0.2, 0.1));
  const NodeId right =
      world.add("right", make_box(Vec3(0.4, 0.3, 0.5)), matte(0.5f), at(0.2, 0.9, 0.3));
  const NodeId camera = shapes_camera(world);
  const std::vector<LabelledInstance> instances{
      {group, {left, right}},
      {world.scene.find("/base/ball"), {world.scene.find("/base/ball")}},
      {world.scene.find("/base/fence"), {world.scene.find("/base/fence")}}};
  set_lens(*world.scene.edit(camera).camera, lens);
  RenderHost host(2);
  EmbreeRenderer renderer({}, host);
  renderer.prepare(world.scene);
  const std::vector<CoverageMask> masks = renderer.cover(camera, instances);

  // By brute force: a camera three times as large, all other meshes hidden.
  Camera wide = *world.scene[camera].camera;
  wide.width *= 3;
  wide.height *= 3;
  wide.cx += 120;
  wide.cy += 90;
  for (std::size_t i = 0; i < instances.size(); ++i) {
    TestWorld alone = shapes();
    alone.scene.create(alone.base, "group");
    alone.add("left", make_sphere(0.3), matte(0.5f), at(-1.9, 0.2, 0.1));
    alone.add("right", make_box(Vec3(0.4, 0.3, 0.5)), matte(0.5f), at(0.2, 0.9, 0.3));
    const NodeId eye = shapes_camera(alone);
    alone.scene.edit(eye).camera = wide;
    for (NodeId node : alone.scene.subtree(alone.base)) {
      const auto& leaves = instances[i].leaves;
      if (!alone.scene[node].mesh) continue;
      if (std::find(leaves.begin(), leaves.end(), node) == leaves.end()) {
        alone.scene.edit(node).is_visible = false;
      }
    }
    NullRenderer null({}, host);
    null.prepare(alone.scene);
    const Frame frame = null.render({eye, {std::string(kLeafId.name)}, 1});
    int covered = 0;
    int differing = 0;
    PixelBox extent{1000, 1000, -1000, -1000};
    for (int y = -90; y < 180; ++y) {
      for (int x = -120; x < 240; ++x) {
        const bool expected = frame.get(kLeafId).at(x + 120, y + 90) != 0;
        covered += expected;
        differing += expected != masks[i].covers(x, y);
        if (!masks[i].covers(x, y)) continue;
        extent = {std::min(extent.x_min, x), std::min(extent.y_min, y),
                  std::max(extent.x_max, x + 1), std::max(extent.y_max, y + 1)};
      }
    }
    CAPTURE(i);
    CHECK(covered > 200);
    CHECK(differing <= 4);
    CHECK(masks[i].box == extent);
  }
  CHECK(masks[0].box.x_min < 0);  // one of the two lies outside on the left
}

TEST_CASE("coverage by arithmetic is that of rays, all around the camera", "[channels]") {
  // What is whole is drawn, what may have holes is traced.
  auto opaque = std::make_shared<Texture>();
  opaque->width = opaque->height = opaque->channels = 1;
  opaque->bytes = {255};
  Material traced = matte(0.5f);
  traced.opacity_texture.texture = opaque;
  traced.opacity_threshold = 0.5f;
  Mesh soup;
  Rng rng(8);
  for (std::uint32_t i = 0; i < 400; ++i) {
    const Vec3f middle(float(rng.uniform(-4, 4)), float(rng.uniform(-4, 4)),
                       float(rng.uniform(-4, 4)));
    const float size = i % 40 == 0 ? 5.0f : 0.4f;
    for (int corner = 0; corner < 3; ++corner) {
      soup.positions.push_back(
          middle + size * Vec3f(float(rng.normal()), float(rng.normal()), float(rng.normal())));
    }
    soup.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  const double near_m = GENERATE(0.001, 1.5);
  const double far_m = GENERATE(2.5, 1000.0);
  RenderHost host(2);
  EmbreeRenderer::Params plain;
  plain.isa = "sse2";
  std::vector<CoverageMask> masks;
  for (const auto& [material, params] :
       {std::pair(matte(0.5f), EmbreeRenderer::Params()),
        std::pair(traced, EmbreeRenderer::Params()), std::pair(matte(0.5f), plain)}) {
    TestWorld world;
    const NodeId node = world.add("soup", Mesh(soup), material, at(0.1, 0, 0));
    const NodeId camera = world.add_camera(96, 72, 60.0, Vec3(0.3, -0.2, 0.1), Vec3(1, 0.4, 0.3));
    world.scene.edit(camera).camera->near_m = near_m;
    world.scene.edit(camera).camera->far_m = far_m;
    EmbreeRenderer renderer(params, host);
    renderer.prepare(world.scene);
    const std::vector<LabelledInstance> instances{{node, {node}}};
    masks.push_back(renderer.cover(camera, instances, true)[0]);
  }
  REQUIRE(masks[0].box == masks[2].box);
  int covered = 0;
  int differing = 0;
  int differing_by_isa = 0;
  const auto is_in_picture = [](int x, int y) { return x >= 0 && x < 96 && y >= 0 && y < 72; };
  for (int y = -72; y < 144; ++y) {
    for (int x = -96; x < 192; ++x) {
      const bool is_met = masks[1].covers(x, y);
      covered += is_met;
      if (is_met != masks[0].covers(x, y)) {
        ++differing;
      } else if (is_met) {
        const float a = masks[0].distances[masks[0].index(x, y)];
        const float b = masks[1].distances[masks[1].index(x, y)];
        differing += std::abs(a - b) > 1e-4f * b;
      }
      // Inside the picture rays have a say, which may differ in the last bit.
      if (is_in_picture(x, y) || !masks[0].covers(x, y)) continue;
      const std::size_t i = masks[0].index(x, y);
      differing_by_isa += !masks[2].covers(x, y) || masks[0].distances[i] != masks[2].distances[i];
    }
  }
  CAPTURE(near_m, far_m, covered);
  CHECK(differing_by_isa == 0);
  CHECK(covered > 5000);
  CHECK(differing <= 12);  // rays along an edge may fall to either side
}

TEST_CASE("what is cut out does not cover, what is hidden neither", "[channels]") {
  TestWorld world = shapes();
  const NodeId camera = shapes_camera(world);
  RenderHost host(1);
  EmbreeRenderer renderer({}, host);
  renderer.prepare(world.scene);
  const NodeId fence = world.scene.find("/base/fence");
  const std::vector<LabelledInstance> instances{{fence, {fence}}};
  const CoverageMask mask = renderer.cover(camera, instances)[0];
  const auto covered = std::count(mask.bits.begin(), mask.bits.end(), 1);
  // Half of a checkerboard.
  CHECK(double(covered) / double(mask.bits.size()) > 0.3);
  CHECK(double(covered) / double(mask.bits.size()) < 0.7);
}

}  // namespace diorama
