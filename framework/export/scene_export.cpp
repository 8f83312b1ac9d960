// SPDX-License-Identifier: Apache-2.0
#include "framework/export/scene_export.h"

#include <span>
#include <string>
#include <system_error>

#include "diorama/error.h"
#include "framework/export/crate_writer.h"
#include "framework/export/scene_layer.h"
#include "framework/export/usda_writer.h"
#include "framework/host/replace_file.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

void write_file(const fs::path& file, std::span<const std::byte> bytes) {
  std::error_code error;
  if (file.has_parent_path()) fs::create_directories(file.parent_path(), error);
  if (error) {
    throw Error(ErrorKind::Output, file.string() + ": cannot be written: " + error.message());
  }
  replace_file(file, bytes);
}

std::vector<std::byte> encode(const Texture& texture, const Host& host) {
  ImageView view{nullptr, texture.width, texture.height, texture.channels, 8};
  if (!texture.floats.empty()) {
    view.data = texture.floats.data();
    view.bits_per_channel = 32;
    return host.encode_image(view, ImageFormat::Hdr);
  }
  view.data = texture.bytes.data();
  if (texture.channels != 2) return host.encode_image(view, ImageFormat::Png);
  std::vector<std::uint8_t> three;
  for (std::size_t i = 0; i < texture.bytes.size(); i += 2) {
    three.insert(three.end(), {texture.bytes[i], texture.bytes[i + 1], 0});
  }
  view.data = three.data();
  view.channels = 3;
  return host.encode_image(view, ImageFormat::Png);
}

void export_sky(const Scene& scene, NodeId root, const fs::path& file, const Host& host) {
  for (const NodeId id : scene.subtree(root)) {
    const auto& light = scene[id].light;
    if (!light || light->kind != LightKind::Dome || !light->texture) continue;
    if (light->texture->floats.empty() || light->texture->channels != 3) continue;
    return write_file(file, encode(*light->texture, host));
  }
  throw Error(ErrorKind::Usage,
              file.string() +
                  ": an .hdr file holds a sky, and the asset has no dome light with a "
                  "picture of floating-point numbers");
}

}  // namespace

void export_scene(const Scene& scene, NodeId root, const fs::path& file,
                  const ExportOptions& options, const Host& host) {
  const std::string ending = file.extension().string();
  if (ending == ".hdr") return export_sky(scene, root, file, host);
  if (ending != ".usda" && ending != ".usdc" && ending != ".usd") {
    throw Error(ErrorKind::Usage, file.string() + ": expected a file that ends in .usda, .usdc, " +
                                      ".usd or .hdr, found '" + ending + "'");
  }
  const usd_export::SceneLayer result =
      usd_export::scene_layer(scene, root, file.stem().string(), options.with_physics);
  for (const usd_export::TextureFile& picture : result.textures) {
    write_file(file.parent_path() / picture.name, encode(*picture.texture, host));
  }
  // Last: a layer is never there without its pictures.
  if (ending == ".usda") {
    const std::string text = usd_export::write_usda(result.layer);
    return write_file(file, std::as_bytes(std::span(text)));
  }
  write_file(file, usd_export::write_crate(result.layer));
}

}  // namespace diorama
