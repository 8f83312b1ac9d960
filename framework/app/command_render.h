// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "framework/app/options.h"
#include "framework/host/console_log.h"

namespace diorama {

struct RenderOptions {
  std::string asset;                  ///< A file or "scheme:rest", by the path rules of jobs.
  std::string output = "render.png";  ///< .png or .jpg: as seen; .exr or .hdr: linear light.
  std::string camera;          ///< Name or end of the path; empty: the first, else a view of all.
  std::vector<double> eye;     ///< Metres, world; three values, or none for a camera of the scene.
  std::vector<double> target;  ///< Metres, world; three values, or none for the scene's middle.
  int width = 0;               ///< 0: the camera's own, 640 without one.
  int height = 0;
  std::string renderer = "embree";
  std::vector<std::string> sets;  ///< Parameters of the renderer, key=value.
  std::uint64_t seed = 0;
};

/// `diorama render FILE`: one picture of anything that a loader reads. A scene without lights gets
/// an even white sky. Throws Error(Usage) for a camera that is not there or an unknown ending,
/// Error(Config) for wrong parameters, Error(Asset) when the file does not load.
int command_render(const GlobalOptions& global, const RenderOptions& options, ConsoleLog& log);

}  // namespace diorama
