// SPDX-License-Identifier: Apache-2.0
#include "framework/images/png_filters.h"

#include <bit>
#include <cstring>
#include <vector>

namespace diorama::images {
namespace {

/// The channels of a pixel side by side, with room for sums and differences; the rest is unused.
using Lanes [[gnu::vector_size(16)]] = std::int16_t;
using Halves [[gnu::vector_size(16)]] = std::uint64_t;

template <std::size_t kStride>
Lanes load(const std::uint8_t* from) {
  std::uint32_t pixel = 0;
  if constexpr (kStride == 3) {
    // A copy of three bytes goes through memory in two parts, for which the processor waits.
    std::uint16_t low = 0;
    std::memcpy(&low, from, sizeof low);
    pixel = low | std::uint32_t(from[2]) << 16;
  } else {
    std::memcpy(&pixel, from, kStride);
  }
  std::uint64_t spread = pixel;
  spread = (spread | spread << 16) & 0x0000FFFF0000FFFFu;
  spread = (spread | spread << 8) & 0x00FF00FF00FF00FFu;
  return std::bit_cast<Lanes>(Halves{spread, 0});
}

/// Values are 0 to 255.
template <std::size_t kStride>
void store(Lanes lanes, std::uint8_t* to) {
  std::uint64_t spread = std::bit_cast<Halves>(lanes)[0];
  spread = (spread | spread >> 8) & 0x0000FFFF0000FFFFu;
  const auto pixel = std::uint32_t(spread | spread >> 16);
  std::memcpy(to, &pixel, kStride);
}

Lanes least(Lanes a, Lanes b) { return a < b ? a : b; }

Lanes absolute(Lanes lanes) {
  const Lanes turned = -lanes;
  return lanes > turned ? lanes : turned;
}

/// Whichever of the three is nearest to left + up - corner, of equally near ones the first; `rest`
/// is added before the choice, as pixels wait for their left neighbours.
Lanes paeth(Lanes left, Lanes up, Lanes corner, Lanes rest) {
  const Lanes from_up = up - corner;
  const Lanes from_left = left - corner;
  const Lanes to_left = absolute(from_up);
  const Lanes to_up = absolute(from_left);
  const Lanes to_corner = absolute(from_up + from_left);
  const Lanes if_left = (left + rest) & 255;
  const Lanes if_up = (up + rest) & 255;
  const Lanes if_corner = (corner + rest) & 255;
  const Lanes if_other = to_up <= to_corner ? if_up : if_corner;
  return to_left <= least(to_up, to_corner) ? if_left : if_other;
}

/// Sixteen sums at a time: `to` may lie in front of `from` and reach into it, which compilers do
/// not make vectors for.
void add_above(const std::uint8_t* from, const std::uint8_t* above, std::size_t size,
               std::uint8_t* to) {
  using Bytes [[gnu::vector_size(16)]] = std::uint8_t;
  std::size_t i = 0;
  for (; i + sizeof(Bytes) <= size; i += sizeof(Bytes)) {
    Bytes rest;
    Bytes up;
    std::memcpy(&rest, from + i, sizeof rest);
    std::memcpy(&up, above + i, sizeof up);
    rest += up;
    std::memcpy(to + i, &rest, sizeof rest);
  }
  for (; i < size; ++i) to[i] = std::uint8_t(from[i] + above[i]);
}

/// What a pixel is beyond what its neighbours tell, by filter. `above` has the length of the row;
/// `to` lies in front of `from`, which it may reach into.
template <std::size_t kStride>
bool undo_row(int filter, const std::uint8_t* from, const std::uint8_t* above, std::size_t size,
              std::uint8_t* to) {
  const auto each_pixel = [&](auto&& sum) {
    Lanes left{};
    Lanes corner{};
    for (std::size_t i = 0; i < size; i += kStride) {
      const Lanes up = load<kStride>(above + i);
      left = sum(load<kStride>(from + i), left, up, corner);
      corner = up;
      store<kStride>(left, to + i);
    }
  };
  switch (filter) {
    case 0:
      std::memmove(to, from, size);
      return true;
    case 1:
      each_pixel([](Lanes rest, Lanes left, Lanes, Lanes) { return (rest + left) & 255; });
      return true;
    case 2:
      add_above(from, above, size, to);
      return true;
    case 3:
      each_pixel([](Lanes rest, Lanes left, Lanes up, Lanes) {
        return (rest + ((left + up) >> 1)) & 255;
      });
      return true;
    case 4:
      each_pixel([](Lanes rest, Lanes left, Lanes up, Lanes corner) {
        return paeth(left, up, corner, rest);
      });
      return true;
    default:
      return false;
  }
}

template <std::size_t kStride>
bool undo_rows(std::span<std::uint8_t> rows, std::size_t height) {
  const std::size_t size = rows.size() / height - 1;
  const std::vector<std::uint8_t> zeros(size, 0);
  const std::uint8_t* above = zeros.data();
  for (std::size_t y = 0; y < height; ++y) {
    const std::uint8_t* from = rows.data() + y * (size + 1);
    std::uint8_t* to = rows.data() + y * size;
    if (!undo_row<kStride>(from[0], from + 1, above, size, to)) return false;
    above = to;
  }
  return true;
}

}  // namespace

bool undo_png_filters(std::span<std::uint8_t> rows, std::size_t height, std::size_t stride) {
  switch (stride) {
    case 1:
      return undo_rows<1>(rows, height);
    case 2:
      return undo_rows<2>(rows, height);
    case 3:
      return undo_rows<3>(rows, height);
    default:
      return undo_rows<4>(rows, height);
  }
}

}  // namespace diorama::images
