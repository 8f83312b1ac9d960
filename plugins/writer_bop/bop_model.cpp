// SPDX-License-Identifier: Apache-2.0
#include "writer_bop/bop_model.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>
#include <utility>

#include "diorama/image.h"
#include "writer_bop/bop_format.h"
#include "writer_bop/point_diameter.h"

namespace diorama {
namespace {

/// The pixel at a uv, rows from the top, the texture repeated; linear.
Vec3f texel(const TextureInput& input, const Vec2f& mesh_uv) {
  const Texture& texture = *input.texture;
  const Vec2f uv = input.uv_from_mesh_uv * Vec3f(mesh_uv.x(), mesh_uv.y(), 1.0f);
  const auto place = [](float share, int size) {
    const float inside = share - std::floor(share);
    return std::clamp(int(inside * float(size)), 0, size - 1);
  };
  const std::size_t pixel =
      std::size_t(place(1.0f - uv.y(), texture.height)) * std::size_t(texture.width) +
      std::size_t(place(uv.x(), texture.width));
  Vec3f color;
  for (int c = 0; c < 3; ++c) {
    // One or two channels are grey.
    const int channel = texture.channels < 3 ? 0 : c;
    const std::size_t at = pixel * std::size_t(texture.channels) + std::size_t(channel);
    float value =
        texture.floats.empty() ? float(texture.bytes.at(at)) / 255.0f : texture.floats.at(at);
    if (texture.color_space == ColorSpace::Srgb) value = linear_from_srgb(value);
    color[c] = value * input.scale[std::size_t(c)] + input.bias[std::size_t(c)];
  }
  return color;
}

/// The material of each vertex: that of the last triangle that has it.
std::vector<std::uint16_t> slots_of_vertices(const Mesh& mesh) {
  std::vector<std::uint16_t> slots(mesh.positions.size(), 0);
  for (std::size_t t = 0; t < mesh.material_slots.size(); ++t) {
    for (const std::uint32_t vertex : mesh.triangles[t]) slots[vertex] = mesh.material_slots[t];
  }
  return slots;
}

std::array<std::uint8_t, 3> vertex_color(const Node& node, const Mesh& mesh, std::size_t vertex,
                                         std::uint16_t slot) {
  Vec3f color = Vec3f::Constant(0.8f);
  const Material* material = slot < node.materials.size() ? node.materials[slot].get() : nullptr;
  if (material) {
    color = material->base_color;
    const TextureInput& picture = material->base_color_texture;
    if (picture && !mesh.uvs.empty()) color = color.cwiseProduct(texel(picture, mesh.uvs[vertex]));
  }
  if (!mesh.colors.empty()) color = color.cwiseProduct(mesh.colors[vertex]);
  std::array<std::uint8_t, 3> bytes{};
  for (std::size_t c = 0; c < 3; ++c) {
    const float linear = std::clamp(color[Eigen::Index(c)], 0.0f, 1.0f);
    bytes[c] = std::uint8_t(std::lround(255.0f * srgb_from_linear(linear)));
  }
  return bytes;
}

void add_mesh(const Node& node, const Affine& root_from_node, BopModel& model) {
  const Mesh& mesh = *node.mesh;
  const auto first = std::uint32_t(model.positions.size());
  const std::vector<Vec3f> normals = mesh.normals.empty() ? smooth_normals(mesh) : mesh.normals;
  const Mat3 turn = root_from_node.linear().inverse().transpose();
  const std::vector<std::uint16_t> slots = slots_of_vertices(mesh);
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const Vec3 position = root_from_node * mesh.positions[i].cast<double>();
    model.positions.push_back(float(kMillimetres) * position.cast<float>());
    model.normals.push_back((turn * normals[i].cast<double>()).normalized().cast<float>());
    model.colors.push_back(vertex_color(node, mesh, i, slots[i]));
  }
  const bool is_mirrored = root_from_node.linear().determinant() < 0.0;
  for (const auto& [a, b, c] : mesh.triangles) {
    model.triangles.push_back(
        {first + a, first + (is_mirrored ? c : b), first + (is_mirrored ? b : c)});
  }
}

void append(std::vector<std::byte>& file, const void* data, std::size_t size) {
  const auto* bytes = static_cast<const std::byte*>(data);
  file.insert(file.end(), bytes, bytes + size);
}

}  // namespace

Aabb BopModel::bounds() const {
  Aabb box;
  for (const Vec3f& position : positions) box.add(position.cast<double>());
  return box;
}

double BopModel::diameter() const { return point_diameter(positions); }

BopModel BopModel::scaled(const Vec3& factors) const {
  BopModel model = *this;
  for (Vec3f& position : model.positions) {
    position = position.cast<double>().cwiseProduct(factors).cast<float>();
  }
  for (Vec3f& normal : model.normals) {
    normal = normal.cast<double>().cwiseQuotient(factors).normalized().cast<float>();
  }
  if (factors.prod() < 0.0) {
    for (auto& triangle : model.triangles) std::swap(triangle[1], triangle[2]);
  }
  return model;
}

std::vector<std::byte> BopModel::ply() const {
  const std::string header =
      "ply\nformat binary_little_endian 1.0\ncomment millimetres\nelement vertex " +
      std::to_string(positions.size()) +
      "\nproperty float x\nproperty float y\nproperty float z\n"
      "property float nx\nproperty float ny\nproperty float nz\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\nelement face " +
      std::to_string(triangles.size()) + "\nproperty list uchar int vertex_indices\nend_header\n";
  std::vector<std::byte> file;
  file.reserve(header.size() + 27 * positions.size() + 13 * triangles.size());
  append(file, header.data(), header.size());
  for (std::size_t i = 0; i < positions.size(); ++i) {
    append(file, positions[i].data(), 12);
    append(file, normals[i].data(), 12);
    append(file, colors[i].data(), 3);
  }
  for (const auto& triangle : triangles) {
    file.push_back(std::byte(3));
    append(file, triangle.data(), 12);
  }
  return file;
}

BopModel bop_model(const Scene& scene, NodeId root) {
  BopModel model;
  const Affine root_from_world = scene.world_from_node(root).inverse();
  for (const NodeId id : scene.subtree(root)) {
    if (!scene[id].mesh || !scene.is_visible(id)) continue;
    add_mesh(scene[id], root_from_world * scene.world_from_node(id), model);
  }
  return model;
}

}  // namespace diorama
