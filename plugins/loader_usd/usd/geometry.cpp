// SPDX-License-Identifier: Apache-2.0
#include "geometry.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "path.h"

namespace diorama::usd {
namespace {

constexpr std::string_view kResetStack = "!resetXformStack!";
constexpr std::string_view kInvert = "!invert!";
constexpr int kMaxCollectionNesting = 16;

// The axes of `rotateXYZ` in the order in which they are applied.
std::optional<std::array<int, 3>> rotation_axes(std::string_view kind) {
  if (kind.size() != 9 || !kind.starts_with("rotate")) return std::nullopt;
  std::array<int, 3> axes{};
  for (std::size_t i = 0; i < 3; ++i) {
    const char c = kind[6 + i];
    if (c < 'X' || c > 'Z') return std::nullopt;
    axes[i] = c - 'X';
  }
  const bool are_different = axes[0] != axes[1] && axes[1] != axes[2] && axes[2] != axes[0];
  return are_different ? std::optional(axes) : std::nullopt;
}

// The axis of `rotateX`, `translateY` or `scaleZ`; nothing for other words.
std::optional<std::size_t> axis_of(std::string_view kind, std::string_view stem) {
  if (kind.size() != stem.size() + 1 || !kind.starts_with(stem)) return std::nullopt;
  const char c = kind.back();
  if (c < 'X' || c > 'Z') return std::nullopt;
  return static_cast<std::size_t>(c - 'X');
}

// Nothing for words that are no ops and for values that do not fit.
std::optional<Matrix> op_matrix(std::string_view kind, const Value& value) {
  using Result = std::optional<Matrix>;
  Vector3 v{};
  if (kind == "transform") {
    Matrix matrix;
    return value.read(matrix.m) ? Result(matrix) : std::nullopt;
  }
  if (kind == "orient") {
    std::array<double, 4> quaternion{};
    return value.read(quaternion) ? Result(rotation(quaternion)) : std::nullopt;
  }
  if (kind == "translate") return value.read(v) ? Result(translation(v)) : std::nullopt;
  if (kind == "scale") return value.read(v) ? Result(scaling(v)) : std::nullopt;
  const auto number = value.as_number();
  if (const auto axis = axis_of(kind, "translate"); axis && number) {
    v[*axis] = *number;
    return translation(v);
  }
  if (const auto axis = axis_of(kind, "scale"); axis && number) {
    v = {1, 1, 1};
    v[*axis] = *number;
    return scaling(v);
  }
  if (const auto axis = axis_of(kind, "rotate"); axis && number) {
    return rotation(static_cast<int>(*axis), *number);
  }
  const auto axes = rotation_axes(kind);
  if (!axes || !value.read(v)) return std::nullopt;
  Matrix result;
  for (const int axis : *axes) {
    result = result * rotation(axis, v[static_cast<std::size_t>(axis)]);
  }
  return result;
}

}  // namespace

double number_or(const Stage& stage, const Prim& prim, std::string_view name, double fallback) {
  return stage.value(prim, name).as_number().value_or(fallback);
}

std::string token_or(const Stage& stage, const Prim& prim, std::string_view name,
                     std::string_view fallback) {
  const Value value = stage.value(prim, name);
  return value.as_text() ? *value.as_text() : std::string(fallback);
}

bool bool_or(const Stage& stage, const Prim& prim, std::string_view name, bool fallback) {
  return stage.value(prim, name).as_bool().value_or(fallback);
}

bool has_schema(const Stage& stage, const Prim& prim, std::string_view name) {
  const Strings schemas = stage.metadata_list(prim, "apiSchemas");
  return std::find(schemas.begin(), schemas.end(), name) != schemas.end();
}

std::optional<Vector3> vector3(const Stage& stage, const Prim& prim, std::string_view name) {
  Vector3 result{};
  if (!stage.value(prim, name).read(result)) return std::nullopt;
  return result;
}

LocalTransform local_transform(const Stage& stage, const Prim& prim) {
  LocalTransform result;
  if (!prim.traits.is_xformable) return result;
  const Value order = stage.value(prim, "xformOpOrder");
  if (!order.as_strings()) return result;
  const Strings& ops = *order.as_strings();
  auto first = ops.begin();
  for (auto op = ops.begin(); op != ops.end(); ++op) {
    if (*op != kResetStack) continue;
    result.resets_stack = true;
    first = op + 1;
  }
  for (auto op = ops.end(); op != first;) {
    std::string_view name = *--op;
    const bool is_inverse = name.starts_with(kInvert);
    if (is_inverse) name.remove_prefix(kInvert.size());
    // An op and its inverse side by side cancel, even where no number can show it.
    const bool cancels =
        op != first && (is_inverse ? *(op - 1) == name : *(op - 1) == std::string(kInvert) + *op);
    if (cancels) {
      --op;
      continue;
    }
    const auto lose = [&] {
      if (result.lost_op.empty()) result.lost_op = name;
    };
    if (!name.starts_with("xformOp:")) {
      lose();
      continue;
    }
    std::string_view kind = name.substr(8);
    kind = kind.substr(0, kind.find(':'));
    const Value value = stage.value(prim, name);
    if (value.is_empty()) {
      // One that is there without a value, or blocked, is meant to do nothing.
      if (!stage.has_property(prim, name)) lose();
      continue;
    }
    const std::optional<Matrix> matrix = op_matrix(kind, value);
    if (!matrix) {
      lose();
      continue;
    }
    result.matrix = result.matrix * (is_inverse ? inverse(*matrix) : *matrix);
  }
  return result;
}

const Matrix& Geometry::world_from_prim(const Prim& prim) {
  if (const auto known = worlds_.find(&prim); known != worlds_.end()) return known->second;
  Matrix world;
  const LocalTransform local = local_transform(stage_, prim);
  if (prim.parent && !local.resets_stack) {
    world = local.matrix * world_from_prim(*prim.parent);
  } else {
    world = local.matrix;
  }
  return worlds_.emplace(&prim, world).first->second;
}

bool Geometry::is_visible(const Prim& prim) {
  for (const Prim* at = &prim; at; at = at->parent) {
    if (!at->traits.is_imageable) continue;
    if (token_or(stage_, *at, "visibility", "inherited") == "invisible") return false;
  }
  return true;
}

std::string Geometry::purpose(const Prim& prim) {
  for (const Prim* at = &prim; at; at = at->parent) {
    if (!at->traits.is_imageable) continue;
    const std::string purpose = token_or(stage_, *at, "purpose", "");
    if (!purpose.empty()) return purpose;
  }
  return "default";
}

bool Geometry::collection_includes(const std::string& collection, const std::string& path,
                                   int nesting) {
  const std::string_view prefix = "collection:";
  const std::string_view property = path::property_part(collection);
  const Prim* owner = stage_.find(path::prim_part(collection));
  if (!owner || !property.starts_with(prefix) || nesting > kMaxCollectionNesting) return false;
  const std::string base(property);
  const std::string rule = token_or(stage_, *owner, base + ":expansionRule", "expandPrims");
  const auto nearest = [&](const Strings& paths) {
    std::size_t best = 0;
    for (const std::string& each : paths) {
      const bool hits = rule == "explicitOnly" ? each == path : path::has_prefix(path, each);
      if (hits) best = std::max(best, each.size());
    }
    return best;
  };
  Strings includes;
  for (std::string& target : stage_.targets(*owner, base + ":includes")) {
    if (path::property_part(target).starts_with(prefix)) {
      if (collection_includes(target, path, nesting + 1)) return true;
    } else {
      includes.push_back(std::move(target));
    }
  }
  if (bool_or(stage_, *owner, base + ":includeRoot", false)) includes.push_back("/");
  return nearest(includes) > nearest(stage_.targets(*owner, base + ":excludes"));
}

std::string Geometry::material(const Prim& prim, std::string_view purpose, std::string* lost) {
  const std::string for_all = "material:binding";
  const std::string collections_for_all = for_all + ":collection:";
  if (!purpose.empty()) {
    const std::string word(purpose);
    const std::string special =
        material_by(prim, for_all + ":" + word, collections_for_all + word + ":", lost);
    if (!special.empty()) return special;
  }
  return material_by(prim, for_all, collections_for_all, lost);
}

std::string Geometry::material_by(const Prim& prim, const std::string& relationship,
                                  const std::string& collection_prefix, std::string* lost) {
  std::string bound;
  std::string unmapped;
  const auto consider = [&](const Prim& owner, const std::string& name, const std::string& target,
                            bool replaces_same_prim) {
    const Value strength = stage_.property_metadata(owner, name, "bindMaterialAs");
    const bool is_strong = strength.as_text() && *strength.as_text() == "strongerThanDescendants";
    if (bound.empty() || is_strong || replaces_same_prim) bound = target;
  };
  for (const Prim* at = &prim; at; at = at->parent) {
    const std::string before = bound;
    const Strings direct = stage_.targets(*at, relationship, bound.empty() ? &unmapped : nullptr);
    if (direct.size() == 1) consider(*at, relationship, direct.front(), false);
    const bool is_bound_here = bound != before;
    for (const std::string& name : stage_.property_names(*at, collection_prefix)) {
      // `material:binding:collection:NAME`; one more part would name a purpose.
      if (name.find(':', collection_prefix.size()) != std::string::npos) continue;
      const Strings pair = stage_.targets(*at, name);
      if (pair.size() != 2) continue;
      const bool first_is_collection = !path::property_part(pair[0]).empty();
      const std::string& collection = pair[first_is_collection ? 0 : 1];
      if (!collection_includes(collection, prim.path, 0)) continue;
      consider(*at, name, pair[first_is_collection ? 1 : 0], is_bound_here);
      break;
    }
  }
  const Prim* material = bound.empty() ? nullptr : stage_.find(bound);
  if (material && material->type_name == "Material") return bound;
  if (lost && !(bound.empty() && unmapped.empty())) *lost = bound.empty() ? unmapped : bound;
  return {};
}

std::vector<Primvar> Geometry::own_primvars(const Prim& prim) const {
  constexpr std::string_view kPrefix = "primvars:";
  std::vector<Primvar> result;
  for (const std::string& property : stage_.property_names(prim, kPrefix)) {
    if (property.ends_with(":indices")) continue;
    Primvar primvar;
    primvar.name = property.substr(kPrefix.size());
    primvar.owner = &prim;
    primvar.type = stage_.attribute_type(prim, property);
    if (primvar.type.empty()) continue;
    const Value interpolation = stage_.property_metadata(prim, property, "interpolation");
    primvar.interpolation = interpolation.as_text() ? *interpolation.as_text() : "constant";
    primvar.is_indexed = stage_.has_authored_value(prim, property + ":indices");
    result.push_back(std::move(primvar));
  }
  return result;
}

// Both sorted by name; of the same name the first list's is taken.
std::vector<Primvar> Geometry::merge(std::vector<Primvar> near, const std::vector<Primvar>& far) {
  const auto is_before = [](const Primvar& a, const Primvar& b) { return a.name < b.name; };
  std::vector<Primvar> result;
  std::set_union(std::make_move_iterator(near.begin()), std::make_move_iterator(near.end()),
                 far.begin(), far.end(), std::back_inserter(result), is_before);
  return result;
}

const std::vector<Primvar>& Geometry::inherited_primvars(const Prim* parent) {
  static const std::vector<Primvar> kNone;
  if (!parent) return kNone;
  if (const auto known = inherited_.find(parent); known != inherited_.end()) return known->second;
  std::vector<Primvar> own = own_primvars(*parent);
  std::erase_if(own, [&](const Primvar& primvar) {
    return primvar.interpolation != "constant" ||
           !stage_.has_authored_value(*parent, "primvars:" + primvar.name);
  });
  std::vector<Primvar> all = merge(std::move(own), inherited_primvars(parent->parent));
  return inherited_.emplace(parent, std::move(all)).first->second;
}

std::vector<Primvar> Geometry::primvars(const Prim& prim) {
  return merge(own_primvars(prim), inherited_primvars(prim.parent));
}

}  // namespace diorama::usd
