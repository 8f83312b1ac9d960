// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "diorama/annotator.h"
#include "diorama/loader.h"
#include "diorama/physics_backend.h"
#include "diorama/randomizer.h"
#include "diorama/reader.h"
#include "diorama/renderer.h"
#include "diorama/writer.h"
#include "framework/conformance/kinds.h"

namespace diorama::conformance {
namespace {

constexpr const char* kUnknown = "no_such_key_here";

std::unique_ptr<Component> make_any(const Subject& subject, const Value& map,
                                    Diagnostics& diagnostics) {
  const auto make_as = [&]<class T>(T*) -> std::unique_ptr<Component> {
    return subject.registry.make<T>(map, "check", {}, diagnostics, subject.host);
  };
  switch (subject.entry.kind) {
    case ComponentKind::Loader:
      return make_as(static_cast<Loader*>(nullptr));
    case ComponentKind::Physics:
      return make_as(static_cast<PhysicsBackend*>(nullptr));
    case ComponentKind::Randomizer:
      return make_as(static_cast<Randomizer*>(nullptr));
    case ComponentKind::Renderer:
      return make_as(static_cast<Renderer*>(nullptr));
    case ComponentKind::Annotator:
      return make_as(static_cast<Annotator*>(nullptr));
    case ComponentKind::Writer:
      return make_as(static_cast<Writer*>(nullptr));
    case ComponentKind::Reader:
      return make_as(static_cast<Reader*>(nullptr));
  }
  return nullptr;
}

void check_spec(const ParamSpec& spec) {
  require(!spec.key.empty(), "a parameter has no name");
  require(!spec.help.empty() && spec.help.back() == '.',
          "the help of '" + spec.key + "' is no sentence with a full stop");
  require(spec.min <= spec.max, "the range of '" + spec.key + "' is empty");
  require(spec.type != ParamType::Choice || !spec.choices.empty(),
          "'" + spec.key + "' has no words to choose from");
  for (const ParamSpec& child : spec.children) check_spec(child);
}

void require_no_twins(const std::vector<ParamSpec>& specs) {
  NameSet keys;
  for (const ParamSpec& spec : specs) {
    require(keys.insert(spec.key).second, "'" + spec.key + "' is declared twice");
    require_no_twins(spec.children);
  }
}

/// A parameter at any depth: how to put a value for it into a job, and its name in messages.
struct Slot {
  const ParamSpec& spec;
  std::vector<const ParamSpec*> groups;  ///< Around it, outermost first.

  Value in_job(const Subject& subject, Value value) const {
    value = map_of(spec.key, std::move(value));
    for (auto group = groups.rbegin(); group != groups.rend(); ++group) {
      if ((*group)->type == ParamType::List) {
        Value list = Value::make_list();
        list.list.push_back(std::move(value));
        value = std::move(list);
      }
      value = map_of((*group)->key, std::move(value));
    }
    value.set("type", Value::text(subject.entry.type));
    return value;
  }

