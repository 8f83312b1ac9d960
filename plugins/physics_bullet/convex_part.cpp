// SPDX-License-Identifier: Apache-2.0
#include "convex_part.h"

#include <btBulletCollisionCommon.h>

#include <algorithm>
#include <optional>

#include "hull_shape.h"

namespace diorama {
namespace {

constexpr double kThinnest = 1e-3;  // metres; thinner things are simulated this thick

bool is_near(double a, double b) { return std::abs(a - b) <= 1e-6 * std::abs(a); }

bool is_diagonal(const Mat3& stretch) {
  return stretch(0, 1) == 0.0 && stretch(0, 2) == 0.0 && stretch(1, 2) == 0.0;
}

std::vector<Vec3> stretched(const Mat3& stretch, const std::vector<Vec3>& points) {
  std::vector<Vec3> result;
  result.reserve(points.size());
  for (const Vec3& point : points) result.push_back(stretch * point);
  return result;
}

std::optional<ConvexPart> hull_part(const std::vector<Vec3>& points, std::size_t max_points) {
  if (points.empty()) return std::nullopt;
  ConvexPart part;
  part.points = reduced_hull_points(thickened(points, kThinnest), max_points);
  const ConvexHull hull = convex_hull(part.points);
  part.mass = mass_of_hull(hull);
  if (!(part.mass.volume > 0.0)) return std::nullopt;
  part.inner_radius_m = std::max(0.0, inner_distance(hull, part.mass.centroid));
  return part;
}

std::optional<ConvexPart> box_part(const Aabb& box, const Mat3& stretch, std::size_t max_points) {
  if (box.is_empty()) return std::nullopt;
  if (!is_diagonal(stretch)) {
    std::vector<Vec3> corners;
    for (int i = 0; i < 8; ++i) corners.push_back(stretch * box.corner(i));
    return hull_part(corners, max_points);
  }
  ConvexPart part;
  part.kind = PartKind::Box;
  part.size = (stretch * box.size()).cwiseAbs().cwiseMax(kThinnest);
  part.frame_from_part.translation() = stretch * box.centre();
  part.mass = mass_of_box(part.size);
  part.inner_radius_m = 0.5 * part.size.minCoeff();
  return part;
}

ConvexPart sphere_part(double radius, const Vec3& centre) {
  ConvexPart part;
  part.kind = PartKind::Sphere;
  part.size = Vec3::Constant(2.0 * radius);
  part.frame_from_part.translation() = centre;
  part.mass = mass_of_sphere(radius);
  part.inner_radius_m = radius;
  return part;
}

std::optional<ConvexPart> bounding_sphere_part(const Mesh& mesh, const Aabb& box,
                                               const Mat3& stretch) {
  if (box.is_empty()) return std::nullopt;
  const Vec3 centre = stretch * box.centre();
  double radius = 0.5 * kThinnest;
  for (const Vec3f& position : mesh.positions) {
    radius = std::max(radius, (stretch * position.cast<double>() - centre).norm());
  }
  return sphere_part(radius, centre);
}

Mesh primitive_mesh(PrimitiveShape primitive, const Vec3& size) {
  constexpr int kSegments = 32;
  const double radius = 0.5;
  Mesh mesh;
  Vec3 made = Vec3::Ones();
  switch (primitive) {
    case PrimitiveShape::Sphere:
      mesh = make_sphere(radius, kSegments);
      break;
    case PrimitiveShape::Cylinder:
      mesh = make_cylinder(radius, 1.0, kSegments);
      break;
    case PrimitiveShape::Cone:
      mesh = make_cone(radius, 1.0, kSegments);
      break;
    case PrimitiveShape::Capsule: {
      const double across = std::max(size.x(), size.y());
      const double between = across > 0.0 ? std::max(0.0, size.z() / across - 1.0) : 0.0;
      mesh = make_capsule(radius, between, kSegments);
      made.z() = 1.0 + between;
      break;
    }
    default:
      mesh = make_box(Vec3::Ones());
      break;
  }
  for (Vec3f& position : mesh.positions) {
    position = position.cast<double>().cwiseQuotient(made).cwiseProduct(size).cast<float>();
  }
  return mesh;
}

std::optional<ConvexPart> tessellated_part(PrimitiveShape primitive, const Vec3& size,
                                           const Mat3& stretch, std::size_t max_points) {
  std::vector<Vec3> points;
  for (const Vec3f& position : primitive_mesh(primitive, size).positions) {
    points.push_back(stretch * position.cast<double>());
  }
  return hull_part(points, max_points);
}

/// The engine's own shape where scale keeps the primitive one of its kind.
std::optional<ConvexPart> exact_part(PrimitiveShape primitive, const Vec3& size) {
  const bool is_round = is_near(size.x(), size.y()) && size.minCoeff() >= kThinnest;
  if (!is_round) return std::nullopt;
  const double radius = 0.5 * size.x();
  ConvexPart part;
  part.size = size;
  part.inner_radius_m = std::min(radius, 0.5 * size.z());
  switch (primitive) {
    case PrimitiveShape::Sphere:
      if (!is_near(size.x(), size.z())) return std::nullopt;
      return sphere_part(radius, Vec3::Zero());
    case PrimitiveShape::Cylinder:
      part.kind = PartKind::Cylinder;
      part.mass = mass_of_cylinder(radius, size.z());
      return part;
    case PrimitiveShape::Cone:
      part.kind = PartKind::Cone;
      part.mass = mass_of_cone(radius, size.z());
      // Distance of the centroid, a quarter up, to the base and to the mantle.
      part.inner_radius_m =
          std::min(0.25 * size.z(), 0.75 * size.z() * radius / std::hypot(radius, size.z()));
      return part;
    case PrimitiveShape::Capsule:
      if (size.z() < size.x()) return std::nullopt;
      part.kind = PartKind::Capsule;
      part.mass = mass_of_capsule(radius, size.z() - size.x());
      return part;
    default:
      return std::nullopt;
  }
}

std::optional<ConvexPart> primitive_part(const Collider& collider, const Mat3& stretch,
                                         std::size_t max_points) {
  const Vec3 size = collider.primitive_size;
  if (collider.primitive == PrimitiveShape::Box) {
    return box_part({-0.5 * size, 0.5 * size}, stretch, max_points);
  }
  const bool turns_over = collider.primitive == PrimitiveShape::Cone && stretch(2, 2) < 0.0;
  if (is_diagonal(stretch) && !turns_over) {
    const Vec3 scaled = (stretch * size).cwiseAbs();
    // A capsule's caps stay round under even scale only.
    const bool keeps_kind = collider.primitive != PrimitiveShape::Capsule ||
                            is_near(std::abs(stretch(0, 0)), std::abs(stretch(2, 2)));
    if (keeps_kind) {
      if (auto part = exact_part(collider.primitive, scaled)) return part;
    }
  }
  return tessellated_part(collider.primitive, size, stretch, max_points);
}

std::optional<ConvexPart> part_of(const Node& node, const Mat3& stretch, ShapeCache& cache,
                                  std::size_t max_points) {
  const Collider& collider = *node.collider;
  const bool has_primitive = collider.primitive != PrimitiveShape::None;
  const bool wants_primitive = collider.shape == ColliderShape::Primitive || !node.mesh;
  if (wants_primitive && has_primitive) return primitive_part(collider, stretch, max_points);
  if (!node.mesh) return std::nullopt;
  if (collider.shape == ColliderShape::BoundingBox) {
    return box_part(node.mesh->bounds(), stretch, max_points);
  }
  if (collider.shape == ColliderShape::BoundingSphere) {
    return bounding_sphere_part(*node.mesh, node.mesh->bounds(), stretch);
  }
  return hull_part(stretched(stretch, *cache.hull_points(node.mesh)), max_points);
}

std::unique_ptr<btConvexInternalShape> hull_shape(const std::vector<Vec3>& points,
                                                  const Rigid& body_from_part, double margin_m) {
  std::vector<btVector3> placed;
  placed.reserve(points.size());
  for (const Vec3& point : points) {
    const Vec3 p = body_from_part * point;
    placed.emplace_back(p.x(), p.y(), p.z());
  }
  return std::make_unique<HullShape>(placed, margin_m);
}

/// A cone whose surface lies `margin` inside the wanted one, so that with Bullet's margin it is the
/// wanted one with a rounded edge. Returns by how much its centre moves along the axis.
double make_inner_cone(double radius, double height, double margin_m,
                       std::unique_ptr<btConvexInternalShape>& shape) {
  const double tip = margin_m * std::hypot(radius, height) / radius;
  const double inner_height = height - margin_m - tip;
  shape = std::make_unique<btConeShapeZ>(radius * inner_height / height, inner_height);
  shape->setMargin(margin_m);
  return 0.5 * (margin_m - tip);
}

}  // namespace

std::vector<ConvexPart> convex_parts(const Node& node, const RigidStretch& world_from_node,
                                     ShapeCache& cache, std::size_t max_hull_points) {
  std::vector<ConvexPart> parts;
  if (auto part = part_of(node, world_from_node.stretch, cache, max_hull_points)) {
    part->mass = mapped(mapped(part->mass, part->frame_from_part), world_from_node.rigid);
    part->frame_from_part = world_from_node.rigid * part->frame_from_part;
    parts.push_back(std::move(*part));
  }
  return parts;
}

PlacedShape make_shape(const ConvexPart& part, const Rigid& body_from_frame, double margin_m) {
  PlacedShape placed;
  const Rigid body_from_part = body_from_frame * part.frame_from_part;
  const double margin = std::min(margin_m, 0.1 * std::max(part.inner_radius_m, 1e-4));
  if (part.kind == PartKind::Hull) {
    placed.shape = hull_shape(part.points, body_from_part, margin);
    placed.outer_margin_m = margin;
    return placed;
  }
  placed.body_from_shape = body_from_part;
  const Vec3 half = 0.5 * part.size;
  switch (part.kind) {
    case PartKind::Sphere:
      placed.shape = std::make_unique<btSphereShape>(half.x());
      break;
    case PartKind::Capsule:
      placed.shape = std::make_unique<btCapsuleShapeZ>(half.x(), 2.0 * (half.z() - half.x()));
      break;
    case PartKind::Cylinder:
      placed.shape = std::make_unique<btCylinderShapeZ>(btVector3(half.x(), half.y(), half.z()));
      placed.shape->setMargin(margin);
      break;
    case PartKind::Cone: {
      const double shift = make_inner_cone(half.x(), part.size.z(), margin, placed.shape);
      placed.body_from_shape.translate(Vec3(0.0, 0.0, shift));
      break;
    }
    default:
      placed.shape = std::make_unique<btBoxShape>(btVector3(half.x(), half.y(), half.z()));
      placed.shape->setMargin(margin);
      break;
  }
  return placed;
}

}  // namespace diorama
