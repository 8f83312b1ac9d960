// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace diorama::loader_assimp {

/// The files that a model consists of as far as they are there: itself, what assimp opens to read
/// it (material libraries, buffers) and the pictures that its materials name. Sorted but for the
/// first. Read in a child process, as by SceneFile. Throws Error(Asset) that begins with the file's
/// name.
std::vector<std::filesystem::path> files_of(const std::string& file);

}  // namespace diorama::loader_assimp
