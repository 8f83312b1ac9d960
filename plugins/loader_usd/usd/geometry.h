// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "matrix.h"
#include "stage.h"

namespace diorama::usd {

/// The prim's own transform.
struct LocalTransform {
  Matrix matrix;
  bool resets_stack = false;  ///< The parents' transforms do not count.
  /// The first op of the list that has no attribute, or one that cannot be read; empty mostly.
  std::string lost_op;
};

LocalTransform local_transform(const Stage& stage, const Prim& prim);

/// A primvar as a prim sees it, authored on it or inherited.
struct Primvar {
  std::string name;  ///< Without `primvars:`.
  const Prim* owner = nullptr;
  std::string type;           ///< `color3f[]`, as authored.
  std::string interpolation;  ///< constant where nothing is authored.
  bool is_indexed = false;
};

/// Answers what depends on ancestors, each once per prim. Belongs to one stage.
class Geometry {
 public:
  explicit Geometry(Stage& stage) : stage_(stage) {}

  const Matrix& world_from_prim(const Prim& prim);
  /// False when the prim or an ancestor is invisible.
  bool is_visible(const Prim& prim);
  /// default, render, proxy or guide: authored on the prim or its nearest ancestor.
  std::string purpose(const Prim& prim);
  /// The material that is bound to the prim; empty when there is none. A binding for `purpose`
  /// ("full", "preview"), be it that of an ancestor, beats one for all purposes. `lost` becomes
  /// where a binding leads that leads to no material.
  std::string material(const Prim& prim, std::string_view purpose = {},
                       std::string* lost = nullptr);
  /// All primvars, by name: its own, and constant ones of its ancestors.
  std::vector<Primvar> primvars(const Prim& prim);

 private:
  /// Bound by this relationship or by one that begins with the prefix and names a collection.
  std::string material_by(const Prim& prim, const std::string& relationship,
                          const std::string& collection_prefix, std::string* lost);
  bool collection_includes(const std::string& collection, const std::string& path, int nesting);
  std::vector<Primvar> own_primvars(const Prim& prim) const;
  /// What the prims below `parent` inherit from it and from its ancestors.
  const std::vector<Primvar>& inherited_primvars(const Prim* parent);
  static std::vector<Primvar> merge(std::vector<Primvar> near, const std::vector<Primvar>& far);

  Stage& stage_;
  std::unordered_map<const Prim*, Matrix> worlds_;
  std::unordered_map<const Prim*, std::vector<Primvar>> inherited_;
};

/// A number of a schema: authored or, if not, the schema's fallback.
double number_or(const Stage& stage, const Prim& prim, std::string_view name, double fallback);
std::string token_or(const Stage& stage, const Prim& prim, std::string_view name,
                     std::string_view fallback);
bool bool_or(const Stage& stage, const Prim& prim, std::string_view name, bool fallback);
/// Whether an API schema is applied: "PhysicsMassAPI".
bool has_schema(const Stage& stage, const Prim& prim, std::string_view name);
std::optional<Vector3> vector3(const Stage& stage, const Prim& prim, std::string_view name);

}  // namespace diorama::usd
