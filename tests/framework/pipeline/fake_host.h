// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>
#include <vector>

#include "diorama/error.h"
#include "diorama/host.h"

namespace diorama::test {

/// A host whose assets are functions, and that keeps its messages.
class FakeHost final : public Host {
 public:
  using Build = std::function<void(Scene& scene, NodeId root)>;
  std::map<std::string, Build> assets;
  std::vector<std::string> warnings;

  void log(LogLevel level, std::string_view message) override {
    if (level >= LogLevel::Warning) warnings.emplace_back(message);
  }
  std::filesystem::path resolve(std::string_view asset) const override { return asset; }
  std::vector<std::filesystem::path> list_assets(std::string_view,
                                                 std::span<const std::string>) const override {
    return {};
  }
  NodeId load_asset(std::string_view asset, Scene& scene, NodeId parent) override {
    const auto build = assets.find(std::string(asset));
    if (build == assets.end()) throw Error(ErrorKind::Asset, std::string(asset) + ": not there");
    const NodeId root = scene.create(parent, "loaded");
    build->second(scene, root);
    return root;
  }
  std::shared_ptr<const Texture> decode_texture(std::span<const std::byte>,
                                                std::string_view) const override {
    return std::make_shared<Texture>();
  }
  std::shared_ptr<const Texture> read_texture(const std::filesystem::path& file) const override {
    Texture texture;
    texture.name = file.string();
    texture.channels = 3;
    texture.color_space = ColorSpace::Srgb;
    return std::make_shared<Texture>(texture);
  }
  std::vector<std::byte> encode_image(const ImageView&, ImageFormat) const override { return {}; }
  void parallel_for(std::size_t count, const std::function<void(std::size_t)>& body) override {
    for (std::size_t i = 0; i < count; ++i) body(i);
  }
  int thread_count() const override { return 1; }
};

}  // namespace diorama::test
