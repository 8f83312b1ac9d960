// SPDX-License-Identifier: Apache-2.0
#include "shading_mesh.h"

#include <algorithm>
#include <cmath>

namespace diorama {
namespace {

std::int16_t packed(float x) { return std::int16_t(std::lround(x * 32767.0f)); }

}  // namespace

ShadingMesh::ShadingMesh(std::shared_ptr<const Mesh> mesh) : source_(std::move(mesh)) {
  const Mesh& m = *source_;
  triangles_.resize(m.triangles.size());
  if (!m.uvs.empty()) uvs_.resize(m.triangles.size());
  std::vector<std::array<std::int16_t, 3>> normals(m.normals.size());
  for (std::size_t i = 0; i < normals.size(); ++i) {
    const float length = m.normals[i].norm();
    const Vec3f n = length > 0.0f ? Vec3f(m.normals[i] / length) : Vec3f(Vec3f::Zero());
    normals[i] = {packed(n.x()), packed(n.y()), packed(n.z())};
  }
  for (std::size_t t = 0; t < triangles_.size(); ++t) {
    const auto& corners = m.triangles[t];
    for (std::size_t k = 0; k < 3; ++k) {
      if (!normals.empty()) {
        std::copy_n(normals[corners[k]].begin(), 3, triangles_[t].normals.begin() + 3 * k);
      }
      if (!uvs_.empty()) uvs_[t][k] = m.uvs[corners[k]];
    }
    if (!m.material_slots.empty()) triangles_[t].slot = m.material_slots[t];
    highest_slot_ = std::max<std::size_t>(highest_slot_, triangles_[t].slot);
  }
}

}  // namespace diorama
