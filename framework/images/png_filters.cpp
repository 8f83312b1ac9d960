// SPDX-License-Identifier: Apache-2.0
#include "framework/images/png_filters.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <vector>

namespace diorama::images {
namespace {

using Bytes [[gnu::vector_size(16)]] = std::uint8_t;
/// Four pixels of up to four channels.
using Pixels [[gnu::vector_size(16)]] = std::uint32_t;

constexpr std::size_t kLanes = 4;

enum Filter : std::uint8_t { kNone, kLeft, kUp, kAverage, kPaeth };

template <std::size_t kStride>
std::uint32_t load(const std::uint8_t* from) {
  std::uint32_t pixel = 0;
  if constexpr (kStride == 3) {
    // A copy of three bytes goes through memory in two parts, for which the processor waits.
    std::uint16_t low = 0;
    std::memcpy(&low, from, sizeof low);
    pixel = low | std::uint32_t(from[2]) << 16;
  } else {
    std::memcpy(&pixel, from, kStride);
  }
  return pixel;
}

/// Two pixels of three bytes side by side, in the lower and the upper half, and back.
std::uint64_t spread(std::uint64_t pixels) {
  return (pixels & 0xFFFFFF) | (pixels & 0xFFFFFF000000u) << 8;
}
std::uint64_t joined(std::uint64_t halves) {
  return (halves & 0xFFFFFF) | (halves >> 8 & 0xFFFFFF000000u);
}

using Halves [[gnu::vector_size(16)]] = std::uint64_t;

template <std::size_t kStride>
Pixels load_four(const std::uint8_t* from) {
  if constexpr (kStride == 4) {
    Pixels pixels;
    std::memcpy(&pixels, from, sizeof pixels);
    return pixels;
  } else if constexpr (kStride == 3) {
    std::uint64_t first = 0;
    std::uint32_t rest = 0;
    std::memcpy(&first, from, sizeof first);
    std::memcpy(&rest, from + sizeof first, sizeof rest);
    return std::bit_cast<Pixels>(
        Halves{spread(first), spread(first >> 48 | std::uint64_t(rest) << 16)});
  } else {
    return Pixels{load<kStride>(from), load<kStride>(from + kStride),
                  load<kStride>(from + 2 * kStride), load<kStride>(from + 3 * kStride)};
  }
}

template <std::size_t kStride>
void store_four(Pixels pixels, std::uint8_t* to) {
  if constexpr (kStride == 4) {
    std::memcpy(to, &pixels, sizeof pixels);
  } else if constexpr (kStride == 3) {
    const auto halves = std::bit_cast<Halves>(pixels);
    const std::uint64_t second = joined(halves[1]);
    const std::uint64_t first = joined(halves[0]) | second << 48;
    const auto rest = std::uint32_t(second >> 16);
    std::memcpy(to, &first, sizeof first);
    std::memcpy(to + sizeof first, &rest, sizeof rest);
  } else {
    for (std::size_t i = 0; i < kLanes; ++i) {
      const std::uint32_t pixel = pixels[i];
      std::memcpy(to + i * kStride, &pixel, kStride);
    }
  }
}

/// Columns of what were rows.
std::array<Pixels, kLanes> turned(const std::array<Pixels, kLanes>& rows) {
  const auto low = [](Pixels a, Pixels b) { return __builtin_shufflevector(a, b, 0, 4, 1, 5); };
  const auto high = [](Pixels a, Pixels b) { return __builtin_shufflevector(a, b, 2, 6, 3, 7); };
  const Pixels low_even = low(rows[0], rows[2]);
  const Pixels low_odd = low(rows[1], rows[3]);
  const Pixels high_even = high(rows[0], rows[2]);
  const Pixels high_odd = high(rows[1], rows[3]);
  return {low(low_even, low_odd), high(low_even, low_odd), low(high_even, high_odd),
          high(high_even, high_odd)};
}

Bytes least(Bytes a, Bytes b) { return a < b ? a : b; }
Bytes most(Bytes a, Bytes b) { return a < b ? b : a; }

struct FilteredRow {
  std::uint8_t filter = kNone;
  const std::uint8_t* from = nullptr;
  std::uint8_t* to = nullptr;
};

/// Four rows at a time, none of which is an average: a pixel waits for its left neighbour, and the
/// rows below go two pixels behind each other meanwhile.
template <std::size_t kStride>
class FourRows {
 public:
  /// How many places `advance` goes on, and how many it needs beyond the width.
  static constexpr std::size_t kPlaces = kLanes;
  static constexpr std::size_t kBehind = 2;
  static constexpr std::size_t kLast = kBehind * (kLanes - 1);

