// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "diorama/geometry.h"
#include "loader_support/mesh_pool.h"
#include "loader_usd/losses.h"
#include "loader_usd/skinning.h"
#include "loader_usd/usd/geometry.h"
#include "loader_usd/usd/stage.h"

namespace diorama::loader_usd {

struct TranslatedMesh {
  std::shared_ptr<const Mesh> mesh;    ///< Null when nothing is left to draw.
  std::optional<Vec3f> display_color;  ///< One colour for all, linear.
  float display_opacity = 1.0f;
  std::string lacks;       ///< Why there is no mesh, if that is a surprise: "without widths".
  bool lacks_uvs = false;  ///< The materials read several primvars; a mesh has the first one.
  Losses losses;
};

/// Makes meshes out of Mesh prims, shapes, points and curves. The same data give the same mesh, be
/// they seen through instances and references or written several times. Subdivision surfaces are
/// drawn as their cage, with smooth normals. What hangs on a skeleton is a mesh of its own.
class MeshTranslator {
 public:
  MeshTranslator(usd::Stage& stage, usd::Geometry& geometry)
      : stage_(stage), geometry_(geometry), skinning_(stage, geometry) {}

  using Prims = std::vector<const usd::Prim*>;

  /// `subsets`: GeomSubsets that get material slots of their own, 1 + i; slot 0 is the rest.
  /// `uv_names`: primvars that the materials read, the first one that the prim has is taken.
  /// `with_colors`: whether colours that differ within the mesh are wanted.
  TranslatedMesh translate(const usd::Prim& prim, const Prims& subsets,
                           const std::vector<std::string>& uv_names, bool with_colors);

 private:
  using Key = std::vector<const void*>;
  using Primvars = std::vector<usd::Primvar>;

  TranslatedMesh translate_mesh(const usd::Prim& prim, const Primvars& primvars,
                                const Prims& subsets, const std::vector<std::string>& uv_names,
                                const usd::Prim* color_owner);
  TranslatedMesh translate_shape(const usd::Prim& prim);
  TranslatedMesh translate_thin(const usd::Prim& prim, const Primvars& primvars,
                                const usd::Prim* color_owner);
  void add_primvar(Key& key, const usd::Prim* owner, const std::string& name) const;
  void read_display_color(const Primvars& primvars, TranslatedMesh& result) const;

  usd::Stage& stage_;
  usd::Geometry& geometry_;
  Skinning skinning_;
  struct Made {
    std::shared_ptr<const Mesh> mesh;
    Losses losses;
  };
  /// By the specs that they are made of; what is equal without being the same is found in the pool.
  std::map<std::pair<Key, std::string>, Made> meshes_;
  loader_support::MeshPool pool_;
  /// Since pages were given back: layers stay mapped while they are translated, but need not stay
  /// in memory besides the meshes.
  std::size_t corners_read_ = 0;
};

}  // namespace diorama::loader_usd
