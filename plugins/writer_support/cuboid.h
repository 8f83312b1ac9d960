// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "diorama/frame.h"
#include "writer_support/python_json.h"

namespace diorama {

/// A named point of a box: L/R is min/max x, D/U min/max y, B/F min/max z in node space; "Center"
/// is the middle.
struct CuboidPoint {
  const char* name;
  std::array<int, 3> side;  ///< -1 min, 0 middle, 1 max.
};

inline constexpr int kKeypointCount = 9;
using KeypointOrder = std::array<CuboidPoint, kKeypointCount>;

/// Center, LDB, LDF, LUB, LUF, RDB, RDF, RUB, RUF.
inline constexpr KeypointOrder kCuboidKeypoints{{{"Center", {0, 0, 0}},
                                                 {"LDB", {-1, -1, -1}},
                                                 {"LDF", {-1, -1, 1}},
                                                 {"LUB", {-1, 1, -1}},
                                                 {"LUF", {-1, 1, 1}},
                                                 {"RDB", {1, -1, -1}},
                                                 {"RDF", {1, -1, 1}},
                                                 {"RUB", {1, 1, -1}},
                                                 {"RUF", {1, 1, 1}}}};

/// False for a point, which stands for what a stored dataset does not tell.
bool has_extent(const Instance& instance);
/// Also false without an extent at the origin of the world, unturned: nothing is told then.
bool has_pose(const Instance& instance);
/// "world_from_node", "bounds_min" and "bounds_max", as far as they are told.
void add_pose(const Instance& instance, Json& object);

Vec3 keypoint_in_box(const Aabb& box, const CuboidPoint& keypoint);

/// Where a keypoint lies in the image, and whether something (the object itself included) is in
/// front of it by more than a hundredth of its distance.
struct ImagePoint {
  enum class State { Outside, Hidden, Visible };
  State state = State::Outside;
  Vec2 pixel = Vec2::Zero();  ///< Zero when outside.
};
/// Needs kDistanceToCamera.
ImagePoint image_point(const Frame& frame, const Vec3& point_world);

}  // namespace diorama