  FourRows(const std::array<FilteredRow, kLanes>& rows, const std::uint8_t* above,
           std::size_t width)
      : rows_(rows), above_(above), width_(width) {
    const auto set_lane = [](Bytes& bytes, std::size_t r, bool is_set) {
      for (std::size_t i = 0; i < sizeof(std::uint32_t); ++i) {
        bytes[r * sizeof(std::uint32_t) + i] = is_set ? 255 : 0;
      }
    };
    for (std::size_t r = 0; r < kLanes; ++r) {
      set_lane(is_paeth_, r, rows[r].filter == kPaeth);
      set_lane(is_fixed_, r, rows[r].filter == kNone || rows[r].filter == kUp);
      set_lane(is_up_, r, rows[r].filter == kUp);
    }
  }

  /// Undoes the next pixels: of the first row those from `at` on.
  void advance(std::size_t at) {
    if (at < kLast || at + kPlaces > width_) {
      for (std::size_t i = 0; i < kPlaces; ++i) step_at(at + i);
      return;
    }
    std::array<Pixels, kLanes> pixels;
    for (std::size_t r = 0; r < kLanes; ++r) {
      pixels[r] = load_four<kStride>(rows_[r].from + (at - kBehind * r) * kStride);
    }
    pixels = turned(pixels);
    for (std::size_t i = 0; i < kPlaces; ++i) {
      pixels[i] = step(pixels[i], load<kStride>(above_ + (at + i) * kStride));
    }
    pixels = turned(pixels);
    for (std::size_t r = 0; r < kLanes; ++r) {
      store_four<kStride>(pixels[r], rows_[r].to + (at - kBehind * r) * kStride);
    }
  }

 private:
  /// What is there beyond `rest` is that of left, up and corner that is nearest to left + up -
  /// corner, of equally near ones the first: without numbers that bytes do not hold, and with
  /// everything early for which left need not be known. Left itself is the nearest of left, 0 and
  /// 0; what needs no left takes the place of the corner, which nothing is nearer than there.
  Pixels step(Pixels rest_of_four, std::uint32_t over) {
    const auto rest = std::bit_cast<Bytes>(rest_of_four);
    const Bytes corner = up_ & is_paeth_;
    up_ = std::bit_cast<Bytes>(
        __builtin_shufflevector(std::bit_cast<Pixels>(before_), Pixels{}, 4, 0, 1, 2) |
        Pixels{over, 0, 0, 0});
    const Bytes up = up_ & is_paeth_;
    const Bytes low = least(left_, up);
    const Bytes high = most(left_, up);
    // The corner may lie outside; the side across from it is nearest then.
    const Bytes to_low = most(high, corner) - corner;
    const Bytes to_high = corner - least(corner, low);
    const Bytes to_side = least(to_low, to_high);
    const Bytes to_corner = most(to_low, to_high) - to_side;
    const Bytes by_side = to_low < to_high ? low + rest : high + rest;
    const Bytes by_corner = (corner | (up_ & is_up_)) + rest;
    // No distance to a side is 255 more than that to the corner.
    const Bytes beyond = most(to_side, to_corner) - to_corner;
    before_ = left_;
    left_ = beyond == is_fixed_ ? by_side : by_corner;
    return std::bit_cast<Pixels>(left_);
  }

  /// Where not all rows are at a pixel of theirs.
  void step_at(std::size_t at) {
    const auto is_inside = [&](std::size_t r) {
      return at >= kBehind * r && at - kBehind * r < width_;
    };
    Pixels rest{};
    for (std::size_t r = 0; r < kLanes; ++r) {
      if (is_inside(r)) rest[r] = load<kStride>(rows_[r].from + (at - kBehind * r) * kStride);
    }
    const Pixels done = step(rest, at < width_ ? load<kStride>(above_ + at * kStride) : 0);
    for (std::size_t r = 0; r < kLanes; ++r) {
      const std::uint32_t pixel = done[r];
      if (is_inside(r)) std::memcpy(rows_[r].to + (at - kBehind * r) * kStride, &pixel, kStride);
    }
  }

