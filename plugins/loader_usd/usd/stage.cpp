// SPDX-License-Identifier: Apache-2.0
#include "stage.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iterator>

#include "error.h"
#include "path.h"

namespace diorama::usd {
namespace {

constexpr std::uint64_t kComposedBytesPerFileByte = 64;

// `visit` gets the node, the layer and the spec, and says whether to go on.
template <class Visit>
void for_each_spec(const Prim& prim, const Visit& visit) {
  for (const Opinion& opinion : prim.opinions) {
    if (!visit(*opinion.node, *opinion.entry, *opinion.spec)) return;
  }
}

// Found once, because a prim is asked for dozens of values.
void collect_opinions(Prim& prim) {
  for (const int i : prim.order) {
    const IndexNode& node = prim.index.nodes[static_cast<std::size_t>(i)];
    for (const LayerStack::Entry& entry : node.stack->layers) {
      const PrimSpec* spec = entry.layer->prim(node.path);
      if (spec) prim.opinions.push_back({&node, &entry, spec});
    }
  }
}

// Whether arcs of a node lead to another one.
bool is_below(const Prim& prim, const IndexNode& node, const IndexNode& above) {
  const IndexNode* at = &node;
  while (at->parent != IndexNode::kNone) {
    at = &prim.index.nodes[static_cast<std::size_t>(at->parent)];
    if (at == &above) return true;
  }
  return false;
}

}  // namespace

/// What value clips say of an attribute. They are weaker than the layers that they stand beside,
/// and stronger than what is referenced from there.
struct Stage::Clipped {
  FoundValue found;
  const IndexNode* anchor = nullptr;
  bool has_passed = false;  ///< The layers beside it.

