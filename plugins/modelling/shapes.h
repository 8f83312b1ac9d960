// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <functional>
#include <span>
#include <vector>

#include "modelling/mesh_builder.h"

/// Closed shapes with outward normals and uvs in metres, added to the builder's current part.
namespace diorama::modelling {

enum class Axis { X, Y, Z };

/// A box about the origin with rounded edges. The texture's u runs along `grain`. `bevel` is cut
/// down to a little under half of the smallest side.
void add_box(MeshBuilder& builder, const Vec3& size, double bevel, Axis grain, int segments = 1);

/// A part of a picture, uvs 0..1.
struct UvRect {
  Vec2 low = Vec2::Zero();
  Vec2 high = Vec2::Ones();
};
/// Per face -x +x -y +y -z +z: the part of the picture that it shows, upright as seen from outside
/// (top and bottom with +y up).
using BoxPrint = std::array<UvRect, 6>;
void add_printed_box(MeshBuilder& builder, const Vec3& size, double bevel, const BoxPrint& print,
                     int segments = 1);

/// A point of a profile: radius and height.
struct ProfilePoint {
  double r = 0.0;
  double z = 0.0;
};

/// Turns a profile about z. The profile runs so that the outside lies on its right when walking in
/// the direction of the points (bottom to top for an outer wall). Ends at r = 0 close the shape;
/// a profile whose first and last point are equal is a ring. Edges sharper than `crease` radians
/// stay sharp. u is the arc at the largest radius, v the length along the profile.
void add_lathe(MeshBuilder& builder, std::span<const ProfilePoint> profile, int segments,
               double crease = 0.6);
/// The same with uvs 0..1 once around and from `v_low` to `v_high` over the height of the profile,
/// for labels (repeats_per_m and uv_offset of the surface still apply).
void add_lathe_unit_uv(MeshBuilder& builder, std::span<const ProfilePoint> profile, int segments,
                       double v_low, double v_high, double crease = 0.6);

/// A point of a swept path: place, half extents of the elliptic section across and up.
struct PathPoint {
  Vec3 place = Vec3::Zero();
  double radius_x = 0.01;
  double radius_y = 0.01;
};

/// A tube along a path with flat ends (round when the radii shrink there). `exponent` 2 is an
/// ellipse, larger values tend to a rectangle (superellipse). `up` fixes the section's y axis.
void add_sweep(MeshBuilder& builder, std::span<const PathPoint> path, int segments,
               const Vec3& up = Vec3::UnitZ(), double exponent = 2.0);
/// Equal radius everywhere.
void add_tube(MeshBuilder& builder, std::span<const Vec3> path, double radius, int segments);
/// Points on a curve through `knots` (Catmull-Rom), `steps` per span.
std::vector<Vec3> smooth_path(std::span<const Vec3> knots, int steps);

/// A simple polygon in xy (counter-clockwise) raised from z = 0 to `height`, edges cut by `bevel`.
/// Corners blunter than 30 degrees are shaded smooth.
void add_prism(MeshBuilder& builder, std::span<const Vec2> outline, double height, double bevel);
/// Outline of a rectangle about the origin with rounded corners.
std::vector<Vec2> rounded_rectangle(double width, double length, double radius, int segments);

/// A sheet of `thickness` around the surface f(u, v), u and v in 0..1; the front is where the cross
/// product of the u and v directions points.
void add_sheet(MeshBuilder& builder, int columns, int rows, double thickness,
               const std::function<Vec3(double, double)>& surface, const Vec2& uv_size_m);

/// A rectangular hole in a panel, in the panel's x and z.
struct Opening {
  double x_min = 0.0;
  double x_max = 0.0;
  double z_min = 0.0;
  double z_max = 0.0;
};
/// A slab from x 0 to width, y 0 to thickness, z 0 to height with holes right through it. Holes may
/// touch the bottom.
void add_panel(MeshBuilder& builder, double width, double thickness, double height,
               std::span<const Opening> openings);

/// Runs a closed section (x to the left of the path, y up; counter-clockwise) along a level path
/// with mitred corners; closed paths join their ends, open ones get end faces.
void add_moulding(MeshBuilder& builder, std::span<const Vec2> section, std::span<const Vec2> path,
                  bool is_closed);

/// A flat rectangle in xy facing +z with uvs 0..1 (repeats_per_m 1): pictures, labels.
void add_picture(MeshBuilder& builder, double width, double height);

}  // namespace diorama::modelling
