// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdlib>
#include <filesystem>
#include <optional>

namespace diorama::test {

/// The folder of real third-party files beside the repository, or nothing where it is absent: then
/// a test says so (WARN) and returns. DIORAMA_SHARED_DATA overrides the place.
inline std::optional<std::filesystem::path> shared_folder() {
  const char* chosen = std::getenv("DIORAMA_SHARED_DATA");
  const std::filesystem::path folder = chosen ? chosen : DIORAMA_SOURCE_DIR "/../shared";
  if (!std::filesystem::is_directory(folder)) return std::nullopt;
  return std::filesystem::weakly_canonical(folder);
}

}  // namespace diorama::test
