// SPDX-License-Identifier: Apache-2.0
// Rays meet quads; what they tell is about the triangles of the source.
#include "embree_scene.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <vector>

#include "diorama/rng.h"
#include "support/catch.h"
#include "support/render_host/render_host.h"
#include "test_world.h"

namespace diorama {
namespace {

using test::at;
using test::matte;
using test::RenderHost;
using test::TestWorld;

/// A bumpy field whose triangles share no vertices: each corner has a normal and uv of its own. One
/// cell has but one triangle, which stays alone.
Mesh patchwork() {
  constexpr int kColumns = 5;
  constexpr int kRows = 4;
  Rng rng(7);
  std::array<std::array<Vec3f, kRows + 1>, kColumns + 1> field;
  for (int x = 0; x <= kColumns; ++x) {
    for (int y = 0; y <= kRows; ++y) {
      field[std::size_t(x)][std::size_t(y)] = {0.31f * float(x), 0.22f * float(y),
                                               float(rng.uniform(0.0, 0.07))};
    }
  }
  Mesh mesh;
  const auto add = [&](const std::array<std::array<int, 2>, 3>& corners) {
    const auto first = std::uint32_t(mesh.positions.size());
    mesh.triangles.push_back({first, first + 1, first + 2});
    mesh.material_slots.push_back(std::uint16_t(mesh.triangles.size() % 3));
    for (const auto& [x, y] : corners) {
      mesh.positions.push_back(field[std::size_t(x)][std::size_t(y)]);
      const Vec3 lean(rng.uniform(-0.5, 0.5), rng.uniform(-0.5, 0.5), 1.0);
      mesh.normals.push_back(lean.normalized().cast<float>());
      mesh.uvs.emplace_back(float(rng.uniform(-1.0, 2.0)), float(rng.uniform(-1.0, 2.0)));
    }
  };
  for (int x = 0; x < kColumns; ++x) {
    for (int y = 0; y < kRows; ++y) {
      add({{{x, y}, {x + 1, y}, {x + 1, y + 1}}});
      // The halves begin at other corners in every cell.
      if (x + y == 0) continue;
      if (x % 2 == 0) {
        add({{{x + 1, y + 1}, {x, y + 1}, {x, y}}});
      } else {
        add({{{x, y}, {x + 1, y + 1}, {x, y + 1}}});
      }
    }
  }
  return mesh;
}

/// Values that grow evenly to the right and, less, downwards.
std::shared_ptr<const Texture> ramp() {
  auto texture = std::make_shared<Texture>();
  texture->width = texture->height = 16;
  texture->channels = 1;
  for (int y = 0; y < 16; ++y) {
    for (int x = 0; x < 16; ++x) {
      texture->floats.push_back(0.1f + 0.04f * float(x) + 0.015f * float(y));
    }
  }
  return texture;
}

/// Of the inner part of the texture, where bilinear lookups continue it.
float ramp_at(const Vec2& uv) {
  return float(0.1 + 0.04 * (16.0 * uv.x() - 0.5) + 0.015 * (16.0 * (1.0 - uv.y()) - 0.5));
}

/// Uploaded, with a plane of 2 x 1 m that faces +z of the base node.
struct Sheet {
  TestWorld world;
  RenderHost host{1};
  EmbreeScene scene{host, {}};

