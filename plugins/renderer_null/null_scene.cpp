// SPDX-License-Identifier: Apache-2.0
#include "null_scene.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "diorama/image.h"

namespace diorama {
namespace {

int wrapped(int i, int size, Wrap wrap) {
  if (wrap == Wrap::Clamp || wrap == Wrap::Black) return std::clamp(i, 0, size - 1);
  const int period = wrap == Wrap::Mirror ? 2 * size : size;
  const int k = ((i % period) + period) % period;
  return k < size ? k : 2 * size - 1 - k;
}

float texel(const Texture& texture, int x, int y, int channel) {
  const std::size_t at = (std::size_t(y) * std::size_t(texture.width) + std::size_t(x)) *
                             std::size_t(texture.channels) +
                         std::size_t(std::min(channel, texture.channels - 1));
  const float value =
      texture.bytes.empty() ? texture.floats[at] : float(texture.bytes[at]) / 255.0f;
  const bool is_encoded = texture.color_space == ColorSpace::Srgb && channel < 3;
  return is_encoded ? linear_from_srgb(value) : value;
}

// Nearest texel: exact enough for labels, and free of filter choices.
float lookup(const TextureInput& input, const Vec2f& mesh_uv, int channel) {
  const Texture& texture = *input.texture;
  const Vec2f uv = input.uv_from_mesh_uv * Eigen::Vector3f(mesh_uv.x(), mesh_uv.y(), 1.0f);
  const float x = std::floor(uv.x() * float(texture.width));
  const float y = std::floor((1.0f - uv.y()) * float(texture.height));
  constexpr float kLimit = 1e9f;
  const int ix = wrapped(int(std::clamp(x, -kLimit, kLimit)), texture.width, input.wrap_u);
  const int iy = wrapped(int(std::clamp(y, -kLimit, kLimit)), texture.height, input.wrap_v);
  const auto c = std::size_t(channel);
  return texel(texture, ix, iy, channel) * input.scale[c] + input.bias[c];
}

const Material& material_of(const Node& node, std::uint32_t triangle) {
  static const Material fallback;
  const Mesh& mesh = *node.mesh;
  const std::size_t slot = mesh.material_slots.empty() ? 0 : mesh.material_slots[triangle];
  if (slot >= node.materials.size() || !node.materials[slot]) return fallback;
  return *node.materials[slot];
}

template <class V>
V blend(const std::vector<V>& values, const std::array<std::uint32_t, 3>& corners, double u,
        double v) {
  return values[corners[0]] * float(1.0 - u - v) + values[corners[1]] * float(u) +
         values[corners[2]] * float(v);
}

Vec2f uv_at(const Mesh& mesh, std::uint32_t triangle, double u, double v) {
  return mesh.uvs.empty() ? Vec2f::Zero() : blend(mesh.uvs, mesh.triangles[triangle], u, v);
}

bool is_cut_out(const Material& material, const Vec2f& uv) {
  float opacity = material.opacity;
  if (material.opacity_texture) {
    opacity = lookup(material.opacity_texture, uv, material.opacity_texture.channel);
  }
  return material.opacity_threshold > 0.0f ? opacity < material.opacity_threshold : opacity <= 0.0f;
}

}  // namespace

void NullScene::take(const Scene& scene) {
  std::erase_if(trees_, [](const auto& entry) { return entry.second.owner.expired(); });
  instances_.clear();
  add(scene, scene.root(), Affine::Identity());
  std::vector<Aabb> boxes;
  for (const Instance& instance : instances_) boxes.push_back(instance.bounds);
  top_ = BoxTree(boxes);
}

void NullScene::add(const Scene& scene, NodeId id, const Affine& world_from_parent) {
  const Node& node = scene[id];
  if (!node.is_visible) return;
  const Affine world_from_node = world_from_parent * node.parent_from_node;
  const bool is_flat = std::abs(world_from_node.linear().determinant()) == 0.0;
  if (node.mesh && !node.mesh->triangles.empty() && !is_flat) {
    Instance instance{id,    &node, &tree_of(node.mesh), world_from_node, world_from_node.inverse(),
                      Aabb{}};
    for (const Vec3f& p : node.mesh->positions) {
      instance.bounds.add(Vec3(world_from_node * p.cast<double>()));
    }
    instances_.push_back(instance);
  }
  for (NodeId child : node.children) add(scene, child, world_from_node);
}

const BoxTree& NullScene::tree_of(const std::shared_ptr<const Mesh>& mesh) {
  Triangles& entry = trees_[mesh.get()];
  if (entry.owner.lock() == mesh) return entry.tree;
  std::vector<Aabb> boxes(mesh->triangles.size());
  for (std::size_t t = 0; t < boxes.size(); ++t) {
    for (std::uint32_t corner : mesh->triangles[t]) {
      boxes[t].add(Vec3(mesh->positions[corner].cast<double>()));
    }
  }
  entry = {mesh, BoxTree(boxes)};
  return entry.tree;
}

// Moeller and Trumbore, "Fast, minimum storage ray/triangle intersection", 1997.
std::optional<NullScene::Hit> NullScene::intersect(std::uint32_t index, Segment& segment) const {
  const Instance& instance = instances_[index];
  const Mesh& mesh = *instance.source->mesh;
  Segment local = segment;
  local.origin = instance.node_from_world * segment.origin;
  local.direction = instance.node_from_world.linear() * segment.direction;
  std::optional<Hit> best;
  instance.tree->visit(local, [&](std::uint32_t t) {
    const auto& corners = mesh.triangles[t];
    const Vec3 a = mesh.positions[corners[0]].cast<double>();
    const Vec3 ab = mesh.positions[corners[1]].cast<double>() - a;
    const Vec3 ac = mesh.positions[corners[2]].cast<double>() - a;
    const Vec3 p = local.direction.cross(ac);
    const double determinant = ab.dot(p);
    if (determinant == 0.0) return;
    constexpr double kEdge = 1e-12;  // rays through a shared edge may not slip between both sides
    const Vec3 from_a = local.origin - a;
    const double u = from_a.dot(p) / determinant;
    if (u < -kEdge || u > 1.0 + kEdge) return;
    const Vec3 q = from_a.cross(ab);
    const double v = local.direction.dot(q) / determinant;
    if (v < -kEdge || u + v > 1.0 + kEdge) return;
    const double distance = ac.dot(q) / determinant;
    if (!(distance >= local.t_min && distance < local.t_max)) return;
    if (is_cut_out(material_of(*instance.source, t), uv_at(mesh, t, u, v))) return;
    local.t_max = distance;
    best = Hit{index, t, u, v};
  });
  segment.t_max = local.t_max;
  return best;
}

SurfacePoint NullScene::first_hit(Segment segment) const {
  std::optional<Hit> best;
  top_.visit(segment, [&](std::uint32_t instance) {
    if (const auto hit = intersect(instance, segment)) best = hit;
  });
  return best ? describe(*best, segment) : SurfacePoint{};
}

SurfacePoint NullScene::describe(const Hit& hit, const Segment& segment) const {
  const Instance& instance = instances_[hit.instance];
  const Mesh& mesh = *instance.source->mesh;
  const auto& corners = mesh.triangles[hit.triangle];
  SurfacePoint point;
  point.node = instance.node;
  point.distance = segment.t_max;
  point.position = segment.origin + segment.t_max * segment.direction;

  const Vec3 a = instance.world_from_node * mesh.positions[corners[0]].cast<double>();
  const Vec3 b = instance.world_from_node * mesh.positions[corners[1]].cast<double>();
  const Vec3 c = instance.world_from_node * mesh.positions[corners[2]].cast<double>();
  const Vec3 d = segment.direction;
  Vec3 flat = (b - a).cross(c - a).normalized();
  if (instance.world_from_node.linear().determinant() < 0.0) flat = -flat;
  point.normal = flat;
  if (!mesh.normals.empty()) {
    const Vec3 node_normal = blend(mesh.normals, corners, hit.u, hit.v).cast<double>();
    const Vec3 world = instance.node_from_world.linear().transpose() * node_normal;
    if (world.norm() > 0.0) point.normal = world.normalized();
  }
  if (flat.dot(d) > 0.0) point.normal = -point.normal;
  if (const double away = point.normal.dot(d); away > 0.0) {
    point.normal = (point.normal - away * d).normalized();
  }

  point.uv = uv_at(mesh, hit.triangle, hit.u, hit.v);
  const Material& material = material_of(*instance.source, hit.triangle);
  point.albedo = material.base_color;
  if (!mesh.colors.empty()) {
    point.albedo = point.albedo.cwiseProduct(blend(mesh.colors, corners, hit.u, hit.v));
  }
  if (material.base_color_texture) {
    for (int k = 0; k < 3; ++k) point.albedo[k] *= lookup(material.base_color_texture, point.uv, k);
  }
  return point;
}

NullScene::Part NullScene::part(std::span<const NodeId> nodes) const {
  Part part;
  for (std::uint32_t i = 0; i < instances_.size(); ++i) {
    if (std::find(nodes.begin(), nodes.end(), instances_[i].node) == nodes.end()) continue;
    part.instances.push_back(i);
    part.bounds.add(instances_[i].bounds);
  }
  return part;
}

double NullScene::distance(const Part& part, Segment segment) const {
  bool is_met = false;
  for (const std::uint32_t i : part.instances) {
    if (intersect(i, segment)) is_met = true;
  }
  return is_met ? segment.t_max : kInfinity;
}

}  // namespace diorama
