// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "diorama/component.h"
#include "diorama/frame.h"

namespace diorama {

// What frames of a dataset may hold: names of channels, the annotations of Writer::needs()
// ("visibility", "amodal_mask", "occlusion_order"), and these.

/// Which objects are in a picture: Frame::instances with ids that are different in one frame and
/// equal for one object of a capture where the format tells.
inline constexpr std::string_view kHoldsInstances = "instances";
/// Objects that no pixel shows, too.
inline constexpr std::string_view kHoldsUnseenInstances = "unseen_instances";
inline constexpr std::string_view kHoldsLabels = "labels";  ///< Instance::labels.
/// Instance::node_path is the scene's; else the reader made it up.
inline constexpr std::string_view kHoldsNodePaths = "node_paths";
inline constexpr std::string_view kHoldsTightBoxes = "tight_boxes";
/// Instance::world_from_node. Where the camera's pose is not held, "world" is the camera's space.
inline constexpr std::string_view kHoldsPoses = "poses";
inline constexpr std::string_view kHoldsBounds = "bounds";  ///< Instance::bounds_node.
/// world_from_node and bounds_node together are a 3-D box round the object, whatever its axes: of
/// formats with upright boxes they are those of the box, not of the node.
inline constexpr std::string_view kHoldsBoxes3d = "boxes_3d";
inline constexpr std::string_view kHoldsOcclusion = "occlusion";    ///< Visibility::occlusion().
inline constexpr std::string_view kHoldsTruncation = "truncation";  ///< Visibility::truncation().
inline constexpr std::string_view kHoldsAmodalBoxes = "amodal_boxes";
inline constexpr std::string_view kHoldsCamera =
    "camera";  ///< Intrinsics and lens, not size alone.
inline constexpr std::string_view kHoldsCameraPose = "camera_pose";
inline constexpr std::string_view kHoldsClips = "clips";            ///< Capture::clip.
inline constexpr std::string_view kHoldsVelocities = "velocities";  ///< Instance::velocity.
inline constexpr std::string_view kHoldsJoints = "joints";          ///< Frame::joints.
inline constexpr std::string_view kHoldsLeafPaths = "leaf_paths";   ///< Frame::leaf_paths.
inline constexpr std::string_view kHoldsKeypoints = "keypoints";    ///< StoredCapture::keypoints.

/// Something about a dataset that cannot be right.
struct Finding {
  std::string check;  ///< The rule that is broken: "box = extent of mask".
  std::string file;   ///< Relative to the dataset, '/' separated; "." for the dataset as a whole.
  std::optional<int> capture;
  std::string camera;    ///< Name; empty: none in particular.
  std::string object;    ///< Path, or what the format calls it: "annotation 12".
  std::string found;     ///< "its box is [3, 5, 10, 12)"
  std::string expected;  ///< "its pixels extend over [3, 5, 10, 13)"; may be empty.
};

/// What reading found, and how much was looked at.
struct DIORAMA_SDK_API ReadLog {
  std::vector<Finding> findings;
  std::size_t files = 0;   ///< Read.
  std::size_t checks = 0;  ///< Comparisons made.

  /// Counts a comparison; when it does not hold, the finding is kept.
  void check(bool holds, Finding finding);
  void add(ReadLog&& more);
};

/// A keypoint in a picture.
struct StoredKeypoint {
  enum class Sight : std::uint8_t { NotTold, Hidden, Seen };
  Vec2 pixel = Vec2::Zero();  ///< From the picture's upper left corner; x right, y down.
  Sight sight = Sight::NotTold;
};

/// The keypoints that objects of a class have.
struct StoredSkeleton {
  std::vector<std::string> names;          ///< In the format's order; empty: it names none.
  std::vector<std::pair<int, int>> lines;  ///< Places of keypoints that a line joins.
};

/// What is the same for all captures of a stored dataset.
struct StoredInfo {
  std::string format;  ///< For people: "COCO".
  NameSet holds;       ///< What some frame holds; see above.
  /// Names of cameras. A picture of a format that knows no cameras is a capture of its own, by the
  /// camera "camera".
  std::vector<std::string> camera_names;
  std::vector<int> captures;         ///< Capture::index of each capture, ascending.
  std::vector<std::string> classes;  ///< The format's class list in its order; may be empty.
  /// To what the format rounds, by name of what is held: metres, pixels, shares; 0 when absent. Of
  /// pictures with loss: how far they may be off in the mean, of 255.
  std::map<std::string, double, std::less<>> steps;
  /// By label "class"; "" is for those of all others.
  std::map<std::string, StoredSkeleton, std::less<>> skeletons;
};

/// A capture as it was read.
struct StoredCapture {
  /// One frame per camera whose files are there, in the order of StoredInfo::camera_names.
  Capture capture;
  std::string split;  ///< "train", "val" ...; empty: the format has none.
  /// Per frame: the file in which each thing that it holds stands.
  std::vector<std::map<std::string, std::string, std::less<>>> files;
  /// Per frame, by Instance::id, in the order of the skeleton; empty when there are none.
  std::vector<std::map<std::uint32_t, std::vector<StoredKeypoint>>> keypoints;
  ReadLog log;
  /// Per frame, by Instance::id: the pixels that show the object, where channel "instance_id" is
  /// wanted and cannot say it, because masks overlap or some object has none. The frame has no such
  /// channel then. Empty when there are none.
  std::vector<std::map<std::uint32_t, CoverageMask>> masks;
};

/// A dataset that was opened. Every function may be called from several threads at once.
class DIORAMA_SDK_API StoredDataset {
 public:
  virtual ~StoredDataset();

  virtual const StoredInfo& info() const = 0;
  /// What opening found: tables that cannot be read, files without an entry, entries that come
  /// twice.
  virtual const ReadLog& log() const = 0;
  /// The capture at place `i` of StoredInfo::captures. What `wanted` does not name (see holds) may
  /// be left out, and its files unread; camera sizes are always there. Bad files are findings, not
  /// errors. Holds no more than this capture in memory.
  virtual StoredCapture read(std::size_t i, const NameSet& wanted) const = 0;
};

enum class Recognition : std::uint8_t {
  No,
  ByFiles,  ///< Files lie where the format has them.
  ByName,   ///< The folder says that it is of this format.
};

/// Opens folders of one format, whoever wrote them. Several threads may call it.
class DIORAMA_SDK_API Reader : public Component {
 public:
  static constexpr ComponentKind kKind = ComponentKind::Reader;

  ~Reader() override;

  /// Files of which a folder of this format has one at least: paths with '*' for any text inside
  /// one name, "annotations/*.json". The same that the library lists (DIORAMA_ADD_READER).
  virtual std::vector<std::string> patterns() const = 0;
  /// Looks at names and at small files. Throws nothing for damaged ones.
  virtual Recognition recognise(const std::filesystem::path& folder) const = 0;
  /// Throws Error(Asset) that begins with the folder when there is nothing that it could read.
  virtual std::unique_ptr<const StoredDataset> open(const std::filesystem::path& folder) const = 0;
};

}  // namespace diorama
