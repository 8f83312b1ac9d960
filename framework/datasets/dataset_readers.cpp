// SPDX-License-Identifier: Apache-2.0
#include "framework/datasets/dataset_readers.h"

#include <fnmatch.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "diorama/config.h"
#include "diorama/error.h"
#include "framework/config/joined.h"
#include "framework/config/json_text.h"
#include "framework/config/yaml_config.h"
#include "framework/datasets/guarded_dataset.h"
#include "framework/output/file_system.h"
#include "framework/plugins/plugin_call.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

std::string reader_name(const std::string& type) { return "reader '" + type + "'"; }

/// Folders that the page of a run names, as far as they lie below it.
std::set<fs::path> named_folders(const fs::path& run) {
  std::set<fs::path> folders;
  LocalFileSystem file_system;
  if (!file_system.exists(run / "dataset.json")) return {};
  const auto json = parse_json_or_nothing(file_system.read(run / "dataset.json"));
  if (!json.is_object() || !json.contains("writers") || !json.at("writers").is_array()) return {};
  for (const auto& writer : json.at("writers")) {
    if (!writer.is_object() || !writer.contains("folder") || !writer.at("folder").is_string()) {
      continue;
    }
    const fs::path below = fs::path(writer.at("folder").get<std::string>()).lexically_normal();
    if (below.is_absolute() || std::ranges::find(below, "..") != below.end()) continue;
    if (fs::is_directory(run / below)) folders.insert(run / below);
  }
  return folders;
}

/// What folders hold, each read once: all readers together ask with dozens of patterns, of folders
/// with hundreds of thousands of files.
class FolderNames {
 public:
  bool has_file_like(const fs::path& folder, std::string_view pattern) {
    const std::size_t cut = pattern.find('/');
    const std::string part(pattern.substr(0, cut));
    const bool is_last = cut == pattern.npos;
    const auto holds_rest = [&](const std::string& name) {
      return has_file_like(folder / name, pattern.substr(cut + 1));
    };
    if (part.find('*') == part.npos) {
      std::error_code error;
      return is_last ? fs::is_regular_file(folder / part, error) : holds_rest(part);
    }
    // Most names differ before or after what the stars stand for, which is cheap to see.
    constexpr const char* kSpecial = R"(*?[]\)";
    const std::string_view front = std::string_view(part).substr(0, part.find_first_of(kSpecial));
    const std::string_view back = std::string_view(part).substr(part.find_last_of(kSpecial) + 1);
    return std::ranges::any_of(of(folder), [&](const Name& each) {
      return each.is_folder == !is_last && each.name.starts_with(front) &&
             each.name.ends_with(back) &&
             fnmatch(part.c_str(), each.name.c_str(), FNM_PERIOD) == 0 &&
             (is_last || holds_rest(each.name));
    });
  }

 private:
  /// Of a file or a folder.
  struct Name {
    std::string name;
    bool is_folder = false;
  };

  const std::vector<Name>& of(const fs::path& folder) {
    const auto [place, is_new] = names_.try_emplace(folder);
    if (!is_new) return place->second;
    std::vector<Name>& names = place->second;
    std::error_code error;
    for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error)) {
      std::error_code ignored;
      const bool is_folder = at->is_directory(ignored);
      if (!is_folder && !at->is_regular_file(ignored)) continue;
      names.push_back({at->path().filename().string(), is_folder});
    }
    return names;
  }

  std::map<fs::path, std::vector<Name>> names_;  ///< Grows while others of it are looked through.
};

}  // namespace

std::vector<fs::path> folders_of_run(const fs::path& run) {
  std::set<fs::path> folders = named_folders(run);
  std::error_code error;
  for (fs::directory_iterator at(run, error), end; !error && at != end; at.increment(error)) {
    const bool is_hidden = at->path().filename().string().starts_with('.');
    std::error_code ignored;
    if (!is_hidden && at->is_directory(ignored)) folders.insert(at->path());
  }
  return {folders.begin(), folders.end()};
}

bool has_file_like(const fs::path& folder, std::string_view pattern) {
  return FolderNames().has_file_like(folder, pattern);
}

DatasetReaders::DatasetReaders(Registry& registry, Host& host) {
  const auto make = [&registry, &host](const Value& map, const std::string& path) {
    Diagnostics diagnostics;
    auto made = registry.make<Reader>(map, path, {}, diagnostics, host);
    diagnostics.raise();
    return made;
  };
  for (const std::string& type : registry.types(ComponentKind::Reader)) {
    const ComponentEntry& entry = registry.entry(ComponentKind::Reader, type);
    const auto make_default = [make, type] {
      Value map = Value::make_map();
      map.set("type", Value::text(type));
      return make(map, reader_name(type));
    };
    entries_.push_back({type, entry.claims, make_default,
                        [make](const Value& map) { return make(map, "reader"); }});
    if (!entry.claims_are_listed) {
      entries_.back().patterns =
          call_component(reader_name(type), [&] { return reader(entries_.back()).patterns(); });
    }
  }
}

