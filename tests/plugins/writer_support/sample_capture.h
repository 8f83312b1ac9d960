// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "diorama/scene.h"
#include "diorama/writer.h"

namespace diorama::test {

/// A small scene seen by cameras that are all different. Below /Assets:
///   crate     box 0.4 x 0.3 x 0.2 m, turned and scaled, class "crate", shape "cuboid"
///   mug       two meshes, class "mug", partly behind the crate for cam_0
///   ball      sphere, class "ball", partly outside the image of cam_0
///   hidden    box behind the wall, class "crate", seen by no camera
/// and without labels /Distractors/cone and /Environment/wall.
struct SampleScene {
  Scene scene;
  std::vector<NodeId> cameras;

  /// Resolution of cam_0; the other cameras have their own.
  explicit SampleScene(int width = 96, int height = 64, int camera_count = 2);
};

/// Renders by testing every triangle for every pixel-centre ray, which is slow and hard to get
/// wrong, and runs the built-in annotators. Fills every channel but the colours' light transport:
/// kColor is the albedo, kMotion a pattern of its own.
Frame ray_cast(const Scene& scene, NodeId camera);

/// All cameras of a scene.
Capture ray_cast_capture(const SampleScene& sample, int index);

/// Three captures, seed 12, the cameras of the sample.
DatasetInfo sample_dataset(const SampleScene& sample);

}  // namespace diorama::test
