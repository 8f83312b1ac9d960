// SPDX-License-Identifier: Apache-2.0
// A box, a sphere and a cone before a wall, from three places through each lens. What every pixel
// shows is worked out here in closed form, with lens formulas of the test's own, and compared with
// renderers and annotators.
#include <algorithm>
#include <array>
#include <cmath>

#include "framework/annotators/instance_ids.h"
#include "framework/annotators/instances.h"
#include "framework/annotators/motion.h"
#include "framework/annotators/occlusion_order.h"
#include "framework/annotators/visibility.h"
#include "null_renderer.h"
#include "plugins/writer_support/fake_host.h"
#include "support/catch.h"
#include "writer_support/cuboid.h"
#ifdef DIORAMA_HAS_RENDERER_EMBREE
#include "embree_renderer.h"
#endif

using namespace diorama;

namespace {

constexpr double kBoxX = 0.5, kBoxY = 0.3, kBoxZ = 0.4;
constexpr double kSphereRadius = 0.22;
constexpr double kConeRadius = 0.2, kConeHeight = 0.5;

enum Shape { kWall, kBox, kSphere, kCone, kShapes };

/// Distance along the ray to the nearest surface point beyond `t_min`, in the shape's own space.
using Intersect = double (*)(const Vec3& o, const Vec3& d, double t_min);

double slab_box(const Vec3& o, const Vec3& d, double t_min, const Vec3& half) {
  double enter = -kInfinity, leave = kInfinity;
  for (int axis = 0; axis < 3; ++axis) {
    double a = (-half[axis] - o[axis]) / d[axis];
    double b = (half[axis] - o[axis]) / d[axis];
    if (a > b) std::swap(a, b);
    enter = std::max(enter, a);
    leave = std::min(leave, b);
  }
  if (enter > leave) return kInfinity;
  return enter >= t_min ? enter : leave >= t_min ? leave : kInfinity;
}

double hit_wall(const Vec3& o, const Vec3& d, double t_min) {
  return slab_box(o, d, t_min, Vec3(0.05, 2.5, 2.0));
}
double hit_box(const Vec3& o, const Vec3& d, double t_min) {
  return slab_box(o, d, t_min, 0.5 * Vec3(kBoxX, kBoxY, kBoxZ));
}

double hit_sphere(const Vec3& o, const Vec3& d, double t_min) {
  const double b = o.dot(d);
  const double c = o.squaredNorm() - kSphereRadius * kSphereRadius;
  const double root = b * b - d.squaredNorm() * c;
  if (root < 0.0) return kInfinity;
  for (const double t :
       {(-b - std::sqrt(root)) / d.squaredNorm(), (-b + std::sqrt(root)) / d.squaredNorm()}) {
    if (t >= t_min) return t;
  }
  return kInfinity;
}

/// Axis along z, base at -h/2, tip at h/2: x^2 + y^2 = (k (h/2 - z))^2 with k = radius / height.
double hit_cone(const Vec3& o, const Vec3& d, double t_min) {
  const double k = kConeRadius / kConeHeight;
  const double w = 0.5 * kConeHeight - o.z();
  const double a = d.x() * d.x() + d.y() * d.y() - k * k * d.z() * d.z();
  const double b = o.x() * d.x() + o.y() * d.y() + k * k * w * d.z();
  const double c = o.x() * o.x() + o.y() * o.y() - k * k * w * w;
  double best = kInfinity;
  const auto offer = [&](double t) {
    if (t >= t_min && t < best) best = t;
  };
  if (const double root = b * b - a * c; root >= 0.0) {
    for (const double sign : {-1.0, 1.0}) {
      const double t = (-b + sign * std::sqrt(root)) / a;
      const double z = o.z() + t * d.z();
      if (z >= -0.5 * kConeHeight && z <= 0.5 * kConeHeight) offer(t);
    }
  }
  const double t = (-0.5 * kConeHeight - o.z()) / d.z();
  if ((o + t * d).head<2>().norm() <= kConeRadius) offer(t);
  return best;
}

constexpr std::array<Intersect, kShapes> kIntersect{&hit_wall, &hit_box, &hit_sphere, &hit_cone};

struct World {
  Scene scene;
  std::array<NodeId, kShapes> nodes;
  std::vector<NodeId> cameras;  ///< Those of the last place ride on a cart.
  BodyPoses before;             ///< One time step ago.
};

/// A pose one step ago: turned about the node's own origin, and moved.
void move_body(World& world, NodeId node, double angle, const Vec3& axis, const Vec3& shift) {
  world.scene.edit(node).rigid_body = RigidBody{};
  Affine pose = world.scene.world_from_node(node);
  pose.linear() = Eigen::AngleAxisd(angle, axis.normalized()).toRotationMatrix() * pose.linear();
  pose.translation() += shift;
  world.before.emplace(node, pose);
}

std::array<Camera, 3> make_lenses() {
  Camera pinhole = Camera::from_lens(110, 70, 24.0, 30.0);
  pinhole.cx += 3.25;
  pinhole.cy -= 2.5;
  Camera opencv = pinhole;
  opencv.lens = LensModel::OpencvPinhole;
  opencv.distortion = {-0.12, 0.03, 0.002, -0.003, 0.01, 0.02, -0.01, 0.004};
  Camera fisheye = pinhole;
  fisheye.lens = LensModel::FisheyePolynomial;
  fisheye.fisheye_polynomial = {0.0, 0.012, 1e-5, -2e-8, 0.0, 0.0};
  fisheye.fisheye_max_angle_rad = 1.4;
  return {pinhole, opencv, fisheye};
}

void add_cameras(World& world) {
  const NodeId cart = world.scene.create(world.scene.root(), "cart");
  world.scene.set_pose(cart, Transform{{-1.0, 0.2, 0.1}, Quat::Identity(), Vec3::Ones()});
  const std::array<Vec3, 3> places{Vec3(-1.6, -0.4, 0.5), Vec3(-1.3, 0.6, 0.4),
                                   Vec3(-1.2, -0.5, -0.3)};
  for (std::size_t place = 0; place < places.size(); ++place) {
    for (const Camera& lens : make_lenses()) {
      const NodeId parent = place == 2 ? cart : world.scene.root();
      const NodeId node = world.scene.create(parent, "cam_0");
      Transform pose;
      pose.translation = places[place];
      pose.rotation = look_rotation(Vec3(0.1, 0.05, 0.02) - places[place], Vec3(0.1, 0.2, 1.0));
      world.scene.set_pose(node, world.scene.world_from_node(parent).inverse() * pose.affine());
      world.scene.edit(node).camera = lens;
      world.cameras.push_back(node);
    }
  }
  move_body(world, cart, 0.02, Vec3(0.1, 0.2, 1.0), Vec3(0.01, -0.02, 0.005));
}

World make_world() {
  World world;
  const auto add = [&](Shape shape, const char* name, Mesh mesh, const Vec3& place,
                       const Quat& rotation) {
    const NodeId node = world.scene.create(world.scene.root(), name);
    world.scene.set_pose(node, Transform{place, rotation, Vec3::Ones()});
    world.scene.edit(node).mesh = std::make_shared<const Mesh>(std::move(mesh));
    if (shape != kWall) world.scene.edit(node).labels = {{"class", name}};
    world.nodes[shape] = node;
  };
  const Quat tilted(Eigen::AngleAxisd(0.6, Vec3(0.3, 0.5, 0.8).normalized()));
  add(kWall, "wall", make_box({0.1, 5.0, 4.0}), {1.5, 0.0, 0.0}, Quat::Identity());
  add(kBox, "box", make_box({kBoxX, kBoxY, kBoxZ}), {0.1, 0.3, 0.0}, tilted);
  add(kSphere, "sphere", make_sphere(kSphereRadius, 512), {-0.1, -0.1, 0.13}, Quat::Identity());
  add(kCone, "cone", make_cone(kConeRadius, kConeHeight, 512), {0.3, -0.35, -0.1},
      Quat(Eigen::AngleAxisd(0.4, Vec3(1.0, -0.3, 0.1).normalized())));
  // A fast spin and a fast fall: 15 rad/s and 3 m/s at 60 steps per second.
  move_body(world, world.nodes[kBox], -0.25, Vec3(0.2, 1.0, -0.4), Vec3::Zero());
  move_body(world, world.nodes[kSphere], 0.1, Vec3(0.0, 0.3, 1.0), Vec3(0.01, -0.02, 0.05));
  add_cameras(world);
  return world;
}

/// Of OpenCV's pinhole with rational distortion: normalised x right, y down, to the same,
/// distorted.
Vec2 distorted(const Camera& camera, const Vec2& p) {
  const auto& k = camera.distortion;  // k1 k2 p1 p2 k3 k4 k5 k6
  const double r2 = p.squaredNorm();
  const double radial =
      (1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]))) / (1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7])));
  return radial * p + Vec2(2 * k[2] * p.x() * p.y() + k[3] * (r2 + 2 * p.x() * p.x()),
                           k[2] * (r2 + 2 * p.y() * p.y()) + 2 * k[3] * p.x() * p.y());
}

