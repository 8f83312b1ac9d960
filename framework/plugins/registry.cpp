// SPDX-License-Identifier: Apache-2.0
#include "framework/plugins/registry.h"

#include <algorithm>
#include <map>
#include <set>
#include <tuple>

#include "framework/config/joined.h"

namespace diorama {
namespace {

std::string titled(ComponentKind kind, std::string_view type) {
  return std::string(kind_name(kind)) + " '" + std::string(type) + "'";
}

/// Collects the components of the program itself.
class BuiltinCollector final : public Registrar {
 public:
  void add(const ComponentInfo& info) override { components.push_back(info); }
  std::vector<ComponentInfo> components;
};

}  // namespace

struct Registry::State {
  /// One file, or the program itself (`file` empty); `library` is there once it was needed.
  struct Source {
    PluginFile plugin;
    std::unique_ptr<PluginLibrary> library;
    std::vector<ComponentInfo> builtin;
  };
  struct Known {
    ComponentEntry entry;
    std::size_t source = 0;
    int level = 0;
    std::string conflict;  // not empty: two files of one level provide it
  };
  using Key = std::pair<ComponentKind, std::string>;

  PluginSearch search;
  Log log;
  // Libraries are never unloaded, so the order of destruction does not matter to components.
  std::vector<Source> sources;
  std::map<Key, Known> known;

