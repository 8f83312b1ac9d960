// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nettle/sha2.h>

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>

namespace diorama {

/// SHA-256 (FIPS 180-4) of bytes that come in parts.
class Sha256 {
 public:
  Sha256() { sha256_init(&state_); }
  void add(std::span<const std::byte> bytes);
  /// 64 hex digits, as the program sha256sum prints them. Nothing may be added afterwards.
  std::string hex();

 private:
  sha256_ctx state_;
};

/// Of a file's content. Throws Error(Asset) that names the file when it cannot be read.
std::string file_sha256(const std::filesystem::path& file);

}  // namespace diorama
