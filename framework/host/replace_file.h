// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>

namespace diorama {

/// Creates or replaces a single file as a whole: who looks meanwhile sees the old one or the new
/// one, and nothing is left of one that fails. Its folder must exist. Throws Error(Output) that
/// names the file and the system's reason.
void replace_file(const std::filesystem::path& file, std::span<const std::byte> bytes);

}  // namespace diorama
