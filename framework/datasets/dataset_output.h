// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "diorama/host.h"
#include "diorama/writer.h"
#include "framework/output/output_store.h"

namespace diorama {

/// A writer of such an output, and the folder of this name that gets its files.
struct NamedWriter {
  std::string name;
  std::unique_ptr<Writer> writer;
};

OutputFolders output_folders_of(const std::filesystem::path& folder,
                                const std::vector<NamedWriter>& writers);

/// Where a dataset goes that is made of stored captures instead of rendered ones: the layout of a
/// run, with its promises. Main thread, but for what write() says.
class DatasetOutput {
 public:
  /// Nothing is written before open().
  DatasetOutput(const std::filesystem::path& folder, std::vector<NamedWriter> writers,
                int capture_count, bool overwrite);

  const std::vector<NamedWriter>& writers() const { return writers_; }

  /// Takes the folder, and writes what does not depend on captures.
  void open(const DatasetInfo& info, const std::string& dataset_json);
  using Take = std::function<void(Capture)>;
  /// Writes all captures that `give` hands to its argument, on several threads at a time; memory
  /// does not depend on how many there are. Throws what writers throw.
  void write(const std::function<void(const Take&)>& give, Host& host);
  /// What writers make of all captures. Only when all of them were written.
  void finish();
  void close();

 private:
  Transaction encode(const Capture& capture);

  std::vector<NamedWriter> writers_;
  LocalFileSystem file_system_;
  OutputStore store_;
};

}  // namespace diorama
