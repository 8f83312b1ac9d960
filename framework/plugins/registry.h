// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "diorama/plugin.h"
#include "framework/host/log.h"
#include "framework/plugins/plugin_call.h"
#include "framework/plugins/plugin_library.h"
#include "framework/plugins/plugin_search.h"

namespace diorama {

/// A component type that jobs may name, and where it comes from.
struct ComponentEntry {
  ComponentKind kind;
  std::string type;
  std::string help;
  std::vector<std::string> claims;  ///< Of loaders and readers, when they are listed.
  bool claims_are_listed = false;
  std::vector<std::string> needs;     ///< Annotators: of the default parameters ...
  std::vector<std::string> provides;  ///< ... both.
  std::string plugin;                 ///< Name of the plugin; "diorama" for built-in components.
  std::string version;
  std::filesystem::path file;  ///< Empty for built-in components.
};

/// All component types of this process. Libraries are loaded when one of their components is first
/// described or made, and stay loaded. An empty registry is a valid one. Main thread only.
class Registry {
 public:
  /// Takes what the search found. A type that an earlier level already provides is passed over with
  /// an info message. A type that comes twice on one level is refused in both files: a warning
  /// names them, and making it is an error. Rejected files are reported once, as warnings.
  Registry(PluginSearch search, Log log);
  ~Registry();
  Registry(const Registry&) = delete;
  Registry& operator=(const Registry&) = delete;

  /// Components of the program itself; they rank below all plugins.
  void add_builtin(void (*register_components)(Registrar&), const std::string& version);

  /// Sorted by kind, then type.
  std::vector<ComponentEntry> components() const;
  const std::vector<RejectedPlugin>& rejected() const;
  const std::vector<SearchLevel>& levels() const;
  /// Plugins whose libraries were loaded so far: name and version, sorted.
  std::vector<std::pair<std::string, std::string>> loaded_plugins() const;

  /// Types of one kind that can be made, sorted.
  std::vector<std::string> types(ComponentKind kind) const;
  /// Throws Error(Plugin) for an unknown type, naming the nearest one, and for twice provided ones.
  const ComponentEntry& entry(ComponentKind kind, std::string_view type) const;
  bool has(ComponentKind kind, std::string_view type) const;
  /// Loads the plugin if need be. Throws like entry(), and what PluginLibrary throws.
  std::vector<ParamSpec> describe(ComponentKind kind, std::string_view type);

  /// Makes the component that `map` names with its key `type`; the other keys are parameters, those
  /// in `also_known` the caller's. `path` is where `map` stands in the job ("renderer",
  /// "writers[1]"). Bad parameters, a missing and an unknown type are added to `diagnostics`, and
  /// the result is null. Throws Error(Plugin) when the plugin is broken: it cannot be loaded,
  /// throws, returns null or something of another kind.
  template <class T>
  std::unique_ptr<T> make(const Value& map, const std::string& path,
                          std::span<const std::string_view> also_known, Diagnostics& diagnostics,
                          Host& host) {
    std::unique_ptr<Component> made =
        make_component(T::kKind, map, path, also_known, diagnostics, host);
    if (!made) return nullptr;
    T* typed = dynamic_cast<T*>(made.get());
    if (!typed) refuse_kind(T::kKind, map);
    made.release();
    return std::unique_ptr<T>(typed);
  }

 private:
  std::unique_ptr<Component> make_component(ComponentKind kind, const Value& map,
                                            const std::string& path,
                                            std::span<const std::string_view> also_known,
                                            Diagnostics& diagnostics, Host& host);
  [[noreturn]] void refuse_kind(ComponentKind kind, const Value& map) const;

  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace diorama
