// SPDX-License-Identifier: Apache-2.0
#include "camera_lens.h"
#include "camera_motion.h"
#include "camera_relative_pose.h"
#include "framework/pipeline/fake_host.h"
#include "look_at.h"
#include "support/catch.h"
#include "support/statistics.h"

using namespace diorama;
using namespace diorama::test;

namespace {

/// A camera off the origin, and a box whose centre is not its node's origin.
struct Set {
  Set() {
    camera = scene.create(scene.create(scene.root(), "Cameras"), "cam_0");
    scene.edit(camera).camera = Camera::from_lens(640, 400, 24.0, 20.955);
    scene.set_pose(camera, Transform{Vec3(1, 2, 3), look_rotation(Vec3(2, 1, -0.5))});
    mug = scene.create(scene.create(scene.root(), "Assets"), "mug");
    Mesh mesh = make_box(Vec3(0.1, 0.2, 0.3));
    for (Vec3f& position : mesh.positions) position.z() += 0.5f;
    scene.edit(mug).mesh = std::make_shared<const Mesh>(mesh);
    scene.set_pose(
        mug, Transform{Vec3(-3, 4, 1), Quat(Eigen::AngleAxisd(0.7, Vec3::UnitX())), Vec3(1, 2, 1)});
  }
  Vec3 centre() const { return scene.world_bounds(mug).centre(); }
  Vec3 axis(NodeId node, int column) const {
    return scene.world_from_node(node).linear().col(column).normalized();
  }
  FakeHost host;
  Scene scene;
  NodeId camera;
  NodeId mug;
};

}  // namespace

TEST_CASE("A camera that looks at a target keeps its place and a level horizon", "[randomizers]") {
  Set set;
  LookAt({}, set.host).randomize(set.scene, {}, Rng(1));
  CHECK(set.scene.world_from_node(set.camera).translation() == Vec3(1, 2, 3));
  const Vec3 towards = (set.centre() - Vec3(1, 2, 3)).normalized();
  CHECK((-set.axis(set.camera, 2) - towards).norm() < 1e-9);
  CHECK(std::abs(set.axis(set.camera, 0).z()) < 1e-9);
}

TEST_CASE("Any axis can point at the target, with +z upwards; scale stays", "[randomizers]") {
  const std::vector<std::pair<std::string, int>> axes{{"+x", 0}, {"+y", 1}};
  for (const auto& [name, column] : axes) {
    Set set;
    LookAt::Params params;
    params.nodes = "/Assets/*";
    params.targets = "/Cameras/*";
    params.axis = name;
    LookAt(params, set.host).randomize(set.scene, {}, Rng(1));
    const Vec3 towards = (Vec3(1, 2, 3) - Vec3(-3, 4, 1)).normalized();
    CHECK((set.axis(set.mug, column) - towards).norm() < 1e-9);
    CHECK(set.axis(set.mug, 2).z() > 0.5);
    CHECK(set.scene.world_from_node(set.mug).linear().col(1).norm() == Approx(2.0));
    CHECK(set.scene.world_from_node(set.mug).linear().determinant() == Approx(2.0));
  }
  Set set;
  LookAt::Params params;
  params.axis = "+z";
  LookAt(params, set.host).randomize(set.scene, {}, Rng(1));
  CHECK((set.axis(set.camera, 2) - (set.centre() - Vec3(1, 2, 3)).normalized()).norm() < 1e-9);
}

TEST_CASE("The point looked at moves by the offset, the picture turns by the roll",
          "[randomizers]") {
  Set set;
  LookAt::Params params;
  params.offset = Vec3(0.5, 0, 0);
  params.roll_deg = 90.0;
  LookAt(params, set.host).randomize(set.scene, {}, Rng(1));
  const Vec3 towards = (set.centre() + Vec3(0.5, 0, 0) - Vec3(1, 2, 3)).normalized();
  CHECK((-set.axis(set.camera, 2) - towards).norm() < 1e-9);
  CHECK(std::abs(set.axis(set.camera, 1).z()) < 1e-9);
}

