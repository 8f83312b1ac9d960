// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

namespace diorama {

/// A new folder among the temporary files (in TMPDIR, or in /tmp) that nobody else can read. It is
/// removed with the object.
class ScratchFolder {
 public:
  /// The folder's name begins with "diorama_" and `purpose`. Throws Error(Output) when the folder
  /// cannot be made, or when there is no space for small files in it.
  explicit ScratchFolder(const std::string& purpose);
  ~ScratchFolder();
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace diorama
