// SPDX-License-Identifier: Apache-2.0
#include "asset_library.h"

#include <algorithm>
#include <filesystem>
#include <vector>

#include "crate_reader.h"
#include "error.h"
#include "text_reader.h"

namespace diorama::usd {
namespace {

constexpr int kMaxPackageNesting = 16;

// `/a.usdz[b.usdz[c.usd]]` is {`/a.usdz`, `b.usdz[c.usd]`}; the second is empty for plain files.
std::pair<std::string, std::string> split_outer(const std::string& identifier) {
  const std::size_t open = identifier.find('[');
  if (open == std::string::npos || identifier.back() != ']') return {identifier, {}};
  return {identifier.substr(0, open), identifier.substr(open + 1, identifier.size() - open - 2)};
}

// The same is {`/a.usdz[b.usdz]`, `c.usd`}.
std::pair<std::string, std::string> split_inner(const std::string& identifier) {
  if (identifier.empty() || identifier.back() != ']') return {identifier, {}};
  const std::size_t open = identifier.rfind('[');
  if (open == std::string::npos) return {identifier, {}};
  const std::size_t close = identifier.find(']', open);
  return {identifier.substr(0, open) + identifier.substr(close + 1),
          identifier.substr(open + 1, close - open - 1)};
}

// Puts `member` inside of the innermost package of `identifier`.
std::string join_package(const std::string& identifier, const std::string& member) {
  std::size_t closing = identifier.size();
  while (closing > 0 && identifier[closing - 1] == ']') --closing;
  return identifier.substr(0, closing) + "[" + member + "]" + identifier.substr(closing);
}

// Without `.`, without `..` as far as there is something to go back from, and without double
// slashes.
std::string normalize(std::string_view path) {
  const bool is_absolute = path.starts_with('/');
  std::vector<std::string_view> parts;
  for (std::size_t begin = 0; begin < path.size();) {
    const std::size_t end = std::min(path.find('/', begin), path.size());
    const std::string_view part = path.substr(begin, end - begin);
    begin = end + 1;
    if (part.empty() || part == ".") continue;
    const bool goes_back = part == ".." && !parts.empty() && parts.back() != "..";
    if (goes_back) {
      parts.pop_back();
    } else if (part != ".." || !is_absolute) {
      parts.push_back(part);
    }
  }
  std::string result;
  for (const std::string_view part : parts) {
    if (is_absolute || !result.empty()) result += '/';
    result += part;
  }
  return result;
}

// `asset` as seen from the folder that `file` is in.
std::string beside(std::string_view file, std::string_view asset) {
  if (asset.starts_with('/')) return normalize(asset);
  const std::size_t slash = file.rfind('/');
  if (slash == std::string_view::npos) return normalize(asset);
  return normalize(std::string(file.substr(0, slash + 1)).append(asset));
}

bool is_file_relative(std::string_view asset) {
  return asset.starts_with("./") || asset.starts_with("../");
}

}  // namespace

std::vector<std::string> tile_names(const std::string& identifier) {
  constexpr std::string_view kMark = "<UDIM>";
  constexpr int kFirstTile = 1001;
  constexpr int kTiles = 100;
  const std::size_t mark = identifier.find(kMark);
  if (mark == std::string::npos) return {identifier};
  std::vector<std::string> names;
  for (int i = 0; i < kTiles; ++i) {
    names.push_back(identifier);
    names.back().replace(mark, kMark.size(), std::to_string(kFirstTile + i));
  }
  return names;
}

std::string AssetLibrary::anchor(std::string_view asset, const std::string& anchor_layer) const {
  const std::string text(asset.substr(0, asset.find(":SDF_FORMAT_ARGS:")));
  if (text.empty()) return {};
  const auto [outer, inside] = split_outer(text);
  if (!inside.empty()) return join_package(anchor(outer, anchor_layer), inside);

  const std::string anchored = anchor_to_layer(text, anchor_layer);
  if (!look_up_ || is_file_relative(text)) return anchored;
  const auto [entry, is_new] = looked_up_.try_emplace(anchored);
  if (!is_new) return entry->second.file.empty() ? anchored : entry->second.file;
  const std::vector<std::string> own = tile_names(anchored);
  const std::vector<std::string> elsewhere = tile_names(text);
  const auto is_there = [&](const std::string& name) { return exists(name); };
  if (std::any_of(own.begin(), own.end(), is_there)) return anchored;
  for (std::size_t i = 0; i < elsewhere.size() && entry->second.file.empty(); ++i) {
    entry->second = look_up_(elsewhere[i]);
  }
  std::string& file = entry->second.file;
  if (file.empty()) return anchored;
  // A set of tiles is beside the tile that was found.
  if (elsewhere.size() > 1) file = beside(file, text.substr(text.rfind('/') + 1));
  return file;
}

std::string AssetLibrary::missing_text(const std::string& identifier) const {
  const std::string text = "could not be found";
  const auto known = looked_up_.find(identifier);
  if (known == looked_up_.end() || known->second.why_not.empty()) return text;
  return text + ": " + known->second.why_not;
}

std::string AssetLibrary::anchor_to_layer(const std::string& text,
                                          const std::string& anchor_layer) const {
  if (text.find("://") != std::string::npos) return text;
  const auto [package, member] = split_inner(anchor_layer);
  if (member.empty() || text.starts_with('/')) return beside(anchor_layer, text);
  const std::string anchored = join_package(package, beside(member, text));
  if (is_file_relative(text) || exists(anchored)) return anchored;
  // A bare path is looked for at the top of the package as well.
  const std::string at_top = join_package(package, normalize(text));
  if (exists(at_top)) return at_top;
  // And at last beside the package.
  const std::string outside = beside(split_outer(anchor_layer).first, text);
  return exists(outside) ? outside : anchored;
}

std::shared_ptr<const Package> AssetLibrary::package(const std::string& identifier) const {
  if (const auto known = packages_.find(identifier); known != packages_.end()) {
    return known->second;
  }
  auto opened = std::make_shared<const Package>(identifier, read(identifier));
  packages_.emplace(identifier, opened);
  return opened;
}

bool AssetLibrary::exists(const std::string& identifier) const {
  const auto [package_name, member] = split_inner(identifier);
  if (member.empty()) {
    std::error_code error;
    return std::filesystem::is_regular_file(identifier, error);
  }
  try {
    return exists(package_name) && package(package_name)->contains(member);
  } catch (const FormatError&) {
    return false;
  }
}

ByteView AssetLibrary::read(const std::string& identifier) const {
  const auto [package_name, member] = split_inner(identifier);
  if (!member.empty()) return package(package_name)->read(member);
  mapped_files_.push_back(map_file(identifier));
  return mapped_files_.back();
}

void AssetLibrary::release_pages() const {
  for (const ByteView& file : mapped_files_) usd::release_pages(file);
}

std::shared_ptr<const Layer> AssetLibrary::read_layer(const std::string& identifier) const {
  std::string name = identifier;
  ByteView bytes = read(name);
  for (int nesting = 0; is_package(bytes.bytes); ++nesting) {
    if (nesting == kMaxPackageNesting) throw FormatError(name + ": packages are nested too deeply");
    const std::string& first = package(name)->first();
    name = join_package(name, first);
    bytes = read(name);
  }
  layer_bytes_ += bytes.bytes.size();
  return usd::read_layer(name, std::move(bytes));
}

std::shared_ptr<const Layer> AssetLibrary::open(const std::string& identifier) {
  auto [entry, is_new] = layers_.try_emplace(identifier);
  if (is_new) {
    try {
      entry->second.layer = read_layer(identifier);
    } catch (const FormatError& error) {
      entry->second.error = error.what();
    }
  }
  if (!entry->second.layer) throw FormatError(entry->second.error);
  return entry->second.layer;
}

std::shared_ptr<Layer> read_layer(const std::string& identifier, ByteView bytes) {
  if (is_crate(bytes.bytes)) return read_crate(identifier, std::move(bytes));
  const std::string_view text(reinterpret_cast<const char*>(bytes.bytes.data()),
                              bytes.bytes.size());
  if (is_text_layer(text)) return read_text_layer(identifier, text);
  if (identifier.ends_with(".mtlx")) {
    throw FormatError(identifier + ": MaterialX documents are not read");
  }
  throw format_error_at(identifier, "this is neither a crate, nor a package, nor a text layer",
                        std::uint64_t{0});
}

}  // namespace diorama::usd
