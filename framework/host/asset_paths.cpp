// SPDX-License-Identifier: Apache-2.0
#include "framework/host/asset_paths.h"

#include <algorithm>
#include <iterator>
#include <system_error>
#include <utility>

#include "diorama/error.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kFileScheme = "file://";
/// What the folders of Isaac Sim's assets are called on every server and disk.
constexpr std::string_view kKnownFolders[] = {"/Isaac/", "/NVIDIA/"};

std::string lower(std::string_view text) {
  std::string out(text);
  std::transform(out.begin(), out.end(), out.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? char(c + 32) : c; });
  return out;
}

int hex_value(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

/// %XX decoded.
std::string decoded(std::string_view text) {
  std::string path;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const int high = text[i] == '%' && i + 2 < text.size() ? hex_value(text[i + 1]) : -1;
    const int low = high >= 0 ? hex_value(text[i + 2]) : -1;
    if (low < 0) {
      path += text[i];
      continue;
    }
    path += char(high * 16 + low);
    i += 2;
  }
  return path;
}

/// The path of a file:// URL (RFC 8089): an empty or local host.
fs::path path_of_file_url(std::string_view url) {
  std::string_view rest = url.substr(kFileScheme.size());
  if (rest.starts_with("localhost/")) rest.remove_prefix(9);
  return decoded(rest);
}

bool is_url(std::string_view asset) {
  return asset.find("://") != std::string_view::npos && has_scheme(asset);
}

/// Without what a URL says besides (RFC 3986, 3.4 and 3.5): "?version=3", "#top". Servers keep many
/// versions of a file, the assets root one.
std::string_view plain_url(std::string_view asset) {
  return is_url(asset) ? asset.substr(0, asset.find_first_of("?#")) : asset;
}

/// What follows the host, or the whole of what is no URL; begins with '/'.
std::string path_of(std::string_view asset) {
  if (!is_url(asset)) return (asset.starts_with('/') ? "" : "/") + std::string(asset);
  const std::size_t slash = asset.find('/', asset.find("://") + 3);
  return slash == std::string_view::npos ? "/" : decoded(asset.substr(slash));
}

bool is_there(const fs::path& path) {
  std::error_code failed;
  return fs::exists(path, failed);
}

/// From the last known folder on: whatever the server puts above it.
std::string usual_name(const std::string& path) {
  std::size_t start = std::string::npos;
  for (const std::string_view folder : kKnownFolders) {
    const std::size_t found = path.rfind(folder);
    if (found != std::string::npos && (start == std::string::npos || found > start)) start = found;
  }
  if (start != std::string::npos) return path.substr(start);
  return path.size() > 1 ? path : "/...";
}

/// Walks down folders in sorted order.
class Lister {
 public:
  Lister(std::span<const std::string> endings, std::span<const std::string> skip) {
    for (const std::string& ending : endings) endings_.push_back(lower(ending));
    for (const std::string& word : skip) skip_.push_back(lower(word));
  }

  void walk(const fs::path& folder) {
    std::error_code failed;
    const fs::path real = fs::canonical(folder, failed);
    if (failed || std::find(open_.begin(), open_.end(), real) != open_.end()) return;
    open_.push_back(real);
    std::vector<fs::path> entries;
    for (fs::directory_iterator entry(folder, failed), end; !failed && entry != end;
         entry.increment(failed)) {
      entries.push_back(entry->path());
    }
    if (failed) {
      throw Error(ErrorKind::Asset,
                  folder.string() + ": the folder cannot be listed: " + failed.message());
    }
    std::sort(entries.begin(), entries.end());
    for (const fs::path& entry : entries) take(entry);
    open_.pop_back();
  }

  std::vector<fs::path> take_files() {
    std::sort(files_.begin(), files_.end());
    return std::move(files_);
  }

 private:
  void take(const fs::path& entry) {
    const std::string name = lower(entry.filename().string());
    const auto contains = [&](const std::string& word) {
      return !word.empty() && name.find(word) != std::string::npos;
    };
    if (std::any_of(skip_.begin(), skip_.end(), contains)) return;
    std::error_code failed;
    const fs::file_status status = fs::status(entry, failed);
    if (fs::is_directory(status)) return walk(entry);
    const auto ends = [&](const std::string& ending) {
      return name.size() > ending.size() && name.ends_with(ending);
    };
    if (fs::is_regular_file(status) && std::any_of(endings_.begin(), endings_.end(), ends)) {
      files_.push_back(entry);
    }
  }

  std::vector<std::string> endings_;
  std::vector<std::string> skip_;
  std::vector<fs::path> open_;  // folders from the first one down to here, links resolved
  std::vector<fs::path> files_;
};

}  // namespace

bool has_scheme(std::string_view asset) {
  const std::size_t colon = asset.find(':');
  if (colon == std::string_view::npos || colon < 2) return false;
  return std::all_of(asset.begin(), asset.begin() + std::ptrdiff_t(colon), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
           c == '-' || c == '+' || c == '.';
  });
}

void AssetPrefix::visit(ParamVisitor& v) {
  v.param("prefix", prefix, {"How names begin: 'omniverse://nucleus/Projects/'."});
  v.param("below", below,
          {"Folder below the assets root in which the rest of such a name is looked up."});
}

