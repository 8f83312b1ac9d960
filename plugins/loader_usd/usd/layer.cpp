// SPDX-License-Identifier: Apache-2.0
#include "layer.h"

#include <algorithm>

#include "value_clips.h"

namespace diorama::usd {
namespace {

void collect_texts(const Value& value, std::set<std::string>& texts) {
  if (const std::string* text = value.as_text()) texts.insert(*text);
  if (const Strings* list = value.as_strings()) texts.insert(list->begin(), list->end());
  if (const TimeSamples* samples = value.as_time_samples()) {
    for (std::size_t i = 0; i < samples->times.size(); ++i) collect_texts(samples->value(i), texts);
  }
}

void collect_assets(const Value& arcs, std::set<std::string>& assets) {
  if (const Reference* reference = arcs.as_reference()) assets.insert(reference->asset);
  const ListOp<Reference>* list = arcs.as_reference_list_op();
  if (!list) return;
  for (const auto* items :
       {&list->explicit_items, &list->added, &list->prepended, &list->appended}) {
    for (const Reference& reference : *items) assets.insert(reference.asset);
  }
}

void visit_samples(const Value& value, const Layer::Visit& visit) {
  const TimeSamples* samples = value.as_time_samples();
  if (!samples) return visit(value);
  for (std::size_t i = 0; i < samples->times.size(); ++i) visit(samples->value(i));
}

}  // namespace

const PropertySpec* PrimSpec::property(std::string_view name) const {
  const auto found = std::find_if(properties.begin(), properties.end(),
                                  [&](const PropertySpec& spec) { return spec.name == name; });
  return found == properties.end() ? nullptr : &*found;
}

const PrimSpec* Layer::prim(std::string_view path) const {
  const auto found = prims_.find(path);
  return found == prims_.end() ? nullptr : &found->second;
}

const PrimSpec& Layer::root() const {
  static const PrimSpec kEmpty;
  const PrimSpec* spec = prim("/");
  return spec ? *spec : kEmpty;
}

const Layer::Field* Layer::find(const FieldSet& fields, std::string_view name) const {
  for (std::uint32_t i = 0; i < fields.count; ++i) {
    const Field& field = fields_[field_indices_[fields.begin + i]];
    if (field.name == name) return &field;
  }
  return nullptr;
}

bool Layer::has(const FieldSet& fields, std::string_view name) const {
  return find(fields, name) != nullptr;
}

Value Layer::value_of(const Field& field) const {
  return field.representation ? source_->decode(field.representation) : field.value;
}

Value Layer::get(const FieldSet& fields, std::string_view name) const {
  const Field* field = find(fields, name);
  return field ? value_of(*field) : Value();
}

std::vector<std::pair<std::string_view, Value>> Layer::fields(const FieldSet& set) const {
  std::vector<std::pair<std::string_view, Value>> result;
  for (std::uint32_t i = 0; i < set.count; ++i) {
    const Field& field = fields_[field_indices_[set.begin + i]];
    result.emplace_back(field.name, value_of(field));
  }
  return result;
}

Layer::NamedAssets Layer::named_assets() const {
  NamedAssets named;
  collect_texts(get(root(), "subLayers"), named.layers);
  for (const auto& [path, spec] : prims_) {
    for (const char* arc : {"references", "payload"}) collect_assets(get(spec, arc), named.layers);
    const Value clips = get(spec, "clips");
    if (clips.as_dictionary()) add_clip_assets(*clips.as_dictionary(), named.layers);
    for (const PropertySpec& property : spec.properties) {
      const Value type = get(property.fields, "typeName");
      if (!type.as_text() || !type.as_text()->starts_with("asset")) continue;
      collect_texts(get(property.fields, "default"), named.values);
      collect_texts(get(property.fields, "timeSamples"), named.values);
    }
  }
  return named;
}

void Layer::for_each_field(const std::function<void(const Field&)>& visit) const {
  const auto visit_set = [&](const FieldSet& set) {
    for (std::uint32_t i = 0; i < set.count; ++i) visit(fields_[field_indices_[set.begin + i]]);
  };
  for (const auto& [path, spec] : prims_) {
    visit_set(spec.fields);
    for (const PropertySpec& property : spec.properties) visit_set(property.fields);
  }
}

void Layer::for_each_value(const Visit& visit) const {
  for_each_field([&](const Field& field) { visit_samples(value_of(field), visit); });
}

void Layer::for_each_array(const Visit& visit) const {
  const auto visit_array = [&](const Value& value) {
    if (value.is_array()) visit(value);
  };
  for_each_field([&](const Field& field) {
    const bool is_wanted = !field.representation || source_->may_hold_array(field.representation);
    if (is_wanted) visit_samples(value_of(field), visit_array);
  });
}

std::uint32_t Layer::add_field(Field field) {
  fields_.push_back(std::move(field));
  return static_cast<std::uint32_t>(fields_.size() - 1);
}

std::string_view Layer::intern(std::string_view text) { return strings_.emplace_back(text); }

}  // namespace diorama::usd
