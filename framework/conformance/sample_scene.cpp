// SPDX-License-Identifier: Apache-2.0
#include "framework/conformance/sample_scene.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "framework/annotators/instance_ids.h"
#include "framework/annotators/instances.h"
#include "framework/annotators/object_coordinates.h"
#include "framework/annotators/occlusion_order.h"
#include "framework/annotators/visibility.h"

namespace diorama::conformance {
namespace {

std::shared_ptr<const Material> material(const char* name, const Vec3f& color) {
  auto made = std::make_shared<Material>();
  made->name = name;
  made->base_color = color;
  return made;
}

std::shared_ptr<const Material> checkered() {
  auto texture = std::make_shared<Texture>();
  texture->name = "checker";
  texture->width = texture->height = 2;
  texture->channels = 3;
  texture->color_space = ColorSpace::Srgb;
  texture->bytes = {220, 220, 220, 90, 60, 40, 90, 60, 40, 220, 220, 220};
  auto made = std::make_shared<Material>();
  made->name = "tiles";
  made->base_color_texture.texture = texture;
  return made;
}

NodeId add_solid(Scene& scene, NodeId parent, const char* name, Mesh mesh, const Vec3& place,
                 std::shared_ptr<const Material> surface) {
  const NodeId id = scene.create(parent, name);
  scene.set_pose(id, Transform{place, Quat::Identity(), Vec3::Ones()});
  Node& node = scene.edit(id);
  node.mesh = std::make_shared<const Mesh>(std::move(mesh));
  node.materials = {std::move(surface)};
  node.collider = Collider{};
  return id;
}

void add_assets(Scene& scene, int moment, Extra extra) {
  const NodeId assets = scene.create(scene.root(), "Assets");
  if (extra == Extra::Place) scene.create(assets, "extra");
  if (extra == Extra::Crumb) {
    add_solid(scene, assets, "extra", make_box(Vec3::Constant(1e-3)), {1000, 0, 0},
              material("dust", {0.5f, 0.5f, 0.5f}));
  }
  const NodeId box = add_solid(scene, assets, "box", make_box({0.4, 0.3, 0.2}),
                               {-0.3, 0.05 * moment, 0.8}, material("red", {0.8f, 0.1f, 0.1f}));
  scene.edit(box).labels = {{"class", "box"}, {"color", "red"}};
  scene.edit(box).rigid_body = RigidBody{};

  const NodeId pair = scene.create(assets, "pair");
  scene.set_pose(pair, Transform{{0.4, 0.1, 0.0}, Quat::Identity(), Vec3::Ones()});
  scene.edit(pair).labels = {{"class", "pair"}};
  scene.edit(pair).rigid_body = RigidBody{};
  add_solid(scene, pair, "foot", make_cylinder(0.15, 0.2, 12), {0, 0, 0.1},
            material("green", {0.1f, 0.6f, 0.1f}));
  add_solid(scene, pair, "head", make_sphere(0.12, 12), {0, 0, 0.3},
            material("blue", {0.1f, 0.1f, 0.7f}));

  const NodeId hidden = add_solid(scene, assets, "hidden", make_box({0.1, 0.1, 0.1}),
                                  {0.0, -0.6, 0.05}, material("grey", {0.5f, 0.5f, 0.5f}));
  scene.edit(hidden).labels = {{"class", "box"}};
  scene.edit(hidden).is_visible = false;
}

void add_lights(Scene& scene, Extra extra) {
  const NodeId lights = scene.create(scene.root(), "Lights");
  if (extra == Extra::Lamp) scene.edit(scene.create(lights, "extra")).light.emplace();
  const NodeId lamp = scene.create(lights, "lamp");
  scene.set_pose(lamp, Transform{{0.5, -0.5, 2.5}, Quat::Identity(), Vec3::Ones()});
  scene.edit(lamp).light.emplace().color = Vec3f::Constant(40.0f);
  const NodeId sky = scene.create(lights, "sky");
  Light& dome = scene.edit(sky).light.emplace();
  dome.kind = LightKind::Dome;
  dome.color = Vec3f::Constant(0.4f);
}

void add_cameras(Scene& scene, int moment, Extra extra) {
  const NodeId cameras = scene.create(scene.root(), "Cameras");
  if (extra == Extra::Camera) {
    scene.edit(scene.create(cameras, "extra")).camera = Camera::from_lens(20, 10, 24.0, 20.955);
  }
  const Vec3 places[]{{2.2 + 0.02 * moment, 0.4, 1.1}, {-0.4, -2.0, 1.6}};
  for (const Vec3& place : places) {
    const NodeId id = scene.create(cameras, "cam_0");
    Transform pose;
    pose.translation = place;
    pose.rotation = look_rotation(Vec3(0, 0, 0.3) - place);
    scene.set_pose(id, pose);
    const bool is_first = &place == places;
    scene.edit(id).camera = Camera::from_lens(is_first ? 32 : 23, is_first ? 24 : 17, 24.0, 20.955);
  }
}

/// A visible leaf as its camera sees it.
struct Rectangle {
  NodeId leaf;
  PixelBox box;
  double distance = 0.0;  ///< Of the centre of its bounds.
  Vec3 centre;
};

/// Nothing when a corner lies behind the camera.
std::optional<PixelBox> projected(const Frame& frame, const Aabb& bounds) {
  Vec2 low = Vec2::Constant(kInfinity), high = -low;
  for (int i = 0; i < 8; ++i) {
    const std::optional<Vec2> pixel =
        project(frame.camera, frame.world_from_camera.inverse() * bounds.corner(i));
    if (!pixel) return std::nullopt;
    low = low.cwiseMin(*pixel);
    high = high.cwiseMax(*pixel);
  }
  const PixelBox box{int(std::floor(low.x())), int(std::floor(low.y())), int(std::ceil(high.x())),
                     int(std::ceil(high.y()))};
  return box;
}

std::vector<Rectangle> rectangles(const Scene& scene, const Frame& frame) {
  std::vector<Rectangle> found;
  for (const NodeId node : scene.subtree(scene.root())) {
    if (!scene[node].mesh || !scene.is_visible(node)) continue;
    const Aabb bounds = scene.world_bounds(node);
    const std::optional<PixelBox> box = projected(frame, bounds);
    if (!box) continue;
    const double distance = (bounds.centre() - frame.world_from_camera.translation()).norm();
    found.push_back({node, *box, distance, bounds.centre()});
  }
  std::ranges::stable_sort(found, std::greater(), &Rectangle::distance);
  return found;
}

/// The channels of a frame while they are painted.
struct Canvas {
  explicit Canvas(const Camera& c)
      : color(c.width, c.height, {10, 20, 30, 255}),
        hdr(c.width, c.height, Vec3f::Constant(0.05f)),
        normals(c.width, c.height, Vec3f::Zero()),
        positions(normals),
        albedo(normals),
        distance(c.width, c.height, std::numeric_limits<float>::infinity()),
        depth(distance),
        uv(c.width, c.height, Vec2f::Zero()),
        motion(uv),
        leaves(c.width, c.height, 0u) {}

