// SPDX-License-Identifier: Apache-2.0
#include "shading_mesh.h"

#include <algorithm>
#include <cmath>

namespace diorama {
namespace {

using PackedNormal = std::array<std::int16_t, 3>;

std::int16_t packed(float x) { return std::int16_t(std::lrint(x * 32767.0f)); }

std::vector<PackedNormal> packed(const std::vector<Vec3f>& normals) {
  std::vector<PackedNormal> result;
  result.reserve(normals.size());
  for (const Vec3f& normal : normals) {
    const float length = normal.norm();
    const Vec3f n = length > 0.0f ? Vec3f(normal / length) : Vec3f(Vec3f::Zero());
    result.push_back({packed(n.x()), packed(n.y()), packed(n.z())});
  }
  return result;
}

}  // namespace

ShadingMesh::ShadingMesh(std::shared_ptr<const Mesh> mesh) : source_(std::move(mesh)) {
  const Mesh& m = *source_;
  const std::vector<PackedNormal> normals = packed(m.normals);
  const std::vector<TrianglePair> pairs = pair_triangles(m);
  tips_.reserve(2 * pairs.size());
  quads_.reserve(pairs.size());
  triangles_.reserve(2 * pairs.size());
  const auto add_triangle = [&](const std::array<std::uint32_t, 3>& corners, std::uint32_t tip) {
    Triangle& triangle = triangles_.emplace_back();
    if (!normals.empty()) {
      for (std::size_t k = 0; k < 9; ++k) triangle.normals[k] = normals[corners[k / 3]][k % 3];
    }
    if (!m.material_slots.empty()) triangle.slot = m.material_slots[tip / 3];
    highest_slot_ = std::max<std::size_t>(highest_slot_, triangle.slot);
  };
  for (const auto& [first, second] : pairs) {
    const bool is_pair = second != TrianglePair::kNone;
    tips_.push_back(first);
    tips_.push_back(is_pair ? second : first);
    const auto number = std::uint32_t(tips_.size() - 2);
    const auto [a, b, d] = corners(number);
    const auto [c, other_d, other_b] = corners(number + 1);
    // Embree takes a quad that ends with the same corner twice as a triangle.
    quads_.push_back({a, b, is_pair ? c : d, d});
    add_triangle({a, b, d}, tips_[number]);
    add_triangle({c, other_d, other_b}, tips_[number + 1]);
  }
}

void ShadingMesh::pack_uvs() {
  if (!has_uvs() || !uvs_.empty()) return;
  uvs_.reserve(tips_.size());
  for (std::uint32_t t = 0; t < number_end(); ++t) uvs_.push_back(source_uvs(t));
}

}  // namespace diorama
