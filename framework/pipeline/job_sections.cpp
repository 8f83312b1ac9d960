// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/job_sections.h"

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

Value simulation(const TimelineStep& step) {
  if (!step.until_rest) return Value::integer(step.steps);
  Value rest = Value::make_map();
  rest.set("until", Value::text("rest"));
  rest.set("at_least", Value::integer(step.at_least));
  rest.set("at_most", Value::integer(step.steps));
  return rest;
}

Value timeline_of_defaults() {
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

using Kind = ComponentKind;
using detail::EngineHead;
using detail::EntryHead;

constexpr JobSection kSections[] = {
    {.key = "loaders",
     .type = ParamType::List,
     .help = "Parameters of the loaders that read the job's files.",
     .keys = specs_of<EntryHead>,
     .kind = Kind::Loader,
     .default_name = "",
     .is_left_out_when_empty = true},
    {.key = "environments",
     .type = ParamType::List,
     .help = "Loaders whose assets are visited in turn.",
     .keys = specs_of<EntryHead>,
     .kind = Kind::Loader,
     .default_name = ""},
    {.key = "environment",
     .type = ParamType::Group,
     .help = "Rules for what was loaded.",
     .keys = specs_of<EnvironmentRules>},
    {.key = "objects",
     .type = ParamType::List,
     .help = "What is spawned in every visit.",
     .keys = specs_of<ObjectGroup>,
     .kind = Kind::Loader,
     .default_name = ""},
    {.key = "lights",
     .type = ParamType::List,
     .help = "Lights.",
     .keys = specs_of<LightGroup>,
     .default_name = ""},
    {.key = "cameras",
     .type = ParamType::List,
     .help = "Cameras.",
     .keys = specs_of<CameraGroup>,
     .default_name = "cam"},
    {.key = "randomizers",
     .type = ParamType::List,
     .help = "What varies, and when.",
     .keys = specs_of<RandomizerEntry>,
     .kind = Kind::Randomizer,
     .default_name = ""},
    {.key = "physics",
     .type = ParamType::Group,
     .help = "The physics engine.",
     .keys = specs_of<EngineHead>,
     .kind = Kind::Physics,
     .default_type = kDefaultPhysics},
    {.key = "renderer",
     .type = ParamType::Group,
     .help = "The renderer.",
     .keys = specs_of<EngineHead>,
     .kind = Kind::Renderer,
     .default_type = kDefaultRenderer},
    {.key = "annotators",
     .type = ParamType::List,
     .help = "Annotators whose channels replace the renderer's, such as sensors, and parameters of "
             "others.",
     .keys = specs_of<EntryHead>,
     .kind = Kind::Annotator,
     .default_name = "",
     .is_left_out_when_empty = true},
    {.key = "timeline",
     .type = ParamType::List,
     .help = "What happens in a visit, in order.",
     .keys = specs_of<detail::StepKeys>,
     .when_absent = timeline_of_defaults},
    {.key = "settle",
     .type = ParamType::Group,
     .help = "How objects come to rest.",
     .keys = specs_of<SettleSection>},
    {.key = "views",
     .type = ParamType::List,
     .help = "What pictures have to show; views that do not are drawn anew before they are "
             "rendered.",
     .keys = specs_of<ViewRule>,
     .default_name = "views_#",
     .is_left_out_when_empty = true},
    {.key = "writers",
     .type = ParamType::List,
     .help = "What is written.",
     .keys = specs_of<WriterEntry>,
     .kind = Kind::Writer,
     .default_name = ""},
    {.key = "output",
     .type = ParamType::Group,
     .help = "Where it is written.",
     .keys = specs_of<OutputSection>},
};

}  // namespace

std::span<const JobSection> job_sections() { return kSections; }

const JobSection* job_section(std::string_view key) {
  const auto found = std::ranges::find_if(
      kSections, [&](const JobSection& section) { return section.key == key; });
  return found == std::end(kSections) ? nullptr : &*found;
}

const std::vector<ParamSpec>& plain_job_keys() {
  static const std::vector<ParamSpec> keys = specs_of<detail::JobHead>();
  return keys;
}

}  // namespace diorama