  explicit Sheet(const Material& material) {
    world.add("sheet", make_plane(2.0, 1.0), material);
    scene.take(world.scene);
  }
  /// From above through the point with these uvs; the direction is in the base node's space.
  struct Ray {
    Vec3f origin;
    Vec3f direction;
  };
  Ray ray_through(const Vec2& uv, const Vec3& direction) const {
    const Affine world_from_base = world.scene.world_from_node(world.base);
    const Vec3 point(2.0 * (uv.x() - 0.5), uv.y() - 0.5, 0.0);
    return {(world_from_base * (point - direction.normalized())).cast<float>(),
            (world_from_base.linear() * direction.normalized()).cast<float>()};
  }
  /// One by one and in a packet, which must agree.
  Vec3f light_through(const Vec2& uv, const Vec3& direction) const {
    const Ray ray = ray_through(uv, direction);
    const Vec3f alone =
        scene.transmittance(ray.origin, ray.direction, 2.0f, Passage::Glass, kMoment);
    RayPacket8 packet;
    packet.clear();
    for (int i = 0; i < 3; ++i) packet.add(ray.origin, ray.direction, 0.0f, 2.0f, kMoment);
    scene.transmittance(packet, Passage::Glass,
                        [&](int, const Vec3f& share) { CHECK((share - alone).norm() < 1e-5f); });
    return alone;
  }
};

/// In both halves, off the border of the texture.
const std::vector<Vec2> kPlaces{{0.9, 0.1},  {0.1, 0.9},  {0.7, 0.3}, {0.35, 0.6},
                                {0.55, 0.5}, {0.45, 0.5}, {0.2, 0.1}, {0.8, 0.93}};

}  // namespace

TEST_CASE("rays traced together meet what each meets alone, said to be coherent or not", "[rays]") {
  TestWorld world;
  world.add("patchwork", patchwork(), Material(), at(-0.7, -0.4, 0.0));
  for (int i = 0; i < 12; ++i) {
    const double angle = 0.5 * i;
    world.add("ball" + std::to_string(i), make_sphere(0.12, 16), matte(0.5f),
              at(std::cos(angle), 0.7 * std::sin(angle), 0.03 * i));
  }
  RenderHost host(1);
  EmbreeScene scene(host, {});
  scene.take(world.scene);
  Rng rng(3);
  const auto within = [&](double range) { return rng.uniform(-range, range); };
  int met = 0;
  for (int fan = 0; fan < 300; ++fan) {
    const Affine world_from_base = world.scene.world_from_node(world.base);
    const Vec3 eye(within(2.0), within(2.0), rng.uniform(0.3, 2.0));
    const Vec3 target(within(0.9), within(0.9), 0.0);
    // From rays of one pixel to rays that go everywhere.
    const double spread = std::pow(10.0, rng.uniform(-3.0, 1.0));
    BatchRays rays;
    rays.is_coherent = fan % 3 != 0;
    const int count = 1 + fan % 19;
    for (int i = 0; i < count; ++i) {
      const Vec3 direction = target - eye + spread * Vec3(within(1.0), within(1.0), within(1.0));
      rays.add((world_from_base * eye).cast<float>(),
               (world_from_base.linear() * direction.normalized()).cast<float>(), 0.0f,
               i % 7 == 6 ? 0.8f : kInfinite, kMoment);
    }
    BatchHits batch;
    scene.intersect(rays, batch);
    for (std::size_t i = 0; i < rays.count; ++i) {
      CAPTURE(fan, i);
      const RayHit alone = scene.intersect(rays.origin.at(i), rays.direction.at(i), rays.t_min[i],
                                           rays.t_max[i], kMoment);
      REQUIRE(batch.instance[i] == alone.instance);
      if (!alone) continue;
      ++met;
      CHECK(batch.distance[i] == Approx(alone.distance));
      CHECK(batch.triangle[i] == std::int32_t(alone.triangle));
      CHECK(batch.u[i] == Approx(alone.u).margin(1e-4));
      CHECK(batch.v[i] == Approx(alone.v).margin(1e-4));
    }
  }
  CHECK(met > 1000);
}

TEST_CASE("a hit tells of the triangle at its place, in either half of a quad", "[rays]") {
  const bool is_moving = GENERATE(false, true);
  CAPTURE(is_moving);
  TestWorld world;
  Affine pose = at(0.3, -0.2, 0.5);
  pose.linear() = Eigen::AngleAxisd(0.7, Vec3(0.2, 1.0, -0.4).normalized()) *
                  Eigen::Scaling(1.3, -0.8, 1.1).toDenseMatrix();
  const Mesh mesh = patchwork();
  const NodeId node = world.add("patchwork", mesh, Material(), pose);
  for (int i = 0; i < 2; ++i) {
    world.scene.edit(node).materials.push_back(std::make_shared<const Material>());
  }
  if (is_moving) {
    RigidBody body;
    body.linear_velocity = Vec3(0.4, -0.3, 0.2);
    body.angular_velocity = Vec3(0.5, 0.1, -0.3);
    world.scene.edit(node).rigid_body = body;
    const NodeId camera = world.add_camera(8, 6, 5.0, Vec3(3, 0, 0), Vec3(0, 0, 0));
    world.scene.edit(camera).camera->exposure_time_s = 0.02;
  }
  RenderHost host(2);
  EmbreeScene scene(host, {});
  scene.take(world.scene);
  REQUIRE((scene.window() > 0.0) == is_moving);
  const MeshInstance& instance = scene.instances()[0];
  const Affine world_from_node = world.scene.world_from_node(node);

  Rng rng(11);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto& corners = mesh.triangles[t];
    std::array<Vec3, 3> p;
    for (std::size_t k = 0; k < 3; ++k) {
      p[k] = world_from_node * mesh.positions[corners[k]].cast<double>();
    }
    const Vec3 normal = (p[1] - p[0]).cross(p[2] - p[0]);
    BatchRays rays;
    std::vector<RayHit> hits;
    std::vector<std::array<double, 3>> weights;
    for (int i = 0; i < RayPacket8::kSize; ++i) {
      const double u = rng.uniform(0.01, 0.98);
      const double v = rng.uniform(0.01, 0.99 - u);
      weights.push_back({1.0 - u - v, u, v});
      const Vec3 place = p[0] * weights.back()[0] + p[1] * u + p[2] * v;
      // A mirrored pose turns the triangle's front away from its own normal's image.
      const Vec3 direction = (i % 2 == 0 ? 1.0 : -1.0) * normal.normalized();
      const Vec3f origin = (place - 0.01 * direction).cast<float>();
      hits.push_back(scene.intersect(origin, direction.cast<float>(), 0.0f, 0.02f, kMoment));
      rays.add(origin, direction.cast<float>(), 0.0f, 0.02f, kMoment);
    }
    // Once more, as the second packet of the batch.
    for (std::size_t i = 0; i < RayPacket8::kSize; ++i) {
      rays.add(rays.origin.at(i), rays.direction.at(i), rays.t_min[i], rays.t_max[i], rays.time[i]);
    }
    BatchHits batch;
    scene.intersect(rays, batch);
    for (std::size_t i = 0; i < 2 * RayPacket8::kSize; ++i) {
      const std::size_t ray = i % RayPacket8::kSize;
      const RayHit hit = i < RayPacket8::kSize ? hits[ray] : batch.at(8 + ray);
      CAPTURE(t, i);
      REQUIRE(hit.instance == &instance);
      CHECK(hit.distance == Approx(0.01f).margin(1e-4));
      CHECK(instance.slot(hit.triangle) == mesh.material_slots[t]);
      Vec2f uv = Vec2f::Zero();
      Vec3f n = Vec3f::Zero();
      for (std::size_t k = 0; k < 3; ++k) {
        uv += float(weights[ray][k]) * mesh.uvs[corners[k]];
        n += float(weights[ray][k]) * mesh.normals[corners[k]];
      }
      CHECK((instance.uv(hit.triangle, hit.u, hit.v) - uv).norm() < 2e-3f);
      CHECK((instance.shading->normal(hit.triangle, hit.u, hit.v) / 32767.0f - n).norm() < 1e-3f);
      CHECK((hit.normal.cast<double>() - normal).norm() < 1e-3 * normal.norm());
      const auto own = instance.shading->corners(hit.triangle);
      CHECK(std::is_permutation(own.begin(), own.end(), corners.begin()));
      CHECK(own[(std::find(own.begin(), own.end(), corners[0]) - own.begin() + 1) % 3] ==
            corners[1]);
    }
  }
}

