// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "diorama/error.h"
#include "diorama/host.h"

namespace diorama::test {

/// A host that hands out grey textures of one pixel for whatever bytes and keeps log lines; loaders
/// need nothing else of it.
class TextureHost final : public Host {
 public:
  std::vector<std::string> warnings;
  std::function<std::filesystem::path(std::string_view)> find;  ///< Null: all names are paths.
  mutable std::vector<std::string> decoded;

  void log(LogLevel level, std::string_view message) override {
    if (level == LogLevel::Warning) warnings.emplace_back(message);
  }
  std::filesystem::path resolve(std::string_view asset) const override {
    return find ? find(asset) : std::filesystem::path(asset);
  }
  std::vector<std::filesystem::path> list_assets(std::string_view,
                                                 std::span<const std::string>) const override {
    return {};
  }
  NodeId load_asset(std::string_view, Scene&, NodeId) override {
    throw Error(ErrorKind::Internal, "a loader does not load other assets");
  }
  std::shared_ptr<const Texture> decode_texture(std::span<const std::byte>,
                                                std::string_view name) const override {
    decoded.emplace_back(name);
    auto texture = std::make_shared<Texture>();
    texture->name = name;
    texture->width = texture->height = 1;
    texture->channels = 3;
    texture->color_space = ColorSpace::Srgb;
    texture->bytes = {128, 128, 128};
    return texture;
  }
  std::shared_ptr<const Texture> read_texture(const std::filesystem::path& file) const override {
    return decode_texture({}, file.string());
  }
  std::vector<std::byte> encode_image(const ImageView&, ImageFormat) const override { return {}; }
  void parallel_for(std::size_t count, const std::function<void(std::size_t)>& body) override {
    for (std::size_t i = 0; i < count; ++i) body(i);
  }
  int thread_count() const override { return 1; }
};

}  // namespace diorama::test
