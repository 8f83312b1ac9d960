// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "diorama/host.h"
#include "diorama/scene.h"

/// Lights and camera in a JSON file of their own, for comparing renderers whose importers would
/// read them from the scene in different ways. Metres, z up:
///
///     {"camera": {"width": 640, "height": 480, "fx": 502.3, "fy": 502.3, "cx": 320, "cy": 240,
///                 "cam2world_blender": [[...], [...], [...], [...]]},
///      "lights": [{"position_blender": [x, y, z], "radius": 0.1, "power_watt": 70,
///                  "color": [r, g, b]}],
///      "world": {"file": "sky.hdr"}}
///
/// The camera looks along its -z; lamps are spheres of the radiance color * power / (4 pi^2 r^2),
/// hidden from cameras; the sky's file is named from the folder of the JSON file.
namespace diorama::bench {

/// Adds the lights at /lamp ... and /sky. Throws Error(Asset) naming the file.
void add_rig_lights(const std::filesystem::path& rig, Scene& scene, Host& host);

/// Adds the camera at /camera, in its own size.
NodeId add_rig_camera(const std::filesystem::path& rig, Scene& scene);

}  // namespace diorama::bench