TEST_CASE("a triangle without a partner is met where it is and nowhere else", "[rays]") {
  Mesh mesh;
  mesh.positions = {{0.1f, 0.2f, 0.0f}, {1.1f, 0.4f, 0.0f}, {0.5f, 0.9f, 0.0f}};
  mesh.triangles = {{0, 1, 2}};
  mesh.uvs = {{0.3f, 0.8f}, {0.7f, 0.1f}, {-0.4f, 0.2f}};
  mesh.normals = {Vec3f::UnitX(), Vec3f::UnitY(), Vec3f::UnitZ()};
  mesh.material_slots = {1};
  Scene world;
  const NodeId node = world.create(world.root(), "triangle");
  world.edit(node).mesh = std::make_shared<const Mesh>(mesh);
  RenderHost host(1);
  EmbreeScene scene(host, {});
  scene.take(world);
  const Vec3f direction(0.0f, 0.0f, -1.0f);
  // Along its edges and far beyond them, where the quad's other half would be.
  for (int i = -40; i <= 80; ++i) {
    for (int j = -40; j <= 80; ++j) {
      const float u = 0.025f * float(i);
      const float v = 0.025f * float(j);
      const Vec3f place = mesh.positions[0] + u * (mesh.positions[1] - mesh.positions[0]) +
                          v * (mesh.positions[2] - mesh.positions[0]);
      const RayHit hit = scene.intersect(place - direction, direction, 0.0f, 2.0f);
      const float inside = std::min({u, v, 1.0f - u - v});
      CAPTURE(u, v);
      if (std::abs(inside) > 1e-4f) CHECK(bool(hit) == (inside > 0.0f));
      if (!hit) continue;
      const Vec2f uv = (1.0f - u - v) * mesh.uvs[0] + u * mesh.uvs[1] + v * mesh.uvs[2];
      CHECK((hit.instance->uv(hit.triangle, hit.u, hit.v) - uv).norm() < 1e-5f);
      const Vec3f normal = interpolated_normal(hit) / 32767.0f;
      CHECK((normal - Vec3f(1.0f - u - v, u, v)).norm() < 1e-4f);
      CHECK(hit.instance->shading->slot(hit.triangle) == 1);
      const auto corners = hit.instance->shading->corners(hit.triangle);
      const Vec3f met = (1.0f - hit.u - hit.v) * mesh.positions[corners[0]] +
                        hit.u * mesh.positions[corners[1]] + hit.v * mesh.positions[corners[2]];
      CHECK((met - place).norm() < 1e-5f);
    }
  }
}

