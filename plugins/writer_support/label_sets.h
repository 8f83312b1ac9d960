// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "diorama/frame.h"
#include "diorama/writer.h"
#include "writer_support/python_json.h"
#include "writer_support/semantic_filter.h"

namespace diorama {

/// An instance whose labels count.
struct FilteredInstance {
  const Instance* instance = nullptr;
  Labels labels;  ///< Those that passed the filter; never empty.
};

/// In the order of Frame::instances. Pointers into `frame`.
std::vector<FilteredInstance> filtered_instances(const Frame& frame, const SemanticFilter& filter);

/// Numbers label sets from `first` on: those that the dataset knows in sorted order, then others
/// that this capture holds, sorted too. So the known ones have one id in the whole dataset.
std::map<Labels, std::uint32_t> number_label_sets(const std::vector<Labels>& known,
                                                  const Capture& capture,
                                                  const SemanticFilter& filter,
                                                  std::uint32_t first);

/// {"class": "banana"}.
Json labels_json(const Labels& labels);

}  // namespace diorama
