// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <fstream>

namespace diorama {

/// Opens a file for reading, bytes as they are. Pipes and devices are not opened: whoever reads
/// them waits, or finds no end. What comes back is then not good, errno EINVAL.
std::ifstream open_regular_file(const std::filesystem::path& file);

}  // namespace diorama
