// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "framework/pipeline/job.h"
#include "framework/pipeline/job_keys.h"

namespace diorama {
namespace {

template <class Keys>
std::vector<ParamSpec> specs_of() {
  Keys keys;
  ParamLister lister;
  keys.visit(lister);
  return lister.take();
}

ParamSpec section(const char* key, ParamType type, const char* help,
                  std::vector<ParamSpec> children) {
  ParamSpec spec;
  spec.key = key;
  spec.type = type;
  spec.help = help;
  spec.default_value = type == ParamType::List ? Value::make_list() : Value::make_map();
  spec.children = std::move(children);
  return spec;
}

Value with_defaults(const Value& given, const std::vector<ParamSpec>& specs);

Value value_or_default(const Value* given, const ParamSpec& spec) {
  const bool is_given = given && given->kind != Value::Kind::Null;
  if (spec.type == ParamType::Group) {
    return with_defaults(is_given ? *given : Value::make_map(), spec.children);
  }
  if (!given) return spec.default_value;
  if (spec.type != ParamType::List || given->kind != Value::Kind::List) return *given;
  Value list = Value::make_list();
  for (const Value& item : given->list) list.list.push_back(with_defaults(item, spec.children));
  return list;
}

/// The declared keys in declared order, then what else is given.
Value with_defaults(const Value& given, const std::vector<ParamSpec>& specs) {
  if (given.kind != Value::Kind::Map) return given;
  Value result = Value::make_map();
  for (const ParamSpec& spec : specs) {
    result.set(spec.key, value_or_default(given.find(spec.key), spec));
  }
  for (const auto& [key, value] : given.map) {
    if (!result.find(key)) result.set(key, value);
  }
  return result;
}

void set_if_null(Value& map, const char* key, const Value& value) {
  const Value* now = map.find(key);
  const bool is_unset = !now || now->kind == Value::Kind::Null ||
                        (now->kind == Value::Kind::Scalar && now->scalar.empty());
  if (is_unset) map.set(key, value);
}

Value component(const Value& entry, ComponentKind kind, std::vector<ParamSpec> host_specs,
                const char* default_type, const DescribeComponent& describe) {
  Value map = entry.kind == Value::Kind::Map ? entry : Value::make_map();
  if (const Value* type = map.find("type"); type && type->kind == Value::Kind::Null) {
    map.set("type", Value::text("null"));
  }
  if (default_type) set_if_null(map, "type", Value::text(default_type));
  const Value* type = map.find("type");
  if (type) {
    if (auto own = describe(kind, type->scalar)) {
      host_specs.insert(host_specs.end(), own->begin(), own->end());
    }
  }
  return with_defaults(map, host_specs);
}

Value components(const Value& job, const char* section_name, ComponentKind kind,
                 const std::vector<ParamSpec>& host_specs, const DescribeComponent& describe) {
  Value list = Value::make_list();
  const Value* given = job.find(section_name);
  if (!given) return list;
  for (const Value& entry : given->list) {
    Value item = component(entry, kind, host_specs, nullptr, describe);
    if (const Value* type = item.find("type")) set_if_null(item, "name", *type);
    if (kind == ComponentKind::Writer) {
      if (const Value* name = item.find("name")) set_if_null(item, "output_dir", *name);
    }
    list.list.push_back(std::move(item));
  }
  return list;
}

template <class Group>
Value groups(const Value& job, const char* section_name, const char* default_name) {
  Value list = Value::make_list();
  const Value* given = job.find(section_name);
  if (!given) return list;
  const std::vector<ParamSpec> specs = specs_of<Group>();
  for (const Value& entry : given->list) {
    Value item = with_defaults(entry, specs);
    const Value* type = item.find("type");
    const Value name = default_name ? Value::text(default_name) : type ? *type : Value();
    set_if_null(item, "name", name);
    list.list.push_back(std::move(item));
  }
  return list;
}

Value simulation(const TimelineStep& step) {
  if (!step.until_rest) return Value::integer(step.steps);
  Value rest = Value::make_map();
  rest.set("until", Value::text("rest"));
  rest.set("at_least", Value::integer(step.at_least));
  rest.set("at_most", Value::integer(step.steps));
  return rest;
}

Value timeline(const Value& job) {
  const Value* given = job.find("timeline");
  if (given && given->kind != Value::Kind::Null) return *given;
  Value list = Value::make_list();
  for (const TimelineStep& step : default_timeline()) {
    Value item = Value::make_map();
    if (step.kind == TimelineStep::Kind::Simulate) {
      item.set("simulate", simulation(step));
    } else {
      item.set("capture", Value::text(step.name));
      item.set("count", Value::integer(step.count));
    }
    list.list.push_back(std::move(item));
  }
  return list;
}

Value section_or_empty(const Value& job, const char* key) {
  const Value* given = job.find(key);
  return given && given->kind == Value::Kind::Map ? *given : Value::make_map();
}

}  // namespace

Value resolved_job(const Value& job, const DescribeComponent& describe) {
  Value result = Value::make_map();
  for (const ParamSpec& spec : specs_of<detail::JobHead>()) {
    result.set(spec.key, value_or_default(job.find(spec.key), spec));
  }
  using Kind = ComponentKind;
  const auto heads = specs_of<detail::EntryHead>();
  const Value loaders = components(job, "loaders", Kind::Loader, heads, describe);
  if (!loaders.list.empty()) result.set("loaders", loaders);
  result.set("environments", components(job, "environments", Kind::Loader, heads, describe));
  result.set("environment",
             with_defaults(section_or_empty(job, "environment"), specs_of<EnvironmentRules>()));
  result.set("objects",
             components(job, "objects", Kind::Loader, specs_of<ObjectGroup>(), describe));
  result.set("lights", groups<LightGroup>(job, "lights", nullptr));
  result.set("cameras", groups<CameraGroup>(job, "cameras", "cam"));
  result.set("randomizers", components(job, "randomizers", Kind::Randomizer,
                                       specs_of<RandomizerEntry>(), describe));
  const auto engine = specs_of<detail::EngineHead>();
  result.set("physics", component(section_or_empty(job, "physics"), Kind::Physics, engine,
                                  kDefaultPhysics, describe));
  result.set("renderer", component(section_or_empty(job, "renderer"), Kind::Renderer, engine,
                                   kDefaultRenderer, describe));
  const Value annotators = components(job, "annotators", Kind::Annotator, heads, describe);
  if (!annotators.list.empty()) result.set("annotators", annotators);
  result.set("timeline", timeline(job));
  result.set("settle", with_defaults(section_or_empty(job, "settle"), specs_of<SettleSection>()));
  if (const Value* views = job.find("views"); views && !views->list.empty()) {
    Value list = Value::make_list();
    for (const Value& entry : views->list) {
      Value rule = with_defaults(entry, specs_of<ViewRule>());
      set_if_null(rule, "name", Value::text("views_" + std::to_string(list.list.size())));
      list.list.push_back(std::move(rule));
    }
    result.set("views", list);
  }
  result.set("writers",
             components(job, "writers", Kind::Writer, specs_of<WriterEntry>(), describe));
  result.set("output", with_defaults(section_or_empty(job, "output"), specs_of<OutputSection>()));
  return result;
}

std::vector<ParamSpec> job_specs() {
  std::vector<ParamSpec> specs = specs_of<detail::JobHead>();
  const auto head = specs_of<detail::EntryHead>();
  const auto engine = specs_of<detail::EngineHead>();
  specs.push_back(section("loaders", ParamType::List,
                          "Parameters of the loaders that read the job's files.", head));
  specs.push_back(
      section("environments", ParamType::List, "Loaders whose assets are visited in turn.", head));
  specs.push_back(section("environment", ParamType::Group, "Rules for what was loaded.",
                          specs_of<EnvironmentRules>()));
  specs.push_back(section("objects", ParamType::List, "What is spawned in every visit.",
                          specs_of<ObjectGroup>()));
  specs.push_back(section("lights", ParamType::List, "Lights.", specs_of<LightGroup>()));
  specs.push_back(section("cameras", ParamType::List, "Cameras.", specs_of<CameraGroup>()));
  specs.push_back(section("randomizers", ParamType::List, "What varies, and when.",
                          specs_of<RandomizerEntry>()));
  specs.push_back(section("physics", ParamType::Group, "The physics engine.", engine));
  specs.push_back(section("renderer", ParamType::Group, "The renderer.", engine));
  specs.push_back(section("annotators", ParamType::List,
                          "Annotators whose channels replace the renderer's, such as sensors, and "
                          "parameters of others.",
                          head));
  specs.push_back(section("timeline", ParamType::List, "What happens in a visit, in order.",
                          specs_of<detail::StepKeys>()));
  specs.push_back(
      section("settle", ParamType::Group, "How objects come to rest.", specs_of<SettleSection>()));
  specs.push_back(section("views", ParamType::List,
                          "What pictures have to show; views that do not are drawn anew before "
                          "they are rendered.",
                          specs_of<ViewRule>()));
  specs.push_back(section("writers", ParamType::List, "What is written.", specs_of<WriterEntry>()));
  specs.push_back(
      section("output", ParamType::Group, "Where it is written.", specs_of<OutputSection>()));
  return specs;
}

}  // namespace diorama
