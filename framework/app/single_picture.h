// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "diorama/renderer.h"
#include "diorama/scene.h"
#include "framework/host/log.h"
#include "framework/plugins/registry.h"

namespace diorama {

/// One picture of one asset, for `diorama render` and `diorama bench`.
struct PictureOptions {
  std::string asset;           ///< A file or "scheme:rest", by the path rules of jobs.
  std::string camera;          ///< Name or end of the path; empty: the first, else a view of all.
  std::vector<double> eye;     ///< Metres, world; three values, or none for a camera of the scene.
  std::vector<double> target;  ///< Metres, world; three values, or none for the scene's middle.
  int width = 0;               ///< 0: the camera's own, 640 without one.
  int height = 0;
  std::string renderer = "embree";
  std::vector<std::string> sets;  ///< Parameters of the renderer, key=value.
  std::uint64_t seed = 0;
};

/// Throws Error(Config) for wrong parameters.
std::unique_ptr<Renderer> make_renderer(const PictureOptions& options, Registry& registry,
                                        Host& host);

/// Loads the asset and returns the camera that the options mean, in their size. A scene without
/// lights gets an even white sky. Throws Error(Usage) for a camera that is not there, Error(Asset)
/// when the file does not load.
NodeId load_picture_scene(const PictureOptions& options, Scene& scene, Host& host, const Log& log);

/// Gives a camera the size that the options say, by keeping the angle of its width.
void resize_camera(const PictureOptions& options, NodeId camera, Scene& scene);

}  // namespace diorama
