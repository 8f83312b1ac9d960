// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "framework/app/options.h"
#include "framework/app/single_picture.h"
#include "framework/host/console_log.h"

namespace diorama {

struct BenchOptions {
  PictureOptions picture;        ///< Without an asset: a generated room.
  std::filesystem::path lights;  ///< See scene_rig.h; empty: those of the scene, and its camera.
  bool is_diffuse = false;       ///< Every material is a matte surface of its base colour.
  std::string reference;         ///< EXR or HDR of the same size; empty: none.
  int reference_samples = 0;     ///< 0: no reference of our own.
  int repetitions = 1;
  std::string picture_file;  ///< Where to put the last picture, .exr; empty: nowhere.
  bool as_json = false;
};

/// `diorama bench`: renders a scene and prints speed, error and where the time goes. Throws what
/// `diorama render` throws, and Error(Asset) for a reference of another size.
int command_bench(const GlobalOptions& global, const BenchOptions& options, ConsoleLog& log);

}  // namespace diorama
