// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <vector>

#include "diorama/scene.h"

namespace diorama {

/// Where everything in a scene is, and what shape it has, in the last frames of a clip: as many as
/// one frame and those beside it need, so that a clip takes the same memory whatever its length.
class ClipTrack {
 public:
  /// Adds the scene as it is now as the next frame. Its nodes are those of the first frame. Of what
  /// was added before, the last two frames are kept.
  void add(const Scene& scene);
  /// Frames added so far.
  int size() const { return added_; }

  /// Puts everything where it is in one of the frames kept, in the shape that it has there; touches
  /// only what differs.
  void show(int frame, Scene& scene) const;
  const std::shared_ptr<const Mesh>& mesh(NodeId node, int frame) const;
  /// Where a node is in the world in one of the frames kept, whichever frame the scene shows.
  Affine world_from_node(const Scene& scene, NodeId node, int frame) const;

 private:
  struct State {
    Affine parent_from_node = Affine::Identity();
    Vec3 linear_velocity = Vec3::Zero();
    Vec3 angular_velocity = Vec3::Zero();
    std::shared_ptr<const Mesh> mesh;
    bool operator==(const State& other) const;
  };
  static State state_of(const Node& node);
  const std::vector<State>& states(int frame) const;
  std::size_t place_of(NodeId node) const;

  std::vector<NodeId> nodes_;            ///< Ascending.
  std::deque<std::vector<State>> kept_;  ///< By frame, then as `nodes_`; ends with the last one.
  std::vector<std::uint8_t> has_moved_;  ///< As `nodes_`: since the first frame, or bent.
  int added_ = 0;
};

/// Watches that whoever plays a clip changes nothing but meshes and poses, and none of those of
/// rigid bodies: the engine would not know, and the track holds nothing else.
class PlayWatch {
 public:
  PlayWatch() = default;
  /// The scene as the clip begins.
  explicit PlayWatch(const Scene& scene);
  /// To be called before randomizers show a frame: bodies stand where physics has put them.
  void begin_frame(const Scene& scene);
  /// Throws Error(Plugin) when more has changed since.
  void check(const Scene& scene);

 private:
  struct Fixed {
    NodeId node;
    bool is_visible = true;
    bool has_mesh = false;
    Labels labels;
    std::vector<std::shared_ptr<const Material>> materials;
    bool operator==(const Fixed& other) const = default;
  };
  static std::vector<Fixed> fixed_of(const Scene& scene);
  std::vector<Mat4> body_places(const Scene& scene) const;

  std::vector<Fixed> fixed_;
  std::vector<NodeId> bodies_;
  std::vector<Mat4> places_;  ///< Of the bodies.
  std::uint64_t shape_revision_ = 0;
  std::uint64_t pose_revision_ = 0;
};

}  // namespace diorama