TEST_CASE("a hit has the same uv before and after its mesh gets a texture", "[rays]") {
  Sheet sheet(matte(0.5f));
  const NodeId node = sheet.scene.instances()[0].node;
  Material textured = matte(0.5f);
  textured.base_color_texture.texture = ramp();
  const auto check_uvs = [&] {
    for (const Vec2& uv : kPlaces) {
      const Sheet::Ray ray = sheet.ray_through(uv, Vec3(0.1, 0.2, -1.0));
      const RayHit hit = sheet.scene.intersect(ray.origin, ray.direction, 0.0f, 2.0f);
      REQUIRE(hit);
      CHECK((hit.instance->uv(hit.triangle, hit.u, hit.v) - uv.cast<float>()).norm() < 1e-5f);
    }
  };
  check_uvs();
  const ShadingMesh* before = sheet.scene.instances()[0].shading;
  sheet.world.scene.edit(node).materials = {std::make_shared<const Material>(textured)};
  sheet.scene.take(sheet.world.scene);
  check_uvs();
  CHECK(sheet.scene.instances()[0].shading == before);
}

namespace {

/// Skewed, mirrored and scaled.
Affine crooked(Rng& rng) {
  Affine pose = at(rng.uniform(-2.0, 2.0), rng.uniform(-2.0, 2.0), rng.uniform(-0.5, 0.5));
  const Vec3 axis(rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 1.0), 0.7);
  Mat3 shear = Mat3::Identity();
  shear(0, 1) = 0.3;
  const double side = rng.uniform() < 0.5 ? -1.0 : 1.0;
  pose.linear() = Eigen::AngleAxisd(rng.uniform(0.0, 3.0), axis.normalized()) * shear *
                  Eigen::Scaling(side * rng.uniform(0.4, 0.9), 0.6, 0.5).toDenseMatrix();
  return pose;
}

