// SPDX-License-Identifier: Apache-2.0
// A box, a sphere and a cone before a wall, seen through each lens. What every pixel shows is
// worked out here in closed form, with lens formulas of the test's own, and compared with renderer
// and annotators.
#include <algorithm>
#include <array>
#include <cmath>

#include "framework/annotators/instance_ids.h"
#include "framework/annotators/instances.h"
#include "framework/annotators/visibility.h"
#include "null_renderer.h"
#include "plugins/writer_support/fake_host.h"
#include "support/catch.h"

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
  std::vector<NodeId> cameras;
};

NodeId add_camera(World& world, const char* name, const Camera& camera, const Vec3& position) {
  const NodeId node = world.scene.create(world.scene.root(), name);
  Transform pose;
  pose.translation = position;
  pose.rotation = look_rotation(Vec3(0.1, 0.05, 0.02) - position, Vec3(0.1, 0.2, 1.0));
  world.scene.set_pose(node, pose);
  world.scene.edit(node).camera = camera;
  return node;
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
  world.cameras = {add_camera(world, "cam_0", pinhole, {-1.6, -0.4, 0.5}),
                   add_camera(world, "cam_1", opencv, {-1.3, 0.6, 0.4}),
                   add_camera(world, "cam_2", fisheye, {-1.2, -0.5, -0.3})};
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

Frame render(const World& world, NodeId camera) {
  test::FakeHost host;
  NullRenderer renderer({}, host);
  renderer.prepare(world.scene);
  RenderRequest request;
  request.camera = camera;
  request.channels = {"leaf_id", "distance_to_camera", "distance_to_image_plane"};
  Frame frame = renderer.render(request);
  InstanceIds({}, host).annotate(world.scene, frame);
  Instances({}, host).annotate(world.scene, frame);
  measure_visibility(renderer.cover(camera, labelled_instances(world.scene)), false, frame);
  return frame;
}

struct Measured {
  PixelBox box{1 << 20, 1 << 20, 0, 0};
  std::int64_t visible = 0;
  std::int64_t alone = 0;
};

}  // namespace

TEST_CASE("labels are those of the closed form, through every lens", "[annotators]") {
  const World world = make_world();
  std::int64_t hidden = 0;
  for (const NodeId camera : world.cameras) {
    const Frame frame = render(world, camera);
    INFO(frame.camera_name);
    std::array<Measured, kShapes> measured;
    std::array<int, 3> wrong{};  // id, distance, depth
    for (int y = 0; y < frame.camera.height; ++y) {
      for (int x = 0; x < frame.camera.width; ++x) {
        const Truth truth = truth_at(world, frame, Vec2(x + 0.5, y + 0.5));
        for (std::size_t s = 0; s < kShapes; ++s) {
          if (std::isfinite(truth.distance[s])) ++measured[s].alone;
        }
        const std::uint32_t id = truth.nearest < 0 ? 0 : world.nodes[truth.nearest].index;
        if (frame.get(kLeafId).at(x, y) != id) ++wrong[0];
        if (truth.nearest < 0) continue;
        Measured& m = measured[std::size_t(truth.nearest)];
        ++m.visible;
        m.box = {std::min(m.box.x_min, x), std::min(m.box.y_min, y), std::max(m.box.x_max, x + 1),
                 std::max(m.box.y_max, y + 1)};
        const double distance = truth.distance[std::size_t(truth.nearest)];
        // Facets of the curved shapes are up to 5 micrometres inside them, which a grazing ray
        // stretches; those pixels are left to the flat shapes.
        if (truth.nearest == kSphere || truth.nearest == kCone) {
          const Truth beside = truth_at(world, frame, Vec2(x + 1.0, y + 1.0));
          if (beside.nearest != truth.nearest ||
              std::abs(beside.distance[std::size_t(truth.nearest)] - distance) > 0.01) {
            continue;
          }
        }
        if (std::abs(frame.get(kDistanceToCamera).at(x, y) - distance) > 1e-4) ++wrong[1];
        if (std::abs(frame.get(kDistanceToImagePlane).at(x, y) - distance * truth.cosine) > 1e-4) {
          ++wrong[2];
        }
      }
    }
    CHECK(wrong == std::array<int, 3>{0, 0, 0});
    for (const int shape : {kBox, kSphere, kCone}) {
      const auto instance =
          std::ranges::find(frame.instances, world.nodes[shape].index, &Instance::id);
      REQUIRE(instance != frame.instances.end());
      const Measured& m = measured[std::size_t(shape)];
      CHECK(m.visible > 50);
      hidden += m.alone - m.visible;
      CHECK(instance->tight_box == m.box);
      CHECK(instance->visibility->visible_pixels == m.visible);
      CHECK(std::abs(instance->visibility->amodal_pixels - m.alone) <= 1);
    }
  }
  CHECK(hidden > 100);  // else visibility was not put to the test
}

TEST_CASE("box corners project to a hundredth of a pixel through every lens", "[annotators]") {
  const World world = make_world();
  for (const NodeId node : world.cameras) {
    const Camera& camera = *world.scene[node].camera;
    const Affine camera_from_world = world.scene.world_from_node(node).inverse();
    const Affine world_from_box = world.scene.world_from_node(world.nodes[kBox]);
    const Aabb box = world.scene[world.nodes[kBox]].mesh->bounds();
    for (int i = 0; i < 8; ++i) {
      const Vec3 point = camera_from_world * (world_from_box * box.corner(i));
      const Vec2 pixel = project(camera, point).value();
      CHECK((pixel - lens_pixel(camera, point)).norm() < 0.01);
      const Vec3 back = ray_direction(camera, pixel).value();
      CHECK((back - point.normalized()).norm() < 1e-6);
    }
  }
}