  void paint(const Rectangle& rectangle, const Vec3& towards_camera, const Vec3& axis, int x,
             int y) {
    const std::uint32_t id = rectangle.leaf.index;
    const float shade = 0.2f + 0.1f * float(id % 8);
    color.at(x, y) = {std::uint8_t(30 * (id % 8)), std::uint8_t(8 * x), std::uint8_t(8 * y), 255};
    hdr.at(x, y) = Vec3f(shade, 0.5f, 0.02f * float(y));
    albedo.at(x, y) = Vec3f(shade, 0.4f, 0.3f);
    normals.at(x, y) = towards_camera.cast<float>();
    positions.at(x, y) = rectangle.centre.cast<float>();
    distance.at(x, y) = float(rectangle.distance);
    depth.at(x, y) = float(-rectangle.distance * towards_camera.dot(axis));
    uv.at(x, y) = Vec2f(0.1f * float(x % 10), 0.1f * float(y % 10));
    motion.at(x, y) = Vec2f(0.5f, -0.25f);
    leaves.at(x, y) = id;
  }

  void move_to(Frame& frame) {
    frame.set(kColor, std::move(color));
    frame.set(kColorHdr, std::move(hdr));
    frame.set(kNormals, std::move(normals));
    frame.set(kPosition, std::move(positions));
    frame.set(kAlbedo, std::move(albedo));
    frame.set(kDistanceToCamera, std::move(distance));
    frame.set(kDistanceToImagePlane, std::move(depth));
    frame.set(kUv, std::move(uv));
    frame.set(kMotion, std::move(motion));
    frame.set(kLeafId, std::move(leaves));
  }

