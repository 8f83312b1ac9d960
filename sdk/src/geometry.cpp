// SPDX-License-Identifier: Apache-2.0
#include "diorama/geometry.h"

#include <algorithm>
#include <cmath>

#include "diorama/error.h"

namespace diorama {

namespace {

void check_length(const std::string& name, const char* what, std::size_t found,
                  std::size_t expected) {
  if (found == 0 || found == expected) return;
  throw Error(ErrorKind::Asset, name + ": the mesh has " + std::to_string(found) + " " + what +
                                    ", expected " + std::to_string(expected) + " or none");
}

template <class Vectors>
void check_finite(const std::string& name, const char* what, const Vectors& vectors) {
  for (std::size_t i = 0; i < vectors.size(); ++i) {
    if (vectors[i].allFinite()) continue;
    throw Error(ErrorKind::Asset,
                name + ": " + what + " " + std::to_string(i) + " of the mesh is not finite");
  }
}

}  // namespace

Aabb Mesh::bounds() const {
  Aabb box;
  if (positions.empty()) return box;
  Vec3f low = positions.front();
  Vec3f high = low;
  for (const Vec3f& position : positions) {
    low = low.cwiseMin(position);
    high = high.cwiseMax(position);
  }
  box.add(low.cast<double>());
  box.add(high.cast<double>());
  return box;
}

void Mesh::validate(const std::string& name) const {
  check_length(name, "normals", normals.size(), positions.size());
  check_length(name, "uvs", uvs.size(), positions.size());
  check_length(name, "colors", colors.size(), positions.size());
  check_length(name, "material slots", material_slots.size(), triangles.size());
  check_finite(name, "position", positions);
  check_finite(name, "normal", normals);
  check_finite(name, "uv", uvs);
  check_finite(name, "color", colors);
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    for (const std::uint32_t index : triangles[i]) {
      if (index < positions.size()) continue;
      throw Error(ErrorKind::Asset, name + ": triangle " + std::to_string(i) +
                                        " of the mesh uses position " + std::to_string(index) +
                                        ", there are " + std::to_string(positions.size()));
    }
  }
}

std::vector<Vec3f> smooth_normals(const Mesh& mesh) {
  std::vector<Vec3> sums(mesh.positions.size(), Vec3::Zero());
  for (const auto& [a, b, c] : mesh.triangles) {
    const Vec3 origin = mesh.positions[a].cast<double>();
    const Vec3 normal = (mesh.positions[b].cast<double>() - origin)
                            .cross(mesh.positions[c].cast<double>() - origin);
    for (const std::uint32_t index : {a, b, c}) sums[index] += normal;
  }
  std::vector<Vec3f> normals;
  normals.reserve(sums.size());
  for (const Vec3& sum : sums) {
    const double length = sum.norm();
    normals.push_back(length > 0.0 ? Vec3f((sum / length).cast<float>()) : Vec3f::UnitZ());
  }
  return normals;
}

namespace {

/// A ring of a surface of revolution around z. Walking along a profile has the outside on the
/// right when seen with z up and the radius to the right.
struct Ring {
  double radius;
  double z;
  double normal_radius;
  double normal_z;
};

void check_size(const char* what, bool is_good) {
  if (!is_good) {
    throw Error(ErrorKind::Internal,
                std::string(what) + ": sizes must be finite and greater than 0");
  }
}

void check_segments(int segments) {
  if (segments >= 3 && segments <= 100000) return;
  throw Error(ErrorKind::Internal,
              "expected 3 to 100000 segments, found " + std::to_string(segments));
}

bool is_positive(double x) { return std::isfinite(x) && x > 0.0; }

/// Share of the profile's length at which each ring lies.
std::vector<double> lengths_along(const std::vector<Ring>& profile) {
  std::vector<double> along(profile.size(), 0.0);
  for (std::size_t j = 1; j < profile.size(); ++j) {
    along[j] = along[j - 1] + std::hypot(profile[j].radius - profile[j - 1].radius,
                                         profile[j].z - profile[j - 1].z);
  }
  for (double& length : along) length /= along.back();
  return along;
}

void add_ring(Mesh& mesh, const Ring& ring, double v, int segments) {
  for (int i = 0; i <= segments; ++i) {
    // The last column repeats the first one exactly, with u = 1.
    const double angle = 2.0 * kPi * (i % segments) / segments;
    const Vec2 around(std::cos(angle), std::sin(angle));
    const Vec3 position(ring.radius * around.x(), ring.radius * around.y(), ring.z);
    const Vec3 normal(ring.normal_radius * around.x(), ring.normal_radius * around.y(),
                      ring.normal_z);
    mesh.positions.push_back(position.cast<float>());
    mesh.normals.push_back(normal.normalized().cast<float>());
    mesh.uvs.push_back(Vec2f(float(i) / float(segments), float(v)));
  }
}

/// From the lowest ring to the highest; neighbours at the same place are a crease.
Mesh revolved(const std::vector<Ring>& profile, int segments) {
  check_segments(segments);
  Mesh mesh;
  const std::vector<double> along = lengths_along(profile);
  for (std::size_t j = 0; j < profile.size(); ++j) add_ring(mesh, profile[j], along[j], segments);

  const auto columns = std::uint32_t(segments + 1);
  for (std::uint32_t j = 0; j + 1 < profile.size(); ++j) {
    const Ring& lower = profile[j];
    const Ring& upper = profile[j + 1];
    if (lower.radius == upper.radius && lower.z == upper.z) continue;
    for (std::uint32_t i = 0; i + 1 < columns; ++i) {
      const std::uint32_t a = j * columns + i, b = a + 1, c = b + columns, d = a + columns;
      if (lower.radius > 0.0) mesh.triangles.push_back({a, b, c});
      if (upper.radius > 0.0) mesh.triangles.push_back({a, c, d});
    }
  }
  return mesh;
}

/// Rings of a half sphere around (0, z) from angle `from` to `to` above the equator.
void add_arc(std::vector<Ring>& profile, double radius, double z, double from, double to,
             int steps) {
  for (int k = 0; k <= steps; ++k) {
    const double angle = from + (to - from) * k / steps;
    const bool is_pole = std::abs(std::abs(angle) - 0.5 * kPi) < 1e-12;
    const double across = is_pole ? 0.0 : std::cos(angle);
    profile.push_back({radius * across, z + radius * std::sin(angle), across, std::sin(angle)});
  }
}

}  // namespace

