// SPDX-License-Identifier: Apache-2.0
#include "layer.h"

#include <algorithm>

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

Value Layer::get(const FieldSet& fields, std::string_view name) const {
  const Field* field = find(fields, name);
  if (!field) return {};
  return field->representation ? source_->decode(field->representation) : field->value;
}

void Layer::visit_fields(const FieldSet& fields,
                         const std::function<void(const Value&)>& visit) const {
  for (std::uint32_t i = 0; i < fields.count; ++i) {
    const Field& field = fields_[field_indices_[fields.begin + i]];
    const Value value = field.representation ? source_->decode(field.representation) : field.value;
    const TimeSamples* samples = value.as_time_samples();
    if (!samples) {
      visit(value);
      continue;
    }
    for (std::size_t k = 0; k < samples->times.size(); ++k) visit(samples->value(k));
  }
}

Layer::NamedAssets Layer::named_assets() const {
  NamedAssets named;
  collect_texts(get(root(), "subLayers"), named.layers);
  for (const auto& [path, spec] : prims_) {
    for (const char* arc : {"references", "payload"}) collect_assets(get(spec, arc), named.layers);
    for (const PropertySpec& property : spec.properties) {
      const Value type = get(property.fields, "typeName");
      if (!type.as_text() || !type.as_text()->starts_with("asset")) continue;
      collect_texts(get(property.fields, "default"), named.values);
      collect_texts(get(property.fields, "timeSamples"), named.values);
    }
  }
  return named;
}

void Layer::for_each_value(const std::function<void(const Value&)>& visit) const {
  for (const auto& [path, spec] : prims_) {
    visit_fields(spec.fields, visit);
    for (const PropertySpec& property : spec.properties) visit_fields(property.fields, visit);
  }
}

std::uint32_t Layer::add_field(Field field) {
  fields_.push_back(std::move(field));
  return static_cast<std::uint32_t>(fields_.size() - 1);
}

std::string_view Layer::intern(std::string_view text) { return strings_.emplace_back(text); }

}  // namespace diorama::usd
