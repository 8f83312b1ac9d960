// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/sha256.h"

#include <unistd.h>

#include <fstream>
#include <string_view>

#include "diorama/error.h"
#include "support/catch.h"

using namespace diorama;

namespace {

std::string hash_of(std::string_view text) {
  Sha256 hash;
  hash.add(std::as_bytes(std::span(text)));
  return hash.hex();
}

}  // namespace

TEST_CASE("SHA-256 gives the values of its standard", "[sha256]") {
  CHECK(hash_of("") == "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  CHECK(hash_of("abc") == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  CHECK(hash_of("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq") ==
        "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
  CHECK(hash_of(std::string(1000000, 'a')) ==
        "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
}

TEST_CASE("the parts in which bytes come do not matter", "[sha256]") {
  std::string text;
  for (int i = 0; i < 500; ++i) text += char(i * 7);
  for (const std::size_t part : {1u, 55u, 63u, 64u, 65u, 200u}) {
    Sha256 hash;
    for (std::size_t at = 0; at < text.size(); at += part) {
      hash.add(std::as_bytes(std::span(text)).subspan(at, std::min(part, text.size() - at)));
    }
    CHECK(hash.hex() == hash_of(text));
  }
}

TEST_CASE("a file's hash is that of its content, a missing file is named", "[sha256]") {
  const auto file =
      std::filesystem::temp_directory_path() / ("diorama_sha256_" + std::to_string(::getpid()));
  std::ofstream(file, std::ios::binary) << "abc";
  CHECK(file_sha256(file) == hash_of("abc"));
  std::filesystem::remove(file);
  CHECK_THROWS_WITH(file_sha256(file),
                    ContainsSubstring(file.filename().string() + ": cannot be read"));
}