fs::path keypoints_file(std::string_view asset) {
  if (has_scheme(asset)) return {};
  fs::path file(split_variants(asset).first);
  return file.replace_extension(".keypoints.yaml");
}

std::pair<std::string_view, std::string_view> split_variants(std::string_view asset) {
  if (!asset.ends_with('}') || is_there(asset)) return {asset, {}};
  const std::size_t slash = asset.rfind('/');
  const std::size_t brace = asset.find('{', slash == std::string_view::npos ? 0 : slash);
  if (brace == std::string_view::npos) return {asset, {}};
  return {asset.substr(0, brace), asset.substr(brace)};
}

AssetPaths::AssetPaths(std::optional<fs::path> root, std::vector<AssetPrefix> prefixes)
    : root_(std::move(root)), prefixes_(std::move(prefixes)) {
  std::stable_sort(prefixes_.begin(), prefixes_.end(),
                   [](const auto& a, const auto& b) { return a.prefix.size() > b.prefix.size(); });
}

std::vector<fs::path> AssetPaths::places_below(std::string_view asset) const {
  std::vector<fs::path> places;
  asset = plain_url(asset);
  const bool is_remote = is_url(asset);
  // Nothing lies above the root of a server (RFC 3986, 5.2.4).
  const auto plain = [&](const fs::path& path) {
    return is_remote ? ("/" / path.relative_path()).lexically_normal().relative_path()
                     : path.relative_path();
  };
  const auto add = [&](const fs::path& below) {
    const fs::path place = *root_ / below.relative_path();
    if (std::find(places.begin(), places.end(), place) == places.end()) places.push_back(place);
  };
  for (const AssetPrefix& one : prefixes_) {
    if (one.prefix.empty() || !asset.starts_with(one.prefix)) continue;
    const std::string rest(asset.substr(one.prefix.size()));
    add(fs::path(one.below) / plain(is_remote ? decoded(rest) : rest));
  }
  const std::string path = path_of(asset);
  add(plain(path));
  for (std::size_t slash = path.find('/', 1); slash != std::string::npos;
       slash = path.find('/', slash + 1)) {
    const std::string_view rest = std::string_view(path).substr(slash);
    const auto begins = [&](std::string_view folder) { return rest.starts_with(folder); };
    if (std::any_of(std::begin(kKnownFolders), std::end(kKnownFolders), begins)) {
      add(plain(rest));
    }
  }
  return places;
}

fs::path AssetPaths::resolve(std::string_view asset) const {
  if (asset.empty()) throw Error(ErrorKind::Asset, "an asset has an empty name");
  const std::string name(asset);
  if (asset.starts_with(kFileScheme)) {
    const fs::path path = path_of_file_url(asset);
    if (is_there(path)) return path;
    throw Error(ErrorKind::Asset, name + ": there is no file " + path.string());
  }
  const bool is_remote = is_url(asset);
  const fs::path local(asset);
  if (!is_remote && is_there(local)) return local;
  std::string tried;
  for (const fs::path& place : root_ ? places_below(asset) : std::vector<fs::path>()) {
    if (is_there(place)) return place;
    tried += (tried.empty() ? "" : " and ") + place.string();
  }
  if (is_remote) {
    throw Error(ErrorKind::Asset,
                name +
                    ": remote assets are not fetched; copy the file below the assets root "
                    "(--assets-root, DIORAMA_ASSETS_ROOT) and name it '" +
                    usual_name(path_of(plain_url(asset))) + "'" +
                    (tried.empty() ? "" : "; tried " + tried));
  }
  if (!root_) {
    throw Error(ErrorKind::Asset,
                name + ": not found; tried " + local.string() +
                    "; there is no assets root (--assets-root, DIORAMA_ASSETS_ROOT) to look below");
  }
  throw Error(ErrorKind::Asset, name + ": not found; tried " + local.string() + " and " + tried);
}

std::vector<fs::path> AssetPaths::list(std::string_view folder,
                                       std::span<const std::string> endings,
                                       std::span<const std::string> skip) const {
  const fs::path path = resolve(folder);
  std::error_code failed;
  if (!fs::is_directory(path, failed)) {
    throw Error(ErrorKind::Asset, path.string() + ": is a file, expected a folder of assets");
  }
  Lister lister(endings, skip);
  lister.walk(path);
  return lister.take_files();
}

std::optional<fs::path> choose_assets_root(const std::optional<fs::path>& command_line,
                                           const char* environment,
                                           const std::optional<fs::path>& job,
                                           const std::optional<fs::path>& sample_pack) {
  const auto checked = [](const fs::path& root, const char* origin) {
    std::error_code failed;
    if (fs::is_directory(root, failed)) {
      // Absolute, as paths of assets become: datasets name them relative to it.
      fs::path plain = fs::absolute(root).lexically_normal();
      // A link in front of ".." leads elsewhere.
      return fs::equivalent(plain, root, failed) ? plain : fs::canonical(root);
    }
    throw Error(ErrorKind::Asset,
                root.string() + ": the assets root (" + origin + ") is no folder that exists");
  };
  if (command_line) return checked(*command_line, "--assets-root");
  if (environment && *environment) return checked(environment, "DIORAMA_ASSETS_ROOT");
  if (job) return checked(*job, "assets_root of the job");
  std::error_code failed;
  if (sample_pack && fs::is_directory(*sample_pack, failed)) return sample_pack;
  return std::nullopt;
}

}  // namespace diorama