Reader& DatasetReaders::reader(const Entry& entry) {
  std::unique_ptr<Reader>& made = made_[entry.type];
  if (!made) made = entry.make();
  return *made;
}

std::string DatasetReaders::recognise(const fs::path& folder) {
  Recognition best = Recognition::No;
  std::vector<std::string> found;
  FolderNames names;
  for (const Entry& entry : entries_) {
    const bool may_be = std::ranges::any_of(entry.patterns, [&](const std::string& pattern) {
      return names.has_file_like(folder, pattern);
    });
    if (!may_be) continue;
    const Recognition said =
        call_component(reader_name(entry.type), [&] { return reader(entry).recognise(folder); });
    if (said == Recognition::No || said < best) continue;
    if (said > best) found.clear();
    best = said;
    found.push_back(entry.type);
  }
  if (found.size() > 1) {
    throw Error(ErrorKind::Usage, folder.string() + ": looks like a dataset of " + joined(found) +
                                      "; say which with --reader");
  }
  return found.empty() ? std::string() : found.front();
}

const DatasetReaders::Entry& DatasetReaders::entry_of(const std::string& type) const {
  const auto entry = std::ranges::find(entries_, type, &Entry::type);
  if (entry != entries_.end()) return *entry;
  const std::string near = nearest_name(type, types());
  throw Error(ErrorKind::Usage, "unknown " + reader_name(type) +
                                    (near.empty() ? "." : "; did you mean '" + near + "'?") +
                                    " Known: " + joined(types()));
}

Reader& DatasetReaders::reader_with(const std::string& mapping) {
  std::unique_ptr<Reader>& made = made_[mapping];
  if (made) return *made;
  const Value map = parse_yaml(mapping, "--reader");
  const Value* const type = map.kind == Value::Kind::Map ? map.find("type") : nullptr;
  if (!type || type->kind != Value::Kind::Scalar) {
    throw Error(
        ErrorKind::Usage,
        "--reader: expected a type or a mapping {type: TYPE, ...}, found '" + mapping + "'");
  }
  const Entry& entry = entry_of(type->scalar);
  if (!entry.make_with) {
    throw Error(ErrorKind::Usage, reader_name(entry.type) + ": takes no parameters");
  }
  made = entry.make_with(map);
  return *made;
}

Reader& DatasetReaders::opener(const std::string& named) {
  return named.starts_with('{') ? reader_with(named) : reader(entry_of(named));
}

std::unique_ptr<const StoredDataset> DatasetReaders::open(const fs::path& folder,
                                                          const std::string& named,
                                                          LostCaptures lost) {
  Reader& reader = opener(named);
  const std::string who = named.starts_with('{') ? "reader " + named : reader_name(named);
  auto opened = call_component(who, [&] { return reader.open(folder); });
  if (!opened) throw Error(ErrorKind::Plugin, who + ": opened nothing");
  return lost == LostCaptures::Throw ? std::move(opened) : guarded(std::move(opened));
}

std::vector<std::string> DatasetReaders::types() const {
  std::vector<std::string> types;
  for (const Entry& entry : entries_) types.push_back(entry.type);
  return types;
}

std::vector<FoundDataset> find_datasets(const fs::path& folder, DatasetReaders& readers,
                                        const std::string& reader) {
  if (!fs::is_directory(folder)) {
    throw Error(ErrorKind::Usage,
                folder.string() + ": not a folder; give a dataset or the output of a run");
  }
  if (!reader.empty()) return {{folder, reader}};
  if (std::string type = readers.recognise(folder); !type.empty()) return {{folder, type}};
  std::vector<FoundDataset> found;
  for (const fs::path& below : folders_of_run(folder)) {
    if (std::string type = readers.recognise(below); !type.empty()) found.push_back({below, type});
  }
  return found;
}

FoundDataset find_dataset(const fs::path& folder, DatasetReaders& readers,
                          const std::string& reader) {
  const std::vector<FoundDataset> found = find_datasets(folder, readers, reader);
  if (found.size() == 1) return found.front();
  if (found.empty()) {
    throw Error(ErrorKind::Usage, folder.string() +
                                      ": holds no dataset that a reader knows, nor do its "
                                      "folders; readers: " +
                                      joined(readers.types()));
  }
  std::vector<std::string> names;
  for (const FoundDataset& each : found) {
    names.push_back(each.folder.string() + " (" + each.reader + ")");
  }
  throw Error(ErrorKind::Usage,
              folder.string() + ": holds several datasets, name one: " + joined(names));
}

}  // namespace diorama
