// SPDX-License-Identifier: Apache-2.0
#include "path_starts.h"

namespace diorama {
namespace {

/// One coordinate of a pixel that may change places across the nearest border of tiles so wide.
int across_border(int x, int width, int tile, std::uint32_t draw) {
  const int border = (x + tile / 2) / tile * tile;
  const int partner = 2 * border - 1 - x;
  if (partner < 0 || partner >= width) return x;
  // The same for both. Half of those at the border do, none of those in the middle of a tile.
  const auto apart = std::uint32_t(partner > x ? partner - x : x - partner);
  const std::uint32_t bits =
      hashed_bits(draw ^ hashed_bits(std::uint32_t(x + partner) << 8 | apart));
  return (bits >> 16) * std::uint32_t(2 * tile) < (std::uint32_t(tile) - apart) << 16 ? partner : x;
}

}  // namespace

Pixel PixelPlaces::of(int x, int y) const {
  const auto row = std::uint32_t(y);
  const int column = across_border(x, width_, tiles_.width(), hashed_bits(draw_ + row));
  const auto key = hashed_bits(~draw_ + std::uint32_t(column));
  return {column, across_border(y, height_, tiles_.height(), key)};
}

Pixel PixelGroups::pixel(int group, int cell) const {
  const std::uint32_t bits = hashed_bits(draw_ ^ hashed_bits(std::uint32_t(cell)));
  const int place = group ^ int((bits >> 16) & std::uint32_t(count() - 1));
  return {cell % PixelTiles::kColumns * cell_ + place % cell_,
          cell / PixelTiles::kColumns * cell_ + place / cell_};
}

bool PixelGroups::goes_on(int group, int cell, std::uint32_t sample) const {
  constexpr int kNextRow = 3;  // Diagonals.
  const std::uint32_t start = hashed_bits(draw_ + std::uint32_t(group)) >> 16;
  return (std::uint32_t(cell + kNextRow * (cell / PixelTiles::kColumns)) + sample + start) %
             kSpacing ==
         0;
}

std::vector<std::vector<PathStart>> starts_in_order(const TraceJob& job, std::uint32_t begin,
                                                    std::uint32_t end, std::size_t most) {
  std::vector<std::vector<PathStart>> batches(1);
  for (int y = job.y_begin; y < job.y_end; ++y) {
    for (int x = job.x_begin; x < job.x_end; ++x) {
      for (std::uint32_t sample = begin; sample < end; ++sample) {
        if (batches.back().size() == most) batches.emplace_back();
        batches.back().push_back({{x, y}, {x, y}, sample});
      }
    }
  }
  return batches;
}

std::vector<std::vector<PathStart>> starts_in_groups(const TraceJob& job, const PixelPlaces& places,
                                                     std::uint32_t begin, std::uint32_t end,
                                                     std::size_t most) {
  std::vector<std::vector<PathStart>> batches(1);
  std::uint32_t number = 0;
  const auto add_group = [&](const PixelGroups& groups, int group, int left, int top) {
    std::vector<PathStart> paths;
    for (int cell = 0; cell < PixelGroups::kPixels; ++cell) {
      const Pixel in_tile = groups.pixel(group, cell);
      const int x = left + in_tile.x;
      const int y = top + in_tile.y;
      if (x >= job.x_end || y >= job.y_end) continue;
      const Pixel pixel = places.of(x, y);
      for (std::uint32_t sample = begin; sample < end; ++sample) {
        const bool goes_on = groups.goes_on(group, cell, sample);
        paths.push_back({{x, y}, pixel, sample, number + sample - begin, goes_on});
      }
    }
    number += end - begin;
    if (batches.back().size() + paths.size() > most) batches.emplace_back();
    batches.back().insert(batches.back().end(), paths.begin(), paths.end());
  };
  for (int top = job.y_begin; top < job.y_end; top += places.tiles().height()) {
    for (int left = job.x_begin; left < job.x_end; left += places.tiles().width()) {
      const SampleOrder::Place place = job.order.place(left, top, begin);
      const PixelGroups groups(places.tiles(), place.key ^ hashed_bits(place.index));
      for (int group = 0; group < groups.count(); ++group) {
        add_group(groups, group, left, top);
      }
    }
  }
  return batches;
}

}  // namespace diorama
