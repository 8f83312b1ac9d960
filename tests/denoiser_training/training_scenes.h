// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "diorama/host.h"
#include "diorama/rng.h"
#include "diorama/scene.h"

namespace diorama::training {

/// A scene and the cameras that look at it.
struct Set {
  std::string name;
  Scene scene;
  std::vector<NodeId> cameras;
};

/// A generated room with other things, skies and lamps in it, or (one of five) a stage with things
/// on it. Everything follows from the seed. Cameras show cut-outs of larger pictures.
Set training_set(std::uint64_t seed, int cameras, int width, int height, Host& host);

/// The sets that training must not know, by number: rooms of the sample pack under real skies and
/// by lamps alone first, then scenes of other kinds. `data` holds assets_root/ and bench/.
int judged_set_count();
Set judged_set(int number, int width, int height, const std::filesystem::path& data, Host& host);

}  // namespace diorama::training
