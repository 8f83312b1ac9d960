// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "framework/app/options.h"

namespace diorama {

struct NewPluginOptions {
  std::string kind;           ///< As kind_name() has it.
  std::string name;           ///< Of the plugin, its component and its folder: "my_boxes".
  std::filesystem::path dir;  ///< Folder of the project; empty: the name, below the current one.
  std::string licence = "Apache-2.0";  ///< SPDX identifier of a licence among the templates.
};

/// `diorama new-plugin KIND NAME`: writes a project of its own that builds a plugin of this kind
/// against the installed SDK. Throws Error(Usage) for a bad kind, name or licence, and
/// Error(Output) when the folder is in use or cannot be written.
int command_new_plugin(const GlobalOptions& global, const NewPluginOptions& options);

/// Where the templates of this program are, in a build tree and installed alike.
std::filesystem::path template_folder(const std::filesystem::path& program);

}  // namespace diorama
