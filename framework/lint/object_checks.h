// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>

#include "framework/lint/lens.h"

/// What pose, bounds, mask and depth of one object must have in common, in every format.
namespace diorama::lint {

inline constexpr const char* kReproject = "pose and camera reproject onto the mask";
inline constexpr const char* kBackProject = "depth back-projects";

/// An object in a camera's image. Lengths are in the dataset's unit.
struct SeenObject {
  std::string who;   ///< For messages.
  std::string file;  ///< That says the pose.
  Affine camera_from_local = Affine::Identity();
  Aabb bounds;                        ///< Local.
  PixelBox box;                       ///< Of its pixels.
  double slack_px = 0.1;              ///< What the file's rounding makes of a projection.
  std::function<bool(int, int)> has;  ///< Whether a pixel is one of them; asked inside `box`.
};

/// Values of a depth picture, in the dataset's unit.
struct DepthMap {
  std::string file;
  bool is_along_ray = false;              ///< Else along the axis.
  double slack = 0.0;                     ///< Half a step of its numbers.
  std::function<double(int, int)> value;  ///< Not finite where nothing is known.
};

/// Extent of the box's edges in the image; nothing when the lens does not image all of them.
std::optional<Eigen::AlignedBox2d> projected_extent(const Lens& lens,
                                                    const Affine& camera_from_local,
                                                    const Aabb& bounds);

/// The box's projection holds the object's pixels.
void check_reprojection(Dataset& dataset, const Lens& lens, const SeenObject& object);

/// The object's surface points lie in its box.
void check_depth(Dataset& dataset, const Lens& lens, const SeenObject& object,
                 const DepthMap& depth);

/// Keypoints of a 3-D box surround the 2-D box of the object's pixels. `centre` and `size` are
/// those of the 2-D box, pixels. Leaves a tenth for what a lens bends.
void check_surrounded(Dataset& dataset, const std::string& file, const std::string& who,
                      const Vec2& centre, const Vec2& size, const Eigen::AlignedBox2d& keypoints);

/// Row by row; throws when `list` is not four by four numbers in nested lists.
Mat4 matrix4_of(const Json& rows);
Vec3 vec3_of(const Json& list);

/// Turns x right, y up, looking along -z into lint's axes.
Affine flipped_axes();

}  // namespace diorama::lint