  std::array<FilteredRow, kLanes> rows_;
  const std::uint8_t* above_;
  std::size_t width_;
  Bytes is_paeth_{};
  Bytes is_fixed_{};
  Bytes is_up_{};
  Bytes left_{};    // of each row, at its place
  Bytes before_{};  // left of `left_`
  Bytes up_{};
};

/// A row by itself, which is no Paeth's. `above` has the length of the row.
template <std::size_t kStride>
void undo_row(FilteredRow row, const std::uint8_t* above, std::size_t size) {
  const auto each_pixel = [&](auto&& sum) {
    const auto pixel_at = [](const std::uint8_t* from) {
      return std::bit_cast<Bytes>(Pixels{load<kStride>(from), 0, 0, 0});
    };
    Bytes left{};
    for (std::size_t i = 0; i < size; i += kStride) {
      left = sum(pixel_at(row.from + i), left, pixel_at(above + i));
      const std::uint32_t done = std::bit_cast<Pixels>(left)[0];
      std::memcpy(row.to + i, &done, kStride);
    }
  };
  switch (row.filter) {
    case kNone:
      std::memcpy(row.to, row.from, size);
      return;
    case kLeft:
      each_pixel([](Bytes rest, Bytes left, Bytes) { return rest + left; });
      return;
    case kUp:
      for (std::size_t i = 0; i < size; ++i) row.to[i] = std::uint8_t(row.from[i] + above[i]);
      return;
    default:
      each_pixel([](Bytes rest, Bytes left, Bytes up) {
        return (rest + (left & up)) + ((left ^ up) >> 1);
      });
  }
}

/// How many rows are undone at once: twice four, as the processor has time for the second four
/// while the first ones wait.
constexpr std::size_t kMostRows = 2 * kLanes;

template <std::size_t kStride>
void undo_group(const std::array<FilteredRow, kMostRows>& rows, std::size_t count,
                const std::uint8_t* above, std::size_t width) {
  using Four = FourRows<kStride>;
  const auto four_from = [&](std::size_t first) {
    std::array<FilteredRow, kLanes> four;
    std::copy_n(rows.begin() + std::ptrdiff_t(first), kLanes, four.begin());
    return four;
  };
  const std::size_t end = width + Four::kLast;
  Four first(four_from(0), above, width);
  if (count <= kLanes) {
    for (std::size_t at = 0; at < end; at += Four::kPlaces) first.advance(at);
    return;
  }
  // Behind what the last of the first rows has stored.
  constexpr std::size_t kDelay = Four::kLast + Four::kPlaces + 2;
  static_assert(kDelay % Four::kPlaces == 0);
  Four second(four_from(kLanes), rows[kLanes - 1].to, width);
  for (std::size_t at = 0; at < end + kDelay; at += Four::kPlaces) {
    first.advance(at);
    if (at >= kDelay) second.advance(at - kDelay);
  }
}

template <std::size_t kStride>
bool undo_rows(std::span<const std::uint8_t> rows, std::size_t height,
               std::vector<std::uint8_t>& pixels) {
  const std::size_t size = rows.size() / height - 1;
  const std::vector<std::uint8_t> zeros(size, 0);
  std::vector<std::uint8_t> unused(size, 0);
  pixels.reserve(pixels.size() + size * height);
  const std::uint8_t* above = zeros.data();
  const auto filter_of = [&](std::size_t y) { return rows[y * (size + 1)]; };
  for (std::size_t y = 0; y < height;) {
    if (filter_of(y) > kPaeth) return false;
    std::size_t count = 1;
    if (filter_of(y) == kPaeth) {
      while (count < std::min(kMostRows, height - y) && filter_of(y + count) <= kPaeth &&
             filter_of(y + count) != kAverage) {
        ++count;
      }
    }
    std::array<FilteredRow, kMostRows> group;
    group.fill({kNone, zeros.data(), unused.data()});
    for (std::size_t r = 0; r < count; ++r, ++y) {
      pixels.resize(pixels.size() + size);
      group[r] = {filter_of(y), rows.data() + y * (size + 1) + 1,
                  pixels.data() + pixels.size() - size};
    }
    if (group[0].filter == kPaeth) {
      undo_group<kStride>(group, count, above, size / kStride);
    } else {
      undo_row<kStride>(group[0], above, size);
    }
    above = group[count - 1].to;
  }
  return true;
}

}  // namespace

bool undo_png_filters(std::span<const std::uint8_t> rows, std::size_t height, std::size_t stride,
                      std::vector<std::uint8_t>& pixels) {
  switch (stride) {
    case 1:
      return undo_rows<1>(rows, height, pixels);
    case 2:
      return undo_rows<2>(rows, height, pixels);
    case 3:
      return undo_rows<3>(rows, height, pixels);
    default:
      return undo_rows<4>(rows, height, pixels);
  }
}

}  // namespace diorama::images
