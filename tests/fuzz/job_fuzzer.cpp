// SPDX-License-Identifier: Apache-2.0
//
// One input is one job file: parsed, printed, parsed again, read as a native job and planned.
// Refusing is fine; crashing, hanging, taking much memory, and texts that do not mean the same
// again are findings.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <string_view>

#include "diorama/error.h"
#include "framework/config/job_overrides.h"
#include "framework/config/value_text.h"
#include "framework/config/yaml_config.h"
#include "framework/pipeline/capture_plan.h"
#include "framework/pipeline/job.h"

namespace {

using namespace diorama;

void plan(const Value& value) {
  Diagnostics diagnostics;
  const Job job = read_job(value, diagnostics);
  if (!diagnostics.is_empty()) return;
  std::size_t objects = 0;
  for (const ObjectGroup& group : job.objects) objects += std::size_t(group.count);
  if (objects > 1000) return;
  const std::vector<std::string> assets{"/a/011_banana.usd", "/a/caf\xE9.usd"};
  const CapturePlan planned =
      plan_captures(job, {{"room", 0}, {"hall", 0}}, {job.objects.size(), assets});
  if (planned.capture_count() == 0) return;
  const PlannedVisit last = planned.visit(planned.visit_count() - 1);
  const int end = last.first_capture + last.capture_count;
  if (end != planned.capture_count() || planned.capture(end - 1).index != end - 1) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  try {
    Value value = parse_yaml(text, "job.yaml");
    const std::string printed = to_yaml(value);
    if (to_yaml(parse_yaml(printed, "again.yaml")) != printed) std::abort();
    parse_yaml(to_json(value, 1), "job.json");
    plan(value);
    if (value.kind != Value::Kind::Map) return 0;
    const std::size_t line = text.find('\n');
    if (line != std::string_view::npos) apply_set(value, text.substr(0, line));
  } catch (const Error& error) {
    const bool is_told = error.kind() == ErrorKind::Config || error.kind() == ErrorKind::Usage;
    if (!is_told) std::abort();
  }
  return 0;
}
