// SPDX-License-Identifier: Apache-2.0
#include "framework/host/host_services.h"

#include <algorithm>
#include <fstream>
#include <iterator>
#include <set>
#include <string_view>
#include <system_error>
#include <utility>

#include "framework/config/clean_text.h"
#include "framework/host/node_content.h"
#include "framework/host/regular_file.h"
#include "framework/host/stoppable.h"
#include "framework/plugins/plugin_call.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

constexpr std::uintmax_t kMaxImageBytes = std::uintmax_t(1) << 30;

std::string lower(std::string_view text) {
  std::string out(text);
  std::transform(out.begin(), out.end(), out.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? char(c + 32) : c; });
  return out;
}

/// A node name: no '/', never empty.
std::string node_name(std::string text) {
  std::replace(text.begin(), text.end(), '/', '_');
  std::replace(text.begin(), text.end(), ':', '_');
  return text.empty() ? "asset" : text;
}

std::vector<std::byte> read_bytes(const fs::path& file) {
  std::error_code failed;
  const std::uintmax_t size = fs::file_size(file, failed);
  std::ifstream stream = open_regular_file(file);
  if (failed || !stream) {
    throw Error(ErrorKind::Asset, file.string() + ": the image cannot be read" +
                                      (failed ? ": " + failed.message() : std::string()));
  }
  if (size > kMaxImageBytes) {
    throw Error(ErrorKind::Asset, file.string() + ": has " + std::to_string(size) +
                                      " bytes; images of up to 1 GiB are read");
  }
  std::vector<std::byte> bytes(size);
  stream.read(reinterpret_cast<char*>(bytes.data()), std::streamsize(size));
  if (std::uintmax_t(stream.gcount()) != size) {
    throw Error(ErrorKind::Asset, file.string() + ": the image cannot be read to its end");
  }
  return bytes;
}

}  // namespace

HostServices::HostServices(Registry& registry, HostOptions options, Log log)
    : registry_(registry),
      paths_(std::move(options.assets_root), std::move(options.asset_prefixes)),
      log_(std::move(log)),
      pool_(options.threads),
      cache_(options.asset_cache_bytes),
      picture_bytes_(options.picture_bytes) {
  learn_claims();
}

HostServices::~HostServices() = default;

void HostServices::use_loader(const std::string& type, std::unique_ptr<Loader> loader) {
  loaders_[type] = std::move(loader);
}

void HostServices::log(LogLevel level, std::string_view message) { log_(level, message); }

fs::path HostServices::resolve(std::string_view asset) const {
  fs::path found = paths_.resolve(asset);
  const std::lock_guard lock(resolved_mutex_);
  resolved_.insert(found);
  return found;
}

std::vector<fs::path> HostServices::take_resolved() {
  const std::lock_guard lock(resolved_mutex_);
  std::vector<fs::path> files;
  std::copy_if(resolved_.begin(), resolved_.end(), std::back_inserter(files), [](const auto& path) {
    std::error_code error;
    return fs::is_regular_file(path, error);
  });
  resolved_.clear();
  return files;
}

std::vector<fs::path> HostServices::list_assets(std::string_view folder,
                                                std::span<const std::string> skip) const {
  std::vector<std::string> endings;
  for (const Claim& claim : claims_) {
    if (claim.text.starts_with('.')) endings.push_back(claim.text);
  }
  return paths_.list(folder, endings, skip);
}

void HostServices::learn_claims() {
  for (const ComponentEntry& entry : registry_.components()) {
    if (entry.kind != ComponentKind::Loader) continue;
    if (entry.claims_are_listed) {
      take_claims(entry, entry.claims);
      continue;
    }
    // A plugin that does not list its claims must be asked; a broken one must not stop the others.
    try {
      Loader& made = loader(entry.type);
      take_claims(entry,
                  call_component("loader '" + entry.type + "'", [&] { return made.claims(); }));
    } catch (const Error& error) {
      log_(LogLevel::Warning, error.what());
    }
  }
}

void HostServices::take_claims(const ComponentEntry& entry,
                               const std::vector<std::string>& claims) {
  for (const std::string& claim : claims) {
    const auto same = std::find_if(claims_.begin(), claims_.end(),
                                   [&](const Claim& known) { return known.text == claim; });
    if (same == claims_.end()) {
      claims_.push_back({claim, entry.type});
    } else {
      log_(LogLevel::Debug,
           "'" + claim + "' is read by loader '" + same->loader + "', not by '" + entry.type + "'");
    }
  }
}

const HostServices::Claim* HostServices::claim_of(std::string_view asset, bool is_scheme) const {
  const std::string name = lower(asset);
  const Claim* best = nullptr;
  for (const Claim& claim : claims_) {
    const bool fits = is_scheme ? claim.text.ends_with(':') && name.starts_with(claim.text)
                                : claim.text.starts_with('.') && name.ends_with(claim.text);
    if (fits && (!best || claim.text.size() > best->text.size())) best = &claim;
  }
  return best;
}

// Files without an ending say by their first bytes what they are.
const HostServices::Claim* HostServices::claim_of_content(const fs::path& file) const {
  std::size_t longest = 0;
  for (const Claim& claim : claims_) {
    if (claim.text.starts_with('=')) longest = std::max(longest, claim.text.size() - 1);
  }
  std::error_code error;
  if (longest == 0 || !fs::is_regular_file(file, error)) return nullptr;
  std::string content(longest, '\0');
  std::ifstream stream(file, std::ios::binary);
  stream.read(content.data(), std::streamsize(longest));
  content.resize(std::size_t(stream.gcount()));
  const Claim* best = nullptr;
  for (const Claim& claim : claims_) {
    const bool fits =
        claim.text.starts_with('=') && content.starts_with(std::string_view(claim.text).substr(1));
    if (fits && (!best || claim.text.size() > best->text.size())) best = &claim;
  }
  return best;
}

