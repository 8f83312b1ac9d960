// SPDX-License-Identifier: Apache-2.0
#include "box_mapping.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <tuple>

namespace diorama {
namespace {

/// The axis that a triangle faces most, and whether it faces along or against it.
struct Side {
  int axis = 2;
  bool is_along = true;
  friend auto operator<=>(const Side&, const Side&) = default;
};

Side side_of(const Mesh& mesh, const std::array<std::uint32_t, 3>& triangle) {
  const Vec3f& a = mesh.positions[triangle[0]];
  const Vec3f normal =
      (mesh.positions[triangle[1]] - a).cross(Vec3f(mesh.positions[triangle[2]] - a));
  Side side;
  normal.cwiseAbs().maxCoeff(&side.axis);
  side.is_along = normal[side.axis] >= 0.0f;
  return side;
}

/// Seen from outside: up is up on the four walls, and nothing is mirrored.
Vec2f uv_of(const Vec3f& p, const Side& side) {
  const float turn = side.is_along ? 1.0f : -1.0f;
  if (side.axis == 0) return {turn * p.y(), p.z()};
  if (side.axis == 1) return {-turn * p.x(), p.z()};
  return {turn * p.x(), p.y()};
}

Mesh with_uvs(const Mesh& mesh) {
  Mesh result;
  result.material_slots = mesh.material_slots;
  result.is_double_sided = mesh.is_double_sided;
  std::map<std::tuple<std::uint32_t, Side>, std::uint32_t> known;
  for (const auto& triangle : mesh.triangles) {
    const Side side = side_of(mesh, triangle);
    auto& corners = result.triangles.emplace_back();
    for (std::size_t i = 0; i < 3; ++i) {
      const std::uint32_t from = triangle[i];
      const auto [entry, is_new] =
          known.try_emplace({from, side}, std::uint32_t(result.positions.size()));
      corners[i] = entry->second;
      if (!is_new) continue;
      result.positions.push_back(mesh.positions[from]);
      result.uvs.push_back(uv_of(mesh.positions[from], side));
      if (!mesh.normals.empty()) result.normals.push_back(mesh.normals[from]);
      if (!mesh.colors.empty()) result.colors.push_back(mesh.colors[from]);
    }
  }
  return result;
}

}  // namespace

std::shared_ptr<const Mesh> BoxMapping::mapped(const std::shared_ptr<const Mesh>& mesh) {
  std::erase_if(by_source_, [](const auto& entry) {
    return entry.second.source.expired() && entry.second.mapped.expired();
  });
  Entry& entry = by_source_[mesh.get()];
  if (entry.source.lock() == mesh) {
    if (auto known = entry.mapped.lock()) return known;
  }
  auto made = std::make_shared<const Mesh>(with_uvs(*mesh));
  entry = {mesh, made};
  std::erase_if(own_, [](const auto& own) { return own.second.expired(); });
  own_[made.get()] = made;
  return made;
}

bool BoxMapping::is_own(const std::shared_ptr<const Mesh>& mesh) const {
  const auto known = own_.find(mesh.get());
  return known != own_.end() && known->second.lock() == mesh;
}

float BoxMapping::fit(Scene& scene, NodeId node, double picture_m) {
  const std::shared_ptr<const Mesh> mesh = scene[node].mesh;
  if (!is_own(mesh)) {
    if (!mesh || !mesh->uvs.empty()) return 1.0f;
    scene.edit(node).mesh = mapped(mesh);
  }
  const double scale = std::cbrt(std::abs(scene.world_from_node(node).linear().determinant()));
  return float(scale / picture_m);
}

void repeat_textures(Material& material, float times) {
  for (TextureInput* input :
       {&material.base_color_texture, &material.metallic_texture, &material.roughness_texture,
        &material.normal_texture, &material.opacity_texture, &material.emission_texture}) {
    input->uv_from_mesh_uv.leftCols<2>() *= times;
  }
}

}  // namespace diorama
