// SPDX-License-Identifier: Apache-2.0
#include "orbit_cameras.h"

#include "diorama/obstacles.h"
#include "framework/pipeline/fake_host.h"
#include "support/catch.h"
#include "support/statistics.h"

using namespace diorama;
using namespace diorama::test;

namespace {

/// Two targets whose box centres are not their nodes' origins, one camera.
struct CameraSet {
  CameraSet() {
    Mesh mesh = make_box(Vec3(0.1, 0.2, 0.3));
    for (Vec3f& position : mesh.positions) position.z() += 0.5f;
    const auto shared_mesh = std::make_shared<const Mesh>(mesh);
    const NodeId assets = scene.create(scene.root(), "Assets");
    for (const Vec3& centre : centres) {
      const NodeId node = scene.create(assets, "mug");
      scene.edit(node).mesh = shared_mesh;
      scene.set_pose(node, Affine(Eigen::Translation3d(centre - Vec3(0, 0, 0.5))));
    }
    camera = scene.create(scene.create(scene.root(), "Cameras"), "cam_0");
    scene.edit(camera).camera = Camera{};
  }
  NodeId add_wall(const std::string& name, const Mesh& mesh, const Vec3& place) {
    const NodeId environment = scene.find("/Environment")
                                   ? scene.find("/Environment")
                                   : scene.create(scene.root(), "Environment");
    const NodeId node = scene.create(environment, name);
    scene.edit(node).mesh = std::make_shared<const Mesh>(mesh);
    scene.set_pose(node, Affine(Eigen::Translation3d(place)));
    return node;
  }
  Affine pose() const { return scene.world_from_node(camera); }
  /// Index of the nearer target.
  std::size_t target() const {
    const Vec3 position = pose().translation();
    return (position - centres[0]).norm() < (position - centres[1]).norm() ? 0 : 1;
  }

  std::vector<Vec3> centres{Vec3(1, 2, 0.9), Vec3(-7, 3, 1.2)};
  FakeHost host;
  Scene scene;
  NodeId camera;
};

OrbitCameras::Params orbit_params() {
  OrbitCameras::Params params;
  params.polar_angle_deg = Range{5.0, 75.0};
  return params;
}

}  // namespace

TEST_CASE("cameras keep distance and polar angle from the target itself", "[randomizers]") {
  CameraSet set;
  OrbitCameras orbit(orbit_params(), set.host);
  std::vector<double> distance, polar, azimuth, jitter;
  int first = 0;
  for (int seed = 0; seed < kSeeds; ++seed) {
    orbit.randomize(set.scene, {}, Rng(std::uint64_t(seed)));
    const std::size_t index = set.target();
    first += index == 0 ? 1 : 0;
    const Vec3 away = set.pose().translation() - set.centres[index];
    distance.push_back(away.norm());
    polar.push_back(std::acos(away.z() / away.norm()) * 180.0 / kPi);
    azimuth.push_back(std::atan2(away.y(), away.x()));
    // The axis of view passes the centre at no more than the jitter's corner distance.
    const Vec3 forward = -set.pose().linear().col(2);
    jitter.push_back(forward.cross(-away).norm());
    CHECK(forward.dot(-away) > 0.0);
    // A level horizon: the camera's x axis is horizontal.
    CHECK(std::abs(set.pose().linear()(2, 0)) < 1e-9);
    CHECK(set.pose().linear().determinant() == Approx(1.0));
  }
  CHECK(fills(distance, 1.05, 1.25));
  CHECK(fills(polar, 5.0, 75.0));
  CHECK(fills(azimuth, -kPi, kPi));
  CHECK(extent_of(jitter).hi <= 0.1 * std::sqrt(3.0) * 1.25 / 1.05);
  CHECK(extent_of(jitter).hi > 0.1);
  CHECK(std::abs(first - 250) < 45);  // binomial, four standard deviations
}

TEST_CASE("an arc roll is the shortest turn from looking down", "[randomizers]") {
  CameraSet set;
  OrbitCameras::Params params = orbit_params();
  params.roll = "arc";
  params.look_at_offset = 0.0;
  OrbitCameras(params, set.host).randomize(set.scene, {}, Rng(4));
  const Mat3 rotation = set.pose().linear();
  const Vec3 forward = -rotation.col(2);
  const double angle = std::acos(-forward.z());
  CHECK(Eigen::AngleAxisd(rotation).angle() == Approx(angle));
  CHECK((forward - (set.centres[set.target()] - set.pose().translation()).normalized()).norm() <
        1e-7);
}

