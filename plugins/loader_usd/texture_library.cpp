// SPDX-License-Identifier: Apache-2.0
#include "loader_usd/texture_library.h"

#include "diorama/error.h"
#include "loader_usd/usd/error.h"

namespace diorama::loader_usd {
namespace {

constexpr std::string_view kTileMark = "<UDIM>";
constexpr int kTileColumns = 10;
constexpr int kTiles = 100;

std::optional<ColorSpace> to_color_space(TextureSpace space) {
  if (space == TextureSpace::Raw) return ColorSpace::Linear;
  if (space == TextureSpace::Srgb) return ColorSpace::Srgb;
  return std::nullopt;
}

}  // namespace

void TextureLibrary::missing(const usd::FoundValue& asset, const std::string& why,
                             const std::string& material) {
  missing_.add(stage_.anchor(asset),
               asset.layer->identifier() + ": texture @" + *asset.value.as_text() + "@ " + why,
               material);
}

void TextureLibrary::report_missing() const {
  const std::vector<std::string> lines = missing_.lines();
  for (std::size_t i = 0; i < lines.size(); ++i) {
    stage_.diagnostics().missing(missing_.pictures()[i], lines[i]);
  }
}

std::optional<TextureLibrary::Picture> TextureLibrary::find_tiles(const std::string& identifier) {
  struct File {
    UdimTile tile;
    std::string identifier;
    usd::ByteView bytes;
  };
  std::vector<File> files;
  std::vector<UdimTile> tiles;
  const std::vector<std::string> names = usd::tile_names(identifier);
  for (int i = 0; i < kTiles; ++i) {
    const std::string& name = names[std::size_t(i)];
    if (!stage_.assets().exists(name)) continue;
    tiles.push_back({i % kTileColumns, i / kTileColumns, nullptr});
    files.push_back({tiles.back(), name, stage_.assets().read(name)});
  }
  if (files.empty()) return std::nullopt;
  decoder_.announce(identifier, [this, identifier, files] {
    std::vector<UdimTile> decoded;
    for (const File& file : files) {
      decoded.push_back(file.tile);
      decoded.back().texture = host_.decode_texture(file.bytes.bytes, file.identifier);
    }
    return make_udim_atlas(identifier, decoded);
  });
  return Picture{identifier, UdimRange::of(tiles)};
}

std::optional<TextureLibrary::Picture> TextureLibrary::find(const usd::FoundValue& asset,
                                                            const std::string& material) {
  const std::string identifier = stage_.anchor(asset);
  if (identifier.empty()) return std::nullopt;
  const auto [entry, is_new] = found_.try_emplace(identifier);
  Found& found = entry->second;
  if (is_new) {
    found.why_not = stage_.assets().missing_text(identifier);
    try {
      if (identifier.find(kTileMark) != std::string::npos) {
        found.picture = find_tiles(identifier);
      } else if (stage_.assets().exists(identifier)) {
        // Bytes are found here, because that is for one thread; decoding them is for all.
        decoder_.announce(identifier, [this, identifier, bytes = stage_.assets().read(identifier)] {
          return host_.decode_texture(bytes.bytes, identifier);
        });
        found.picture = Picture{identifier, std::nullopt};
      }
    } catch (const usd::FormatError& error) {
      found.why_not = std::string("could not be read: ") + error.what();
    }
  }
  if (!found.picture) missing(asset, found.why_not, material);
  return found.picture;
}

bool TextureLibrary::announce(const usd::FoundValue& asset, const std::string& material) {
  return find(asset, material).has_value();
}

FoundTexture TextureLibrary::read(const usd::FoundValue& asset, TextureSpace space,
                                  const std::string& material) {
  FoundTexture result;
  const std::optional<Picture> picture = find(asset, material);
  if (!picture) return result;
  try {
    result.texture = decoder_.get(picture->identifier, to_color_space(space));
    if (picture->udim) result.texture_from_uv = picture->udim->atlas_from_uv();
  } catch (const Error& error) {
    missing(asset, std::string("could not be read: ") + error.what(), material);
  }
  return result;
}

}  // namespace diorama::loader_usd
