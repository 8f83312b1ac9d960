// SPDX-License-Identifier: Apache-2.0
#include "framework/host/replace_file.h"

#include <unistd.h>

#include <cerrno>
#include <fstream>
#include <string>
#include <system_error>

#include "diorama/error.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail(const fs::path& file, const std::string& why) {
  throw Error(ErrorKind::Output, file.string() + ": cannot be written: " + why);
}

}  // namespace

void replace_file(const fs::path& file, std::span<const std::byte> bytes) {
  const fs::path part = file.string() + "." + std::to_string(::getpid()) + ".part";
  std::error_code error;
  std::ofstream out(part, std::ios::binary);
  out.write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
  out.close();
  if (!out) {
    const std::string why = std::system_category().message(errno);
    fs::remove(part, error);
    fail(file, why);
  }
  fs::rename(part, file, error);
  if (!error) return;
  std::error_code ignored;
  fs::remove(part, ignored);
  fail(file, error.message());
}

}  // namespace diorama
