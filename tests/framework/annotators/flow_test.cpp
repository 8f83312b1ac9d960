// SPDX-License-Identifier: Apache-2.0
#include "framework/annotators/flow.h"

#include <cmath>

#include "diorama/rng.h"
#include "framework/annotators/triangle_grid.h"
#include "support/catch.h"

using namespace diorama;

namespace {

/// A wavy sheet of triangles, `n` by `n` quads.
Mesh sheet(int n, double wave) {
  Mesh mesh;
  for (int y = 0; y <= n; ++y) {
    for (int x = 0; x <= n; ++x) {
      const double u = double(x) / n, v = double(y) / n;
      mesh.positions.push_back(
          Vec3(u - 0.5 + 0.1 * wave * v, v - 0.5, wave * std::sin(3.0 * u + 2.0 * v))
              .cast<float>());
    }
  }
  const auto at = [&](int x, int y) { return std::uint32_t(y * (n + 1) + x); };
  for (int y = 0; y < n; ++y) {
    for (int x = 0; x < n; ++x) {
      mesh.triangles.push_back({at(x, y), at(x + 1, y), at(x + 1, y + 1)});
      mesh.triangles.push_back({at(x, y), at(x + 1, y + 1), at(x, y + 1)});
    }
  }
  return mesh;
}

Vec3 point_at(const Mesh& mesh, std::uint32_t triangle, const std::array<double, 3>& weights) {
  Vec3 point = Vec3::Zero();
  for (std::size_t k = 0; k < 3; ++k) {
    point += weights[k] * mesh.positions[mesh.triangles[triangle][k]].cast<double>();
  }
  return point;
}

/// The pictures have one pixel, which shows a point of a leaf; the camera at the origin looks along
/// -z and images more.
struct OnePixel {
  explicit OnePixel(std::shared_ptr<const Mesh> mesh) {
    leaf = scene.create(scene.root(), "leaf");
    scene.edit(leaf).mesh = std::move(mesh);
    scene.set_pose(leaf, Affine(Eigen::Translation3d(0.0, 0.0, -2.0)));
    camera = scene.create(scene.root(), "camera");
    frame.camera = Camera::from_lens(100, 100, 24.0, 40.0);
    scene.edit(camera).camera = frame.camera;
    frame.camera_path = "/camera";
    frame.leaf_paths[leaf.index] = "/leaf";
  }
  void show(const Vec3& in_node) {
    Image<std::uint32_t> leaves(1, 1, leaf.index);
    Image<Vec3f> positions(1, 1, Vec3f((in_node + Vec3(0, 0, -2)).cast<float>()));
    frame.set(kLeafId, std::move(leaves));
    frame.set(kPosition, std::move(positions));
  }
  FlowMeter meter(const std::shared_ptr<const Mesh>& there) const {
    return FlowMeter(scene, frame, [&](NodeId node) {
      return FlowMeter::There{scene.world_from_node(node), node == leaf ? there : nullptr};
    });
  }

  Scene scene;
  NodeId leaf, camera;
  Frame frame;
};

}  // namespace

TEST_CASE("A point of a mesh is found on the triangle that it was taken from", "[flow]") {
  Rng rng(7);
  for (const int n : {1, 3, 40}) {
    const Mesh mesh = sheet(n, 0.3);
    const TriangleGrid grid(mesh);
    for (int i = 0; i < 500; ++i) {
      const auto triangle = std::uint32_t(rng.index(mesh.triangles.size()));
      double a = rng.uniform(0.01, 1.0), b = rng.uniform(0.01, 1.0), c = rng.uniform(0.01, 1.0);
      const double sum = a + b + c;
      const std::array<double, 3> weights{a / sum, b / sum, c / sum};
      const auto place = grid.place_of(point_at(mesh, triangle, weights));
      REQUIRE(place);
      CHECK(place->triangle == triangle);
      for (std::size_t k = 0; k < 3; ++k) CHECK(std::abs(place->weights[k] - weights[k]) < 1e-5);
    }
  }
}

TEST_CASE("A grid takes what is odd: flat, tiny, one huge triangle among many, none", "[flow]") {
  Mesh mesh = sheet(30, 0.0);  // flat
  mesh.positions.insert(mesh.positions.end(), {{-500, -400, 300}, {600, -300, -200}, {0, 700, 9}});
  const auto last = std::uint32_t(mesh.positions.size());
  mesh.triangles.push_back({last - 3, last - 2, last - 1});
  const TriangleGrid grid(mesh);
  const auto huge = std::uint32_t(mesh.triangles.size() - 1);
  CHECK(grid.place_of(point_at(mesh, huge, {0.2, 0.3, 0.5}))->triangle == huge);
  CHECK(grid.place_of(point_at(mesh, 77, {0.2, 0.3, 0.5}))->triangle == 77);
  Mesh point;
  point.positions = {{1, 2, 3}, {1, 2, 3}, {1, 2, 3}};
  point.triangles = {{0, 1, 2}};
  const auto place = TriangleGrid(point).place_of({1, 2, 3});
  REQUIRE(place);
  CHECK(place->weights[0] + place->weights[1] + place->weights[2] == Approx(1.0));
  CHECK_FALSE(TriangleGrid(Mesh{}).place_of({0, 0, 0}));
}

TEST_CASE("Flow follows points of a mesh that bends", "[flow]") {
  const auto here = std::make_shared<const Mesh>(sheet(20, 0.1));
  const auto there = std::make_shared<const Mesh>(sheet(20, 0.4));
  OnePixel pixel(here);
  Rng rng(3);
  for (int i = 0; i < 200; ++i) {
    const auto triangle = std::uint32_t(rng.index(here->triangles.size()));
    const double a = rng.uniform(0.1, 0.4), b = rng.uniform(0.1, 0.4);
    const std::array<double, 3> weights{a, b, 1.0 - a - b};
    pixel.show(point_at(*here, triangle, weights));
    const Vec3 from(point_at(*here, triangle, weights) + Vec3(0, 0, -2));
    const Vec3 to(point_at(*there, triangle, weights) + Vec3(0, 0, -2));
    const Vec2 expected = *project(pixel.frame.camera, to) - *project(pixel.frame.camera, from);
    const FlowMeter meter = pixel.meter(there);
    CHECK((meter.flow().at(0, 0).cast<double>() - expected).norm() < 1e-3);
    REQUIRE(meter.points().size() == 1);
    CHECK((meter.points()[0] - to).norm() < 1e-5);
  }
}

TEST_CASE("Where a mesh gets other triangles, nobody knows where its points are", "[flow]") {
  OnePixel pixel(std::make_shared<const Mesh>(sheet(20, 0.1)));
  pixel.show(point_at(*pixel.scene[pixel.leaf].mesh, 5, {0.2, 0.3, 0.5}));
  for (const auto& there :
       {std::make_shared<const Mesh>(sheet(19, 0.1)), std::shared_ptr<const Mesh>()}) {
    const FlowMeter meter = pixel.meter(there);
    CHECK(meter.points().empty());
    CHECK(meter.states().at(0, 0) == std::uint32_t(FlowState::Unknown));
    CHECK(meter.flow().at(0, 0).isZero());
  }
}
