// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "plugins/writer_support/fake_host.h"
#include "plugins/writer_support/memory_files.h"
#include "plugins/writer_support/sample_capture.h"

namespace diorama::test {

/// Three captures of the sample by two cameras; the captures differ in the crate's place. Rendered
/// once per process.
const std::vector<Capture>& sample_captures();

/// What a writer of type W makes of sample_captures(). Parameters that choose the validation share
/// are the writer's defaults.
template <class W>
MemoryFiles write_sample(typename W::Params params, Host& host) {
  W writer(std::move(params), host);
  std::vector<const Capture*> captures;
  for (const Capture& capture : sample_captures()) captures.push_back(&capture);
  return write_dataset(writer, sample_dataset(SampleScene(8, 6)), captures);
}

/// "train" or "val" as dataset.json has it.
std::string split_of(const MemoryFiles& files, int capture);

/// By node path; throws when it is not there.
const Instance& instance_at(const Frame& frame, const std::string& path);

/// Pixels of an instance.
std::int64_t visible_count(const Frame& frame, const Instance& instance);

}  // namespace diorama::test
