// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "framework/datasets/dataset_readers.h"
#include "plugins/writer_support/memory_files.h"
#include "writer_basic/basic_writer.h"

namespace diorama::test {

/// BasicWriter with every annotator on.
BasicWriter::Params everything();

/// One way to write a dataset.
struct SampleFormat {
  std::string name;  ///< Of a folder.
  std::function<MemoryFiles(Host&, const DatasetInfo&, const std::vector<const Capture*>&)> write;
};

/// Every writer, with the parameters that change what is in its files.
std::vector<SampleFormat> every_format();

/// Writers of clips: captures are frames of some.
std::vector<SampleFormat> formats_of_clips();

/// The sample's captures as the frames of one clip, ten per second.
struct SampleClip {
  DatasetInfo dataset;
  std::vector<Capture> frames;

  std::vector<const Capture*> captures() const;
};
SampleClip sample_clip();

/// The readers of all formats that have one. The host must outlive them.
DatasetReaders every_reader(Host& host);

}  // namespace diorama::test
