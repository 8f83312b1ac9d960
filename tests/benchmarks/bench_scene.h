// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "diorama/host.h"
#include "diorama/scene.h"

namespace diorama::bench {

/// Reads the bench scene (scene.glb, scene.json, sky.hdr in one folder): just the parts of glTF
/// that it uses. With `is_diffuse` every material is a plain Lambert surface of its base colour.
Scene load_bench_scene(const std::filesystem::path& folder, Host& host, bool is_diffuse);

/// Adds the scene's camera at /camera in the given size.
NodeId add_bench_camera(const std::filesystem::path& folder, Scene& scene, int width, int height);

}  // namespace diorama::bench
