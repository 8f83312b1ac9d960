// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "diorama/geometry.h"
#include "loader_usd/usd/geometry.h"
#include "loader_usd/usd/stage.h"

namespace diorama::loader_usd {

/// A mesh with the GeomSubsets that its material slots stand for.
struct TranslatedMesh {
  std::shared_ptr<const Mesh> mesh;       ///< Null when nothing is left to draw.
  std::vector<const usd::Prim*> subsets;  ///< Slot 1 + i; slot 0 is the rest of the mesh.
  std::optional<Vec3f> display_color;     ///< One colour for all, linear.
  float display_opacity = 1.0f;
};

/// Makes meshes out of Mesh prims and of the shapes. The same data, seen through instances or
/// several references, give the same mesh. Subdivision surfaces are drawn as their cage, with
/// smooth normals.
class MeshTranslator {
 public:
  MeshTranslator(usd::Stage& stage, usd::Geometry& geometry) : stage_(stage), geometry_(geometry) {}

  /// `uv_names`: primvars that the materials read, the first one that the prim has is taken.
  TranslatedMesh translate(const usd::Prim& prim, const std::vector<std::string>& uv_names);

 private:
  using Key = std::vector<const void*>;

  TranslatedMesh translate_mesh(const usd::Prim& prim, const std::vector<std::string>& uv_names);
  TranslatedMesh translate_shape(const usd::Prim& prim);
  std::string find_uv(const std::vector<usd::Primvar>& primvars,
                      const std::vector<std::string>& uv_names) const;
  void read_display_color(const usd::Prim& prim, TranslatedMesh& result);

  usd::Stage& stage_;
  usd::Geometry& geometry_;
  std::map<std::pair<Key, std::string>, std::shared_ptr<const Mesh>> meshes_;
};

}  // namespace diorama::loader_usd
