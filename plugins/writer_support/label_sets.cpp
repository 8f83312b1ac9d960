// SPDX-License-Identifier: Apache-2.0
#include "writer_support/label_sets.h"

#include <set>

namespace diorama {

std::vector<FilteredInstance> filtered_instances(const Frame& frame, const SemanticFilter& filter) {
  std::vector<FilteredInstance> result;
  for (const Instance& instance : frame.instances) {
    Labels labels = filter.apply(instance.labels);
    if (!labels.empty()) result.push_back({&instance, std::move(labels)});
  }
  return result;
}

std::map<Labels, std::uint32_t> number_label_sets(const std::vector<Labels>& known,
                                                  const Capture& capture,
                                                  const SemanticFilter& filter,
                                                  std::uint32_t first) {
  std::set<Labels> known_sets;
  for (const Labels& labels : known) {
    Labels kept = filter.apply(labels);
    if (!kept.empty()) known_sets.insert(std::move(kept));
  }
  std::set<Labels> other_sets;
  for (const Frame& frame : capture.frames) {
    for (const FilteredInstance& filtered : filtered_instances(frame, filter)) {
      if (!known_sets.contains(filtered.labels)) other_sets.insert(filtered.labels);
    }
  }
  std::map<Labels, std::uint32_t> ids;
  for (const auto* sets : {&known_sets, &other_sets}) {
    for (const Labels& labels : *sets) ids.emplace(labels, first++);
  }
  return ids;
}

Json labels_json(const Labels& labels) {
  Json json = Json::object();
  for (const auto& [type, label] : labels) json[type] = label;
  return json;
}

}  // namespace diorama
