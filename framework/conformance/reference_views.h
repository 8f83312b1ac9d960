// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "diorama/frame.h"
#include "diorama/scene.h"

namespace diorama::conformance {

/// A scene of flat faces and one of its cameras, in which nothing is symmetric: every flip, turn,
/// shift or mixed-up space shows in some channel.
struct ReferenceView {
  std::string name;  ///< For messages: "the rolled camera".
  Scene scene;
  NodeId camera;
};

/// Three: a principal point off the centre and pixels that are not square, before faces of several
/// materials, a texture and the back of a sheet; a rolled camera on a turned stand before turned,
/// scaled and nested nodes; a distorted lens, before which something is too near.
std::vector<ReferenceView> reference_views();

/// What the ray through a pixel's centre meets, by the words of frame.h, found by trying every
/// triangle. Where a ray 2 % of a pixel aside meets another leaf nothing is decided.
struct ReferencePixel {
  bool is_decided = false;
  NodeId leaf;  ///< Null where nothing is hit.
  double distance = kInfinity;
  double depth = kInfinity;
  Vec3 position = Vec3::Zero();
  Vec3 normal = Vec3::Zero();
  Vec2 uv = Vec2::Zero();
  Vec3f albedo = Vec3f::Zero();
};

/// Looks at all visible meshes, or at those of some leaves as if nothing else were there.
class ReferenceEye {
 public:
  ReferenceEye(const Scene& scene, NodeId camera, const std::vector<NodeId>* leaves = nullptr);
  ReferencePixel look(int x, int y) const;

 private:
  struct Face {
    NodeId leaf;
    Vec3 corners[3];
    Vec3 normal;
    Vec2 uvs[3];
    Vec3f albedo;
  };
  struct Hit {
    const Face* face = nullptr;
    double distance = kInfinity;
    double u = 0.0, v = 0.0;
  };
  Hit meet(const Vec2& pixel) const;

  Camera camera_;
  Affine world_from_camera_;
  std::vector<Face> faces_;
};

}  // namespace diorama::conformance
