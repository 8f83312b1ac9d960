// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "diorama/camera.h"
#include "diorama/error.h"
#include "diorama/image.h"
#include "diorama/scene.h"

namespace diorama {

using NameSet = std::set<std::string, std::less<>>;

/// Name and pixel type of a per-pixel output. Third parties add channels by adding a constant.
template <class Pixel>
struct Channel {
  std::string_view name;
};

// Geometry and id channels come from the one ray through the pixel centre and are never filtered.
// What that ray meets: the first surface of a visible node that is not cut out by its opacity.

/// View-transformed, sRGB encoded, straight alpha 255.
inline constexpr Channel<Rgba8> kColor{"color"};
/// Linear radiance before exposure and view transform.
inline constexpr Channel<Vec3f> kColorHdr{"color_hdr"};
/// Metres from the camera centre to the surface; +infinity where nothing was hit.
inline constexpr Channel<float> kDistanceToCamera{"distance_to_camera"};
/// Metres along the viewing axis (minus camera-space z); +infinity where nothing was hit.
inline constexpr Channel<float> kDistanceToImagePlane{"distance_to_image_plane"};
/// Unit shading normal in world space, facing the camera; zero where nothing was hit.
inline constexpr Channel<Vec3f> kNormals{"normals"};
/// NodeId::index of the node hit; 0 where nothing was hit.
inline constexpr Channel<std::uint32_t> kLeafId{"leaf_id"};
/// NodeId::index of the nearest labelled node at or above the node hit; 0 for no hit and for
/// unlabelled surfaces. Derived from kLeafId by the host.
inline constexpr Channel<std::uint32_t> kInstanceId{"instance_id"};
/// World position of the surface point, metres; zero where nothing was hit.
inline constexpr Channel<Vec3f> kPosition{"position"};
/// Mesh uv; zero where nothing was hit or the mesh has none.
inline constexpr Channel<Vec2f> kUv{"uv"};
/// Linear base colour, textured; zero where nothing was hit.
inline constexpr Channel<Vec3f> kAlbedo{"albedo"};
/// Position inside the labelled instance's box in its own space, scaled to [0, 1]^3 (NOCS); zero
/// for unlabelled pixels. Derived by the host.
inline constexpr Channel<Vec3f> kObjectCoordinates{"object_coordinates"};
/// Pixels that the surface point moved since the previous time step, image x right, y down; zero
/// where nothing was hit. In a clip: since the previous frame, zero in the first one. Derived by
/// the host.
inline constexpr Channel<Vec2f> kMotion{"motion"};
/// Where the surface point in a pixel's centre is in the picture of the clip's next (forward) or
/// previous (backward) frame, less where it is here; pixels, image x right, y down. Zero where the
/// lens images the point nowhere, and where the state is Unknown. Derived by the host.
inline constexpr Channel<Vec2f> kFlowForward{"flow_forward"};
inline constexpr Channel<Vec2f> kFlowBackward{"flow_backward"};
/// What becomes of these points there: values of FlowState.
inline constexpr Channel<std::uint32_t> kFlowForwardState{"flow_forward_state"};
inline constexpr Channel<std::uint32_t> kFlowBackwardState{"flow_backward_state"};
/// Metres along the viewing axis as a depth camera measures them; 0 where it measures nothing.
/// Made by annotators, not a label.
inline constexpr Channel<float> kSensorDepth{"sensor_depth"};

/// What the other frame of a flow shows of a point.
enum class FlowState : std::uint32_t {
  Seen = 0,     ///< The point itself.
  Hidden = 1,   ///< Something in front of it.
  Outside = 2,  ///< Nothing: it is out of the picture, or too near or far.
  Unknown = 3,  ///< There is no such point (nothing was hit), or no such frame.
};

/// True for names that stand for fields of a frame instead of channels: "instances", "visibility",
/// "amodal_mask", "occlusion_order".
DIORAMA_SDK_API bool is_annotation(std::string_view name);

/// The pixels that an object covers when nothing else is in the scene, by the same pixel-centre
/// rays. The box may reach beyond the image by up to one image size to each side, so that the part
/// outside can be counted; what lies further out is not counted.
struct DIORAMA_SDK_API CoverageMask {
  PixelBox box;
  std::vector<std::uint8_t> bits;  ///< One byte (0 or 1) per pixel of the box, row by row.
  /// Metres from the camera centre to the object, one per pixel of the box, +infinity where it does
  /// not cover; empty unless asked for.
  std::vector<float> distances;

  bool covers(int x, int y) const;  ///< Image coordinates.
  /// Index of a pixel of the box, given in image coordinates.
  std::size_t index(int x, int y) const {
    return std::size_t(y - box.y_min) * std::size_t(box.width()) + std::size_t(x - box.x_min);
  }
  /// The smallest box with all covered pixels; empty when there is none.
  PixelBox extent() const;
  /// What lies in `part`, a box inside this one's.
  CoverageMask cropped(const PixelBox& part) const;
};

/// How much of an instance one camera sees.
struct Visibility {
  std::int64_t visible_pixels = 0;     ///< Its pixels in kInstanceId.
  std::int64_t amodal_pixels = 0;      ///< Covered without occluders, inside the image.
  std::int64_t outside_pixels = 0;     ///< Covered without occluders, outside the image.
  std::optional<PixelBox> amodal_box;  ///< Clipped to the image; absent when nothing is inside.
  /// Of all covered pixels, as far out as CoverageMask reaches; absent when nothing is covered.
  std::optional<PixelBox> whole_box;
  CoverageMask amodal_mask;  ///< Filled only when "amodal_mask" was demanded.