  bool are_stronger_than(const Prim& prim, const IndexNode& node) {
    if (!found || !anchor) return false;
    if (&node == anchor) {
      has_passed = true;
      return false;
    }
    return has_passed || is_below(prim, node, *anchor);
  }
};

Stage::Clipped Stage::clipped_value(const Prim& prim, std::string_view name) const {
  Clipped clips;
  if (!prim.has_clips) return clips;
  has_samples_ = true;
  clips.found = clips_->find(prim, name, &clips.anchor);
  return clips;
}

Stage::Stage(const std::string& file, Sampling sampling, std::uint64_t most_composed_bytes,
             AssetLibrary::LookUp look_up, std::map<std::string, std::string> selections,
             std::optional<double> seconds)
    : sampling_(sampling),
      most_composed_bytes_(most_composed_bytes),
      assets_(std::move(look_up)),
      stacks_(assets_, diagnostics_),
      root_stack_(
          &stacks_.open(std::filesystem::absolute(file).lexically_normal().generic_string(), {})),
      indexer_(stacks_, *root_stack_, std::move(selections)),
      time_(seconds ? std::optional(*seconds * codes_per_second()) : std::nullopt),
      clips_(std::make_unique<ValueClips>(assets_, stacks_, diagnostics_, root_stack_->root(),
                                          time_)) {
  auto root = std::make_unique<Prim>();
  root->path = "/";
  root->index = indexer_.root_index();
  root->order = {0};
  collect_opinions(*root);
  root->is_defined = true;
  root_ = root.get();
  prims_.emplace("/", std::move(root));
}

Stage::~Stage() = default;

std::string Stage::up_axis() const {
  const Value axis = root_layer().get(root_layer().root(), "upAxis");
  return axis.as_text() ? *axis.as_text() : "Y";
}

double Stage::meters_per_unit() const {
  const Value unit = root_layer().get(root_layer().root(), "metersPerUnit");
  // OpenUSD asks for a double and takes its fallback for a value of another type.
  if (unit.type() != Type::Double) return 0.01;
  return *unit.as_number();
}

double Stage::codes_per_second() const {
  const Layer& layer = root_layer();
  for (const char* field : {"timeCodesPerSecond", "framesPerSecond"}) {
    const auto number = layer.get(layer.root(), field).as_number();
    if (number && *number > 0.0 && std::isfinite(*number)) return *number;
  }
  return 24.0;
}

std::optional<std::pair<double, double>> Stage::animation() const {
  if (!has_samples_) return std::nullopt;
  const Layer& layer = root_layer();
  const auto start = layer.get(layer.root(), "startTimeCode").as_number();
  const auto end = layer.get(layer.root(), "endTimeCode").as_number();
  double first = INFINITY;
  double last = -INFINITY;
  if (start && end && *start <= *end) {
    first = *start;
    last = *end;
  } else {
    for (const auto& [path, prim] : layer.prims()) {
      for (const PropertySpec& property : prim.properties) {
        if (!layer.has(property.fields, "timeSamples")) continue;
        const Value value = layer.get(property.fields, "timeSamples");
        const TimeSamples* samples = value.as_time_samples();
        if (!samples || samples->times.empty()) continue;
        first = std::min(first, samples->times.front());
        last = std::max(last, samples->times.back());
      }
    }
  }
  if (!std::isfinite(first) || !std::isfinite(last) || first > last) return std::nullopt;
  return std::pair(first / codes_per_second(), last / codes_per_second());
}

std::string Stage::default_prim() {
  const Value name = root_layer().get(root_layer().root(), "defaultPrim");
  if (!name.as_text() || name.as_text()->empty()) return {};
  const std::string path =
      name.as_text()->starts_with('/') ? *name.as_text() : std::string("/").append(*name.as_text());
  return find(path) ? path : std::string();
}

std::map<std::string, std::set<std::string>> Stage::root_variants() {
  std::map<std::string, std::set<std::string>> variants;
  for (const Prim* prim : visible_children(root())) {
    for (const IndexNode& node : prim->index.nodes) {
      const std::string start = path::strip_variants(node.path) + "{";
      for (const LayerStack::Entry& entry : node.stack->layers) {
        for (const auto& [path, spec] : entry.layer->prims()) {
          if (!path.starts_with(start) || !path::is_variant(path)) continue;
          if (path::parent(path) != path::strip_variants(node.path)) continue;
          const auto [set, name] = path::variant_selection(path);
          if (!name.empty()) variants[std::string(set)].insert(std::string(name));
        }
      }
    }
  }
  return variants;
}

const Prim* Stage::find(std::string_view path) {
  if (path == "/") return root_;
  if (!path.starts_with('/') || !path::property_part(path).empty()) return nullptr;
  if (const auto known = prims_.find(path); known != prims_.end()) return known->second.get();
  const Prim* parent = find(path::parent(path));
  if (!parent) return nullptr;
  if (!parent->is_active) return nullptr;
  // Asked for one child, people ask for its siblings next.
  auto [names, is_new] = listed_.try_emplace(parent);
  if (is_new) {
    Strings list = child_names(parent->index);
    names->second.insert(std::make_move_iterator(list.begin()),
                         std::make_move_iterator(list.end()));
  }
  const std::string name(path::name(path));
  return names->second.contains(name) ? compose(*parent, name) : nullptr;
}

std::vector<const Prim*> Stage::children(const Prim& prim) {
  std::vector<const Prim*> result;
  if (!prim.is_active) return result;
  for (const std::string& name : child_names(prim.index)) result.push_back(compose(prim, name));
  return result;
}

std::vector<const Prim*> Stage::visible_children(const Prim& prim) {
  std::vector<const Prim*> result;
  if (!prim.is_active || prim.is_abstract) return result;
  for (const std::string& name : child_names(prim.index)) {
    // Classes may inherit from long chains of others, all of them to be left out again.
    if (is_plain_class(prim, name)) continue;
    const Prim* child = compose(prim, name);
    if (child->is_active && child->is_defined && !child->is_abstract) result.push_back(child);
  }
  return result;
}

// Whether the strongest opinion of all, a local one, makes it a class.
bool Stage::is_plain_class(const Prim& parent, std::string_view name) const {
  const IndexNode& local = parent.index.nodes.front();
  if (local.is_inert || parent.is_instance || !local.stack->relocate_targets.empty()) return false;
  const std::string path = path::append_child(local.path, name);
  for (const LayerStack::Entry& entry : local.stack->layers) {
    const PrimSpec* spec = entry.layer->prim(path);
    if (!spec) continue;
    const auto specifier = entry.layer->get(*spec, "specifier").as_enumerator();
    if (specifier && *specifier != static_cast<int>(Specifier::Over)) {
      return *specifier == static_cast<int>(Specifier::Class);
    }
  }
  return false;
}

// Arcs to arcs multiply: thirty small files can make as many prims as there are atoms in a room.
void Stage::count_memory(const Prim& prim) {
  std::size_t bytes =
      sizeof(Prim) + 2 * prim.path.size() + prim.opinions.capacity() * sizeof(Opinion);
  for (const IndexNode& node : prim.index.nodes) {
    bytes +=
        sizeof(IndexNode) + node.path.capacity() + (node.children.capacity() + 1) * sizeof(int);
    // Maps that this prim's index made; it shares others with its parent's.
    for (const auto* map : {&node.map_to_parent, &node.map_to_root}) {
      if (map->use_count() == 1) bytes += (*map)->bytes();
    }
  }
  composed_bytes_ += bytes;
  const std::uint64_t most =
      most_composed_bytes_ + kComposedBytesPerFileByte * assets_.layer_bytes();
  if (composed_bytes_ <= most) return;
  throw FormatError(root_layer().identifier() + ": its prims take more than " +
                    std::to_string(most >> 20) + " MiB, at <" + prim.path +
                    ">, which is too much for " + std::to_string(assets_.layer_bytes()) +
                    " bytes of layers; do references multiply?");
}

const Prim* Stage::compose(const Prim& parent, std::string_view name) {
  std::string path = path::append_child(parent.path, name);
  if (const auto known = prims_.find(path); known != prims_.end()) return known->second.get();
  auto prim = std::make_unique<Prim>();
  prim->path = path;
  prim->parent = &parent;
  prim->index = indexer_.child_index(parent.index, name);
  prim->index.nodes.shrink_to_fit();
  prim->order = prim->index.strength_order();
  collect_opinions(*prim);
  count_memory(*prim);
  prim->is_instance = prim->index.is_instance;
  prim->has_clips = parent.has_clips || !metadata(*prim, "clips").is_empty();
  prim->is_instance_proxy = parent.is_instance || parent.is_instance_proxy;
  prim->is_active = metadata(*prim, "active").as_bool().value_or(true);
  bool is_defining = false;
  const Specifier specifier = compose_specifier(*prim, is_defining);
  prim->is_defined = parent.is_defined && is_defining;
  prim->is_abstract = parent.is_abstract || specifier == Specifier::Class;
  for_each_spec(*prim, [&](const IndexNode&, const LayerStack::Entry& entry, const PrimSpec& spec) {
    const Value type = entry.layer->get(spec, "typeName");
    const bool is_type =
        type.as_text() && !type.as_text()->empty() && *type.as_text() != "__AnyType__";
    if (is_type) prim->type_name = *type.as_text();
    return !is_type;
  });
  prim->traits = type_traits(prim->type_name);
  return prims_.emplace(std::move(path), std::move(prim)).first->second.get();
}

// The strongest `def` or `class`; a class that the prim merely inherits is weaker than any other.
Specifier Stage::compose_specifier(const Prim& prim, bool& is_defining) const {
  Specifier result = Specifier::Over;
  for_each_spec(prim,
                [&](const IndexNode& node, const LayerStack::Entry& entry, const PrimSpec& spec) {
                  const int number = entry.layer->get(spec, "specifier")
                                         .as_enumerator()
                                         .value_or(static_cast<int>(Specifier::Over));
                  const auto specifier = static_cast<Specifier>(number);
                  if (specifier == Specifier::Over) return true;
                  bool is_inherited = false;
                  for (const IndexNode* at = &node; at->parent != IndexNode::kNone;
                       at = &prim.index.nodes[static_cast<std::size_t>(at->parent)]) {
                    const bool is_class_arc = at->arc == Arc::Inherit || at->arc == Arc::Specialize;
                    is_inherited |= is_class_arc && !at->is_due_to_ancestor();
                  }
                  const bool is_weak = specifier == Specifier::Class && is_inherited;
                  if (is_weak && is_defining) return true;
                  result = specifier;
                  is_defining = true;
                  return is_weak;
                });
  return result;
}

Value Stage::metadata(const Prim& prim, std::string_view field) const {
  Value result;
  for_each_spec(prim, [&](const IndexNode&, const LayerStack::Entry& entry, const PrimSpec& spec) {
    result = entry.layer->get(spec, field);
    return result.is_empty();
  });
  return result;
}

Strings Stage::metadata_list(const Prim& prim, std::string_view field) const {
  std::vector<Value> opinions;
  for_each_spec(prim, [&](const IndexNode&, const LayerStack::Entry& entry, const PrimSpec& spec) {
    Value value = entry.layer->get(spec, field);
    if (value.as_string_list_op()) opinions.push_back(std::move(value));
    return true;
  });
  Strings result;
  for (auto it = opinions.rbegin(); it != opinions.rend(); ++it) {
    it->as_string_list_op()->apply(result);
  }
  return result;
}

bool Stage::has_property(const Prim& prim, std::string_view name) const {
  bool found = false;
  for_each_spec(prim, [&](const IndexNode&, const LayerStack::Entry&, const PrimSpec& spec) {
    found = spec.property(name) != nullptr;
    return !found;
  });
  return found;
}

Strings Stage::property_names(const Prim& prim, std::string_view prefix) const {
  std::vector<std::string_view> names;
  for_each_spec(prim, [&](const IndexNode&, const LayerStack::Entry&, const PrimSpec& spec) {
    for (const PropertySpec& property : spec.properties) {
      if (property.name.starts_with(prefix)) names.push_back(property.name);
    }
    return true;
  });
  std::sort(names.begin(), names.end());
  names.erase(std::unique(names.begin(), names.end()), names.end());
  return Strings(names.begin(), names.end());
}

Value Stage::property_metadata(const Prim& prim, std::string_view name,
                               std::string_view field) const {
  Value result;
  for_each_spec(prim, [&](const IndexNode&, const LayerStack::Entry& entry, const PrimSpec& spec) {
    if (const PropertySpec* property = spec.property(name)) {
      result = entry.layer->get(property->fields, field);
    }
    return result.is_empty();
  });
  return result;
}

std::string Stage::attribute_type(const Prim& prim, std::string_view name) const {
  const Value type = property_metadata(prim, name, "typeName");
  if (!type.as_text()) return {};
  const std::string_view known = schema_attribute_type(prim.traits, name);
  if (!known.empty()) return std::string(known);
  return *type.as_text();
}

bool Stage::has_authored_value(const Prim& prim, std::string_view name) const {
  bool result = false;
  for_each_spec(prim, [&](const IndexNode&, const LayerStack::Entry& entry, const PrimSpec& spec) {
    const PropertySpec* property = spec.property(name);
    if (!property) return true;
    result = entry.layer->has(property->fields, "timeSamples");
    if (result) return false;
    const Value value = entry.layer->get(property->fields, "default");
    result = !value.is_empty() && !value.is_block();
    return value.is_empty();
  });
  return result;
}

std::vector<std::int64_t> Stage::metadata_integers(const Prim& prim, std::string_view field) const {
  std::vector<Value> opinions;
  for_each_spec(prim, [&](const IndexNode&, const LayerStack::Entry& entry, const PrimSpec& spec) {
    Value value = entry.layer->get(spec, field);
    if (value.as_integer_list_op()) opinions.push_back(std::move(value));
    return true;
  });
  std::vector<std::int64_t> result;
  for (auto it = opinions.rbegin(); it != opinions.rend(); ++it) {
    it->as_integer_list_op()->apply(result);
  }
  return result;
}

// The strongest opinion at the stage's time.
FoundValue Stage::timed_value(const Prim& prim, std::string_view name) const {
  FoundValue result;
  bool is_found = false;
  Clipped clips = clipped_value(prim, name);
  for_each_spec(prim, [&](const IndexNode& node, const LayerStack::Entry& entry,
                          const PrimSpec& spec) {
    if (clips.are_stronger_than(prim, node)) return false;
    const PropertySpec* property = spec.property(name);
    if (!property) return true;
    result.layer = entry.layer.get();
    result.stack = node.stack;
    result.spec = property;
    const Value samples = entry.layer->get(property->fields, "timeSamples");
    const TimeSamples* list = samples.as_time_samples();
    if (list && !list->times.empty()) {
      has_samples_ = true;
      const LayerOffset offset = node.map_to_root->offset().compose(entry.offset);
      const double time = offset.scale == 0.0 ? *time_ : (*time_ - offset.offset) / offset.scale;
      result.value = value_at(*list, time);
      auto& known = timed_[{property, time}];
      if (!known) known = std::make_unique<PropertySpec>(*property);
      result.spec = known.get();
      is_found = true;
      return false;
    }
    result.value = entry.layer->get(property->fields, "default");
    is_found = bool(result);
    return !is_found;
  });
  if (!is_found) result = clips.found;
  return result.value.is_block() ? FoundValue() : result;
}

// The same without reading any number.
const PropertySpec* Stage::timed_spec(const Prim& prim, std::string_view name) const {
  const PropertySpec* result = nullptr;
  Clipped clips = clipped_value(prim, name);
  for_each_spec(prim, [&](const IndexNode& node, const LayerStack::Entry& entry,
                          const PrimSpec& spec) {
    if (clips.are_stronger_than(prim, node)) return false;
    const PropertySpec* property = spec.property(name);
    if (!property) return true;
    if (entry.layer->has(property->fields, "timeSamples")) {
      const LayerOffset offset = node.map_to_root->offset().compose(entry.offset);
      const double time = offset.scale == 0.0 ? *time_ : (*time_ - offset.offset) / offset.scale;
      auto& known = timed_[{property, time}];
      if (!known) known = std::make_unique<PropertySpec>(*property);
      result = known.get();
      return false;
    }
    if (entry.layer->has(property->fields, "default")) result = property;
    return !result;
  });
  return result ? result : clips.found.spec;
}

FoundValue Stage::find_value(const Prim& prim, std::string_view name) const {
  if (time_) return timed_value(prim, name);
  // Whatever it is at the default time, clips move it at others.
  has_samples_ = has_samples_ || prim.has_clips;
  FoundValue first_default;
  FoundValue first_sample;
  for_each_spec(
      prim, [&](const IndexNode& node, const LayerStack::Entry& entry, const PrimSpec& spec) {
        const PropertySpec* property = spec.property(name);
        if (!property) return true;
        const auto found = [&](Value value) {
          return FoundValue{std::move(value), entry.layer.get(), node.stack, property};
        };
        has_samples_ = has_samples_ || entry.layer->has(property->fields, "timeSamples");
        first_default = found(entry.layer->get(property->fields, "default"));
        if (first_default && !first_default.value.is_block()) return false;
        if (!first_sample && sampling_ == Sampling::OrFirstSample) {
          const Value samples = entry.layer->get(property->fields, "timeSamples");
          const TimeSamples* list = samples.as_time_samples();
          if (list && !list->times.empty()) {
            // Arcs may run time backwards; then the last sample comes first.
            const bool is_reversed = node.map_to_root->offset().scale * entry.offset.scale < 0.0;
            first_sample = found(list->value(is_reversed ? list->times.size() - 1 : 0));
          }
        }
        return !first_default;
      });
  const bool has_default = first_default && !first_default.value.is_block();
  FoundValue result = has_default ? first_default : first_sample;
  if (!result && prim.has_clips && sampling_ == Sampling::OrFirstSample) {
    result = clips_->find(prim, name);
  }
  return result.value.is_block() ? FoundValue() : result;
}

const PropertySpec* Stage::value_spec(const Prim& prim, std::string_view name) const {
  if (time_) return timed_spec(prim, name);
  const PropertySpec* with_default = nullptr;
  const PropertySpec* with_samples = nullptr;
  for_each_spec(prim, [&](const IndexNode&, const LayerStack::Entry& entry, const PrimSpec& spec) {
    const PropertySpec* property = spec.property(name);
    if (!property) return true;
    if (!with_samples && sampling_ == Sampling::OrFirstSample &&
        entry.layer->has(property->fields, "timeSamples")) {
      with_samples = property;
    }
    if (!entry.layer->has(property->fields, "default")) return true;
    // Only a block yields to samples, and only where there are some the value need be looked at.
    const bool is_block = with_samples && entry.layer->get(property->fields, "default").is_block();
    if (!is_block) with_default = property;
    return false;
  });
  if (!with_default && !with_samples && prim.has_clips && sampling_ == Sampling::OrFirstSample) {
    return clips_->find(prim, name).spec;
  }
  return with_default ? with_default : with_samples;
}

Strings Stage::compose_paths(const Prim& prim, std::string_view name, std::string_view field,
                             std::string* lost) const {
  std::vector<ListOp<std::string>> opinions;
  for_each_spec(prim,
                [&](const IndexNode& node, const LayerStack::Entry& entry, const PrimSpec& spec) {
                  const PropertySpec* property = spec.property(name);
                  if (!property) return true;
                  const Value value = entry.layer->get(property->fields, field);
                  if (!value.as_string_list_op()) return true;
                  ListOp<std::string> op = *value.as_string_list_op();
                  const auto map_all = [&](Strings& items) {
                    Strings mapped;
                    for (const std::string& item : items) {
                      // Paths that the arc does not carry out of its asset are lost.
                      if (auto path = node.map_to_root->to_target(item)) {
                        mapped.push_back(std::move(*path));
                      } else if (lost) {
                        *lost = item;
                      }
                    }
                    items = std::move(mapped);
                  };
                  for (Strings* items : {&op.explicit_items, &op.added, &op.prepended, &op.appended,
                                         &op.deleted, &op.ordered}) {
                    map_all(*items);
                  }
                  const bool is_final = op.is_explicit;
                  opinions.push_back(std::move(op));
                  return !is_final;
                });
  Strings result;
  for (auto it = opinions.rbegin(); it != opinions.rend(); ++it) it->apply(result);
  return result;
}

Strings Stage::targets(const Prim& prim, std::string_view name, std::string* lost) const {
  return compose_paths(prim, name, "targetPaths", lost);
}

Strings Stage::connections(const Prim& prim, std::string_view name) const {
  return compose_paths(prim, name, "connectionPaths", nullptr);
}

std::string Stage::anchor(const FoundValue& value) const {
  const std::string* asset = value.value.as_text();
  if (!asset || !value.layer) return {};
  return stacks_.anchor(*asset, *value.layer, value.stack->expression_variables);
}

}  // namespace diorama::usd