/// Camera-space ray of a pixel coordinate, not normalised for pinholes.
Vec3 lens_ray(const Camera& camera, const Vec2& pixel) {
  if (camera.lens == LensModel::FisheyePolynomial) {
    const Vec2 offset = pixel - Vec2(camera.cx, camera.cy);
    const double r = offset.norm();
    const auto& k = camera.fisheye_polynomial;
    const double theta = k[0] + r * (k[1] + r * (k[2] + r * (k[3] + r * (k[4] + r * k[5]))));
    return {std::sin(theta) * offset.x() / r, -std::sin(theta) * offset.y() / r, -std::cos(theta)};
  }
  const Vec2 wanted((pixel.x() - camera.cx) / camera.fx, (pixel.y() - camera.cy) / camera.fy);
  Vec2 p = wanted;
  if (camera.lens == LensModel::OpencvPinhole) {
    for (int i = 0; i < 200; ++i) p += 0.7 * (wanted - distorted(camera, p));
  }
  return {p.x(), -p.y(), -1.0};
}

Vec2 lens_pixel(const Camera& camera, const Vec3& p) {
  const Vec2 flat(p.x() / -p.z(), -p.y() / -p.z());
  if (camera.lens == LensModel::Pinhole) {
    return {camera.fx * flat.x() + camera.cx, camera.fy * flat.y() + camera.cy};
  }
  if (camera.lens == LensModel::OpencvPinhole) {
    const Vec2 d = distorted(camera, flat);
    return {camera.fx * d.x() + camera.cx, camera.fy * d.y() + camera.cy};
  }
  const double theta = std::atan2(p.head<2>().norm(), -p.z());
  const auto& k = camera.fisheye_polynomial;
  double lo = 0.0, hi = 400.0;
  for (int i = 0; i < 200; ++i) {
    const double r = 0.5 * (lo + hi);
    const double angle = k[0] + r * (k[1] + r * (k[2] + r * (k[3] + r * (k[4] + r * k[5]))));
    (angle < theta ? lo : hi) = r;
  }
  const Vec2 direction = Vec2(p.x(), -p.y()).normalized();
  return Vec2(camera.cx, camera.cy) + lo * direction;
}

