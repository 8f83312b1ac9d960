// SPDX-License-Identifier: Apache-2.0
#include "layer.h"

#include <algorithm>

namespace diorama::usd {

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
