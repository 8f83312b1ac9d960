// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <string>
#include <vector>

#include "diorama/host.h"
#include "diorama/reader.h"
#include "framework/plugins/plugin_call.h"

namespace diorama {

/// How many results of a sweep are in memory, for each thread: threads wait for the slowest at the
/// end of so many captures.
inline constexpr std::size_t kResultsWithPixels = 4;
inline constexpr std::size_t kSmallResults = 64;

/// Reads all captures of a dataset on the host's threads, some at a time. `work` makes a result of
/// each on the thread that has read it; `collect` gets the results in order on the calling thread.
/// Rethrows the first error, by capture.
template <class Result, class Work, class Collect>
void sweep_captures(const StoredDataset& dataset, const NameSet& wanted, Host& host, Work&& work,
                    Collect&& collect, std::size_t results_per_thread = kResultsWithPixels) {
  const std::size_t count = dataset.info().captures.size();
  const std::size_t at_once = results_per_thread * std::size_t(std::max(host.thread_count(), 1));
  const std::string who = "reader of " + dataset.info().format;
  std::vector<Result> results;
  for (std::size_t first = 0; first < count; first += at_once) {
    results.clear();
    results.resize(std::min(at_once, count - first));
    host.parallel_for(results.size(), [&](std::size_t i) {
      results[i] = work(call_component(who, [&] { return dataset.read(first + i, wanted); }));
    });
    for (Result& result : results) collect(std::move(result));
  }
}

}  // namespace diorama