Mesh make_box(const Vec3& size) {
  check_size("box", is_positive(size.x()) && is_positive(size.y()) && is_positive(size.z()));
  Mesh mesh;
  for (int axis = 0; axis < 3; ++axis) {
    for (const double side : {-1.0, 1.0}) {
      // u and v go right and up for a viewer outside; for the vertical faces, v is z.
      const Vec3 normal = side * Vec3::Unit(axis);
      const Vec3 up = axis == 2 ? Vec3::UnitY() : Vec3::UnitZ();
      const Vec3 right = up.cross(normal);
      const auto first = std::uint32_t(mesh.positions.size());
      for (const Vec2f& uv : {Vec2f(0, 0), Vec2f(1, 0), Vec2f(1, 1), Vec2f(0, 1)}) {
        const Vec3 corner = 0.5 * normal + (uv.x() - 0.5) * right + (uv.y() - 0.5) * up;
        mesh.positions.push_back(corner.cwiseProduct(size).cast<float>());
        mesh.normals.push_back(normal.cast<float>());
        mesh.uvs.push_back(uv);
      }
      mesh.triangles.push_back({first, first + 1, first + 2});
      mesh.triangles.push_back({first, first + 2, first + 3});
    }
  }
  return mesh;
}

Mesh make_sphere(double radius, int segments) {
  check_size("sphere", is_positive(radius));
  std::vector<Ring> profile;
  add_arc(profile, radius, 0.0, -0.5 * kPi, 0.5 * kPi, std::max(2, segments / 2));
  return revolved(profile, segments);
}

Mesh make_cylinder(double radius, double height, int segments) {
  check_size("cylinder", is_positive(radius) && is_positive(height));
  const double top = 0.5 * height;
  return revolved({{0, -top, 0, -1},
                   {radius, -top, 0, -1},
                   {radius, -top, 1, 0},
                   {radius, top, 1, 0},
                   {radius, top, 0, 1},
                   {0, top, 0, 1}},
                  segments);
}

Mesh make_cone(double radius, double height, int segments) {
  check_size("cone", is_positive(radius) && is_positive(height));
  const double top = 0.5 * height;
  return revolved({{0, -top, 0, -1},
                   {radius, -top, 0, -1},
                   {radius, -top, height, radius},
                   {0, top, height, radius}},
                  segments);
}

Mesh make_capsule(double radius, double height, int segments) {
  check_size("capsule", is_positive(radius) && is_positive(height));
  std::vector<Ring> profile;
  const int steps = std::max(1, segments / 4);
  add_arc(profile, radius, -0.5 * height, -0.5 * kPi, 0.0, steps);
  add_arc(profile, radius, 0.5 * height, 0.0, 0.5 * kPi, steps);
  return revolved(profile, segments);
}

Mesh make_plane(double width, double length) {
  check_size("plane", is_positive(width) && is_positive(length));
  Mesh mesh;
  for (const Vec2f& uv : {Vec2f(0, 0), Vec2f(1, 0), Vec2f(1, 1), Vec2f(0, 1)}) {
    mesh.positions.push_back(
        Vec3f((uv.x() - 0.5f) * float(width), (uv.y() - 0.5f) * float(length), 0));
    mesh.normals.push_back(Vec3f::UnitZ());
    mesh.uvs.push_back(uv);
  }
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

}  // namespace diorama