/// Copies of one mesh at many poses, which share it or have it each as their own; every third lets
/// light through, every fourth has holes.
TestWorld copies(bool are_shared, bool are_moving) {
  TestWorld world;
  Rng rng(5);
  const auto mesh = std::make_shared<const Mesh>(patchwork());
  Material glass;
  glass.base_color = Vec3f(0.9f, 0.6f, 0.3f);
  glass.transmission = 0.8f;
  glass.is_thin_walled = true;
  Material fence = matte(0.5f);
  fence.opacity_texture.texture = ramp();
  fence.opacity_threshold = 0.45f;
  for (int i = 0; i < 24; ++i) {
    const Material& material = i % 3 == 0 ? glass : i % 4 == 0 ? fence : matte(0.5f);
    const NodeId node = world.add("copy", *mesh, material, crooked(rng));
    if (are_shared) world.scene.edit(node).mesh = mesh;
    if (!are_moving || i % 2 == 0) continue;
    RigidBody body;
    body.linear_velocity = Vec3(0.4, -0.3, 0.2);
    body.angular_velocity = Vec3(0.5, 0.1, -0.3);
    world.scene.edit(node).rigid_body = body;
  }
  const NodeId camera = world.add_camera(8, 6, 5.0, Vec3(3, 0, 0), Vec3(0, 0, 0));
  if (are_moving) world.scene.edit(camera).camera->exposure_time_s = 0.02;
  return world;
}

void check_same(const RayHit& a, const RayHit& b) {
  CHECK(a.triangle == b.triangle);
  CHECK(a.u == Approx(b.u).margin(2e-3));
  CHECK(a.v == Approx(b.v).margin(2e-3));
  CHECK(a.distance == Approx(b.distance).epsilon(1e-4).margin(1e-5));
  CHECK((a.normal - b.normal).norm() < 2e-3f * b.normal.norm());
  const Vec3f normal = interpolated_normal(b);
  CHECK((interpolated_normal(a) - normal).norm() < 4e-3f * normal.norm());
}

}  // namespace

TEST_CASE("a mesh that is used several times is met like as many meshes", "[rays][instances]") {
  const bool are_moving = GENERATE(false, true);
  CAPTURE(are_moving);
  const TestWorld shared_world = copies(true, are_moving);
  const TestWorld own_world = copies(false, are_moving);
  RenderHost host(2);
  EmbreeScene shared(host, {});
  shared.take(shared_world.scene);
  EmbreeScene own(host, {});
  own.take(own_world.scene);
  REQUIRE(shared.trees().shared == 1);
  REQUIRE(own.trees().shared == 0);
  REQUIRE((shared.window() > 0.0) == are_moving);

  Rng rng(8);
  const auto within = [&](double range) { return rng.uniform(-range, range); };
  const Affine world_from_base = shared_world.scene.world_from_node(shared_world.base);
  constexpr int kRays = 6000;
  int met = 0;
  int differing = 0;
  int tinted = 0;
  for (int i = 0; i < kRays; i += RayPacket8::kSize) {
    BatchRays rays;
    for (int k = 0; k < RayPacket8::kSize; ++k) {
      const Vec3 eye(within(3.0), within(3.0), rng.uniform(0.5, 3.0));
      const Vec3 target(within(2.0), within(2.0), within(0.5));
      const float time = are_moving ? float(rng.uniform()) : kMoment;
      rays.add((world_from_base * eye).cast<float>(),
               (world_from_base.linear() * (target - eye).normalized()).cast<float>(), 0.0f,
               kInfinite, time);
    }
    BatchHits hits;
    shared.intersect(rays, hits);
    RayPacket8 packet;
    packet.clear();
    std::array<Vec3f, RayPacket8::kSize> passed;
    passed.fill(Vec3f::Zero());
    packet.load(rays, 0);
    shared.transmittance(packet, Passage::Glass,
                         [&](int k, const Vec3f& share) { passed[std::size_t(k)] = share; });
    for (std::size_t k = 0; k < rays.count; ++k) {
      CAPTURE(i, k);
      const Vec3f origin = rays.origin.at(k);
      const Vec3f direction = rays.direction.at(k);
      const RayHit alone = shared.intersect(origin, direction, 0.0f, kInfinite, rays.time[k]);
      const RayHit hit = own.intersect(origin, direction, 0.0f, kInfinite, rays.time[k]);
      const Vec3f through =
          own.transmittance(origin, direction, kInfinite, Passage::Glass, rays.time[k]);
      // Rays along an edge may go either way.
      const RayHit together = hits.at(k);
      const bool is_same = alone.instance == together.instance && bool(alone) == bool(hit) &&
                           (!hit || (alone.number == hit.number && alone.triangle == hit.triangle &&
                                     alone.triangle == together.triangle));
      differing += is_same && (through - passed[k]).norm() < 1e-2f ? 0 : 1;
      tinted += through.maxCoeff() > 0.0f && through.minCoeff() < 1.0f ? 1 : 0;
      if (!is_same || !hit) continue;
      ++met;
      check_same(alone, hit);
      check_same(together, alone);
    }
  }
  CHECK(met > kRays / 4);
  CHECK(tinted > kRays / 50);
  CHECK(differing < kRays / 500);
}

