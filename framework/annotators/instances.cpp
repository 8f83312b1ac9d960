// SPDX-License-Identifier: Apache-2.0
#include "framework/annotators/instances.h"

#include <algorithm>
#include <limits>
#include <map>
#include <vector>

#include "diorama/joints.h"

namespace diorama {
namespace {

constexpr PixelBox kNothing{std::numeric_limits<int>::max(), std::numeric_limits<int>::max(), 0, 0};

/// Position in `instances` by id, for ids below the size of the table.
std::vector<int> position_of_id(const std::vector<Instance>& instances) {
  std::uint32_t largest = 0;
  for (const Instance& instance : instances) largest = std::max(largest, instance.id);
  std::vector<int> table(std::size_t(largest) + 1, -1);
  for (std::size_t i = 0; i < instances.size(); ++i) table[instances[i].id] = int(i);
  return table;
}

}  // namespace

void measure_tight_boxes(const Image<std::uint32_t>& ids, std::vector<Instance>& instances) {
  const std::vector<int> position = position_of_id(instances);
  std::vector<PixelBox> boxes(instances.size(), kNothing);
  for (int y = 0; y < ids.height(); ++y) {
    const auto row = ids.row(y);
    // Neighbours are mostly equal: a box is widened once per run.
    for (int x = 0, end = 0; x < ids.width(); x = end) {
      const std::uint32_t id = row[std::size_t(x)];
      end = x + 1;
      while (end < ids.width() && row[std::size_t(end)] == id) ++end;
      if (id == 0 || id >= position.size() || position[id] < 0) continue;
      PixelBox& box = boxes[std::size_t(position[id])];
      box.x_min = std::min(box.x_min, x);
      box.y_min = std::min(box.y_min, y);
      box.x_max = std::max(box.x_max, end);
      box.y_max = std::max(box.y_max, y + 1);
    }
  }
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    if (!boxes[i].is_empty()) instances[i].tight_box = boxes[i];
  }
}

Aabb instance_bounds(const Scene& scene, const LabelledInstance& instance) {
  const Affine node_from_world = scene.world_from_node(instance.node).inverse();
  Aabb box;
  for (const NodeId leaf : instance.leaves) {
    const Mesh& mesh = *scene[leaf].mesh;
    if (leaf == instance.node) {
      box.add(mesh.bounds());
      continue;
    }
    const Affine node_from_leaf = node_from_world * scene.world_from_node(leaf);
    for (const Vec3f& p : mesh.positions) box.add(node_from_leaf * p.cast<double>());
  }
  return box;
}

std::vector<Keypoint> instance_keypoints(const Scene& scene, NodeId labelled) {
  std::vector<Keypoint> points;
  const Affine node_from_world = scene.world_from_node(labelled).inverse();
  std::vector<NodeId> waiting{labelled};
  while (!waiting.empty()) {
    const NodeId id = waiting.back();
    waiting.pop_back();
    const Node& node = scene[id];
    for (const Keypoint& point : node.keypoints) {
      if (std::ranges::find(points, point.name, &Keypoint::name) != points.end()) continue;
      const Vec3 place = id == labelled
                             ? point.position
                             : Vec3(node_from_world * (scene.world_from_node(id) * point.position));
      points.push_back({point.name, place});
    }
    for (auto child = node.children.rbegin(); child != node.children.rend(); ++child) {
      if (scene[*child].labels.empty()) waiting.push_back(*child);
    }
  }
  return points;
}

std::optional<Velocity> instance_velocity(const Scene& scene, NodeId labelled) {
  NodeId body = labelled;
  while (body && !scene[body].rigid_body) body = scene[body].parent;
  if (!body) return std::nullopt;
  const RigidBody& moving = *scene[body].rigid_body;
  const Vec3 arm =
      scene.world_from_node(labelled).translation() - scene.world_from_node(body).translation();
  return Velocity{moving.linear_velocity + moving.angular_velocity.cross(arm),
                  moving.angular_velocity};
}

NameSet Instances::needs() const { return {std::string(kInstanceId.name)}; }
NameSet Instances::provides() const { return {"instances"}; }

void Instances::do_annotate(const Scene& scene, Frame& frame) const {
  frame.instances.clear();
  for (const LabelledInstance& labelled : labelled_instances(scene)) {
    Instance instance;
    instance.id = labelled.node.index;
    instance.node_path = scene.path(labelled.node);
    instance.labels = scene.effective_labels(labelled.node);
    instance.world_from_node = scene.world_from_node(labelled.node);
    instance.bounds_node = instance_bounds(scene, labelled);
    instance.keypoints = instance_keypoints(scene, labelled.node);
    instance.velocity = instance_velocity(scene, labelled.node);
    frame.instances.push_back(std::move(instance));
  }
  frame.joints = joint_states(scene);
  measure_tight_boxes(frame.get(kInstanceId), frame.instances);
}

}  // namespace diorama
