// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include "diorama/plugin.h"
#include "framework/plugins/plugin_file.h"

namespace diorama {

/// A plugin's code in memory. It stays mapped until the process ends, whatever happens to this
/// object: exceptions, deleters and functions that came from it remain valid.
class PluginLibrary {
 public:
  /// Loads with all symbols resolved and none exported to others. The file must have passed
  /// read_plugin_file(). Throws Error(Plugin): missing libraries or symbols, no entry function, a
  /// descriptor in memory that differs from the one in the file, errors while registering,
  /// component names that are not allowed or differ from the listed ones.
  explicit PluginLibrary(const PluginFile& file);
  ~PluginLibrary();
  PluginLibrary(PluginLibrary&&) noexcept;

  const std::vector<ComponentInfo>& components() const { return components_; }

 private:
  struct Handle;
  std::unique_ptr<Handle> handle_;
  std::vector<ComponentInfo> components_;
};

}  // namespace diorama
