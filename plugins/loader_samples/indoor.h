// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>
#include <vector>

#include "diorama/math.h"

namespace diorama::samples {

/// A furnished room as somebody in it sees it: lamps and windows that light it, walls, floor, and
/// pieces of furniture as plain boxes. Linear; 1 stands for 1000 nits.
class RoomView {
 public:
  /// `name` is one of the indoor skies.
  explicit RoomView(std::string_view name);
  Vec3 radiance(const Vec3& direction) const;

 private:
  struct Box {
    Vec3 min, max;
    Vec3 albedo;
  };
  /// A lamp or a window: a rectangle of one plane of the room.
  struct Panel {
    int axis = 2;
    double plane = 0.0;
    Vec3 min, max;
    Vec3 light;
  };
  struct Hit {
    Vec3 place, normal, albedo;
    Vec3 light = Vec3::Zero();
  };
  Hit first_hit(const Vec3& direction) const;
  Vec3 surface(int axis, bool is_upper, const Vec3& place) const;
  Vec3 irradiance(const Vec3& place, const Vec3& normal) const;

  Vec3 half_;      ///< The room is a box round the origin of so much each way ...
  double height_;  ///< ... and so high.
  Vec3 eye_;
  Vec3 wall_, floor_, ceiling_;
  double plank_m_ = 0.0;  ///< Width of floor boards, or of square tiles; 0: neither.
  bool has_boards_ = false;
  std::uint64_t seed_ = 0;
  std::vector<Panel> panels_;
  std::vector<Box> furniture_;
};

}  // namespace diorama::samples
