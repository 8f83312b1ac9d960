// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace diorama {

/// The named sections of a shared library for this machine, read from the file without running
/// anything in it; sections that are not there are left out. Throws Error(Plugin) with a reason
/// that begins with the file: not readable, not ELF, 32 bit, other byte order, other processor, not
/// a shared library, damaged.
std::map<std::string, std::vector<std::byte>, std::less<>> read_elf_sections(
    const std::filesystem::path& file, const std::vector<std::string_view>& names);

}  // namespace diorama
