// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <unordered_map>
#include <unordered_set>
#include <utility>
#include <vector>

#include "asset_library.h"
#include "layer_stack.h"
#include "prim_index.h"
#include "schema.h"
#include "value_clips.h"

namespace diorama::usd {

/// What one layer says about a composed prim.
struct Opinion {
  const IndexNode* node;
  const LayerStack::Entry* entry;
  const PrimSpec* spec;
};

/// A composed prim. Belongs to its stage.
struct Prim {
  std::string path;
  const Prim* parent = nullptr;  ///< Null for the pseudo-root.
  PrimIndex index;
  std::vector<int> order;         ///< Nodes of the index with opinions, strongest first.
  std::vector<Opinion> opinions;  ///< Of the layers of these nodes, strongest first.
  std::string type_name;
  TypeTraits traits;
  bool is_active = true;
  bool is_defined = false;   ///< `def` or `class`, and so are its ancestors.
  bool is_abstract = false;  ///< A class or below one.
  bool is_instance = false;
  bool is_instance_proxy = false;  ///< Below an instance.
  bool has_clips = false;          ///< It or an ancestor has value clips.
};

/// A value with the layer that it was found in, which asset paths are relative to.
struct FoundValue {
  Value value;
  const Layer* layer = nullptr;
  const LayerStack* stack = nullptr;
  /// The spec that says it: the same spec is the same value.
  const PropertySpec* spec = nullptr;
  explicit operator bool() const { return !value.is_empty(); }
};

/// Which time a value is taken at.
enum class Sampling {
  DefaultTime,  ///< The default alone: an attribute with time samples only has no value.
  /// The first time sample where no layer has a default: a blocked default is none, a blocked
  /// sample is no value. Where there is neither, what value clips say when the stage starts.
  OrFirstSample,
};

/// A composed scene: what all layers together say, with all payloads loaded, default variants and
/// at the default time. Prims are composed when they are asked for and take memory in proportion to
/// what the files hold; small files that refer to themselves over and over end with a FormatError.
/// Not thread safe.
class Stage {
 public:
  /// What composed prims may take, besides 64 times the size of the layers.
  static constexpr std::uint64_t kComposedBytes = std::uint64_t{512} << 20;

  /// Throws FormatError when the layer cannot be read. What its arcs cannot reach becomes warnings.
  /// `selections` choose variants of the root prims, by set, whatever layers say. With `seconds`
  /// values are those of that time: samples come before the default of the same layer, and between
  /// two of them numbers are blended.
  explicit Stage(const std::string& file, Sampling sampling = Sampling::DefaultTime,
                 std::uint64_t most_composed_bytes = kComposedBytes,
                 AssetLibrary::LookUp look_up = {},
                 std::map<std::string, std::string> selections = {},
                 std::optional<double> seconds = {});
  ~Stage();

  const Layer& root_layer() const { return root_stack_->root(); }
  const std::vector<std::string>& warnings() const { return diagnostics_.warnings(); }
  Diagnostics& diagnostics() { return diagnostics_; }
  const AssetLibrary& assets() const { return assets_; }

  /// What the layer says, be it an axis or not; "Y" where nothing is authored.
  std::string up_axis() const;
  bool is_z_up() const { return up_axis() == "Z"; }
  /// What the layer says, be it a length or not; 0.01 where nothing is authored.
  double meters_per_unit() const;
  /// When the stage starts and ends, in seconds: what its root layer says, else the samples of that
  /// layer; nothing when no value that was asked for so far has samples.
  std::optional<std::pair<double, double>> animation() const;
  /// Path of the default prim if there is such a prim; empty otherwise.
  std::string default_prim();
  /// The variants, by set, that the root prims have.
  std::map<std::string, std::set<std::string>> root_variants();

  const Prim& root() const { return *root_; }
  /// About what the prims that were composed so far take.
  std::uint64_t composed_bytes() const { return composed_bytes_; }
  /// Null if there is no such prim. Also finds prims that a traversal leaves out.
  const Prim* find(std::string_view path);
  /// All children that have opinions, in composed order.
  std::vector<const Prim*> children(const Prim& prim);
  /// The children that a renderer sees: active, defined and not abstract.
  std::vector<const Prim*> visible_children(const Prim& prim);

  /// The strongest opinion about a metadata field.
  Value metadata(const Prim& prim, std::string_view field) const;
  /// A composed list of tokens: apiSchemas.
  Strings metadata_list(const Prim& prim, std::string_view field) const;

  bool has_property(const Prim& prim, std::string_view name) const;
  /// Names of all authored properties that begin with `prefix`, sorted.
  Strings property_names(const Prim& prim, std::string_view prefix = {}) const;
  Value property_metadata(const Prim& prim, std::string_view name, std::string_view field) const;
  /// The type, `float3[]`: the schema's for attributes that it defines, else the authored one, also
  /// where that is an old name (`Vec3f[]`); empty if there is no such attribute.
  std::string attribute_type(const Prim& prim, std::string_view name) const;
  /// The strongest value by the stage's sampling. Empty when there is none or it is blocked.
  FoundValue find_value(const Prim& prim, std::string_view name) const;
  Value value(const Prim& prim, std::string_view name) const {
    return find_value(prim, name).value;
  }
  /// Whether any layer has a default or time samples that are not blocked.
  bool has_authored_value(const Prim& prim, std::string_view name) const;
  /// A composed list of integers: inactiveIds.
  std::vector<std::int64_t> metadata_integers(const Prim& prim, std::string_view field) const;
  /// Composed paths that a relationship leads to, or an attribute is connected to. `lost` becomes
  /// a path that an arc does not carry out of its asset.
  Strings targets(const Prim& prim, std::string_view name, std::string* lost = nullptr) const;
  Strings connections(const Prim& prim, std::string_view name) const;

  /// The spec that `find_value` would read, without reading it; null where there is no value.
  const PropertySpec* value_spec(const Prim& prim, std::string_view name) const;

  /// The identifier of an asset-valued attribute: relative to the layer that says it.
  std::string anchor(const FoundValue& value) const;

 private:
  const Prim* compose(const Prim& parent, std::string_view name);
  bool is_plain_class(const Prim& parent, std::string_view name) const;
  void count_memory(const Prim& prim);
  Specifier compose_specifier(const Prim& prim, bool& is_defining) const;
  Strings compose_paths(const Prim& prim, std::string_view name, std::string_view field,
                        std::string* lost) const;

  struct Clipped;
  Clipped clipped_value(const Prim& prim, std::string_view name) const;
  FoundValue timed_value(const Prim& prim, std::string_view name) const;
  const PropertySpec* timed_spec(const Prim& prim, std::string_view name) const;
  double codes_per_second() const;

  Sampling sampling_;
  std::uint64_t most_composed_bytes_;
  AssetLibrary assets_;
  Diagnostics diagnostics_;
  LayerStacks stacks_;
  const LayerStack* root_stack_;
  PrimIndexer indexer_;
  std::unordered_map<std::string, std::unique_ptr<Prim>, StringHash, std::equal_to<>> prims_;
  std::unordered_map<const Prim*, std::unordered_set<std::string>> listed_;  ///< For find().
  std::uint64_t composed_bytes_ = 0;
  std::optional<double> time_;  ///< In time codes.
  std::unique_ptr<ValueClips> clips_;
  mutable bool has_samples_ = false;
  /// Stand for a spec at a time: arcs may take the same one at several.
  mutable std::map<std::pair<const PropertySpec*, double>, std::unique_ptr<PropertySpec>> timed_;
  const Prim* root_ = nullptr;
};

}  // namespace diorama::usd
