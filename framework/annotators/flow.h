// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "diorama/frame.h"
#include "diorama/scene.h"

namespace diorama {

/// Where the surface points of a frame are in the picture of the same camera at another moment.
class FlowMeter {
 public:
  /// A node at that moment.
  struct There {
    Affine world_from_node = Affine::Identity();
    /// Points go with their triangles from the mesh here to this one; where it has others, nobody
    /// knows where they are.
    std::shared_ptr<const Mesh> mesh;
  };
  using NodeThere = std::function<There(NodeId)>;

  /// The scene is that of the frame, which has kLeafId and kPosition.
  FlowMeter(const Scene& scene, const Frame& frame, const NodeThere& node_there);

  /// What the camera may see there, if nothing hides it, where it is there.
  const std::vector<Vec3>& points() const { return points_; }
  /// By point: whether it is seen there (Renderer::sees).
  void set_seen(std::span<const std::uint8_t> seen);

  const Image<Vec2f>& flow() const { return flow_; }
  const Image<std::uint32_t>& states() const { return states_; }

 private:
  Image<Vec2f> flow_;
  Image<std::uint32_t> states_;
  std::vector<Vec3> points_;
  std::vector<std::size_t> pixels_;  ///< Of the points.
};

}  // namespace diorama
