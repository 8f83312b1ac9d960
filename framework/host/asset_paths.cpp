// SPDX-License-Identifier: Apache-2.0
#include "framework/host/asset_paths.h"

#include <algorithm>
#include <system_error>
#include <utility>

#include "diorama/error.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kFileScheme = "file://";

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

/// The path of a file:// URL (RFC 8089): an empty or local host, %XX decoded.
fs::path path_of_url(std::string_view url) {
  std::string_view rest = url.substr(kFileScheme.size());
  if (rest.starts_with("localhost/")) rest.remove_prefix(9);
  std::string path;
  for (std::size_t i = 0; i < rest.size(); ++i) {
    const int high = rest[i] == '%' && i + 2 < rest.size() ? hex_value(rest[i + 1]) : -1;
    const int low = high >= 0 ? hex_value(rest[i + 2]) : -1;
    if (low < 0) {
      path += rest[i];
      continue;
    }
    path += char(high * 16 + low);
    i += 2;
  }
  return path;
}

bool is_there(const fs::path& path) {
  std::error_code failed;
  return fs::exists(path, failed);
}

[[noreturn]] void refuse_remote(std::string_view asset) {
  const std::size_t host = asset.find("://") + 3;
  const std::size_t slash = asset.find('/', host);
  const std::string below(slash == std::string_view::npos ? "/..." : asset.substr(slash));
  throw Error(ErrorKind::Asset,
              std::string(asset) +
                  ": remote assets are not fetched; copy the file below the assets "
                  "root (--assets-root, DIORAMA_ASSETS_ROOT) and name it '" +
                  below + "'");
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

AssetPaths::AssetPaths(std::optional<fs::path> root) : root_(std::move(root)) {}

fs::path AssetPaths::resolve(std::string_view asset) const {
  if (asset.empty()) throw Error(ErrorKind::Asset, "an asset has an empty name");
  if (asset.starts_with(kFileScheme)) {
    const fs::path path = path_of_url(asset);
    if (is_there(path)) return path;
    throw Error(ErrorKind::Asset, std::string(asset) + ": there is no file " + path.string());
  }
  const fs::path local(asset);
  if (is_there(local)) return local;
  if (asset.find("://") != std::string_view::npos && has_scheme(asset)) refuse_remote(asset);
  std::string tried = "not found; tried " + local.string();
  if (root_) {
    const fs::path below = *root_ / local.relative_path();
    if (is_there(below)) return below;
    tried += " and " + below.string();
  } else {
    tried += "; there is no assets root (--assets-root, DIORAMA_ASSETS_ROOT) to look below";
  }
  throw Error(ErrorKind::Asset, std::string(asset) + ": " + tried);
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
    if (fs::is_directory(root, failed)) return root;
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
