// SPDX-License-Identifier: Apache-2.0
#include "framework/app/single_picture.h"

#include <algorithm>
#include <cmath>
#include <string_view>

#include "framework/config/job_overrides.h"

namespace diorama {
namespace {

/// The same view on another number of pixels; the width keeps its angle.
Camera resized(Camera camera, int width, int height) {
  const double scale = double(width) / camera.width;
  camera.fx *= scale;
  camera.fy *= scale;
  camera.cx *= scale;
  camera.cy = 0.5 * height + (camera.cy - 0.5 * camera.height) * scale;
  camera.width = width;
  camera.height = height;
  return camera;
}

Vec3 point_of(const std::vector<double>& values) { return {values[0], values[1], values[2]}; }

/// A camera that looks at the target from the eye; without an eye from where it sees all of the
/// box.
NodeId add_camera(const PictureOptions& options, const Aabb& box, Scene& scene) {
  if (box.is_empty()) {
    throw Error(ErrorKind::Asset, options.asset + ": there is nothing to be seen in it");
  }
  Camera camera = Camera::from_lens(640, 480, 24.0, 20.955);
  const double radius = std::max(0.5 * box.size().norm(), 1e-6);
  const double narrow = std::atan(0.5 * camera.height / camera.fy);
  const Vec3 target = options.target.empty() ? box.centre() : point_of(options.target);
  const Vec3 from = Vec3(0.55, -0.75, 0.4).normalized();
  const Vec3 eye =
      options.eye.empty() ? Vec3(target + from * radius / std::sin(narrow)) : point_of(options.eye);
  if ((target - eye).norm() == 0.0) {
    throw Error(ErrorKind::Usage, "--eye and --target are the same point");
  }
  const double farthest = (eye - box.centre()).norm() + radius;
  camera.near_m = 1e-3 * farthest;
  camera.far_m = 2.0 * farthest;
  const NodeId node = scene.create(scene.root(), "RenderCamera");
  scene.edit(node).camera = camera;
  scene.set_pose(node, Transform{eye, look_rotation(target - eye)});
  return node;
}

NodeId choose_camera(const PictureOptions& options, NodeId root, Scene& scene) {
  std::string known;
  const bool wants_own = options.eye.empty() && options.target.empty();
  for (const NodeId id : scene.subtree(root)) {
    if (!scene[id].camera) continue;
    if (options.camera.empty() ? wants_own : scene.path(id).ends_with(options.camera)) return id;
    known += (known.empty() ? "" : ", ") + scene.path(id);
  }
  if (!options.camera.empty()) {
    throw Error(ErrorKind::Usage, options.asset + ": no camera '" + options.camera + "'; there " +
                                      (known.empty() ? "are none" : "are " + known));
  }
  return add_camera(options, scene.world_bounds(root), scene);
}

void add_sky_where_dark(NodeId root, Scene& scene, const Log& log) {
  for (const NodeId id : scene.subtree(root)) {
    if (scene[id].light) return;
  }
  log(LogLevel::Info, "the scene has no lights; an even white sky lights it");
  Light sky;
  sky.kind = LightKind::Dome;
  scene.edit(scene.create(scene.root(), "RenderSky")).light = sky;
}

}  // namespace

std::unique_ptr<Renderer> make_renderer(const PictureOptions& options, Registry& registry,
                                        Host& host) {
  Value parameters = Value::make_map();
  parameters.set("type", Value::text(options.renderer));
  for (const std::string& assignment : options.sets) apply_set(parameters, assignment);
  Diagnostics diagnostics;
  const std::vector<std::string_view> known{"type"};
  auto renderer = registry.make<Renderer>(parameters, "renderer", known, diagnostics, host);
  diagnostics.raise();
  return renderer;
}

void resize_camera(const PictureOptions& options, NodeId camera, Scene& scene) {
  const Camera own = *scene[camera].camera;
  const int width = options.width > 0 ? options.width : own.width;
  const int height = options.height > 0
                         ? options.height
                         : std::max(1, int(std::lround(double(own.height) * width / own.width)));
  scene.edit(camera).camera = resized(own, width, height);
}

NodeId load_picture_scene(const PictureOptions& options, Scene& scene, Host& host, const Log& log) {
  const NodeId root = host.load_asset(options.asset, scene, scene.root());
  const NodeId camera = choose_camera(options, root, scene);
  resize_camera(options, camera, scene);
  add_sky_where_dark(root, scene, log);
  return camera;
}

}  // namespace diorama
