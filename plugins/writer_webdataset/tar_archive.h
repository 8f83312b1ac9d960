// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>

#include "diorama/writer.h"

namespace diorama {

/// A tar archive that grows in a dataset: POSIX ustar, plain files of mode 644, owner and time 0,
/// so that the same files give the same bytes.
class TarArchive {
 public:
  TarArchive(DatasetFiles& files, std::string path) : files_(files), path_(std::move(path)) {}

  /// The parts are one after the other the file's content. Throws Error(Output) when the name is
  /// longer than 100 bytes or the file larger than 8 GiB.
  void add(std::string_view name, std::span<const std::span<const std::byte>> parts);
  void add(std::string_view name, std::span<const std::byte> content);
  void add(std::string_view name, std::string_view content);
  void end();

 private:
  DatasetFiles& files_;
  std::string path_;
};

}  // namespace diorama
