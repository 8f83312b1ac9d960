// SPDX-License-Identifier: Apache-2.0
#include "path_starts.h"

#include <algorithm>
#include <cstdlib>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "support/catch.h"

namespace diorama {
namespace {

using Batches = std::vector<std::vector<PathStart>>;

/// How often every sample of every pixel is begun.
std::map<std::pair<int, int>, std::vector<int>> begun(const TraceJob& job, const Batches& batches) {
  std::map<std::pair<int, int>, std::vector<int>> counts;
  for (int y = job.y_begin; y < job.y_end; ++y) {
    for (int x = job.x_begin; x < job.x_end; ++x) counts[{x, y}].resize(job.sample_end, 0);
  }
  for (const auto& batch : batches) {
    for (const PathStart& start : batch) {
      ++counts.at({start.of_job.x, start.of_job.y}).at(start.sample);
    }
  }
  return counts;
}

}  // namespace

TEST_CASE("every sample of a job's pixels is begun once, in batches that are not too large",
          "[path_starts]") {
  const auto [width, height] = GENERATE(std::pair(8, 8), std::pair(3, 1), std::pair(32, 16),
                                        std::pair(67, 35), std::pair(5, 40));
  const int samples = GENERATE(1, 3, 4);
  const int picture = GENERATE(100, 300);
  CAPTURE(width, height, samples, picture);
  constexpr std::size_t kMost = 128;
  const std::uint32_t end = 7 + std::uint32_t(samples);
  const TraceJob job{16, 24, 16 + width, 24 + height, 7, end, SampleOrder(3, 16)};
  const PixelPlaces places(picture, picture, job.order);
  for (const Batches& batches :
       {starts_in_order(job, 7, end, kMost), starts_in_groups(job, places, 7, end, kMost)}) {
    for (const auto& batch : batches) {
      CHECK(!batch.empty());
      CHECK(batch.size() <= kMost);
    }
    for (const auto& [pixel, counts] : begun(job, batches)) {
      for (std::size_t s = 0; s < counts.size(); ++s) CHECK(counts[s] == (s >= 7));
    }
  }
}

TEST_CASE("a group has a pixel of every cell, one sample of each, in one batch", "[path_starts]") {
  const int size = GENERATE(100, 300);
  const SampleOrder order(3, 16);
  const PixelPlaces places(size, size, order);
  const PixelTiles& tiles = places.tiles();
  const TraceJob job{0, 0, 2 * tiles.width(), tiles.height(), 0, 3, order};
  std::map<std::uint32_t, std::set<std::pair<int, int>>> cells;
  std::map<std::uint32_t, std::set<std::uint32_t>> samples;
  std::map<std::uint32_t, std::set<std::size_t>> in_batches;
  const Batches batches = starts_in_groups(job, places, 0, 3, 128);
  for (std::size_t i = 0; i < batches.size(); ++i) {
    for (const PathStart& start : batches[i]) {
      cells[start.group].insert({start.of_job.x / tiles.cell, start.of_job.y / tiles.cell});
      samples[start.group].insert(start.sample);
      in_batches[start.group].insert(i);
    }
  }
  CHECK(cells.size() == std::size_t(2 * 3 * tiles.cell * tiles.cell));
  for (const auto& [group, own] : cells) {
    CHECK(own.size() == PixelGroups::kPixels);
    CHECK(own.rbegin()->first - own.begin()->first == PixelTiles::kColumns - 1);  // Of one tile.
    CHECK(samples[group].size() == 1);
    CHECK(in_batches[group].size() == 1);
  }
}

TEST_CASE("neighbours are in other groups, and in those of other pixels every time",
          "[path_starts]") {
  // How often pixels so far apart share a group, in one row.
  const auto shared = [](int apart) {
    int count = 0;
    for (std::uint32_t draw = 0; draw < 400; ++draw) {
      const PixelGroups groups(PixelTiles{4}, draw);
      std::map<std::pair<int, int>, int> of;
      for (int group = 0; group < groups.count(); ++group) {
        for (int cell = 0; cell < PixelGroups::kPixels; ++cell) {
          const Pixel pixel = groups.pixel(group, cell);
          of[{pixel.x, pixel.y}] = group;
        }
      }
      count += of[{1, 1}] == of[{1 + apart, 1}];
    }
    return count;
  };
  for (const int apart : {1, 2}) CHECK(shared(apart) == 0);  // Of one cell.
  // As often as any place of another cell is met: 25 of 400.
  for (const int apart : {3, 4, 7, 8, 12}) {
    CAPTURE(apart);
    CHECK(shared(apart) > 5);
    CHECK(shared(apart) < 60);
  }
}

TEST_CASE("pixels change places one for one, half of those at borders of tiles", "[path_starts]") {
  const PixelTiles tiles;
  const int border = tiles.width();
  const int width = 7 * border + 5;
  const int height = 11 * tiles.height() + 11;
  constexpr int kDraws = 4;
  std::vector<int> moved(std::size_t(width), 0);
  int farthest = 0;
  for (std::uint64_t seed = 0; seed < kDraws; ++seed) {
    const PixelPlaces places(width, height, SampleOrder(seed, 4));
    REQUIRE(places.tiles().cell == tiles.cell);
    std::set<std::pair<int, int>> taken;
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const Pixel place = places.of(x, y);
        taken.insert({place.x, place.y});
        farthest = std::max({farthest, std::abs(place.x - x), 2 * std::abs(place.y - y)});
        moved[std::size_t(x)] += place.x != x;
      }
    }
    CHECK(taken.size() == std::size_t(width * height));
    CHECK(*taken.begin() == std::pair(0, 0));
    CHECK(*taken.rbegin() == std::pair(width - 1, height - 1));
  }
  CHECK(farthest < border);
  const auto share = [&](int x) { return moved[std::size_t(x)] / double(kDraws * height); };
  CHECK(share(border) == Approx(0.5).margin(0.06));
  CHECK(share(border - 1) == Approx(0.5).margin(0.06));
  CHECK(share(border + border / 4) == Approx(0.25).margin(0.06));
  CHECK(share(border + border / 2) == Approx(0.0).margin(0.06));
  // Beyond the picture there is none to change places with.
  CHECK(share(3) == 0.0);
  CHECK(share(7 * border - 7) == 0.0);
  CHECK(share(7 * border - 3) > 0.3);
}

TEST_CASE("one path of so many goes on, whatever the draw", "[path_starts]") {
  for (std::uint32_t draw = 0; draw < 20; ++draw) {
    const PixelGroups groups(PixelTiles{4}, draw);
    for (const int group : {0, 1, 9}) {
      std::vector<int> of_pixels(PixelGroups::kPixels, 0);
      for (std::uint32_t sample = 4; sample < 4 + PixelGroups::kSpacing; ++sample) {
        int going = 0;
        for (int cell = 0; cell < PixelGroups::kPixels; ++cell) {
          const bool goes_on = groups.goes_on(group, cell, sample);
          going += goes_on;
          of_pixels[std::size_t(cell)] += goes_on;
        }
        CHECK(going == PixelGroups::kPixels / int(PixelGroups::kSpacing));
      }
      CHECK(std::ranges::all_of(of_pixels, [](int count) { return count == 1; }));
    }
  }
}

}  // namespace diorama