TEST_CASE("without targets cameras look at the working area", "[randomizers]") {
  CameraSet set;
  OrbitCameras::Params params = orbit_params();
  params.targets = "/Nothing/*";
  params.look_at_offset = 0.0;
  RandomizeContext context;
  context.working_area_world = Vec3(4, 5, 6);
  OrbitCameras(params, set.host).randomize(set.scene, context, Rng(4));
  const Vec3 away = set.pose().translation() - Vec3(4, 5, 6);
  CHECK(away.norm() >= 1.05);
  CHECK(away.norm() <= 1.25);
}

TEST_CASE("cameras stay on the target's side of a wall and off its surface", "[randomizers]") {
  CameraSet set;
  // Walls 0.4 m beside both targets: about a third of all views would be taken from behind.
  for (const Vec3& centre : set.centres) {
    set.add_wall("wall", make_box(Vec3(0.1, 8, 8)), centre + Vec3(0.4, 0, 0));
  }
  OrbitCameras::Params params = orbit_params();
  OrbitCameras orbit(params, set.host);
  params.avoid_obstacles = false;
  OrbitCameras blind(params, set.host);
  int behind = 0;
  for (int seed = 0; seed < 200; ++seed) {
    orbit.randomize(set.scene, {}, Rng(std::uint64_t(seed)));
    const Vec3 away = set.pose().translation() - set.centres[set.target()];
    CHECK(away.x() <= 0.35 - 0.3 + 1e-9);
    CHECK(away.norm() >= 1.05 - 1e-9);
    CHECK(away.norm() <= 1.25 + 1e-9);
    blind.randomize(set.scene, {}, Rng(std::uint64_t(seed)));
    behind += (set.pose().translation() - set.centres[set.target()]).x() > 0.4 ? 1 : 0;
  }
  CHECK(behind > 20);
}

TEST_CASE("no near plane cuts a thing open, but things may hide a target", "[randomizers]") {
  CameraSet set;
  // A plate of clutter 0.7 m beside each target: some views are taken from within 0.3 m of it.
  const Vec3 half(0.05, 0.5, 0.5);
  const NodeId clutter = set.scene.create(set.scene.root(), "Distractors");
  for (const Vec3& centre : set.centres) {
    const NodeId plate = set.scene.create(clutter, "plate");
    set.scene.edit(plate).mesh = std::make_shared<const Mesh>(make_box(2.0 * half));
    set.scene.set_pose(plate, Affine(Eigen::Translation3d(centre + Vec3(0.7, 0, 0))));
  }
  OrbitCameras::Params params = orbit_params();
  OrbitCameras orbit(params, set.host);
  params.avoid_obstacles = false;
  OrbitCameras blind(params, set.host);
  const auto outside_of_plate = [&] {
    const Vec3 from_plate = set.pose().translation() - set.centres[set.target()] - Vec3(0.7, 0, 0);
    return Vec3(from_plate.cwiseAbs() - half).cwiseMax(0.0).norm();
  };
  int too_near = 0;
  int beyond = 0;
  for (int seed = 0; seed < 200; ++seed) {
    orbit.randomize(set.scene, {}, Rng(std::uint64_t(seed)));
    CHECK(outside_of_plate() >= 0.3 - 1e-6);
    beyond += (set.pose().translation() - set.centres[set.target()]).x() > 1.0 ? 1 : 0;
    blind.randomize(set.scene, {}, Rng(std::uint64_t(seed)));
    too_near += outside_of_plate() < 0.3 ? 1 : 0;
  }
  CHECK(too_near > 5);
  CHECK(beyond > 0);
}

TEST_CASE("a target that nothing can see still gets a view, the one without avoidance",
          "[randomizers]") {
  CameraSet set;
  for (const Vec3& centre : set.centres) {
    set.add_wall("box", make_box(Vec3(0.7, 0.7, 0.7)), centre);
  }
  OrbitCameras::Params params = orbit_params();
  params.max_tries = 5;
  OrbitCameras(params, set.host).randomize(set.scene, {}, Rng(11));
  const Affine with = set.pose();
  params.avoid_obstacles = false;
  OrbitCameras(params, set.host).randomize(set.scene, {}, Rng(11));
  CHECK(with.matrix() == set.pose().matrix());
}

