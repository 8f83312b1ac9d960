// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "diorama/host.h"
#include "diorama/loader.h"
#include "framework/host/asset_cache.h"
#include "framework/host/asset_paths.h"
#include "framework/host/log.h"
#include "framework/host/picture_pool.h"
#include "framework/host/thread_pool.h"
#include "framework/images/image_codecs.h"
#include "framework/plugins/registry.h"

namespace diorama {

struct HostOptions {
  std::optional<std::filesystem::path> assets_root;
  std::vector<AssetPrefix> asset_prefixes;
  int threads = 1;
  std::size_t asset_cache_bytes = std::size_t(1) << 30;
  std::uint64_t picture_bytes = kPictureBudget;  ///< Memory to decode one picture.
};

/// The services that plugins get. Loaders are made on first use, with default parameters unless a
/// job says other ones. When two loaders claim the same ending, the first by name takes it.
class HostServices final : public Host {
 public:
  /// The registry must outlive the host services.
  HostServices(Registry& registry, HostOptions options, Log log);
  ~HostServices() override;

  /// Reads with this loader what its type claims, instead of with one that has default parameters.
  /// Call before anything is loaded.
  void use_loader(const std::string& type, std::unique_ptr<Loader> loader);
  /// The type of the loader that reads this asset; none for pictures and other files.
  std::optional<std::string> loader_of(std::string_view asset) const;
  /// The files that this asset consists of, as its loader says; the file itself without a loader.
  std::vector<std::filesystem::path> files_of(std::string_view asset);

  /// The files that resolve() has given since the last call, sorted: what components named.
  std::vector<std::filesystem::path> take_resolved();

  void log(LogLevel level, std::string_view message) override;
  std::filesystem::path resolve(std::string_view asset) const override;
  std::vector<std::filesystem::path> list_assets(std::string_view folder,
                                                 std::span<const std::string> skip) const override;
  NodeId load_asset(std::string_view asset, Scene& scene, NodeId parent) override;
  std::shared_ptr<const Texture> decode_texture(std::span<const std::byte> bytes,
                                                std::string_view name) const override;
  std::shared_ptr<const Texture> read_texture(const std::filesystem::path& file) const override;
  std::vector<std::byte> encode_image(const ImageView& image, ImageFormat format) const override;
  void parallel_for(std::size_t count, const std::function<void(std::size_t)>& body) override;
  int thread_count() const override;
  bool stop_requested() const override;

  /// From now on the job is to end when this becomes true.
  void stop_on(const std::atomic<bool>& stop) { stop_ = &stop; }
  ThreadPool& pool() { return pool_; }

 private:
  /// An asset with the loader that takes it.
  struct Source {
    std::string asset;  ///< A path that exists, or "scheme:rest".
    std::string key;    ///< The same for one file under two names.
    std::string loader;
    std::string stem;  ///< For the node's name.
  };
  struct Claim {
    std::string text;  ///< ".usd", "dining_room:" or "=#usda".
    std::string loader;
  };
  std::optional<Source> claimed_source(std::string_view asset) const;
  Source find_source(std::string_view asset) const;
  const Claim* claim_of(std::string_view asset, bool is_scheme) const;
  const Claim* claim_of_content(const std::filesystem::path& file) const;
  void learn_claims();
  void take_claims(const ComponentEntry& entry, const std::vector<std::string>& claims);
  Loader& loader(const std::string& type);

  Registry& registry_;
  AssetPaths paths_;
  Log log_;
  ThreadPool pool_;
  std::thread::id main_thread_ = std::this_thread::get_id();
  const std::atomic<bool>* stop_ = nullptr;
  std::recursive_mutex loading_;  ///< Loaders may load what theirs consists of.
  AssetCache cache_;
  std::uint64_t picture_bytes_;
  mutable PicturePool pictures_;
  std::map<std::string, std::unique_ptr<Loader>> loaders_;
  std::vector<Claim> claims_;  // earlier ones win
  mutable std::mutex resolved_mutex_;
  mutable std::set<std::filesystem::path> resolved_;
};

}  // namespace diorama