struct Truth {
  std::array<double, kShapes> distance;  ///< Infinite where a shape is not met.
  int nearest = -1;
  double cosine = 1.0;  ///< Of the ray to the viewing axis.
};

Truth truth_at(const World& world, const Frame& frame, const Vec2& pixel) {
  const Vec3 ray = lens_ray(frame.camera, pixel).normalized();
  Truth truth;
  truth.cosine = -ray.z();
  const Vec3 origin = frame.world_from_camera.translation();
  const Vec3 direction = frame.world_from_camera.linear() * ray;
  double best = kInfinity;
  for (int shape = 0; shape < kShapes; ++shape) {
    const Affine local_from_world = world.scene.world_from_node(world.nodes[shape]).inverse();
    truth.distance[std::size_t(shape)] = kIntersect[std::size_t(shape)](
        local_from_world * origin, local_from_world.linear() * direction, 0.0);
    if (truth.distance[std::size_t(shape)] >= best) continue;
    best = truth.distance[std::size_t(shape)];
    truth.nearest = shape;
  }
  return truth;
}

/// Where the point that a ray meets was in the image one step ago.
Vec2 earlier_pixel(const World& world, const Frame& frame, const Truth& truth, const Vec2& pixel) {
  const auto moved = [&](NodeId node, const Vec3& point) -> Vec3 {
    const auto before = world.before.find(node);
    if (before == world.before.end()) return point;
    return before->second * (world.scene.world_from_node(node).inverse() * point);
  };
  const Vec3 ray = lens_ray(frame.camera, pixel).normalized();
  const Vec3 point = frame.world_from_camera * (truth.distance[std::size_t(truth.nearest)] * ray);
  const Vec3 earlier = moved(world.nodes[std::size_t(truth.nearest)], point);
  // The camera may ride on something that moved, too.
  Affine camera = frame.world_from_camera;
  if (const NodeId parent = world.scene[world.scene.require(frame.camera_path)].parent;
      world.before.contains(parent)) {
    camera = world.before.at(parent) * world.scene.world_from_node(parent).inverse() * camera;
  }
  return lens_pixel(frame.camera, camera.inverse() * earlier);
}