  /// 1 - visible / amodal, in [0, 1]; nothing when no pixel is inside the image.
  std::optional<double> occlusion() const {
    if (amodal_pixels == 0) return std::nullopt;
    return 1.0 - double(visible_pixels) / double(amodal_pixels);
  }
  /// Share of the covered pixels that lies outside the image, in [0, 1].
  double truncation() const {
    const double all = double(amodal_pixels + outside_pixels);
    return all == 0 ? 1.0 : double(outside_pixels) / all;
  }
};

/// How a node's origin moves and how the node turns.
struct Velocity {
  Vec3 linear = Vec3::Zero();   ///< m/s, world.
  Vec3 angular = Vec3::Zero();  ///< rad/s, world axes.
};

/// A labelled node as one camera sees it.
struct Instance {
  std::uint32_t id = 0;  ///< Value in kInstanceId.
  std::string node_path;
  Labels labels;  ///< Effective labels.
  Affine world_from_node = Affine::Identity();
  Aabb bounds_node;  ///< Of its visible meshes, in its own space, before world_from_node.
  /// Extent of its pixels in kInstanceId; absent when none is visible.
  std::optional<PixelBox> tight_box;
  std::optional<Visibility> visibility;  ///< Filled when "visibility" was demanded.
  /// Of all its parts, in its own space, before world_from_node; each name once.
  std::vector<Keypoint> keypoints;
  /// As the simulation left it; absent for what is no part of a rigid body.
  std::optional<Velocity> velocity;
};

/// Two instances that cover some of the same pixels of the image, seen or hidden by a third.
struct Occlusion {
  std::uint32_t front = 0;   ///< Instance::id.
  std::uint32_t behind = 0;  ///< Instance::id.
  std::int64_t pixels = 0;   ///< Where `front` is the nearer one; at least 1.
  friend bool operator==(const Occlusion&, const Occlusion&) = default;
};

/// A joint at the moment of a capture.
struct JointState {
  std::string path;  ///< Of the joint's node.
  JointKind kind = JointKind::Fixed;
  std::string parent_path;  ///< Of the bodies' nodes.
  std::string child_path;
  double position = 0.0;  ///< Radians or metres, see joint_position(); 0 when fixed.
  double lower = -kInfinity;
  double upper = kInfinity;
};

/// One camera's data in one capture.
class DIORAMA_SDK_API Frame {
 public:
  Frame();
  ~Frame();
  Frame(Frame&&) noexcept;
  Frame& operator=(Frame&&) noexcept;

  std::string camera_name;  ///< Name of the camera's node, "cam_0".
  std::string camera_path;
  Camera camera;
  Affine world_from_camera = Affine::Identity();
  /// Every labelled instance of the scene in creation order, seen or not. Filled when "instances"
  /// was demanded.
  std::vector<Instance> instances;
  /// Who is in front of whom, in the order of `instances` by `front`, then by `behind`. Things that
  /// reach around each other occur both ways. Filled when "occlusion_order" was demanded.
  std::vector<Occlusion> occlusions;
  /// Every joint of the scene in creation order. Filled when "instances" was demanded.
  std::vector<JointState> joints;
  /// Path of every leaf id that occurs in kLeafId.
  std::map<std::uint32_t, std::string> leaf_paths;
  double exposure = 1.0;  ///< Factor from kColorHdr to the view transform's input.
  /// RenderRequest::seed: start of the streams of annotators that add chance, each by its own name.
  std::uint64_t seed = 0;

  template <class Pixel>
  void set(Channel<Pixel> channel, Image<Pixel> image) {
    set_image(channel.name, AnyImage(std::move(image)));
  }
  /// Throws Error when the channel is not there or has another pixel type.
  template <class Pixel>
  const Image<Pixel>& get(Channel<Pixel> channel) const {
    if (const auto* image = std::get_if<Image<Pixel>>(&image_named(channel.name))) return *image;
    throw Error(ErrorKind::Internal, camera_path + ": channel '" + std::string(channel.name) +
                                         "' has another pixel type");
  }
  bool has(std::string_view channel) const;
  NameSet channels() const;
  /// For code that treats all pixel types alike. Throws Error when the channel is not there.
  const AnyImage& image_named(std::string_view channel) const;

  /// Throws Error unless the channel, which must be there, has the camera's size, and, when it is
  /// one of those above, its pixel type.
  void check_channel(std::string_view channel) const;

 private:
  friend class Annotator;
  /// What an annotator may touch while it works.
  struct Access {
    NameSet readable;
    NameSet settable;
  };
  bool is_readable(std::string_view channel) const;
  void set_image(std::string_view channel, AnyImage image);

  std::map<std::string, AnyImage, std::less<>> images_;
  const Access* access_ = nullptr;  ///< Null: everything.
};

/// The place of a capture in a clip: captures of one scene in which time goes on. Instance ids and
/// node paths are those of the same things in all frames of a clip.
struct ClipFrame {
  int clip = 0;                                  ///< 0-based in the whole job.
  int frame = 0;                                 ///< 0-based in the clip.
  int frame_count = 1;                           ///< Of the clip.
  double fps = 30.0;                             ///< Frames per second.
  double time_s() const { return frame / fps; }  ///< Since the clip's first frame.
  friend bool operator==(const ClipFrame&, const ClipFrame&) = default;
};

/// One moment of the scene seen by all cameras.
struct Capture {
  int index = 0;      ///< 0-based in the whole job, the same in every shard.
  int visit = 0;      ///< Which pass through an environment.
  std::string phase;  ///< Name of the capture series: "floating", "dropped".
  std::string environment;
  std::vector<Frame> frames;      ///< One per camera, in camera order.
  std::optional<ClipFrame> clip;  ///< Absent for captures that stand alone.
};

}  // namespace diorama
