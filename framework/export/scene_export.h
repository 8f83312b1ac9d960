// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "diorama/host.h"
#include "diorama/scene.h"

namespace diorama {

struct ExportOptions {
  bool with_physics = true;  ///< Masses, rigid bodies, colliders, joints.
};

/// Writes what is at and below `root` to `file`: .usda as text, .usdc and .usd as crate, pictures
/// as PNG and .hdr into "textures" beside it. For .hdr, writes the picture of the first dome light
/// instead. Every file appears complete or not at all; equal scenes give equal bytes. Throws
/// Error(Usage) for other endings or when there is no picture, Error(Output) when it cannot write.
void export_scene(const Scene& scene, NodeId root, const std::filesystem::path& file,
                  const ExportOptions& options, const Host& host);

}  // namespace diorama