TEST_CASE("copies that become glass let light through, and block it again", "[instances]") {
  for (const int count : {1, 2}) {
    TestWorld world;
    std::vector<NodeId> nodes;
    const auto mesh = std::make_shared<const Mesh>(make_plane(2.0, 2.0));
    for (int i = 0; i < count; ++i) {
      nodes.push_back(world.add("sheet", *mesh, matte(0.5f), at(3.0 * i, 0.0, 0.0)));
      world.scene.edit(nodes.back()).mesh = mesh;
    }
    RenderHost host(1);
    EmbreeScene scene(host, {});
    const auto light_through = [&](int i) {
      const Affine pose = world.scene.world_from_node(nodes[std::size_t(i)]);
      const Vec3 origin = pose * Vec3(0.3, 0.2, 1.0);
      const Vec3 direction = pose.linear() * Vec3(0.0, 0.0, -1.0);
      return scene
          .transmittance(origin.cast<float>(), direction.cast<float>(), 2.0f, Passage::Glass,
                         kMoment)
          .x();
    };
    const auto set_material = [&](int i, const Material& material) {
      world.scene.edit(nodes[std::size_t(i)]).materials = {
          std::make_shared<const Material>(material)};
      scene.take(world.scene);
    };
    Material glass;
    glass.base_color.setOnes();
    glass.transmission = 1.0f;
    glass.is_thin_walled = true;
    scene.take(world.scene);
    CHECK(light_through(0) == 0.0f);
    set_material(0, glass);
    CHECK(light_through(0) > 0.8f);
    if (count == 2) CHECK(light_through(1) == 0.0f);
    set_material(0, matte(0.5f));
    CHECK(light_through(0) == 0.0f);
  }
}