TEST_CASE("Nodes placed in a camera's picture are seen where they should be", "[randomizers]") {
  Set set;
  CameraRelativePose::Params params;
  params.distance_m = Range{0.9, 1.4};
  params.horizontal = Range{-0.5, 0.75};
  params.vertical = Range{-0.8, 0.4};
  CameraRelativePose placement(params, set.host);
  const Mat3 before = set.scene.world_from_node(set.mug).linear();
  std::vector<double> distance, horizontal, vertical;
  for (int seed = 0; seed < kSeeds; ++seed) {
    placement.randomize(set.scene, {}, Rng(std::uint64_t(seed)));
    const Vec3 point = set.scene.world_from_node(set.camera).inverse() * set.centre();
    const auto pixel = project(*set.scene[set.camera].camera, point);
    REQUIRE(pixel);
    distance.push_back(point.norm());
    horizontal.push_back(pixel->x() / 320.0 - 1.0);
    vertical.push_back(1.0 - pixel->y() / 200.0);
  }
  CHECK(fills(distance, 0.9, 1.4));
  CHECK(fills(horizontal, -0.5, 0.75));
  CHECK(fills(vertical, -0.8, 0.4));
  CHECK((set.scene.world_from_node(set.mug).linear() - before).norm() < 1e-12);
}

TEST_CASE("A pattern without cameras is told in words", "[randomizers]") {
  Set set;
  CameraRelativePose::Params params;
  params.camera = "/Assets/*";
  CameraRelativePose placement(params, set.host);
  CHECK_THROWS_WITH(placement.randomize(set.scene, {}, Rng(1)),
                    ContainsSubstring("no camera fits '/Assets/*'"));
}

TEST_CASE("Lenses are drawn, what is not given stays", "[randomizers]") {
  Set set;
  CameraLens::Params params;
  params.focal_length_mm = Range{18.0, 50.0};
  params.principal_point_px = Distribution::between({-10, -4, 0}, {10, 4, 0});
  CameraLens lens(params, set.host);
  std::vector<double> focal, shift_x, shift_y;
  set.scene.edit(set.camera).camera->fy *= 1.25;
  for (int seed = 0; seed < kSeeds; ++seed) {
    lens.randomize(set.scene, {}, Rng(std::uint64_t(seed)));
    const Camera& camera = *set.scene[set.camera].camera;
    focal.push_back(camera.focal_length_mm);
    // Pixels follow the lens: 640 px on 20.955 mm.
    CHECK(camera.fx == Approx(camera.focal_length_mm * 640.0 / 20.955));
    CHECK(camera.fy == Approx(1.25 * camera.fx));
    shift_x.push_back(camera.cx - 320.0);
    shift_y.push_back(camera.cy - 200.0);
    CHECK(camera.f_stop == 0.0);
  }
  CHECK(fills(focal, 18.0, 50.0));
  CHECK(fills(shift_x, -10.0, 10.0));
  CHECK(fills(shift_y, -4.0, 4.0));
}

TEST_CASE("Velocities go along the camera's axes and move nothing", "[randomizers]") {
  Set set;
  CameraMotion::Params params;
  params.velocity = Vec3(0, 0, -2.0);
  params.angular_velocity_deg = Vec3(0, 90.0, 0);
  params.exposure_time_s = 0.01;
  const Affine before = set.scene.world_from_node(set.camera);
  CameraMotion(params, set.host).randomize(set.scene, {}, Rng(1));
  CHECK(set.scene.world_from_node(set.camera).matrix() == before.matrix());
  const Camera& camera = *set.scene[set.camera].camera;
  CHECK((camera.linear_velocity - 2.0 * Vec3(2, 1, -0.5).normalized()).norm() < 1e-9);
  CHECK((camera.angular_velocity - 0.5 * kPi * set.axis(set.camera, 1)).norm() < 1e-9);
  CHECK(camera.exposure_time_s == 0.01);

  CameraMotion drawn({}, set.host);
  drawn.randomize(set.scene, {}, Rng(2));
  const Vec3 first = camera.linear_velocity;
  CHECK(first.cwiseAbs().maxCoeff() <= 0.2 * std::sqrt(3.0));
  CHECK(camera.exposure_time_s == 0.01);  // null keeps it
  drawn.randomize(set.scene, {}, Rng(3));
  CHECK(camera.linear_velocity != first);
}
