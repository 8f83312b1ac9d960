// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "diorama/component.h"
#include "diorama/plugin.h"

namespace diorama {

/// A component as its plugin file lists it.
struct ListedComponent {
  ComponentKind kind;
  std::string type;
  std::string help;
  std::vector<std::string> claims;  ///< Loaders: endings and schemes.
  friend bool operator==(const ListedComponent&, const ListedComponent&) = default;
};

/// What a plugin file says of itself, read without running any of its code.
struct PluginFile {
  std::filesystem::path file;
  DioramaPluginDescriptor descriptor{};
  std::string name;
  std::string version;
  std::string licence;
  /// Nothing when the plugin lists its components in code only; it must be loaded to know them.
  std::optional<std::vector<ListedComponent>> components;
};

/// Reads the file and checks that it was built for this host: magic, descriptor size, ABI number,
/// ABI tag, layout digest, texts. Throws Error(Plugin): file, what was found, what is required,
/// what to do.
PluginFile read_plugin_file(const std::filesystem::path& file);

}  // namespace diorama