TEST_CASE("copies of a mesh cost a pose each, and come and go", "[instances]") {
  constexpr int kCopies = 400;
  TestWorld world;
  Rng rng(2);
  const auto mesh = std::make_shared<const Mesh>(make_sphere(0.3, 40));
  world.add("floor", make_plane(6.0, 5.0), matte(0.5f));
  std::vector<NodeId> nodes;
  for (int i = 0; i < kCopies; ++i) {
    nodes.push_back(world.add("copy", make_plane(1.0, 1.0), matte(0.3f), crooked(rng)));
    world.scene.edit(nodes.back()).mesh = mesh;
    if (i % 2 == 0) world.scene.edit(nodes.back()).rigid_body = RigidBody{};
  }
  RenderHost host(2);
  EmbreeScene scene(host, {});
  const auto check = [&](std::size_t in_world, std::size_t shared, std::size_t vertices) {
    scene.take(world.scene);
    CHECK(scene.trees().in_world == in_world);
    CHECK(scene.trees().shared == shared);
    CHECK(scene.trees().vertices == vertices);
  };
  const std::size_t of_mesh = mesh->positions.size();
  check(1, 1, of_mesh + 4);
  REQUIRE(scene.instances().size() == kCopies + 1);

  // From above the last copy, wherever it is.
  const auto sees_last = [&] {
    const Affine pose = world.scene.world_from_node(nodes.back());
    const Vec3f up = world.scene.world_from_node(world.base).linear().col(2).cast<float>();
    const Vec3f origin = pose.translation().cast<float>() + 3.0f * up;
    const RayHit hit = scene.intersect(origin, -up, 0.0f, kInfinite);
    return hit && hit.instance->node == nodes.back();
  };
  world.scene.set_pose(nodes.back(), at(5.0, 5.0, 0.2));
  check(1, 1, of_mesh + 4);
  CHECK(sees_last());
  world.scene.set_pose(nodes.back(), at(-5.0, 5.0, 0.4));
  check(1, 1, of_mesh + 4);
  CHECK(sees_last());

  for (int i = 2; i < kCopies; ++i) world.scene.edit(nodes[std::size_t(i)]).is_visible = false;
  check(1, 1, of_mesh + 4);
  world.scene.edit(nodes[1]).is_visible = false;
  check(2, 0, of_mesh + 4);
  world.scene.edit(nodes.back()).is_visible = true;
  check(1, 1, of_mesh + 4);
  CHECK(sees_last());
  // Pressed flat, it is better met in the world.
  Affine flat = at(-5.0, 5.0, 0.4);
  flat.linear() = Eigen::Scaling(1.0, 1.0, 1e-5).toDenseMatrix();
  world.scene.set_pose(nodes.back(), flat);
  check(2, 1, 2 * of_mesh + 4);
  CHECK(sees_last());
  world.scene.edit(nodes.back()).mesh = std::make_shared<const Mesh>(*mesh);
  check(3, 0, 2 * of_mesh + 4);
  CHECK(sees_last());
}

TEST_CASE("a scene that takes the place of another is taken in anew", "[instances]") {
  // At the same address and after as many changes.
  RenderHost host(1);
  EmbreeScene scene(host, {});
  for (const double size : {1.0, 2.0, 3.0}) {
    TestWorld world;
    const NodeId node = world.add("sheet", make_plane(size, size), matte(0.5f));
    scene.take(world.scene);
    const Aabb bounds = world.scene.world_bounds(node);
    CHECK((scene.instances()[0].bounds.size() - bounds.size()).norm() < 1e-5);
  }
}

TEST_CASE("what has not changed is not made again", "[instances]") {
  TestWorld world = copies(true, false);
  world.add(test::dome(1.0f));
  RenderHost host(1);
  EmbreeScene scene(host, {});
  scene.take(world.scene);
  const ShadingMesh* mesh = scene.instances()[0].shading;
  const LightTable::Record* light = scene.lights().records().data();
  scene.take(world.scene);
  CHECK(scene.times().tree_s == 0.0);
  // A camera that moves changes nothing.
  world.scene.set_pose(world.scene.find("/base/camera"), at(0.1, 0.2, 0.3));
  scene.take(world.scene);
  CHECK(scene.lights().records().data() == light);
  CHECK(scene.instances()[0].shading == mesh);
}

