// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <memory>

#include "patterns.h"

namespace dice {

/// How the plastic of a die is coloured.
enum class Body { Plain, Marbled, Speckled, Striped, Clear };

/// All that tells one die from another. Lengths are shares of half an edge unless they end in _m.
struct DieLook {
  double edge_m = 0.016;
  double rounding = 0.2;  ///< Radius of the edges.
  double ball = 2.0;      ///< Radius of the ball that cuts the corners; above 1.73 it cuts nothing.
  double dome = 0.0;      ///< Faces shine as if they bulged with this curvature, per half edge.
  bool is_mirrored = false;  ///< 1, 2, 3 run clockwise round their corner.
  /// The two, three and six may lie either way on their faces.
  std::array<bool, 3> is_turned{};
  double pip_radius = 0.2;
  double pip_offset = 0.5;  ///< From the middle of a face to the outer pips.
  double first_pip = 1.0;   ///< Factor on the radius of the one.
  double dent = 0.5;        ///< Slope of the pips' rims; 0: painted.
  Body body = Body::Plain;
  Color color = Color::Ones();
  Color second = Color::Ones();
  Color third = Color::Ones();
  Color pips = Color::Zero();
  Color one = Color::Zero();   ///< Of the one's pip.
  double pattern_scale = 1.0;  ///< Features per half edge.
  double wear = 0.0;           ///< 0: new, 1: paint is half gone.
  double roughness = 0.2;
  double clearcoat = 0.0;
  double transmission = 0.0;
  std::uint64_t seed = 0;
};

/// A die as shops sell them, with pips that can be told from the body.
DieLook any_look(diorama::Rng rng);
/// A plain die of one random colour with white or black pips, all else as it is.
DieLook plain_look(diorama::Rng rng);

/// The rotations that turn +z into the direction of the face with 1, 2, ... 6 pips.
std::array<diorama::Mat3, 6> faces(bool is_mirrored);

/// Centres of the pips in a face's own x and y, as shares of half an edge.
std::vector<diorama::Vec2> pip_places(const DieLook& look, int number);

/// About the origin; the face with n pips looks along faces()[n - 1] * z.
std::shared_ptr<const diorama::Mesh> die_mesh(const DieLook& look);
std::shared_ptr<const diorama::Material> die_material(const DieLook& look);

}  // namespace dice
