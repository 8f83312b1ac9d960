// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "diorama/geometry.h"
#include "loader_usd/corner_data.h"
#include "loader_usd/losses.h"
#include "loader_usd/usd/value.h"

namespace diorama::loader_usd {

/// What a Mesh prim says of itself. Nothing of it is trusted.
struct MeshSources {
  usd::Numbers<float> points;
  /// Where the points are at rest, if that is elsewhere: faces are split as they are there, so that
  /// a mesh has the same triangles in all its poses.
  std::vector<float> points_at_rest;
  usd::Numbers<std::int32_t> counts;   ///< Corners of each face.
  usd::Numbers<std::int32_t> indices;  ///< The point of each corner.
  std::optional<usd::Numbers<std::int32_t>> holes;
  std::optional<CornerData> normals;
  std::optional<CornerData> uvs;
  std::optional<CornerData> colors;
  std::vector<std::uint16_t> slot_of_face;  ///< Empty: slot 0 for all.
  bool is_left_handed = false;
  bool is_smooth = false;  ///< Points get the mean normal of their faces where none are authored.
};

struct AssembledMesh {
  Mesh mesh;
  Losses losses;
};

/// Makes triangles of the faces. Corners of the same point with the same attributes share a vertex.
/// Faces with points that do not exist or are not finite are left out; so is what follows a face
/// count that reaches behind the indices. What comes out passes Mesh::validate(). `rest` is called
/// now and then: pages of the sources that were read so far may be given back.
AssembledMesh assemble_mesh(MeshSources sources, const std::function<void()>& rest);

}  // namespace diorama::loader_usd
