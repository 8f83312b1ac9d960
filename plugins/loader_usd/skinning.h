// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "diorama/math.h"
#include "loader_usd/losses.h"
#include "loader_usd/mesh_assembly.h"
#include "loader_usd/usd/geometry.h"
#include "loader_usd/usd/stage.h"

namespace diorama::loader_usd {

/// Bends meshes as their skeletons (UsdSkel) stand at the stage's time: blend shapes first, then
/// linear or dual quaternion skinning. What an animation does not say a joint does at rest. Nothing
/// of a file is trusted.
class Skinning {
 public:
  Skinning(usd::Stage& stage, usd::Geometry& geometry) : stage_(stage), geometry_(geometry) {}

  /// Whether a skeleton or blend shapes may move the points of the mesh.
  bool applies_to(const usd::Prim& prim);
  /// Moves points and normals; normals of shapes that do not say how they move are left out.
  void apply(const usd::Prim& prim, MeshSources& sources, Losses& losses);

 private:
  struct Animation {
    usd::Strings joints;
    std::vector<Affine> poses;  ///< Of `joints`; empty: none.
    std::map<std::string, double> weights;
    bool is_broken = false;  ///< It says joints, but no pose of each.
  };
  struct Skeleton {
    usd::Strings joints;
    std::vector<Affine> skeleton_from_bound;  ///< Moves a bound point to where it is now.
    const Animation* animation = nullptr;
    std::string problem;
  };

  /// Where the property is said: on the prim or the nearest above it.
  const usd::Prim* target_of(const usd::Prim& prim, const char* name);
  const Skeleton& skeleton(const usd::Prim& prim);
  const Animation& animation(const usd::Prim& prim);
  Skeleton read_skeleton(const usd::Prim& prim);
  Animation read_animation(const usd::Prim& prim);
  const Animation* animation_of(const usd::Prim& skeleton);
  void blend_shapes(const usd::Prim& prim, const Animation& animation, std::vector<Vec3>& points,
                    MeshSources& sources, Losses& losses);
  /// A blend shape at one of its weights: nothing at 0, its offsets at 1, others in between.
  struct SubShape {
    double weight = 0.0;
    std::string name;  ///< Of the property; empty: nothing.
  };
  std::vector<SubShape> sub_shapes(const usd::Prim& shape, std::size_t offsets,
                                   Losses& losses) const;
  /// What a blend shape adds, three numbers per point that it moves.
  struct Offsets {
    std::vector<double> of_points;
    std::vector<double> of_normals;
    bool has_normals = true;  ///< Everything that counts says those of normals, too.
  };
  Offsets offsets_at(const usd::Prim& shape, double weight, Losses& losses) const;
  const usd::Prim& owner_of(const usd::Prim& prim, const char* name);
  std::vector<Affine> matrices(const usd::Prim& prim, const char* name) const;

  usd::Stage& stage_;
  usd::Geometry& geometry_;
  std::map<const usd::Prim*, Skeleton> skeletons_;
  std::map<const usd::Prim*, Animation> animations_;
};

}  // namespace diorama::loader_usd
