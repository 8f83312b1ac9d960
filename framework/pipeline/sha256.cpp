// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/sha256.h"

#include <nettle/base16.h>

#include <array>
#include <cstdint>
#include <fstream>
#include <vector>

#include "diorama/error.h"
#include "framework/host/regular_file.h"

namespace diorama {

void Sha256::add(std::span<const std::byte> bytes) {
  sha256_update(&state_, bytes.size(), reinterpret_cast<const std::uint8_t*>(bytes.data()));
}

std::string Sha256::hex() {
  std::array<std::uint8_t, SHA256_DIGEST_SIZE> digest;
  sha256_digest(&state_, digest.size(), digest.data());
  std::string text(BASE16_ENCODE_LENGTH(digest.size()), '\0');
  base16_encode_update(text.data(), digest.size(), digest.data());
  return text;
}

std::string file_sha256(const std::filesystem::path& file) {
  std::ifstream stream = open_regular_file(file);
  std::vector<char> block(std::size_t(1) << 18);
  Sha256 hash;
  while (stream.read(block.data(), std::streamsize(block.size())) || stream.gcount() > 0) {
    hash.add(std::as_bytes(std::span(block.data(), std::size_t(stream.gcount()))));
  }
  if (stream.bad() || !stream.eof()) {
    throw Error(ErrorKind::Asset, file.string() + ": cannot be read as a regular file");
  }
  return hash.hex();
}

}  // namespace diorama
