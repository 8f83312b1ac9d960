// SPDX-License-Identifier: Apache-2.0
#include "support/render_host/render_host.h"

#include <filesystem>
#include <fstream>

#include "diorama/error.h"
#include "framework/images/image_codecs.h"

namespace diorama::test {

void RenderHost::log(LogLevel level, std::string_view message) {
  if (level != LogLevel::Debug) messages.emplace_back(message);
}

std::filesystem::path RenderHost::resolve(std::string_view asset) const { return asset; }

std::vector<std::filesystem::path> RenderHost::list_assets(std::string_view,
                                                           std::span<const std::string>) const {
  return {};
}

NodeId RenderHost::load_asset(std::string_view asset, Scene&, NodeId) {
  throw Error(ErrorKind::Asset, std::string(asset) + ": this host has no loaders");
}

std::shared_ptr<const Texture> RenderHost::decode_texture(std::span<const std::byte> bytes,
                                                          std::string_view name) const {
  return decode_image(bytes, name);
}

std::shared_ptr<const Texture> RenderHost::read_texture(const std::filesystem::path& file) const {
  return decode_image(read_bytes(file), file.string());
}

std::vector<std::byte> RenderHost::encode_image(const ImageView& image, ImageFormat format) const {
  return diorama::encode_image(image, format);
}

void RenderHost::parallel_for(std::size_t count, const std::function<void(std::size_t)>& body) {
  pool_.parallel_for(count, body);
}

std::vector<std::byte> read_bytes(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) throw Error(ErrorKind::Asset, file.string() + ": cannot be read");
  std::vector<std::byte> bytes(std::filesystem::file_size(file));
  in.read(reinterpret_cast<char*>(bytes.data()), std::streamsize(bytes.size()));
  return bytes;
}

void write_png(const Host& host, const Image<Rgba8>& image, const std::filesystem::path& file) {
  const ImageView view{image.pixels().data(), image.width(), image.height(), 4, 8};
  const auto bytes = host.encode_image(view, ImageFormat::Png);
  std::ofstream out(file, std::ios::binary);
  out.write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
  out.close();
  if (!out) throw Error(ErrorKind::Output, file.string() + ": cannot be written");
}

}  // namespace diorama::test
