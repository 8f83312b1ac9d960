// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "diorama/frame.h"
#include "diorama/host.h"
#include "embree_scene.h"
#include "renderer_support/hit_image.h"
#include "renderer_support/isa.h"
#include "renderer_support/view.h"

namespace diorama {

/// What the rays through the pixels' centres met: as little of it as labels need.
struct SeenMeshes {
  static constexpr std::uint32_t kNone = 0xFFFFFFFFu;

  Image<std::uint32_t> numbers;  ///< Of the meshes; kNone: nothing.
  Image<float> distances;
};

/// Names of the channels that fill_channels() knows.
NameSet geometry_channels();
/// What those of them that are wanted take.
std::size_t geometry_bytes_per_pixel(const NameSet& wanted);

/// Fills the wanted ones among the id and geometry channels, all from one ray per pixel centre, and
/// `seen` with what these rays met; its memory is used again where it has the view's size. `hits`
/// gets all of it, if there: they are valid until the scene's next take().
void fill_channels(Frame& frame, const NameSet& wanted, const EmbreeScene& meshes, const View& view,
                   SeenMeshes& seen, HitImage* hits, Host& host);

/// See Renderer::cover. `seen` is that of the same view.
std::vector<CoverageMask> coverage(const EmbreeScene& meshes, const View& view,
                                   const SeenMeshes& seen,
                                   std::span<const LabelledInstance> instances, bool with_distances,
                                   Isa isa, Host& host);

/// See Renderer::sees; `centre` is the camera's.
std::vector<std::uint8_t> seen_points(const EmbreeScene& meshes, const Vec3& centre,
                                      std::span<const Vec3> points_world, Host& host);

}  // namespace diorama
