// SPDX-License-Identifier: Apache-2.0
#include "modelling/mesh_builder.h"

#include <algorithm>
#include <utility>

namespace diorama::modelling {

void MeshBuilder::begin(const Affine& mesh_from_part, const Surface& surface) {
  mesh_from_part_ = mesh_from_part;
  normal_matrix_ = mesh_from_part.linear().inverse().transpose();
  is_mirrored_ = mesh_from_part.linear().determinant() < 0;
  surface_ = surface;
}

std::uint32_t MeshBuilder::add_vertex(const Vec3& point, const Vec3& normal, const Vec2& uv_m) {
  mesh_.positions.push_back((mesh_from_part_ * point).cast<float>());
  mesh_.normals.push_back((normal_matrix_ * normal).normalized().cast<float>());
  mesh_.uvs.push_back((uv_m * surface_.repeats_per_m + surface_.uv_offset).cast<float>());
  return std::uint32_t(mesh_.positions.size() - 1);
}

void MeshBuilder::add_triangle(std::uint32_t a, std::uint32_t b, std::uint32_t c) {
  if (is_mirrored_) std::swap(b, c);
  mesh_.triangles.push_back({a, b, c});
  mesh_.material_slots.push_back(surface_.slot);
}

void MeshBuilder::add_quad(std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) {
  add_triangle(a, b, c);
  add_triangle(a, c, d);
}

Aabb MeshBuilder::bounds() const { return mesh_.bounds(); }

Vec3 MeshBuilder::centre_on_vertex_mean() {
  Vec3 sum = Vec3::Zero();
  for (const Vec3f& p : mesh_.positions) sum += p.cast<double>();
  const Vec3f mean = (sum / double(std::max<std::size_t>(1, mesh_.positions.size()))).cast<float>();
  for (Vec3f& p : mesh_.positions) p -= mean;
  return mean.cast<double>();
}

std::shared_ptr<const Mesh> MeshBuilder::build() {
  Mesh mesh = std::exchange(mesh_, {});
  std::size_t kept = 0;
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const auto [a, b, c] = mesh.triangles[i];
    const Vec3f ab = mesh.positions[b] - mesh.positions[a];
    const Vec3f ac = mesh.positions[c] - mesh.positions[a];
    if (ab.cross(ac).norm() < 1e-11f) continue;
    mesh.triangles[kept] = mesh.triangles[i];
    mesh.material_slots[kept++] = mesh.material_slots[i];
  }
  mesh.triangles.resize(kept);
  mesh.material_slots.resize(kept);
  const bool has_one_slot = std::all_of(mesh.material_slots.begin(), mesh.material_slots.end(),
                                        [](std::uint16_t slot) { return slot == 0; });
  if (has_one_slot) mesh.material_slots.clear();
  return std::make_shared<const Mesh>(std::move(mesh));
}

Affine at(double x, double y, double z) { return Affine(Eigen::Translation3d(x, y, z)); }
Affine at(const Vec3& point) { return Affine(Eigen::Translation3d(point)); }
Affine turned_x(double radians) { return Affine(Eigen::AngleAxisd(radians, Vec3::UnitX())); }
Affine turned_y(double radians) { return Affine(Eigen::AngleAxisd(radians, Vec3::UnitY())); }
Affine turned_z(double radians) { return Affine(Eigen::AngleAxisd(radians, Vec3::UnitZ())); }
Affine scaled(double x, double y, double z) { return Affine(Eigen::Scaling(x, y, z)); }

}  // namespace diorama::modelling
