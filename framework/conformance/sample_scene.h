// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "diorama/host.h"
#include "diorama/scene.h"
#include "diorama/writer.h"

namespace diorama::conformance {

/// A small scene with one of everything:
///   /Environment/floor    static, textured, its top at z = 0
///   /Assets/box           labelled "box", a body in the air, falls
///   /Assets/pair          labelled "pair", of two meshes; stands on the floor
///   /Assets/hidden        labelled "box", not visible
///   /Lights/lamp, /Lights/sky, /Cameras/cam_0, /Cameras/cam_1 (cameras of different size)
/// `moment` shifts the box and the cameras a little, so that captures differ.
Scene sample_scene(int moment = 0);

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
