// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <string_view>
#include <vector>

namespace diorama {

/// A tar archive in memory: POSIX ustar, plain files of mode 644, owner and time 0, so that the
/// same files give the same bytes.
class TarArchive {
 public:
  /// Throws Error(Output) when the name is longer than 100 bytes or the file larger than 8 GiB.
  void add(std::string_view name, std::span<const std::byte> content);
  void add(std::string_view name, std::string_view content);
  /// Closes the archive and hands it over.
  std::vector<std::byte> take();

 private:
  std::vector<std::byte> bytes_;
};

}  // namespace diorama