TEST_CASE("hidden obstacles block no view, distances to triangles are exact", "[randomizers]") {
  CameraSet set;
  const NodeId wall = set.add_wall("wall", make_plane(2, 4), Vec3(10, 0, 1));
  const Obstacles obstacles(set.scene, "/Environment/**");
  CHECK(obstacles.is_between(Vec3(10.9, 1.9, 0), Vec3(10.9, 1.9, 2)));
  CHECK_FALSE(obstacles.is_between(Vec3(10.9, 1.9, 1.1), Vec3(10.9, 1.9, 2)));
  CHECK_FALSE(obstacles.is_between(Vec3(11.1, 0, 0), Vec3(11.1, 0, 2)));
  CHECK_FALSE(obstacles.is_between(Vec3(10.9, 2.1, 0), Vec3(10.9, 2.1, 2)));
  CHECK(obstacles.is_near(Vec3(10.3, 0.7, 1.2), 0.201));
  CHECK_FALSE(obstacles.is_near(Vec3(10.3, 0.7, 1.2), 0.199));
  // Beside the corner (11, 2, 1), at a distance of 0.3 * sqrt(3).
  CHECK(obstacles.is_near(Vec3(11.3, 2.3, 1.3), 0.52));
  CHECK_FALSE(obstacles.is_near(Vec3(11.3, 2.3, 1.3), 0.519));
  set.scene.edit(wall).is_visible = false;
  CHECK_FALSE(
      Obstacles(set.scene, "/Environment/**").is_between(Vec3(10.9, 1.9, 0), Vec3(10.9, 1.9, 2)));
}

TEST_CASE("cameras know the scene as it is at each call", "[randomizers]") {
  CameraSet set;
  CameraSet other;
  NodeId wall;
  for (const Vec3& centre : set.centres) {
    wall = set.add_wall("wall", make_box(Vec3(0.1, 8, 8)), centre + Vec3(0.4, 0, 0));
  }
  OrbitCameras orbit(orbit_params(), set.host);
  const auto sees_what_is_there = [&](CameraSet& now) {
    for (int seed = 0; seed < 20; ++seed) {
      orbit.randomize(now.scene, {}, Rng(std::uint64_t(seed)));
      const Affine pose = now.pose();
      OrbitCameras(orbit_params(), now.host).randomize(now.scene, {}, Rng(std::uint64_t(seed)));
      if (pose.matrix() != now.pose().matrix()) return false;
    }
    return true;
  };
  CHECK(sees_what_is_there(set));
  set.scene.set_pose(wall, Affine(Eigen::Translation3d(set.centres[1] - Vec3(0.4, 0, 0))));
  CHECK(sees_what_is_there(set));
  set.scene.set_pose(set.scene[wall].parent, Affine(Eigen::Translation3d(0.1, 0, 0)));
  CHECK(sees_what_is_there(set));
  set.scene.edit(wall).is_visible = false;
  CHECK(sees_what_is_there(set));
  const NodeId target = set.scene.match("/Assets/*").front();
  set.scene.set_pose(target, Affine(Eigen::Translation3d(3, 1, 2)));
  CHECK(sees_what_is_there(set));
  CHECK(sees_what_is_there(other));
  set.scene.erase(target);
  CHECK(sees_what_is_there(set));
}

TEST_CASE("cameras never stand in a closed thing, and leave the nearest for the freest place",
          "[randomizers]") {
  CameraSet set;
  // Shades of lamps, hollow for a camera of 0.3 m clearance, on the sphere of views.
  for (const Vec3& centre : set.centres) {
    for (int i = 0; i < 6; ++i) {
      const double angle = kPi / 3 * i;
      set.add_wall("shade", make_sphere(0.5, 24),
                   centre + Vec3(1.3 * std::cos(angle), 1.3 * std::sin(angle), 0.4));
    }
  }
  set.add_wall("far", make_box(Vec3(0.1, 0.1, 0.1)), Vec3(40, 40, 40));
  OrbitCameras orbit(orbit_params(), set.host);
  const Obstacles things(set.scene, "/Environment/**");
  for (int seed = 0; seed < 100; ++seed) {
    orbit.randomize(set.scene, {}, Rng(std::uint64_t(seed)));
    const Vec3 place = set.pose().translation();
    CHECK_FALSE(things.encloser(place));
    CHECK(things.distance(place, 1.0) >= 0.3);
  }
  // Nowhere is a metre of room: the freest of all draws is taken.
  OrbitCameras::Params params = orbit_params();
  params.clearance_m = 3.0;
  OrbitCameras choosy(params, set.host);
  params.clearance_m = 0.0;
  OrbitCameras easy(params, set.host);
  double chosen = 0.0, any = 0.0;
  for (int seed = 0; seed < 30; ++seed) {
    choosy.randomize(set.scene, {}, Rng(std::uint64_t(seed)));
    chosen += things.distance(set.pose().translation(), 3.0);
    easy.randomize(set.scene, {}, Rng(std::uint64_t(seed)));
    any += things.distance(set.pose().translation(), 3.0);
  }
  CHECK(chosen > 1.2 * any);
}
