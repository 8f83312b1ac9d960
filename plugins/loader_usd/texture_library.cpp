// SPDX-License-Identifier: Apache-2.0
#include "loader_usd/texture_library.h"

#include "diorama/error.h"
#include "loader_usd/usd/error.h"

namespace diorama::loader_usd {
namespace {

constexpr std::string_view kTileMark = "<UDIM>";
constexpr std::string_view kFirstTile = "1001";

}  // namespace

std::shared_ptr<const Texture> TextureLibrary::decode(const std::string& identifier) {
  auto [entry, is_new] = decoded_.try_emplace(identifier);
  if (is_new) {
    const usd::ByteView bytes = stage_.assets().read(identifier);
    entry->second = host_.decode_texture(bytes.bytes, identifier);
  }
  return entry->second;
}

std::shared_ptr<const Texture> TextureLibrary::read(const usd::FoundValue& asset,
                                                    TextureSpace space) {
  std::string identifier = stage_.anchor(asset);
  if (identifier.empty()) return nullptr;
  if (const std::size_t mark = identifier.find(kTileMark); mark != std::string::npos) {
    identifier.replace(mark, kTileMark.size(), kFirstTile);
  }
  const auto missing = [&](const std::string& why) {
    stage_.diagnostics().missing(asset.layer->identifier() + ": texture @" +
                                 *asset.value.as_text() + "@ " + why);
    return nullptr;
  };
  const bool is_raw = space == TextureSpace::Raw;
  const ColorSpace wanted = is_raw ? ColorSpace::Linear : ColorSpace::Srgb;
  if (const auto known = converted_.find({identifier, wanted});
      space != TextureSpace::Auto && known != converted_.end()) {
    return known->second;
  }
  std::shared_ptr<const Texture> texture;
  try {
    if (!stage_.assets().exists(identifier)) return missing("could not be found");
    texture = decode(identifier);
  } catch (const Error& error) {
    return missing(std::string("could not be read: ") + error.what());
  } catch (const usd::FormatError& error) {
    return missing(std::string("could not be read: ") + error.what());
  }
  if (!texture || space == TextureSpace::Auto || !texture->floats.empty()) return texture;
  if (texture->color_space == wanted) return texture;
  auto copy = std::make_shared<Texture>(*texture);
  copy->color_space = wanted;
  // Most files are used in one way only: then the first reading need not stay.
  decoded_.erase(identifier);
  return converted_.emplace(std::pair(identifier, wanted), std::move(copy)).first->second;
}

}  // namespace diorama::loader_usd
