// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "diorama/host.h"
#include "framework/host/thread_pool.h"

namespace diorama::test {

/// The host services that a renderer uses, without plugins and assets: threads, image codecs and a
/// log that is kept, but for what is of use in debugging only.
class RenderHost final : public Host {
 public:
  explicit RenderHost(int threads) : pool_(threads) {}

  std::vector<std::string> messages;

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
  int thread_count() const override { return pool_.thread_count(); }

 private:
  ThreadPool pool_;
};

std::vector<std::byte> read_bytes(const std::filesystem::path& file);
void write_png(const Host& host, const Image<Rgba8>& image, const std::filesystem::path& file);

}  // namespace diorama::test
