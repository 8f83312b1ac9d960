// SPDX-License-Identifier: Apache-2.0
#include "framework/host/regular_file.h"

#include <cerrno>
#include <system_error>

namespace diorama {

std::ifstream open_regular_file(const std::filesystem::path& file) {
  std::error_code failed;
  const std::filesystem::file_status status = std::filesystem::status(file, failed);
  if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status)) {
    std::ifstream refused;
    refused.setstate(std::ios::failbit);
    errno = EINVAL;
    return refused;
  }
  return std::ifstream(file, std::ios::binary);
}

}  // namespace diorama
