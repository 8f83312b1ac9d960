// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

namespace diorama {

/// Where libraries of the program lie that it maps when it needs them: <build>/on_demand in a build
/// tree, else beside the folder of the bundled plugins.
std::filesystem::path on_demand_folder(const std::filesystem::path& program);

/// The program whose libraries those are: that of the process unless somebody embeds the engine.
/// Before anything is mapped.
void use_on_demand_libraries_of(const std::filesystem::path& program);

/// A function of the program's own library NAME.so, which is mapped and stays so. Throws
/// Error(Plugin) with the reason when the library is not there or lacks others. Several threads may
/// call it.
void* on_demand_function(const std::string& name, const char* function);

}  // namespace diorama
