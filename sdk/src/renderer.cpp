// SPDX-License-Identifier: Apache-2.0
#include "diorama/renderer.h"

#include <algorithm>

#include "diorama/error.h"
#include "diorama/obstacles.h"

namespace diorama {

namespace {

[[noreturn]] void fail(const std::string& text) { throw Error(ErrorKind::Internal, text); }

const Camera& checked_camera(const Scene* scene, NodeId id) {
  if (!scene) fail("Renderer: prepare() was not called before");
  if (!scene->contains(id)) fail("Renderer: the camera's node is not in the scene");
  const Node& node = (*scene)[id];
  if (!node.camera) fail(scene->path(id) + ": the node has no camera");
  if (node.camera->width < 1 || node.camera->height < 1) {
    fail(scene->path(id) + ": expected an image of at least 1 x 1 pixels, found " +
         std::to_string(node.camera->width) + " x " + std::to_string(node.camera->height));
  }
  return *node.camera;
}

std::map<std::uint32_t, std::string> paths_of_leaves(const Scene& scene,
                                                     const Image<std::uint32_t>& leaf_ids) {
  std::map<std::uint32_t, std::string> paths;
  std::uint32_t previous = 0;
  for (const std::uint32_t id : leaf_ids.pixels()) {
    if (id == previous || id == 0) continue;
    previous = id;
    if (paths.contains(id)) continue;
    if (!scene.contains(NodeId{id})) {
      fail("Renderer: leaf id " + std::to_string(id) + " is no node of the scene");
    }
    paths.emplace(id, scene.path(NodeId{id}));
  }
  return paths;
}

void check_mask(const Camera& camera, const CoverageMask& mask, bool has_distances,
                const std::string& path) {
  const PixelBox& box = mask.box;
  if (box.is_empty() && mask.bits.empty()) return;
  const bool is_in_reach = box.x_min >= -camera.width && box.x_max <= 2 * camera.width &&
                           box.y_min >= -camera.height && box.y_max <= 2 * camera.height;
  if (!is_in_reach || box.is_empty()) fail(path + ": the box of its coverage mask is out of reach");
  if (mask.bits.size() != std::size_t(box.width()) * std::size_t(box.height())) {
    fail(path + ": its coverage mask has " + std::to_string(mask.bits.size()) +
         " pixels, its box has " + std::to_string(box.width()) + " x " +
         std::to_string(box.height()));
  }
  if (mask.distances.size() != (has_distances ? mask.bits.size() : 0)) {
    fail(path + ": its coverage mask has " + std::to_string(mask.distances.size()) +
         " distances, expected " + (has_distances ? std::to_string(mask.bits.size()) : "none"));
  }
}

}  // namespace

Renderer::~Renderer() = default;

RenderReport Renderer::report() const { return {}; }

std::size_t Renderer::working_bytes(const Camera&, const NameSet&) const { return 0; }

void Renderer::prepare(const Scene& scene) {
  scene_ = nullptr;  // stays so when do_prepare throws
  do_prepare(scene);
  scene_ = &scene;
}

Frame Renderer::render(const RenderRequest& request) {
  const Camera& camera = checked_camera(scene_, request.camera);
  const NameSet known = provides();
  for (const std::string& channel : request.channels) {
    if (!known.contains(channel)) fail("Renderer: channel '" + channel + "' is not provided");
  }

  Frame frame = do_render(*scene_, request);
  frame.camera_name = (*scene_)[request.camera].name;
  frame.camera_path = scene_->path(request.camera);
  frame.camera = camera;
  frame.world_from_camera = scene_->world_from_node(request.camera);
  frame.seed = request.seed;

  for (const std::string& channel : request.channels) frame.check_channel(channel);
  for (const std::string& channel : frame.channels()) frame.check_channel(channel);
  frame.leaf_paths.clear();
  if (frame.has(kLeafId.name)) frame.leaf_paths = paths_of_leaves(*scene_, frame.get(kLeafId));
  return frame;
}

std::vector<CoverageMask> Renderer::cover(NodeId camera,
                                          std::span<const LabelledInstance> instances,
                                          bool with_distances) {
  const Camera& lens = checked_camera(scene_, camera);
  for (const LabelledInstance& instance : instances) {
    for (const NodeId leaf : instance.leaves) {
      if (!scene_->contains(leaf)) fail("Renderer: an instance's leaf is not in the scene");
    }
  }
  std::vector<CoverageMask> masks = do_cover(*scene_, camera, instances, with_distances);
  if (masks.size() != instances.size()) {
    fail("Renderer: expected " + std::to_string(instances.size()) + " coverage masks, found " +
         std::to_string(masks.size()));
  }
  for (std::size_t i = 0; i < masks.size(); ++i) {
    check_mask(lens, masks[i], with_distances, scene_->path(instances[i].node));
  }
  return masks;
}

std::vector<std::uint8_t> Renderer::sees(NodeId camera, std::span<const Vec3> points_world) {
  checked_camera(scene_, camera);
  std::vector<std::uint8_t> seen = do_see(*scene_, camera, points_world);
  if (seen.size() == points_world.size()) return seen;
  fail("Renderer: expected " + std::to_string(points_world.size()) + " answers, found " +
       std::to_string(seen.size()));
}

std::vector<std::uint8_t> Renderer::do_see(const Scene& scene, NodeId camera,
                                           std::span<const Vec3> points_world) {
  const NodeId root = scene.root();
  const Obstacles obstacles(scene, {&root, 1}, Obstacles::Hidden::LeaveOut);
  const Vec3 centre = scene.world_from_node(camera).translation();
  std::vector<std::uint8_t> seen;
  seen.reserve(points_world.size());
  for (const Vec3& point : points_world) {
    const double distance = (point - centre).norm();
    const double share = std::max(0.0, 1.0 - sight_margin(distance) / distance);
    seen.push_back(distance == 0.0 ||
                   !obstacles.is_between(centre, centre + share * (point - centre)));
  }
  return seen;
}

}  // namespace diorama
