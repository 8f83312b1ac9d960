// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <BulletCollision/CollisionShapes/btConvexInternalShape.h>

#include <cstdint>
#include <memory>
#include <vector>

#include "diorama/scene.h"
#include "mass_properties.h"
#include "shape_cache.h"

namespace diorama {

enum class PartKind : std::uint8_t { Hull, Box, Sphere, Cylinder, Cone, Capsule };

/// One convex collider in metres, scale applied, placed in the frame of its body.
struct ConvexPart {
  PartKind kind = PartKind::Hull;
  std::vector<Vec3> points;  ///< Of a hull.
  Vec3 size = Vec3::Zero();  ///< Of a primitive's bounding box; axis along z.
  Rigid frame_from_part = Rigid::Identity();
  MassProperties mass;          ///< In the body's frame.
  double inner_radius_m = 0.0;  ///< Of a sphere round the centroid that lies inside.
};

/// Reads the collider of a node; no parts when it has neither triangles nor a primitive. The part's
/// place is that of the node in the world.
std::vector<ConvexPart> convex_parts(const Node& node, const RigidStretch& world_from_node,
                                     ShapeCache& cache, std::size_t max_hull_points);

/// A shape for Bullet and where it sits.
struct PlacedShape {
  std::unique_ptr<btConvexInternalShape> shape;
  Rigid body_from_shape = Rigid::Identity();
  double outer_margin_m = 0.0;  ///< How far the shape reaches beyond the true surface.
};

/// `body_from_frame` moves the part; a hull takes it into its points, so that a body of one hull
/// needs no compound.
PlacedShape make_shape(const ConvexPart& part, const Rigid& body_from_frame, double margin_m);

}  // namespace diorama
