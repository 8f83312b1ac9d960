// SPDX-License-Identifier: Apache-2.0
#include "loader_usd/shapes.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "loader_usd/usd/geometry.h"

namespace diorama::loader_usd {
namespace {

// Turns a shape made along z so that it lies along another axis.
void turn_axis(Mesh& mesh, const std::string& axis) {
  if (axis != "X" && axis != "Y") return;
  const auto turn = [&](Vec3f& v) {
    v = axis == "X" ? Vec3f(v.z(), v.x(), v.y()) : Vec3f(v.y(), v.z(), v.x());
  };
  for (Vec3f& position : mesh.positions) turn(position);
  for (Vec3f& normal : mesh.normals) turn(normal);
}

struct Ends {
  double top = 0.0;
  double bottom = 0.0;
  double height = 0.0;

  double widest() const { return std::max(top, bottom); }
};

// Gives a straight cylinder or capsule of the widest radius another radius at each end. What is
// beyond the ends, a capsule's half spheres, is scaled about its centre.
void taper(Mesh& mesh, const Ends& ends) {
  const double half = 0.5 * ends.height;
  const double slope = (ends.bottom - ends.top) / ends.height;
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    Vec3 position = mesh.positions[i].cast<double>();
    const double end = std::clamp(position.z(), -half, half);
    const double share = end / ends.height + 0.5;
    const double scale = (ends.bottom + (ends.top - ends.bottom) * share) / ends.widest();
    position.x() *= scale;
    position.y() *= scale;
    position.z() = end + (position.z() - end) * scale;
    mesh.positions[i] = position.cast<float>();
    Vec3 normal = mesh.normals[i].cast<double>();
    if (std::abs(normal.z()) > 1e-6) continue;
    normal.z() = slope;
    mesh.normals[i] = normal.normalized().cast<float>();
  }
}

std::optional<Mesh> make_tapered(const Ends& ends, bool is_capsule) {
  const double radius = ends.widest();
  if (is_capsule && radius > 0.0 && ends.height == 0.0) return make_sphere(radius);
  if (!(radius > 0.0) || !(ends.height > 0.0)) return std::nullopt;
  Mesh mesh = is_capsule ? make_capsule(radius, ends.height) : make_cylinder(radius, ends.height);
  if (ends.top != ends.bottom) taper(mesh, ends);
  return mesh;
}

}  // namespace

std::optional<Mesh> make_shape(const usd::Stage& stage, const usd::Prim& prim) {
  const std::string& type = prim.type_name;
  // Zero where it is no number, or one whose square is none that fits into a mesh.
  constexpr double kLargest = 1e18;
  const auto length = [&](const char* name, double fallback) {
    const double value = std::abs(usd::number_or(stage, prim, name, fallback));
    return value < kLargest ? value : 0.0;
  };
  if (type == "Cube") {
    const double size = length("size", 2.0);
    return size > 0.0 ? std::optional(make_box(Vec3::Constant(size))) : std::nullopt;
  }
  if (type == "Sphere") {
    const double radius = length("radius", 1.0);
    return radius > 0.0 ? std::optional(make_sphere(radius)) : std::nullopt;
  }
  std::optional<Mesh> mesh;
  if (type == "Cylinder") {
    const double radius = length("radius", 1.0);
    mesh = make_tapered({radius, radius, length("height", 2.0)}, false);
  } else if (type == "Cylinder_1") {
    mesh = make_tapered(
        {length("radiusTop", 1.0), length("radiusBottom", 1.0), length("height", 2.0)}, false);
  } else if (type == "Capsule") {
    const double radius = length("radius", 0.5);
    mesh = make_tapered({radius, radius, length("height", 1.0)}, true);
  } else if (type == "Capsule_1") {
    mesh = make_tapered(
        {length("radiusTop", 0.5), length("radiusBottom", 0.5), length("height", 1.0)}, true);
  } else if (type == "Cone") {
    const double radius = length("radius", 1.0);
    const double height = length("height", 2.0);
    if (radius > 0.0 && height > 0.0) mesh = make_cone(radius, height);
  } else if (type == "Plane") {
    const double width = length("width", 2.0);
    const double depth = length("length", 2.0);
    if (width > 0.0 && depth > 0.0) mesh = make_plane(width, depth);
  }
  if (mesh) turn_axis(*mesh, usd::token_or(stage, prim, "axis", "Z"));
  return mesh;
}

}  // namespace diorama::loader_usd
