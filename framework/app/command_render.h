// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "framework/app/options.h"
#include "framework/app/single_picture.h"
#include "framework/host/console_log.h"

namespace diorama {

struct RenderOptions {
  PictureOptions picture;
  std::string output = "render.png";  ///< .png or .jpg: as seen; .exr or .hdr: linear light.
};

/// `diorama render FILE`: one picture of anything that a loader reads. A scene without lights gets
/// an even white sky. Throws Error(Usage) for a camera that is not there or an unknown ending,
/// Error(Config) for wrong parameters, Error(Asset) when the file does not load.
int command_render(const GlobalOptions& global, const RenderOptions& options, ConsoleLog& log);

}  // namespace diorama
