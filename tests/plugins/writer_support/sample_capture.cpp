// SPDX-License-Identifier: Apache-2.0
#include "plugins/writer_support/sample_capture.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "framework/annotators/instance_ids.h"
#include "framework/annotators/instances.h"
#include "framework/annotators/object_coordinates.h"
#include "framework/annotators/occlusion_order.h"
#include "framework/annotators/visibility.h"
#include "plugins/writer_support/fake_host.h"

namespace diorama::test {
namespace {

NodeId add_mesh(Scene& scene, NodeId parent, const char* name, Mesh mesh, const Vec3f& color,
                const Transform& pose) {
  const NodeId node = scene.create(parent, name);
  scene.set_pose(node, pose);
  mesh.colors.assign(mesh.positions.size(), color);
  scene.edit(node).mesh = std::make_shared<const Mesh>(std::move(mesh));
  return node;
}

NodeId add_camera(Scene& scene, NodeId parent, const char* name, const Camera& camera,
                  const Vec3& position, const Vec3& target) {
  const NodeId node = scene.create(parent, name);
  Transform pose;
  pose.translation = position;
  pose.rotation = look_rotation(target - position);
  scene.set_pose(node, pose);
  scene.edit(node).camera = camera;
  return node;
}

Quat turned(double angle, const Vec3& axis) {
  return Quat(Eigen::AngleAxisd(angle, axis.normalized()));
}

/// Triangles of one leaf in world space.
struct WorldMesh {
  NodeId node;
  const Mesh* mesh;
  std::vector<Vec3> points;
  Aabb box;
};

std::vector<WorldMesh> world_meshes(const Scene& scene) {
  std::vector<WorldMesh> result;
  for (const NodeId node : scene.subtree(scene.root())) {
    if (!scene[node].mesh || !scene.is_visible(node)) continue;
    WorldMesh mesh{node, scene[node].mesh.get(), {}, {}};
    for (const Vec3f& p : mesh.mesh->positions) {
      mesh.points.push_back(scene.world_from_node(node) * p.cast<double>());
      mesh.box.add(mesh.points.back());
    }
    result.push_back(std::move(mesh));
  }
  return result;
}

struct Hit {
  double t = kInfinity;
  const WorldMesh* mesh = nullptr;
  Vec3 normal = Vec3::Zero();
};

/// Solves origin + t direction = a + u (b - a) + v (c - a).
void intersect(const Vec3& origin, const Vec3& direction, double t_min, const WorldMesh& mesh,
               Hit& hit) {
  for (const auto& triangle : mesh.mesh->triangles) {
    const Vec3& a = mesh.points[triangle[0]];
    const Vec3 ab = mesh.points[triangle[1]] - a;
    const Vec3 ac = mesh.points[triangle[2]] - a;
    Mat3 columns;
    columns << -direction, ab, ac;
    if (std::abs(columns.determinant()) < 1e-18) continue;
    const Vec3 tuv = columns.inverse() * (origin - a);
    if (tuv[0] < t_min || tuv[0] >= hit.t) continue;
    if (tuv[1] < 0.0 || tuv[2] < 0.0 || tuv[1] + tuv[2] > 1.0) continue;
    hit = {tuv[0], &mesh, ab.cross(ac).normalized()};
  }
}

/// The ray through a pixel's centre, in world space.
struct PixelRay {
  Vec3 origin;
  Vec3 direction;
  double t_min;
};

/// Nothing where the lens images nothing.
std::optional<PixelRay> pixel_ray(const Frame& frame, int x, int y) {
  const auto direction = ray_direction(frame.camera, Vec2(x + 0.5, y + 0.5));
  if (!direction || direction->z() >= 0.0) return std::nullopt;
  return PixelRay{frame.world_from_camera.translation(),
                  frame.world_from_camera.linear() * *direction,
                  frame.camera.near_m / -direction->z()};
}

/// False only when the ray passes well clear of the box.
bool may_meet(const PixelRay& ray, const Aabb& box) {
  const Vec3 to_centre = box.centre() - ray.origin;
  const Vec3 nearest = to_centre - ray.direction * to_centre.dot(ray.direction);
  return nearest.norm() <= 0.51 * box.size().norm();
}

Hit trace(const PixelRay& ray, const std::vector<WorldMesh>& meshes) {
  Hit hit;
  for (const WorldMesh& mesh : meshes) {
    if (may_meet(ray, mesh.box)) intersect(ray.origin, ray.direction, ray.t_min, mesh, hit);
  }
  return hit;
}

Vec3f color_of(const Mesh& mesh) {
  return mesh.colors.empty() ? Vec3f(Vec3f::Ones()) : mesh.colors[0];
}

CoverageMask cover(const Frame& frame, const std::vector<WorldMesh>& all,
                   const LabelledInstance& instance) {
  std::vector<WorldMesh> own;
  for (const WorldMesh& mesh : all) {
    if (std::ranges::find(instance.leaves, mesh.node) != instance.leaves.end()) own.push_back(mesh);
  }
  const Camera& camera = frame.camera;
  CoverageMask mask;
  mask.box = {-camera.width, -camera.height, 2 * camera.width, 2 * camera.height};
  for (int y = mask.box.y_min; y < mask.box.y_max; ++y) {
    for (int x = mask.box.x_min; x < mask.box.x_max; ++x) {
      const auto ray = pixel_ray(frame, x, y);
      const double distance = ray ? trace(*ray, own).t : kInfinity;
      mask.bits.push_back(distance < kInfinity);
      mask.distances.push_back(float(distance));
    }
  }
  return mask;
}

}  // namespace

SampleScene::SampleScene(int width, int height, int camera_count) {
  const NodeId environment = scene.create(scene.root(), "Environment");
  const NodeId assets = scene.create(scene.root(), "Assets");
  const NodeId distractors = scene.create(scene.root(), "Distractors");
  const NodeId camera_root = scene.create(scene.root(), "Cameras");

  add_mesh(scene, environment, "wall", make_box({0.05, 2.0, 1.4}), {0.8f, 0.8f, 0.75f},
           {{1.2, 0.1, 0.3}, Quat::Identity(), Vec3::Ones()});

  const NodeId crate =
      add_mesh(scene, assets, "crate", make_box({0.4, 0.3, 0.2}), {0.9f, 0.3f, 0.2f},
               {{0.1, 0.2, 0.15}, turned(0.7, {0.3, -0.2, 1.0}), {1.1, 0.9, 1.3}});
  scene.edit(crate).labels = {{"class", "crate"}, {"shape", "cuboid"}};

  const NodeId mug = scene.create(assets, "mug");
  scene.set_pose(mug, Transform{{0.55, 0.05, 0.2}, turned(-0.4, {0.0, 0.1, 1.0}), Vec3::Ones()});
  scene.edit(mug).labels = {{"class", "mug"}};
  add_mesh(scene, mug, "body", make_cylinder(0.12, 0.3, 24), {0.2f, 0.5f, 0.9f}, {});
  add_mesh(scene, mug, "handle", make_box({0.12, 0.03, 0.16}), {0.2f, 0.4f, 0.8f},
           {{0.16, 0.0, 0.02}, Quat::Identity(), Vec3::Ones()});

  const NodeId ball = add_mesh(scene, assets, "ball", make_sphere(0.18, 20), {0.9f, 0.8f, 0.1f},
                               {{0.2, -0.55, 0.35}, Quat::Identity(), Vec3::Ones()});
  scene.edit(ball).labels = {{"class", "ball"}};

  const NodeId hidden =
      add_mesh(scene, assets, "hidden", make_box({0.1, 0.1, 0.1}), {1.0f, 1.0f, 1.0f},
               {{1.5, 0.1, 0.3}, Quat::Identity(), Vec3::Ones()});
  scene.edit(hidden).labels = {{"class", "crate"}};

  add_mesh(scene, distractors, "cone", make_cone(0.1, 0.3, 16), {0.4f, 0.9f, 0.4f},
           {{0.3, 0.5, 0.25}, turned(0.5, {1.0, 0.2, 0.0}), Vec3::Ones()});

  Camera first = Camera::from_lens(width, height, 24.0, 20.955);
  first.near_m = 0.1;
  cameras.push_back(
      add_camera(scene, camera_root, "cam_0", first, {-1.1, -0.25, 0.65}, {0.25, 0.02, 0.2}));
  if (camera_count > 1) {
    Camera second = Camera::from_lens(width * 3 / 4, height, 18.0, 24.0);
    second.cx += 5.25;
    second.cy -= 3.5;
    second.near_m = 0.1;
    cameras.push_back(
        add_camera(scene, camera_root, "cam_1", second, {-0.3, 1.0, 0.9}, {0.3, 0.0, 0.2}));
  }
}

Frame ray_cast(const Scene& scene, NodeId camera_node) {
  Frame frame;
  frame.camera_name = scene[camera_node].name;
  frame.camera_path = scene.path(camera_node);
  frame.camera = *scene[camera_node].camera;
  frame.world_from_camera = scene.world_from_node(camera_node);
  const int width = frame.camera.width;
  const int height = frame.camera.height;
  constexpr float kFar = std::numeric_limits<float>::infinity();
  Image<Rgba8> color(width, height, {20, 25, 30, 255});
  Image<Vec3f> hdr(width, height, Vec3f::Constant(0.01f)), normals(width, height, Vec3f::Zero());
  Image<Vec3f> positions(width, height, Vec3f::Zero());
  Image<float> distance(width, height, kFar), depth(width, height, kFar);
  Image<std::uint32_t> leaves(width, height, 0);
  Image<Vec2f> motion(width, height, Vec2f::Zero());

  const std::vector<WorldMesh> meshes = world_meshes(scene);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const auto pixel = pixel_ray(frame, x, y);
      const Hit hit = pixel ? trace(*pixel, meshes) : Hit();
      if (hit.mesh == nullptr) continue;
      const PixelRay& ray = *pixel;
      const Vec3 normal = hit.normal.dot(ray.direction) > 0.0 ? Vec3(-hit.normal) : hit.normal;
      const Vec3 axis = -frame.world_from_camera.linear().col(2);
      leaves.at(x, y) = hit.mesh->node.index;
      distance.at(x, y) = float(hit.t);
      depth.at(x, y) = float(hit.t * ray.direction.dot(axis));
      normals.at(x, y) = normal.cast<float>();
      positions.at(x, y) = (ray.origin + hit.t * ray.direction).cast<float>();
      motion.at(x, y) = Vec2f(0.25f * float(x), -0.5f * float(y));
      hdr.at(x, y) = color_of(*hit.mesh->mesh) * float(0.25 - 0.75 * normal.dot(ray.direction));
      for (std::size_t c = 0; c < 3; ++c) {
        color.at(x, y)[c] =
            std::uint8_t(255.0f * srgb_from_linear(std::min(hdr.at(x, y)[Eigen::Index(c)], 1.0f)));
      }
      frame.leaf_paths.emplace(hit.mesh->node.index, scene.path(hit.mesh->node));
    }
  }
  frame.set(kColor, std::move(color));
  frame.set(kColorHdr, std::move(hdr));
  frame.set(kNormals, std::move(normals));
  frame.set(kPosition, std::move(positions));
  frame.set(kDistanceToCamera, std::move(distance));
  frame.set(kDistanceToImagePlane, std::move(depth));
  frame.set(kLeafId, std::move(leaves));
  frame.set(kMotion, std::move(motion));

  FakeHost host;
  InstanceIds({}, host).annotate(scene, frame);
  Instances({}, host).annotate(scene, frame);
  std::vector<CoverageMask> masks;
  for (const LabelledInstance& instance : labelled_instances(scene)) {
    masks.push_back(cover(frame, meshes, instance));
  }
  measure_visibility(masks, true, frame);
  order_occlusions(masks, frame);
  ObjectCoordinates({}, host).annotate(scene, frame);
  return frame;
}

Capture ray_cast_capture(const SampleScene& sample, int index) {
  Capture capture;
  capture.index = index;
  capture.phase = "floating";
  capture.environment = "sample";
  for (const NodeId camera : sample.cameras) {
    capture.frames.push_back(ray_cast(sample.scene, camera));
  }
  return capture;
}

DatasetInfo sample_dataset(const SampleScene& sample) {
  DatasetInfo dataset;
  dataset.seed = 12;
  dataset.capture_count = 3;
  for (const NodeId camera : sample.cameras) {
    dataset.camera_names.push_back(sample.scene[camera].name);
  }
  dataset.labels = {{{"class", "ball"}}, {{"class", "crate"}}, {{"class", "mug"}}};
  dataset.resolved_job = "seed: 12\n";
  dataset.program_version = "0.1.0";
  dataset.plugin_versions = {{"writer_basic", "1.0.0"}};
  dataset.assets = {{"/props/mug.usd",
                     {{{"class", "mug"}}},
                     {{"/props/mug.usd", std::string(64, 'a')},
                      {"/props/textures/mug.png", std::string(64, 'b')}}},
                    {"shape:cube", {}, {}}};
  return dataset;
}

}  // namespace diorama::test