  Image<Rgba8> color;
  Image<Vec3f> hdr, normals, positions, albedo;
  Image<float> distance, depth;
  Image<Vec2f> uv, motion;
  Image<std::uint32_t> leaves;
};

CoverageMask coverage(const LabelledInstance& instance, const std::vector<Rectangle>& painted,
                      const Camera& camera) {
  CoverageMask mask;
  mask.box = {0, 0, camera.width, camera.height};
  mask.bits.assign(std::size_t(camera.width) * std::size_t(camera.height), 0);
  mask.distances.assign(mask.bits.size(), std::numeric_limits<float>::infinity());
  for (const Rectangle& rectangle : painted) {
    if (std::ranges::find(instance.leaves, rectangle.leaf) == instance.leaves.end()) continue;
    const PixelBox box = rectangle.box.clipped(camera.width, camera.height);
    for (int y = box.y_min; y < box.y_max; ++y) {
      for (int x = box.x_min; x < box.x_max; ++x) {
        mask.bits[mask.index(x, y)] = 1;
        // Painted from far to near.
        mask.distances[mask.index(x, y)] = float(rectangle.distance);
      }
    }
  }
  return mask;
}

void annotate(const Scene& scene, const std::vector<Rectangle>& painted, Host& host, Frame& frame) {
  InstanceIds({}, host).annotate(scene, frame);
  Instances({}, host).annotate(scene, frame);
  ObjectCoordinates({}, host).annotate(scene, frame);
  std::vector<CoverageMask> masks;
  for (const LabelledInstance& instance : labelled_instances(scene)) {
    masks.push_back(coverage(instance, painted, frame.camera));
  }
  measure_visibility(masks, true, frame);
  order_occlusions(masks, frame);
}

}  // namespace

Scene sample_scene(int moment, Extra extra) {
  Scene scene;
  const NodeId environment = scene.create(scene.root(), "Environment");
  const NodeId floor =
      add_solid(scene, environment, "floor", make_box({4, 4, 0.2}), {0, 0, -0.1}, checkered());
  scene.edit(floor).collider = Collider{.shape = ColliderShape::TriangleMesh};
  add_assets(scene, moment, extra);
  add_lights(scene, extra);
  add_cameras(scene, moment, extra);
  return scene;
}

std::vector<NodeId> cameras_of(const Scene& scene) {
  std::vector<NodeId> cameras;
  for (const NodeId node : scene.subtree(scene.root())) {
    if (scene[node].camera) cameras.push_back(node);
  }
  return cameras;
}

Frame painted_frame(const Scene& scene, NodeId camera, Host& host) {
  Frame frame;
  frame.camera_name = scene[camera].name;
  frame.camera_path = scene.path(camera);
  frame.camera = *scene[camera].camera;
  frame.world_from_camera = scene.world_from_node(camera);

  const std::vector<Rectangle> painted = rectangles(scene, frame);
  const Vec3 axis = -frame.world_from_camera.linear().col(2);
  Canvas canvas(frame.camera);
  for (const Rectangle& rectangle : painted) {
    const Vec3 towards_camera =
        (frame.world_from_camera.translation() - rectangle.centre).normalized();
    const PixelBox box = rectangle.box.clipped(frame.camera.width, frame.camera.height);
    for (int y = box.y_min; y < box.y_max; ++y) {
      for (int x = box.x_min; x < box.x_max; ++x) {
        canvas.paint(rectangle, towards_camera, axis, x, y);
      }
    }
  }
  for (const std::uint32_t id : canvas.leaves.pixels()) {
    if (id != 0) frame.leaf_paths.emplace(id, scene.path(NodeId{id}));
  }
  canvas.move_to(frame);
  annotate(scene, painted, host, frame);
  return frame;
}

const NameSet& painted_annotations() {
  static const NameSet names{"instances", "visibility", "amodal_mask", "occlusion_order"};
  return names;
}

std::vector<Capture> sample_captures(int count, Host& host) {
  std::vector<Capture> captures;
  for (int index = 0; index < count; ++index) {
    Capture& capture = captures.emplace_back();
    capture.index = index;
    capture.visit = index * 2 / std::max(count, 1);
    capture.phase = index % 2 == 0 ? "floating" : "dropped";
    capture.environment = "room";
    const Scene scene = sample_scene(index);
    for (const NodeId camera : cameras_of(scene)) {
      capture.frames.push_back(painted_frame(scene, camera, host));
    }
  }
  return captures;
}

DatasetInfo sample_dataset(int capture_count) {
  const Scene scene = sample_scene();
  DatasetInfo dataset;
  dataset.seed = 7;
  dataset.capture_count = capture_count;
  for (const NodeId camera : cameras_of(scene)) dataset.camera_names.push_back(scene[camera].name);
  dataset.labels = {{{"class", "box"}}, {{"class", "box"}, {"color", "red"}}, {{"class", "pair"}}};
  dataset.resolved_job = "seed: 7\n";
  dataset.program_version = "0.0.0";
  return dataset;
}

}  // namespace diorama::conformance