  void take_plugins();
  void take(const ListedComponent& listed, std::size_t source, int level);
  std::vector<ListedComponent> components_of(Source& source);
  PluginLibrary& library(Source& source);
  const Known& require(ComponentKind kind, std::string_view type) const;
  const ComponentInfo& info(ComponentKind kind, std::string_view type);
  void reject(const std::filesystem::path& file, const std::string& reason);
};

void Registry::State::reject(const std::filesystem::path& file, const std::string& reason) {
  search.rejected.push_back({file, reason});
}

PluginLibrary& Registry::State::library(Source& source) {
  if (!source.library) {
    source.library = std::make_unique<PluginLibrary>(source.plugin);
    log(LogLevel::Debug, "loaded " + source.plugin.file.string());
  }
  return *source.library;
}

std::vector<ListedComponent> Registry::State::components_of(Source& source) {
  if (!source.plugin.learns_types) return source.plugin.components;
  std::vector<ListedComponent> components;
  for (const ComponentInfo& info : library(source).components()) {
    components.push_back(listed(info));
  }
  return components;
}

void Registry::State::take_plugins() {
  for (FoundPlugin& found : search.plugins) {
    sources.push_back({found.plugin, nullptr, {}});
    try {
      for (const ListedComponent& listed : components_of(sources.back())) {
        take(listed, sources.size() - 1, found.level);
      }
    } catch (const Error& error) {
      reject(found.plugin.file, error.what());
    }
  }
}

void Registry::State::take(const ListedComponent& listed, std::size_t source, int level) {
  const PluginFile& plugin = sources[source].plugin;
  const auto [at, is_new] = known.try_emplace({listed.kind, listed.type});
  Known& component = at->second;
  if (is_new) {
    // Who registers a loader without DIORAMA_ADD_LOADER may have claims all the same.
    const bool claims_are_listed = !plugin.learns_types || !listed.claims.empty();
    component.entry = {listed.kind,       listed.type,  listed.help,     listed.claims,
                       claims_are_listed, listed.needs, listed.provides, plugin.name,
                       plugin.version,    plugin.file};
    component.source = source;
    component.level = level;
    return;
  }
  const std::string what = titled(listed.kind, listed.type);
  const std::string first = component.entry.file.string();
  if (component.level != level) {
    log(LogLevel::Info, what + ": " + first + " comes before " + plugin.file.string());
    return;
  }
  component.conflict = what + " is provided by two plugins of the same rank, " + first + " and " +
                       plugin.file.string() + "; remove one of them";
  reject(plugin.file, plugin.file.string() + ": " + component.conflict);
}

const Registry::State::Known& Registry::State::require(ComponentKind kind,
                                                       std::string_view type) const {
  const auto found = known.find({kind, std::string(type)});
  if (found != known.end()) {
    if (!found->second.conflict.empty()) throw Error(ErrorKind::Plugin, found->second.conflict);
    return found->second;
  }
  std::vector<std::string> names;
  for (const auto& [key, component] : known) {
    if (key.first == kind) names.push_back(key.second);
  }
  const std::string name(kind_name(kind));
  if (names.empty()) {
    throw Error(ErrorKind::Plugin,
                "no " + name + " '" + std::string(type) + "': no " + name +
                    " plugin was found; 'diorama plugins' shows where was looked");
  }
  const std::string near = nearest_name(type, names);
  throw Error(ErrorKind::Plugin, "unknown " + titled(kind, type) +
                                     (near.empty() ? "." : ", did you mean '" + near + "'?") +
                                     " There is: " + joined(names));
}

const ComponentInfo& Registry::State::info(ComponentKind kind, std::string_view type) {
  Source& source = sources[require(kind, type).source];
  const std::vector<ComponentInfo>& infos =
      source.plugin.file.empty() ? source.builtin : library(source).components();
  const auto found = std::find_if(infos.begin(), infos.end(), [&](const ComponentInfo& info) {
    return info.kind == kind && info.type == type;
  });
  if (found == infos.end()) {
    throw Error(ErrorKind::Internal, titled(kind, type) + " is known, but not registered");
  }
  return *found;
}

Registry::Registry(PluginSearch search, Log log) : state_(std::make_unique<State>()) {
  state_->search = std::move(search);
  state_->log = std::move(log);
  state_->take_plugins();
}

Registry::~Registry() = default;

void Registry::add_builtin(void (*register_components)(Registrar&), const std::string& version) {
  BuiltinCollector collector;
  register_components(collector);
  PluginFile program;
  program.name = "diorama";
  program.version = version;
  program.learns_types = true;
  state_->sources.push_back({program, nullptr, collector.components});
  for (const ComponentInfo& info : collector.components) {
    state_->take(listed(info), state_->sources.size() - 1, int(state_->search.levels.size()));
  }
}

std::vector<ComponentEntry> Registry::components() const {
  std::vector<ComponentEntry> entries;
  for (const auto& [key, component] : state_->known) entries.push_back(component.entry);
  return entries;
}

const std::vector<RejectedPlugin>& Registry::rejected() const { return state_->search.rejected; }
const std::vector<SearchLevel>& Registry::levels() const { return state_->search.levels; }

std::vector<std::pair<std::string, std::string>> Registry::loaded_plugins() const {
  std::set<std::pair<std::string, std::string>> loaded;
  for (const State::Source& source : state_->sources) {
    if (source.library) loaded.emplace(source.plugin.name, source.plugin.version);
  }
  return {loaded.begin(), loaded.end()};
}

std::vector<std::string> Registry::types(ComponentKind kind) const {
  std::vector<std::string> types;
  for (const auto& [key, component] : state_->known) {
    if (key.first == kind && component.conflict.empty()) types.push_back(key.second);
  }
  return types;
}

bool Registry::has(ComponentKind kind, std::string_view type) const {
  return state_->known.contains({kind, std::string(type)});
}

const ComponentEntry& Registry::entry(ComponentKind kind, std::string_view type) const {
  return state_->require(kind, type).entry;
}

std::vector<ParamSpec> Registry::describe(ComponentKind kind, std::string_view type) {
  const ComponentInfo& info = state_->info(kind, type);
  return call_component(titled(kind, type), [&] { return info.describe(info.context); });
}

std::unique_ptr<Component> Registry::make_component(ComponentKind kind, const Value& map,
                                                    const std::string& path,
                                                    std::span<const std::string_view> also_known,
                                                    Diagnostics& diagnostics, Host& host) {
  const std::string name(kind_name(kind));
  if (map.kind != Value::Kind::Map) {
    diagnostics.add(map.place, path + ": expected a mapping that names a " + name +
                                   " with the key 'type', found " + map.describe());
    return nullptr;
  }
  const Value* type = map.find("type");
  if (!type || type->kind != Value::Kind::Scalar) {
    diagnostics.add(type ? type->place : map.place,
                    path + ": expected the key 'type' with one of: " + joined(types(kind)) +
                        (type ? ", found " + type->describe() : ""));
    return nullptr;
  }
  if (!has(kind, type->scalar)) {
    try {
      state_->require(kind, type->scalar);
    } catch (const Error& error) {
      diagnostics.add(type->place, path + ": " + error.what());
    }
    return nullptr;
  }
  const ComponentInfo& info = state_->info(kind, type->scalar);
  std::vector<std::string_view> known(also_known.begin(), also_known.end());
  known.push_back("type");
  const std::size_t before = diagnostics.messages().size();
  std::unique_ptr<Component> made;
  try {
    made = call_component(titled(kind, type->scalar), [&] {
      return info.make(info.context, map, path, known, diagnostics, host);
    });
  } catch (const Error& error) {
    // What stands in a file is told with its place, and beside all else that is wrong there.
    if (error.kind() != ErrorKind::Config || map.place.text().empty()) throw;
    diagnostics.add(map.place, path + ": " + error.what());
    return nullptr;
  }
  if (!made && diagnostics.messages().size() == before) {
    throw Error(ErrorKind::Plugin, titled(kind, type->scalar) + ": its factory returned nothing (" +
                                       entry(kind, type->scalar).file.string() + ")");
  }
  return made;
}

void Registry::refuse_kind(ComponentKind kind, const Value& map) const {
  const std::string type = map.find("type")->scalar;
  throw Error(ErrorKind::Plugin, titled(kind, type) + ": its factory made something that is no " +
                                     std::string(kind_name(kind)) + " (" +
                                     entry(kind, type).file.string() + ")");
}

}  // namespace diorama
