// SPDX-License-Identifier: Apache-2.0
#include "loader_usd/udim_atlas.h"

#include <algorithm>
#include <cstdint>

namespace diorama::loader_usd {
namespace {

constexpr int kMaxAtlasWidth = 32768;
constexpr std::size_t kMaxAtlasBytes = std::size_t(1) << 31;

// Nearest neighbours will do: the tiles of a set are of one size as a rule.
void copy_tile(const Texture& tile, Texture& atlas, int left, int top, int width, int height) {
  for (int y = 0; y < height; ++y) {
    const int from_y = y * tile.height / height;
    for (int x = 0; x < width; ++x) {
      const int from_x = x * tile.width / width;
      const std::uint8_t* from =
          tile.bytes.data() +
          (std::size_t(from_y) * std::size_t(tile.width) + std::size_t(from_x)) *
              std::size_t(tile.channels);
      std::uint8_t* to = atlas.bytes.data() +
                         (std::size_t(top + y) * std::size_t(atlas.width) + std::size_t(left + x)) *
                             std::size_t(atlas.channels);
      for (int c = 0; c < atlas.channels; ++c) to[c] = from[std::min(c, tile.channels - 1)];
    }
  }
}

}  // namespace

UdimRange UdimRange::of(const std::vector<UdimTile>& tiles) {
  int last_column = tiles.front().column;
  int last_row = tiles.front().row;
  UdimRange range{last_column, last_row, 0, 0};
  for (const UdimTile& tile : tiles) {
    range.first_column = std::min(range.first_column, tile.column);
    range.first_row = std::min(range.first_row, tile.row);
    last_column = std::max(last_column, tile.column);
    last_row = std::max(last_row, tile.row);
  }
  range.columns = last_column - range.first_column + 1;
  range.rows = last_row - range.first_row + 1;
  return range;
}

Eigen::Matrix<float, 2, 3> UdimRange::atlas_from_uv() const {
  const float u = 1.0f / static_cast<float>(columns);
  const float v = 1.0f / static_cast<float>(rows);
  Eigen::Matrix<float, 2, 3> map;
  map << u, 0.0f, -u * static_cast<float>(first_column), 0.0f, v,
      -v * static_cast<float>(first_row);
  return map;
}

std::shared_ptr<const Texture> make_udim_atlas(const std::string& name,
                                               const std::vector<UdimTile>& tiles) {
  const Texture& first = *tiles.front().texture;
  const UdimRange range = UdimRange::of(tiles);
  int width = 0;
  int height = 0;
  int channels = 0;
  for (const UdimTile& tile : tiles) {
    if (tile.texture->bytes.empty()) return tiles.front().texture;
    width = std::max(width, tile.texture->width);
    height = std::max(height, tile.texture->height);
    channels = std::max(channels, tile.texture->channels);
  }
  auto atlas = std::make_shared<Texture>();
  atlas->name = name;
  atlas->channels = channels;
  atlas->color_space = first.color_space;
  // A sparse set of large tiles must not become a picture of gigabytes.
  const auto bytes = [&] {
    return std::size_t(width) * std::size_t(height) * std::size_t(range.columns * range.rows) *
           std::size_t(channels);
  };
  while (width > 1 && (bytes() > kMaxAtlasBytes || width * range.columns > kMaxAtlasWidth)) {
    width = (width + 1) / 2;
    height = (height + 1) / 2;
  }
  atlas->width = width * range.columns;
  atlas->height = height * range.rows;
  atlas->bytes.resize(bytes());
  for (const UdimTile& tile : tiles) {
    const int left = (tile.column - range.first_column) * width;
    // Rows of tiles count from the bottom, rows of pixels from the top.
    const int top = (range.rows - 1 - (tile.row - range.first_row)) * height;
    copy_tile(*tile.texture, *atlas, left, top, width, height);
  }
  return atlas;
}

}  // namespace diorama::loader_usd
