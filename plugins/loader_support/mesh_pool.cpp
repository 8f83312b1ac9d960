// SPDX-License-Identifier: Apache-2.0
#include "loader_support/mesh_pool.h"

#include <algorithm>
#include <cstring>
#include <utility>

namespace diorama::loader_support {
namespace {

// Looks at sizes and a few entries only: meshes that differ nearly always differ there, and those
// that do not are compared in full.
class Fingerprint {
 public:
  template <class T>
  void add(const std::vector<T>& list) {
    constexpr std::size_t kSamples = 32;
    const std::size_t size = list.size();
    add_bytes(&size, sizeof size);
    const std::size_t step = std::max<std::size_t>(size / kSamples, 1);
    for (std::size_t i = 0; i < size; i += step) add_bytes(&list[i], sizeof(T));
  }
  std::uint64_t value() const { return value_; }

 private:
  // FNV-1a (Fowler, Noll, Vo).
  void add_bytes(const void* data, std::size_t size) {
    const auto* bytes = static_cast<const unsigned char*>(data);
    for (std::size_t i = 0; i < size; ++i) value_ = (value_ ^ bytes[i]) * 0x100000001b3u;
  }

  std::uint64_t value_ = 0xcbf29ce484222325u;
};

template <class T>
bool is_same(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() &&
         (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0);
}

bool is_same(const Mesh& a, const Mesh& b) {
  return a.is_double_sided == b.is_double_sided && is_same(a.positions, b.positions) &&
         is_same(a.triangles, b.triangles) && is_same(a.normals, b.normals) &&
         is_same(a.uvs, b.uvs) && is_same(a.colors, b.colors) &&
         is_same(a.material_slots, b.material_slots);
}

}  // namespace

std::shared_ptr<const Mesh> MeshPool::share(Mesh mesh) {
  Fingerprint print;
  print.add(mesh.positions);
  print.add(mesh.triangles);
  print.add(mesh.normals);
  print.add(mesh.uvs);
  print.add(mesh.colors);
  print.add(mesh.material_slots);
  const auto [first, last] = meshes_.equal_range(print.value());
  for (auto known = first; known != last; ++known) {
    if (is_same(*known->second, mesh)) return known->second;
  }
  auto made = std::make_shared<const Mesh>(std::move(mesh));
  meshes_.emplace(print.value(), made);
  return made;
}

}  // namespace diorama::loader_support