std::unique_ptr<Renderer> make_renderer(const std::string& name, Host& host) {
#ifdef DIORAMA_HAS_RENDERER_EMBREE
  if (name == "embree") return std::make_unique<EmbreeRenderer>(EmbreeRenderer::Params{}, host);
#endif
  return name == "null" ? std::make_unique<NullRenderer>(NullRenderer::Params{}, host) : nullptr;
}

Frame render(Renderer& renderer, const World& world, NodeId camera) {
  test::FakeHost host;
  RenderRequest request;
  request.camera = camera;
  request.channels = {"leaf_id", "position", "distance_to_camera", "distance_to_image_plane"};
  Frame frame = renderer.render(request);
  InstanceIds({}, host).annotate(world.scene, frame);
  Instances({}, host).annotate(world.scene, frame);
  const auto coverage = renderer.cover(camera, labelled_instances(world.scene), true);
  measure_visibility(coverage, false, frame);
  order_occlusions(coverage, frame);
  measure_motion(world.scene, world.before, frame);
  return frame;
}

struct Measured {
  PixelBox box{1 << 20, 1 << 20, 0, 0};
  std::int64_t visible = 0;
  std::int64_t alone = 0;
  std::array<std::int64_t, kShapes> behind{};  ///< By shape, where this one is nearer.

  void add(int x, int y) {
    ++visible;
    box = {std::min(box.x_min, x), std::min(box.y_min, y), std::max(box.x_max, x + 1),
           std::max(box.y_max, y + 1)};
  }
};

/// Pixels whose value is not the true one.
struct Wrong {
  int id = 0;
  int distance = 0;
  int depth = 0;
  int motion = 0;
};

using Measures = std::array<Measured, kShapes>;

/// Facets of the curved shapes are up to 5 micrometres inside them, which a grazing ray stretches;
/// those pixels are left to the flat shapes.
bool is_grazing(const World& world, const Frame& frame, const Truth& truth, int x, int y) {
  if (truth.nearest != kSphere && truth.nearest != kCone) return false;
  const auto nearest = std::size_t(truth.nearest);
  const Truth beside = truth_at(world, frame, Vec2(x + 1.0, y + 1.0));
  return beside.nearest != truth.nearest ||
         std::abs(beside.distance[nearest] - truth.distance[nearest]) > 0.01;
}

Wrong compare_pixels(const World& world, const Frame& frame, Measures& measured) {
  Wrong wrong;
  for (int y = 0; y < frame.camera.height; ++y) {
    for (int x = 0; x < frame.camera.width; ++x) {
      const Vec2 pixel(x + 0.5, y + 0.5);
      const Truth truth = truth_at(world, frame, pixel);
      for (std::size_t s = 0; s < kShapes; ++s) {
        if (!std::isfinite(truth.distance[s])) continue;
        ++measured[s].alone;
        for (std::size_t other = 0; other < kShapes; ++other) {
          const double distance = truth.distance[other];
          if (std::isfinite(distance) && truth.distance[s] < distance) ++measured[s].behind[other];
        }
      }
      const auto nearest = std::size_t(truth.nearest);
      const std::uint32_t id = truth.nearest < 0 ? 0 : world.nodes[nearest].index;
      if (frame.get(kLeafId).at(x, y) != id) ++wrong.id;
      if (truth.nearest < 0) continue;
      measured[nearest].add(x, y);
      if (is_grazing(world, frame, truth, x, y)) continue;
      const double distance = truth.distance[nearest];
      const double depth = distance * truth.cosine;
      const Vec2 motion = pixel - earlier_pixel(world, frame, truth, pixel);
      wrong.distance += std::abs(frame.get(kDistanceToCamera).at(x, y) - distance) > 1e-4;
      wrong.depth += std::abs(frame.get(kDistanceToImagePlane).at(x, y) - depth) > 1e-4;
      wrong.motion += (frame.get(kMotion).at(x, y).cast<double>() - motion).norm() > 0.01;
    }
  }
  return wrong;
}

}  // namespace

