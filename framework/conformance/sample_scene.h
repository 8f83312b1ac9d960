// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "diorama/host.h"
#include "diorama/scene.h"
#include "diorama/writer.h"

namespace diorama::conformance {

/// A node that may be added to the sample scene, called "extra".
enum class Extra : std::uint8_t {
  None,
  Place,   ///< Below /Assets, without a mesh.
  Crumb,   ///< Below /Assets, a box of a millimetre, far away.
  Camera,  ///< Below /Cameras.
  Lamp,    ///< Below /Lights.
};

/// A small scene with one of everything:
///   /Environment/floor    static, textured, its top at z = 0
///   /Assets/box           labelled "box", a body in the air, falls
///   /Assets/pair          labelled "pair", of two meshes; stands on the floor
///   /Assets/hidden        labelled "box", not visible
///   /Lights/lamp, /Lights/sky, /Cameras/cam_0, /Cameras/cam_1 (cameras of different size)
/// `moment` shifts the box and the cameras a little, so that captures differ. `extra` is the first
/// of its folder.
Scene sample_scene(int moment = 0, Extra extra = Extra::None);

/// Nodes with cameras, in creation order.
std::vector<NodeId> cameras_of(const Scene& scene);

/// The nearest whole thing to a rendered frame that needs no renderer: every visible leaf is
/// painted as the rectangle that its box projects to, far ones first. All channels of frame.h and
/// all annotations are filled.
Frame painted_frame(const Scene& scene, NodeId camera, Host& host);

/// Names of the annotations that painted_frame() fills beside its channels.
const NameSet& painted_annotations();

/// Painted captures 0 to `count` - 1 of the sample scene, in two visits.
std::vector<Capture> sample_captures(int count, Host& host);

/// What a writer is told of `capture_count` captures of the sample scene.
DatasetInfo sample_dataset(int capture_count);

}  // namespace diorama::conformance