std::optional<HostServices::Source> HostServices::claimed_source(std::string_view asset) const {
  if (has_scheme(asset)) {
    if (const Claim* claim = claim_of(asset, true)) {
      return Source{std::string(asset), std::string(asset), claim->loader,
                    node_name(std::string(asset))};
    }
  }
  const auto [plain, variants] = split_variants(asset);
  const fs::path file = paths_.resolve(plain);
  std::string name = file.filename().string();
  const Claim* claim = claim_of(name, false);
  if (claim) {
    name.resize(name.size() - claim->text.size());
  } else if (file.extension().empty()) {
    claim = claim_of_content(file);
  }
  if (!claim) return std::nullopt;
  const std::string suffix(variants);
  return Source{file.string() + suffix, fs::canonical(file).string() + suffix, claim->loader,
                node_name(name)};
}

HostServices::Source HostServices::find_source(std::string_view asset) const {
  if (std::optional<Source> source = claimed_source(asset)) return *source;
  std::set<std::string> endings;
  for (const Claim& known : claims_) {
    if (known.text.starts_with('.')) endings.insert(known.text);
  }
  std::string list;
  for (const std::string& ending : endings) list += (list.empty() ? "" : " ") + ending;
  const fs::path file = paths_.resolve(asset);
  const std::string found = file.extension().empty()
                                ? "a file without an ending that begins like this"
                                : "'" + file.extension().string() + "' files";
  throw Error(ErrorKind::Asset,
              file.string() + ": no loader reads " + found +
                  "; there are loaders for: " + (list.empty() ? "nothing" : list));
}

Loader& HostServices::loader(const std::string& type) {
  std::unique_ptr<Loader>& made = loaders_[type];
  if (!made) {
    Value defaults = Value::make_map();
    defaults.set("type", Value::text(type));
    Diagnostics diagnostics;
    made = registry_.make<Loader>(defaults, "loader", {}, diagnostics, *this);
    diagnostics.raise();
  }
  return *made;
}

std::optional<std::string> HostServices::loader_of(std::string_view asset) const {
  const std::optional<Source> source = claimed_source(asset);
  return source ? std::optional(source->loader) : std::nullopt;
}

std::vector<fs::path> HostServices::files_of(std::string_view asset) {
  const std::optional<Source> source = claimed_source(asset);
  if (!source) return {paths_.resolve(asset)};
  Loader& reader = loader(source->loader);
  std::vector<fs::path> files = call_component("loader '" + source->loader + "'",
                                               [&] { return reader.files(source->asset); });
  const fs::path points = keypoints_file(source->asset);
  std::error_code error;
  if (!points.empty() && fs::is_regular_file(points, error)) files.push_back(points);
  return files;
}

NodeId HostServices::load_asset(std::string_view asset, Scene& scene, NodeId parent) {
  const Source source = find_source(asset);
  std::unique_lock lock(loading_, std::try_to_lock);
  if (!lock) {
    const ThreadPool::Rest rest(pool_);
    lock.lock();
  }
  Loader& with = loader(source.loader);
  const std::string key = source.loader + " " + source.key;
  const auto loaded = cache_.get(key, [&](Scene& own) {
    const NodeId root = own.create(own.root(), source.stem);
    call_component("loader '" + source.loader + "'", [&] { with.load(source.asset, own, root); });
    const std::string word = first_unclean_word(own, root);
    if (word.empty()) return;
    log_(LogLevel::Warning, source.asset + ": the name '" + clean_name(word) +
                                "' is no plain UTF-8 text; bytes of it are written as \\x00 to "
                                "\\xFF, in datasets, too");
  });
  lock.unlock();
  const NodeId root = (*loaded)[loaded->root()].children.front();
  return instantiate(*loaded, root, scene, parent, source.stem);
}

std::shared_ptr<const Texture> HostServices::decode_texture(std::span<const std::byte> bytes,
                                                            std::string_view name) const {
  return pictures_.get(bytes, name, [&] { return decode_image(bytes, name, picture_bytes_); });
}

std::shared_ptr<const Texture> HostServices::read_texture(const fs::path& file) const {
  return decode_texture(read_bytes(file), file.string());
}

std::vector<std::byte> HostServices::encode_image(const ImageView& image,
                                                  ImageFormat format) const {
  return diorama::encode_image(image, format);
}

void HostServices::parallel_for(std::size_t count, const std::function<void(std::size_t)>& body) {
  // Not for writers, which have threads of their own: what was captured is written.
  const std::atomic<bool>* const own = Stoppable::flag_of_this_thread();
  const bool may_stop = own || (stop_ && std::this_thread::get_id() == main_thread_);
  const WorkAtHand work;
  pool_.parallel_for(count, [&](std::size_t i) {
    const WorkAtHand::Helper helper(work);
    if (may_stop && ((stop_ && *stop_) || (own && *own))) throw Stopped();
    body(i);
  });
}

bool HostServices::stop_requested() const {
  const std::atomic<bool>* const own = Stoppable::flag_of_this_thread();
  return (stop_ && *stop_) || (own && *own);
}

int HostServices::thread_count() const { return pool_.thread_count(); }

}  // namespace diorama
