// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "diorama/error.h"
#include "diorama/host.h"

namespace diorama::test {

/// A host for components that need nothing but a log and loops; everything else throws.
class PlainHost : public Host {
 public:
  std::vector<std::string> messages;

  void log(LogLevel, std::string_view message) override { messages.emplace_back(message); }
  std::filesystem::path resolve(std::string_view asset) const override { return refuse(asset); }
  std::vector<std::filesystem::path> list_assets(std::string_view folder,
                                                 std::span<const std::string>) const override {
    return {refuse(folder)};
  }
  NodeId load_asset(std::string_view asset, Scene&, NodeId) override {
    refuse(asset);
    return {};
  }
  std::shared_ptr<const Texture> decode_texture(std::span<const std::byte>,
                                                std::string_view name) const override {
    refuse(name);
    return nullptr;
  }
  std::shared_ptr<const Texture> read_texture(const std::filesystem::path& file) const override {
    refuse(file.string());
    return nullptr;
  }
  std::vector<std::byte> encode_image(const ImageView&, ImageFormat) const override {
    refuse("an image");
    return {};
  }
  void parallel_for(std::size_t count, const std::function<void(std::size_t)>& body) override {
    for (std::size_t i = 0; i < count; ++i) body(i);
  }
  int thread_count() const override { return 1; }

 private:
  static std::filesystem::path refuse(std::string_view what) {
    throw Error(ErrorKind::Internal, "unexpected request for " + std::string(what));
  }
};

}  // namespace diorama::test
