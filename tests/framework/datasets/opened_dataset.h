// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "framework/datasets/dataset_readers.h"
#include "framework/lint/encoding_host.h"
#include "framework/lint/every_format.h"
#include "framework/lint/lint_dataset.h"
#include "support/catch.h"
#include "support/temporary_folder.h"

namespace diorama::test {

/// The dataset as its reader sees it, found by what it looks like; lint must find nothing.
struct OpenedDataset {
  EncodingHost host;
  DatasetReaders readers = every_reader(host);
  std::unique_ptr<const StoredDataset> dataset;

  OpenedDataset(const TemporaryFolder& folder, const std::string& type) {
    REQUIRE(readers.recognise(folder.path("")) == type);
    dataset = readers.open(folder.path(""), type);
    const LintReport report = lint_datasets(folder.path(""), readers, host).at(0);
    INFO(lint_text(report, 20));
    CHECK(report.findings.empty());
  }
  StoredCapture read(std::size_t i) const { return dataset->read(i, dataset->info().holds); }
  bool holds(std::string_view name) const { return dataset->info().holds.contains(name); }
};

inline LintReport lint(const TemporaryFolder& folder) {
  EncodingHost host;
  DatasetReaders readers = every_reader(host);
  return lint_datasets(folder.path(""), readers, host).at(0);
}

/// The content of a picture's file.
inline std::string encoded(const ImageView& image, ImageFormat format = ImageFormat::Png) {
  const auto bytes = EncodingHost().encode_image(image, format);
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

}  // namespace diorama::test
