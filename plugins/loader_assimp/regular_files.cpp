// SPDX-License-Identifier: Apache-2.0
#include "loader_assimp/regular_files.h"

#include <filesystem>
#include <system_error>

namespace diorama::loader_assimp {
namespace {

bool is_regular(const char* file) {
  std::error_code failed;
  return std::filesystem::is_regular_file(file, failed);
}

}  // namespace

bool RegularFiles::Exists(const char* file) const {
  return is_regular(file) && DefaultIOSystem::Exists(file);
}

Assimp::IOStream* RegularFiles::Open(const char* file, const char* mode) {
  return is_regular(file) ? DefaultIOSystem::Open(file, mode) : nullptr;
}

}  // namespace diorama::loader_assimp