TEST_CASE("labels are those of the closed form, through every lens", "[annotators]") {
#ifdef DIORAMA_HAS_RENDERER_EMBREE
  const std::string name = GENERATE("null", "embree");
#else
  const std::string name = "null";
#endif
  INFO(name);
  const World world = make_world();
  test::FakeHost host;
  const auto renderer = make_renderer(name, host);
  renderer->prepare(world.scene);
  std::int64_t hidden = 0;
  std::int64_t ordered = 0;
  for (const NodeId camera : world.cameras) {
    const Frame frame = render(*renderer, world, camera);
    INFO(frame.camera_name);
    Measures measured;
    const Wrong wrong = compare_pixels(world, frame, measured);
    CHECK(wrong.id == 0);
    CHECK(wrong.distance == 0);
    CHECK(wrong.depth == 0);
    CHECK(wrong.motion == 0);
    for (const int shape : {kBox, kSphere, kCone}) {
      const auto instance =
          std::ranges::find(frame.instances, world.nodes[std::size_t(shape)].index, &Instance::id);
      REQUIRE(instance != frame.instances.end());
      const Measured& m = measured[std::size_t(shape)];
      CHECK(m.visible > 50);
      hidden += m.alone - m.visible;
      CHECK(instance->tight_box == m.box);
      CHECK(instance->visibility->visible_pixels == m.visible);
      CHECK(std::abs(instance->visibility->amodal_pixels - m.alone) <= 1);
      for (const int other : {kBox, kSphere, kCone}) {
        const auto order = std::ranges::find_if(frame.occlusions, [&](const Occlusion& o) {
          return o.front == instance->id && o.behind == world.nodes[std::size_t(other)].index;
        });
        const std::int64_t pixels = order == frame.occlusions.end() ? 0 : order->pixels;
        CHECK(std::abs(pixels - m.behind[std::size_t(other)]) <= 1);
        ordered += pixels;
      }
    }
  }
  CHECK(hidden > 100);  // else visibility was not put to the test
  CHECK(ordered > 100);
}

TEST_CASE("cuboid keypoints lie within a hundredth of a pixel, through every lens",
          "[annotators]") {
  const World world = make_world();
  test::FakeHost host;
  const auto renderer = make_renderer("null", host);
  renderer->prepare(world.scene);
  int checked = 0;
  for (const NodeId camera : world.cameras) {
    const Frame frame = render(*renderer, world, camera);
    const auto box = std::ranges::find(frame.instances, world.nodes[kBox].index, &Instance::id);
    for (const CuboidPoint& keypoint : kCuboidKeypoints) {
      const Vec3 half(0.5 * kBoxX, 0.5 * kBoxY, 0.5 * kBoxZ);
      const Vec3 corner(keypoint.side[0] * half.x(), keypoint.side[1] * half.y(),
                        keypoint.side[2] * half.z());
      const Vec3 world_corner = world.scene.world_from_node(world.nodes[kBox]) * corner;
      const Vec2 expected =
          lens_pixel(frame.camera, frame.world_from_camera.inverse() * world_corner);
      const ImagePoint point =
          image_point(frame, box->world_from_node * keypoint_in_box(box->bounds_node, keypoint));
      if (point.state == ImagePoint::State::Outside) continue;
      CHECK((point.pixel - expected).norm() < 0.01);
      const Vec3 back = ray_direction(frame.camera, point.pixel).value();
      CHECK((back - (frame.world_from_camera.inverse() * world_corner).normalized()).norm() < 1e-6);
      ++checked;
    }
  }
  CHECK(checked > 60);
}

TEST_CASE("what stands still has no motion, what was not imaged before neither", "[annotators]") {
  const World world = make_world();
  test::FakeHost host;
  const auto renderer = make_renderer("null", host);
  renderer->prepare(world.scene);
  Frame frame = render(*renderer, world, world.cameras[0]);
  const auto& leaves = frame.get(kLeafId).pixels();
  for (std::size_t i = 0; i < leaves.size(); ++i) {
    if (leaves[i] != world.nodes[kCone].index && leaves[i] != world.nodes[kWall].index) continue;
    REQUIRE(frame.get(kMotion).pixels()[i].isZero(0.0f));
  }
  BodyPoses behind{{world.nodes[kBox], Affine(Eigen::Translation3d(-9.0, 0.0, 0.0))}};
  measure_motion(world.scene, behind, frame);
  for (const Vec2f& motion : frame.get(kMotion).pixels()) REQUIRE(motion.isZero(0.0f));
}