 private:
  static Value map_of(const std::string& key, Value value) {
    Value map = Value::make_map();
    map.set(key, std::move(value));
    return map;
  }
};

std::vector<Slot> slots_of(const std::vector<ParamSpec>& specs,
                           const std::vector<const ParamSpec*>& groups = {}) {
  std::vector<Slot> slots;
  for (const ParamSpec& spec : specs) {
    slots.push_back({spec, groups});
    if (spec.type == ParamType::Any) continue;  // its keys depend on its neighbours
    std::vector<const ParamSpec*> inner = groups;
    inner.push_back(&spec);
    for (Slot& slot : slots_of(spec.children, inner)) slots.push_back(std::move(slot));
  }
  return slots;
}

void require_complaint(const Subject& subject, const Value& map, const std::string& key) {
  Diagnostics diagnostics;
  make_any(subject, map, diagnostics);
  const auto& messages = diagnostics.messages();
  require(std::any_of(messages.begin(), messages.end(),
                      [&](const std::string& text) { return text.find(key) != text.npos; }),
          "no complaint names '" + key + "'");
}

void refuse_unknown_keys(const Subject& subject, const std::vector<Slot>& slots) {
  ParamSpec unknown;
  unknown.key = kUnknown;
  require_complaint(subject, Slot{unknown, {}}.in_job(subject, Value::integer(1)), kUnknown);
  for (const Slot& slot : slots) {
    if (slot.spec.children.empty() || slot.spec.type == ParamType::Any) continue;
    std::vector<const ParamSpec*> groups = slot.groups;
    groups.push_back(&slot.spec);
    require_complaint(subject, Slot{unknown, groups}.in_job(subject, Value::integer(1)), kUnknown);
  }
}

void refuse_wrong_type(const Subject& subject, const Slot& slot) {
  if (slot.spec.type == ParamType::Any) return;
  Value odd = Value::make_map();
  odd.set("odd", Value::text("lots"));
  const bool takes_maps = slot.spec.type == ParamType::Group;
  require_complaint(subject, slot.in_job(subject, takes_maps ? Value::text("lots") : odd),
                    slot.spec.key);
}

void refuse_unknown_word(const Subject& subject, const Slot& slot) {
  if (slot.spec.type != ParamType::Choice) return;
  require_complaint(subject, slot.in_job(subject, Value::text("no_such_word")), slot.spec.key);
}

/// A value of the parameter's type whose numbers are all `number`; nothing for other types.
std::optional<Value> value_of(ParamType type, double number) {
  Value list = Value::make_list();
  switch (type) {
    case ParamType::Int:
    case ParamType::Number:
    case ParamType::OptionalNumber:
    case ParamType::Interval:
    case ParamType::Distribution:
    case ParamType::VectorDistribution:
    case ParamType::OptionalDistribution:
    case ParamType::OptionalVectorDistribution:
      return Value::number(number);
    case ParamType::NumberList:
      list.list = {Value::number(number)};
      return list;
    case ParamType::Vector:
      list.list.assign(3, Value::number(number));
      return list;
    default:
      return std::nullopt;
  }
}

void refuse_out_of_range(const Subject& subject, const Slot& slot) {
  for (const double bad : {slot.spec.min - 1.0, slot.spec.max + 1.0}) {
    // Infinite bounds, and those too large to be one less than anything.
    if (!std::isfinite(bad) || bad == slot.spec.max || bad == slot.spec.min) continue;
    const std::optional<Value> value = value_of(slot.spec.type, bad);
    if (value) require_complaint(subject, slot.in_job(subject, *value), slot.spec.key);
  }
}

/// Whoever copies a default into a job must not be refused.
void accept_default(const Subject& subject, const Slot& slot) {
  const bool has_parts = slot.spec.type == ParamType::Group || slot.spec.type == ParamType::List;
  if (has_parts || slot.spec.default_value.kind == Value::Kind::Null) return;
  Diagnostics diagnostics;
  const Value job = slot.in_job(subject, slot.spec.default_value);
  try {
    make_any(subject, job, diagnostics);
  } catch (const Error&) {
    return;  // it needs other keys as well, or the asset that it names
  }
  require(diagnostics.is_empty(),
          "refuses the default of '" + slot.spec.key +
              "': " + (diagnostics.is_empty() ? "" : diagnostics.messages().front()));
}

}  // namespace

bool check_parameters(const CheckRun& run, const Subject& subject) {
  const ComponentEntry& entry = subject.entry;
  std::vector<ParamSpec> specs;
  run.check("parameters are documented", [&] {
    specs = subject.registry.describe(entry.kind, entry.type);
    require(!entry.help.empty() && entry.help.back() == '.', "its help is no sentence");
    for (const ParamSpec& spec : specs) check_spec(spec);
    require_no_twins(specs);
  });
  const std::vector<Slot> slots = slots_of(specs);
  const bool is_made = run.check("defaults are valid", [&] {
    Value map = Value::make_map();
    map.set("type", Value::text(entry.type));
    Diagnostics diagnostics;
    const auto one = make_any(subject, map, diagnostics);
    const auto other = make_any(subject, map, diagnostics);
    diagnostics.raise();
  });
  run.check("defaults are within their ranges", [&] {
    for (const Slot& slot : slots) accept_default(subject, slot);
  });
  run.check("unknown keys are refused", [&] { refuse_unknown_keys(subject, slots); });
  run.check("wrong types are refused", [&] {
    for (const Slot& slot : slots) refuse_wrong_type(subject, slot);
  });
  run.check("unknown words are refused", [&] {
    for (const Slot& slot : slots) refuse_unknown_word(subject, slot);
  });
  run.check("values out of range are refused", [&] {
    for (const Slot& slot : slots) refuse_out_of_range(subject, slot);
  });
  return is_made;
}

}  // namespace diorama::conformance
