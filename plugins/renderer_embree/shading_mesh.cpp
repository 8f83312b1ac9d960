// SPDX-License-Identifier: Apache-2.0
#include "shading_mesh.h"

#include <algorithm>
#include <cmath>

namespace diorama {
namespace {

std::int16_t packed(float x) { return std::int16_t(std::lrint(x * 32767.0f)); }

}  // namespace

ShadingMesh::ShadingMesh(std::shared_ptr<const Mesh> mesh) : source_(std::move(mesh)) {
  const Mesh& m = *source_;
  for (const auto& [first, second] : pair_triangles(m)) {
    tips_.push_back(first);
    tips_.push_back(second == TrianglePair::kNone ? first : second);
  }
  std::vector<std::array<std::int16_t, 3>> normals(m.normals.size());
  for (std::size_t i = 0; i < normals.size(); ++i) {
    const float length = m.normals[i].norm();
    const Vec3f n = length > 0.0f ? Vec3f(m.normals[i] / length) : Vec3f(Vec3f::Zero());
    normals[i] = {packed(n.x()), packed(n.y()), packed(n.z())};
  }
  triangles_.resize(tips_.size());
  if (!m.uvs.empty()) uvs_.resize(tips_.size());
  quads_.reserve(tips_.size() / 2);
  for (std::uint32_t t = 0; t < tips_.size(); t += 2) {
    const auto [a, b, d] = corners(t);
    // Embree takes a quad that ends with the same corner twice as a triangle.
    quads_.push_back({a, b, is_repeated(t + 1) ? d : corners(t + 1)[0], d});
    fill(t, normals);
    fill(t + 1, normals);
  }
}

void ShadingMesh::fill(std::uint32_t triangle,
                       const std::vector<std::array<std::int16_t, 3>>& normals) {
  const Mesh& m = *source_;
  const auto vertices = corners(triangle);
  Triangle& record = triangles_[triangle];
  for (std::size_t k = 0; k < 3; ++k) {
    if (!normals.empty()) {
      std::copy_n(normals[vertices[k]].begin(), 3, record.normals.begin() + 3 * k);
    }
    if (!uvs_.empty()) uvs_[triangle][k] = m.uvs[vertices[k]];
  }
  if (!m.material_slots.empty()) record.slot = m.material_slots[tips_[triangle] / 3];
  highest_slot_ = std::max<std::size_t>(highest_slot_, record.slot);
}

}  // namespace diorama
