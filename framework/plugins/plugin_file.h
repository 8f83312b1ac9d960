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
  std::vector<std::string> claims;    ///< Loaders: what they claim; readers: patterns.
  std::vector<std::string> needs;     ///< Annotators: of the default parameters ...
  std::vector<std::string> provides;  ///< ... both.
  friend bool operator==(const ListedComponent&, const ListedComponent&) = default;
};

/// What a plugin file says of itself, read without running any of its code.
struct PluginFile {
  std::filesystem::path file;
  DioramaPluginDescriptor descriptor{};
  std::string name;
  std::string version;
  std::string licence;
  std::vector<ListedComponent> components;
  /// Registers more than it lists, or lists nothing; it must be loaded to know its components.
  bool learns_types = false;
};

/// What a component is registered with, in the words of a list.
ListedComponent listed(const ComponentInfo& info);

/// Reads the file and checks that it was built for this host: magic, descriptor size, ABI number,
/// ABI tag, digests of layout and headers, texts. Throws Error(Plugin): file, what was found, what
/// is required, what to do.
PluginFile read_plugin_file(const std::filesystem::path& file);

}  // namespace diorama