TEST_CASE("a mesh that bends is made once, although others are shown in between", "[instances]") {
  TestWorld world;
  const NodeId node = world.add("sheet", make_plane(1.0, 1.0), matte(0.5f));
  world.scene.edit(world.base).animation = Animation{"sheet", 0.0, 1.0};
  RenderHost host(1);
  EmbreeScene scene(host, {});
  std::vector<std::shared_ptr<const Mesh>> frames;
  for (int i = 0; i < 12; ++i) {
    frames.push_back(std::make_shared<const Mesh>(make_plane(1.0 + 0.1 * i, 1.0)));
  }
  std::map<int, const ShadingMesh*> made;
  const auto show = [&](int frame) {
    world.scene.edit(node).mesh = frames[std::size_t(frame)];
    scene.take(world.scene);
    const MeshInstance& instance = scene.instances()[0];
    CHECK(&instance.source() == frames[std::size_t(frame)].get());
    const auto [known, is_new] = made.emplace(frame, instance.shading);
    CHECK(known->second == instance.shading);
    // Near its edge, which is elsewhere in each.
    const Affine world_from_node = world.scene.world_from_node(node);
    const Vec3 above(0.5 + 0.05 * frame - 0.01, 0.0, 1.0);
    const RayHit hit = scene.intersect(
        (world_from_node * above).cast<float>(),
        (world_from_node.linear() * Vec3(0.0, 0.0, -1.0)).cast<float>(), 0.0f, 2.0f);
    CHECK(hit);
  };
  // As a clip with flow shows them.
  for (int frame = 1; frame + 1 < 12; ++frame) {
    for (const int shown : {frame, frame + 1, frame - 1, frame}) show(shown);
  }
  CHECK(scene.kept().meshes <= 4);
  // Whose scene is gone goes, too.
  frames.clear();
  made.clear();
  world.scene.edit(node).mesh = std::make_shared<const Mesh>(make_plane(1.0, 1.0));
  scene.take(world.scene);
  CHECK(scene.kept().meshes == 1);
}

TEST_CASE("cut-outs have their holes in both halves of a quad", "[rays]") {
  Material fence = matte(0.5f);
  fence.opacity_texture.texture = ramp();
  fence.opacity_threshold = 0.45f;
  const Sheet sheet(fence);
  for (const Vec2& uv : kPlaces) {
    const Sheet::Ray ray = sheet.ray_through(uv, Vec3(0.1, 0.2, -1.0));
    const bool is_hole = ramp_at(uv) < 0.45f;
    CAPTURE(uv.x(), uv.y());
    CHECK(bool(sheet.scene.intersect(ray.origin, ray.direction, 0.0f, 2.0f)) == !is_hole);
    CHECK(sheet.light_through(uv, Vec3(0.1, 0.2, -1.0)) == Vec3f::Constant(is_hole ? 1.0f : 0.0f));
  }
}

TEST_CASE("veils weaken light by their texture in both halves of a quad", "[rays]") {
  Material veil = matte(0.5f);
  veil.opacity_texture.texture = ramp();
  const Sheet sheet(veil);
  for (const Vec2& uv : kPlaces) {
    CAPTURE(uv.x(), uv.y());
    CHECK(sheet.light_through(uv, Vec3(-0.3, 0.1, -1.0)).x() == Approx(1.0f - ramp_at(uv)));
  }
}

TEST_CASE("panes tint light by their texture and angle in both halves of a quad", "[rays]") {
  Material pane;
  pane.base_color.setOnes();
  pane.base_color_texture.texture = ramp();
  pane.transmission = 1.0f;
  pane.is_thin_walled = true;
  const Sheet sheet(pane);
  const Vec3 direction(0.6, 0.3, -1.0);
  // Fresnel's equations for n = 1.5, and the light that bounces between both faces.
  const double cosine = 1.0 / direction.norm();
  const double inner = std::sqrt(1.0 - (1.0 - cosine * cosine) / 2.25);
  const double s = (cosine - 1.5 * inner) / (cosine + 1.5 * inner);
  const double p = (1.5 * cosine - inner) / (1.5 * cosine + inner);
  const double once = 0.5 * (s * s + p * p);
  const double passed = 1.0 - 2.0 * once / (1.0 + once);
  for (const Vec2& uv : kPlaces) {
    CAPTURE(uv.x(), uv.y());
    CHECK(double(sheet.light_through(uv, direction).x()) ==
          Approx(passed * double(ramp_at(uv))).epsilon(1e-4));
  }
}

}  // namespace diorama
