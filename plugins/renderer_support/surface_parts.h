// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "mesh_instance.h"

namespace diorama {

/// All surfaces of a scene, cut into parts of at most the same area, and many for every mesh: large
/// triangles into smaller ones, small ones gathered. Each part counts twice, once for either side.
/// World space, at the moment of the poses.
class SurfaceParts {
 public:
  /// About `wanted` parts, and up to as many more as there are meshes. `instances` must outlive
  /// this.
  SurfaceParts(std::span<const MeshInstance> instances, std::size_t wanted);

  /// Memory beside the parts.
  static constexpr std::size_t kBytesPerTriangle = 12;

  /// Of sides: part_of() is below.
  std::size_t count() const { return 2 * parts_.size(); }
  /// Square metres.
  double area(std::size_t side) const { return parts_[side / 2].area; }
  /// Whose side a hit lies on; `is_back`: not where the triangle's normal by its corners points to.
  std::size_t part_of(std::uint32_t instance, std::uint32_t triangle, float u, float v,
                      bool is_back) const;

  /// Fetches what part_of() reads.
  void prefetch(std::uint32_t instance, std::uint32_t triangle) const {
    __builtin_prefetch(&triangles_[starts_[instance] + triangle]);
  }

  struct Point {
    RayHit hit;  ///< Of a ray that came from one metre away along `normal`.
    Vec3f position;
    Vec3f normal;  ///< Unit, of the triangle, on the part's side.
  };
  /// Spread evenly over the part, by numbers in [0, 1): one chooses the triangle, two place.
  Point point(std::size_t side, float choice, const Vec2f& u) const;

  /// A triangle, by what renderers elsewhere need for part_of().
  struct Triangle {
    std::uint32_t part = 0;  ///< The first, where it is cut.
    std::uint32_t rows = 0;  ///< Of pieces that it is cut into; 0: it is whole.
    float end = 0.0f;        ///< Area of the part up to and with this triangle, where it is whole.
  };
  /// By instances: their numbers, from where the instance starts.
  std::span<const Triangle> triangles() const { return triangles_; }
  std::span<const std::uint32_t> starts() const { return starts_; }

 private:
  /// Either triangles of an instance, one behind the other, or a piece of one.
  struct Part {
    double area = 0.0;
    std::uint32_t instance = 0;
    std::uint32_t triangle = 0;  ///< The first.
    std::uint32_t count = 1;     ///< Of numbers of triangles.
    std::uint32_t rows = 0;      ///< Of pieces that the triangle is cut into; 0: it is whole.
    std::uint32_t piece = 0;
  };
  static std::uint32_t piece_at(float u, float v, std::uint32_t rows);
  void cut(std::uint32_t instance, double area);

  std::span<const MeshInstance> instances_;
  std::vector<Part> parts_;
  std::vector<Triangle> triangles_;
  std::vector<std::uint32_t> starts_;  ///< Of the instances in triangles_.
};

}  // namespace diorama
