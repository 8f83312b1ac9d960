// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "types.h"
#include "value.h"

namespace diorama::usd {

struct StringHash {
  using is_transparent = void;
  std::size_t operator()(std::string_view text) const {
    return std::hash<std::string_view>{}(text);
  }
};

/// The fields of one spec: a run in the layer's list of field indices.
struct FieldSet {
  std::uint32_t begin = 0;
  std::uint32_t count = 0;
};

/// An attribute or a relationship as one layer has it.
struct PropertySpec {
  std::string_view name;  ///< In the layer's memory.
  SpecType type = SpecType::Unknown;
  FieldSet fields;
};

/// A prim, a variant, a variant set or the layer itself (`/`) as one layer has it.
struct PrimSpec {
  SpecType type = SpecType::Unknown;
  FieldSet fields;
  std::vector<PropertySpec> properties;  ///< In the order of the file.

  const PropertySpec* property(std::string_view name) const;
};

/// One layer in memory: specs by path, each with named fields. Values of crate layers are read from
/// the file when they are asked for. Immutable after reading; safe to use from many threads.
class Layer {
 public:
  explicit Layer(std::string identifier) : identifier_(std::move(identifier)) {}

  /// The resolved file, `/rooms/a.usdc`, or a member of a package, `/rooms/a.usdz[b.usda]`.
  const std::string& identifier() const { return identifier_; }

  const PrimSpec* prim(std::string_view path) const;
  const PrimSpec& root() const;
  std::size_t prim_count() const { return prims_.size(); }

  bool has(const FieldSet& fields, std::string_view name) const;
  /// Empty when the field is absent. Throws FormatError when a crate lies about it.
  Value get(const FieldSet& fields, std::string_view name) const;
  Value get(const PrimSpec& spec, std::string_view name) const { return get(spec.fields, name); }
  /// All fields of a spec, as the file has them.
  std::vector<std::pair<std::string_view, Value>> fields(const FieldSet& set) const;

  using Prims = std::unordered_map<std::string, PrimSpec, StringHash, std::equal_to<>>;
  const Prims& prims() const { return prims_; }

  /// What the layer names, as it is written.
  struct NamedAssets {
    /// Sublayers, references and payloads, those of variants too, value clips.
    std::set<std::string> layers;
    std::set<std::string> values;  ///< Of asset-valued attributes: textures.
  };
  NamedAssets named_assets() const;

  /// Reads every value once, time samples included. Throws FormatError as `get` does.
  using Visit = std::function<void(const Value&)>;
  void for_each_value(const Visit& visit) const;
  /// The same for arrays alone: other values are not decoded.
  void for_each_array(const Visit& visit) const;

  /// Called by the readers.
  struct Field {
    std::string_view name;
    Value value;
    std::uint64_t representation = 0;  ///< Of a crate value; 0: `value` holds it.
  };
  std::uint32_t add_field(Field field);
  std::string_view intern(std::string_view text);
  std::vector<std::uint32_t>& field_indices() { return field_indices_; }
  Prims& prims() { return prims_; }
  void set_source(std::shared_ptr<const ValueSource> source) { source_ = std::move(source); }

 private:
  const Field* find(const FieldSet& fields, std::string_view name) const;
  void for_each_field(const std::function<void(const Field&)>& visit) const;
  Value value_of(const Field& field) const;

  std::string identifier_;
  std::shared_ptr<const ValueSource> source_;
  std::deque<std::string> strings_;
  std::vector<Field> fields_;
  std::vector<std::uint32_t> field_indices_;
  Prims prims_;
};

}  // namespace diorama::usd
