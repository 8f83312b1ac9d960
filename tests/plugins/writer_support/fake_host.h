// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "diorama/host.h"

namespace diorama::test {

/// What FakeHost made of an image.
struct RawImage {
  ImageFormat format = ImageFormat::Png;
  int width = 0;
  int height = 0;
  int channels = 0;
  int bits_per_channel = 0;
  std::vector<std::byte> samples;
  std::vector<std::byte> palette;  ///< Red, green and blue by turns; empty: none.

  /// Sample `c` of a pixel, 8 or 16 bits.
  int at(int x, int y, int c) const;
};

/// Encodes pictures as they are, so that tests see every sample. Keeps log lines; its one asset is
/// "/props/mug.usd", the mug of SampleScene. Nothing else works.
class FakeHost : public Host {
 public:
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
  int thread_count() const override { return 1; }

  std::vector<std::string> messages;
};

/// Reverses FakeHost::encode_image; throws when the bytes are something else.
RawImage raw_image(std::span<const std::byte> bytes);

}  // namespace diorama::test
