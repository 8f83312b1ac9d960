// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "renderer_support/sample_plan.h"
#include "renderer_support/trace_job.h"

namespace diorama {

struct Pixel {
  int x = 0;
  int y = 0;
};

/// Tiles of a picture, in which pixels' paths use each other's surfaces, and their square cells.
struct PixelTiles {
  static constexpr int kColumns = 8;  ///< Of cells.
  static constexpr int kRows = 4;
  static constexpr int kCells = kColumns * kRows;
  int cell = 4;  ///< Pixels, its side: a power of two.

  /// Of small pictures they are smaller, so that the pixels of one see about the same.
  static PixelTiles of_picture(int width, int height) {
    constexpr int kSmall = 200 * 200;
    return {width * height < kSmall ? 2 : 4};
  }
  int width() const { return kColumns * cell; }
  int height() const { return kRows * cell; }
  /// Has a plan decide for tiles: their groups are whole only where one job has all of a tile.
  void set_blocks(SamplePlan::Limits& limits) const {
    limits.block_width = width();
    limits.block_height = height();
  }
};

/// Which pixels' paths use each other's surfaces (see PathReuse). A group has one pixel of every
/// cell of a tile; which one, changes from cell to cell and from draw to draw. Neighbours are in
/// different groups, so what the pixels of a group have in common of their errors is grain in
/// place of a patch, and no pattern is seen.
class PixelGroups {
 public:
  static constexpr int kPixels = PixelTiles::kCells;  ///< Of a group.
  static constexpr std::uint32_t kSpacing = 4;  ///< One path of so many goes on: see PathReuse.

  PixelGroups(const PixelTiles& tiles, std::uint32_t draw) : cell_(tiles.cell), draw_(draw) {}

  int count() const { return cell_ * cell_; }  ///< In a tile.

  /// In the tile.
  Pixel pixel(int group, int cell) const;
  /// As many pixels of the group do in every sample, and every pixel does in one of kSpacing
  /// samples that follow each other.
  bool goes_on(int group, int cell, std::uint32_t sample) const;

 private:
  int cell_;
  std::uint32_t draw_;
};

/// Places of the tiles' pixels in the picture, one for each. Those near a tile's border change
/// places with others as far beyond it, the fewer the farther away: what a tile's pixels have in
/// common fades into what the next one's have, and no border is seen.
class PixelPlaces {
 public:
  /// `order`: of the picture.
  PixelPlaces(int width, int height, const SampleOrder& order)
      : tiles_(PixelTiles::of_picture(width, height)),
        width_(width),
        height_(height),
        draw_(order.place(0, 0, 0).key) {}

  const PixelTiles& tiles() const { return tiles_; }
  Pixel of(int x, int y) const;

 private:
  PixelTiles tiles_;
  int width_;
  int height_;
  std::uint32_t draw_;
};

struct PathStart {
  Pixel of_job;  ///< Where it is summed up; ...
  Pixel pixel;   ///< ... its place in the picture.
  std::uint32_t sample = 0;
  std::uint32_t group = 0;  ///< Paths with the same number use each other's surfaces.
  bool goes_on = true;      ///< Beyond a second surface that others see, too: see PathReuse.
};

/// The paths of a job's samples from `begin` to before `end`, at most `most` in each batch:
/// samples of a pixel side by side, ...
std::vector<std::vector<PathStart>> starts_in_order(const TraceJob& job, std::uint32_t begin,
                                                    std::uint32_t end, std::size_t most);
/// ... and whole groups in a batch, which `most` must have room for. The job's pixels lie at their
/// `places` in the picture.
std::vector<std::vector<PathStart>> starts_in_groups(const TraceJob& job, const PixelPlaces& places,
                                                     std::uint32_t begin, std::uint32_t end,
                                                     std::size_t most);

}  // namespace diorama
