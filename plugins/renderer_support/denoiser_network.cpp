// SPDX-License-Identifier: Apache-2.0
#include "denoiser_network.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cstdint>
#include <cstring>
#include <numbers>
#include <utility>

#include "diorama/error.h"

namespace diorama {
namespace {

constexpr int kBlock = ChannelBlocks::kWidth;
constexpr std::int32_t kMagic = 0x574E4544;  // "DENW"
constexpr std::int32_t kVersion = 3;
constexpr int kRowsPerTask = 4;

// Convolutions of 3 x 3 pixels go by Winograd's way, F(4 x 4, 3 x 3) of Lavin and Gray, "Fast
// Algorithms for Convolutional Neural Networks" (2015): 4 x 4 pixels take 36 products instead of
// 144. Rows and columns count as polynomials, which are multiplied by their values at the points
// 0, +-kNear, +-kFar and infinity. With 1 and 2 the largest rounding errors would be three times as
// large.
constexpr int kTile = 4;   // pixels of a side of what comes out
constexpr int kPatch = 6;  // of what goes in
constexpr int kPlaces = kPatch * kPatch;
constexpr float kFar = std::numbers::sqrt2_v<float>;
constexpr float kNear = kFar / 2.0f;
constexpr float kFar2 = 2.0f;
constexpr float kNear2 = 0.5f;
// They share the weights from the nearer caches, into which the values of many more would not fit.
constexpr int kTilesPerGroup = 24;

float from_half(std::uint16_t half) {
  const std::uint32_t sign = std::uint32_t(half & 0x8000u) << 16;
  const std::uint32_t exponent = half >> 10 & 0x1Fu;
  const std::uint32_t mantissa = half & 0x3FFu;
  if (exponent == 0) {
    const float value = float(mantissa) * 0x1p-24f;
    return sign != 0 ? -value : value;
  }
  return std::bit_cast<float>(sign | (exponent + 112u) << 23 | mantissa << 13);
}

int blocks_of(int channels) { return (channels + kBlock - 1) / kBlock; }

/// Reads the file of weights from front to back.
class WeightReader {
 public:
  explicit WeightReader(std::span<const std::byte> bytes) : bytes_(bytes) {}

  std::int32_t number() {
    std::int32_t value;
    std::memcpy(&value, take(sizeof value), sizeof value);
    return value;
  }
  std::vector<float> halves(int count) {
    std::vector<float> values(std::size_t(count), 0.0f);
    const std::byte* from = take(2 * values.size());
    for (std::size_t i = 0; i < values.size(); ++i) {
      std::uint16_t half;
      std::memcpy(&half, from + 2 * i, 2);
      values[i] = from_half(half);
    }
    return values;
  }
  bool is_at_end() const { return bytes_.empty(); }

 private:
  const std::byte* take(std::size_t count) {
    if (bytes_.size() < count) throw Error(ErrorKind::Internal, "denoiser: weights end too early");
    const std::byte* const from = bytes_.data();
    bytes_ = bytes_.subspan(count);
    return from;
  }
  std::span<const std::byte> bytes_;
};

/// Row by row: output channel, input channel, y, x; then the biases.
struct PlainWeights {
  PlainWeights(WeightReader& reader, int input_channels, int output_channels, int kernel_side)
      : inputs(input_channels),
        outputs(output_channels),
        side(kernel_side),
        weights(reader.halves(outputs * inputs * side * side)),
        biases(reader.halves(outputs)) {}

  int inputs, outputs, side;
  std::vector<float> weights, biases;
};

/// The values of a row of three weights at the points, each divided by the product of the point's
/// distances from the others, as interpolation asks for.
std::array<double, kPatch> weights_at_points(double w0, double w1, double w2) {
  const auto pair = [&](double x, double x2, double other2) {
    const double scale = 1.0 / (2.0 * x2 * (x2 - other2));
    const double even = scale * (w0 + x2 * w2);
    const double odd = scale * x * w1;
    return std::pair(even + odd, even - odd);
  };
  const auto [near, minus_near] = pair(kNear, kNear2, kFar2);
  const auto [far, minus_far] = pair(kFar, kFar2, kNear2);
  static_assert(kNear2 * kFar2 == 1.0f);  // by which w0 would be divided
  return {w0, near, minus_near, far, minus_far, w2};
}

/// Of a point for columns and one for rows each.
std::array<double, kPlaces> weights_at_places(const float* weights) {
  std::array<std::array<double, kPatch>, 3> rows;
  for (std::size_t y = 0; y < 3; ++y, weights += 3) {
    rows[y] = weights_at_points(weights[0], weights[1], weights[2]);
  }
  std::array<double, kPlaces> places;
  for (std::size_t x = 0; x < kPatch; ++x) {
    const auto column = weights_at_points(rows[0][x], rows[1][x], rows[2][x]);
    for (std::size_t y = 0; y < kPatch; ++y) places[y * kPatch + x] = column[y];
  }
  return places;
}

/// With the outputs from `begin` on, `count` of them, after those of `before`.
void add_outputs(Convolution& to, const PlainWeights& from, int begin, int count, int before) {
  const bool is_tiled = from.side == 3;
  const int places = is_tiled ? kPlaces : 1;
  std::copy_n(&from.biases[std::size_t(begin)], count, &to.biases[std::size_t(before)]);
  for (int in = 0; in < from.inputs; ++in) {
    for (int o = 0; o < count; ++o) {
      const int out = before + o;
      const float* const plain =
          &from.weights[std::size_t(((begin + o) * from.inputs + in) * from.side * from.side)];
      const auto put = [&](int place, float value) {
        const std::size_t row =
            std::size_t((out / kBlock * places + place) * to.inputs * kBlock + in);
        to.weights[row * kBlock + std::size_t(out % kBlock)] = value;
      };
      if (!is_tiled) {
        put(0, *plain);
        continue;
      }
      const auto values = weights_at_places(plain);
      for (int place = 0; place < kPlaces; ++place) put(place, float(values[std::size_t(place)]));
    }
  }
}

Convolution empty_convolution(int inputs, int outputs, int side) {
  Convolution c{blocks_of(inputs), blocks_of(outputs), {}, {}};
  const int places = side == 3 ? kPlaces : 1;
  c.weights.assign(std::size_t(c.inputs * c.outputs * places) * kBlock * kBlock, 0.0f);
  c.biases.assign(std::size_t(c.outputs) * kBlock, 0.0f);
  return c;
}

Convolution read_convolution(WeightReader& reader, int inputs, int outputs, int side) {
  Convolution c = empty_convolution(inputs, outputs, side);
  add_outputs(c, PlainWeights(reader, inputs, outputs, side), 0, outputs, 0);
  return c;
}

// As wide as the instruction set, so that sums stay in registers.
template <int kWide>
struct Wide {
  using Numbers [[gnu::vector_size(4 * kWide)]] = float;
  /// The same anywhere in memory.
  using Loose [[gnu::vector_size(4 * kWide), gnu::aligned(4), gnu::may_alias]] = float;
};

/// Of pixels or tiles that lie side by side in blocks of 16 channels.
struct Product {
  const float* in;  ///< The first one's first block.
  std::size_t in_block_stride;
  int inputs;            ///< Blocks.
  const float* weights;  ///< Of the first block of outputs.
  std::size_t weights_block_stride;
  const float* biases;  ///< May be null.
  float* out;           ///< The first one's first block.
  std::size_t out_block_stride;
};

/// kGroup blocks of outputs of kCount pixels or tiles.
template <int kWide, int kGroup, int kCount>
[[gnu::always_inline]] inline void multiply(const Product& product) {
  using Numbers = typename Wide<kWide>::Numbers;
  using Loose = typename Wide<kWide>::Loose;
  constexpr int kPerBlock = kBlock / kWide;
  constexpr int kVectors = kGroup * kPerBlock;
  Numbers sums[kVectors][kCount];
#pragma GCC unroll 16
  for (int v = 0; v < kVectors; ++v) {
    const Numbers bias =
        product.biases ? *reinterpret_cast<const Loose*>(product.biases + v * kWide) : Numbers{};
#pragma GCC unroll 16
    for (int p = 0; p < kCount; ++p) sums[v][p] = bias;
  }
  const float* weights = product.weights;
  for (int block = 0; block < product.inputs; ++block) {
    const float* in = product.in + std::size_t(block) * product.in_block_stride;
    for (int i = 0; i < kBlock; ++i, ++in, weights += kBlock) {
      Numbers w[kVectors];
#pragma GCC unroll 16
      for (int v = 0; v < kVectors; ++v) {
        w[v] = *reinterpret_cast<const Loose*>(
            weights + (v / kPerBlock) * product.weights_block_stride + (v % kPerBlock) * kWide);
      }
#pragma GCC unroll 16
      for (int p = 0; p < kCount; ++p) {
        const float value = in[p * kBlock];
#pragma GCC unroll 16
        for (int v = 0; v < kVectors; ++v) sums[v][p] += w[v] * value;
      }
    }
  }
#pragma GCC unroll 16
  for (int v = 0; v < kVectors; ++v) {
    float* const out = product.out + std::size_t(v / kPerBlock) * product.out_block_stride +
                       (v % kPerBlock) * kWide;
#pragma GCC unroll 16
    for (int p = 0; p < kCount; ++p) *reinterpret_cast<Loose*>(out + p * kBlock) = sums[v][p];
  }
}

/// A convolution of 1 x 1 pixel.
struct RowTask {
  const Convolution* convolution;
  const ChannelBlocks* from;
  int y;       ///< Of the row that is read.
  float* out;  ///< The row's first pixel of the first block.
  std::size_t out_block_stride;
};

/// kGroup blocks of outputs, kCount pixels at a time. The last pixels of a row that is no multiple
/// of kCount are found twice.
template <int kWide, int kGroup, int kCount>
[[gnu::always_inline]] inline void convolve_blocks(const RowTask& task, int first_block) {
  const Convolution& c = *task.convolution;
  const std::size_t per_block = std::size_t(c.inputs) * kBlock * kBlock;
  const auto product_at = [&](int x) {
    return Product{task.from->at(0, x, task.y),
                   task.from->block_stride(),
                   c.inputs,
                   c.weights.data() + std::size_t(first_block) * per_block,
                   per_block,
                   c.biases.data() + first_block * kBlock,
                   task.out + std::size_t(first_block) * task.out_block_stride + x * kBlock,
                   task.out_block_stride};
  };
  const int width = task.from->width();
  if (width < kCount) {
    for (int x = 0; x < width; ++x) multiply<kWide, kGroup, 1>(product_at(x));
    return;
  }
  for (int x = 0; x < width; x += kCount) {
    multiply<kWide, kGroup, kCount>(product_at(std::min(x, width - kCount)));
  }
}

/// A convolution of 3 x 3 pixels for a group of tiles, which are counted row by row. What is below
/// zero becomes zero.
struct TileTask {
  const Convolution* convolution;
  const ChannelBlocks* from;
  const ChannelBlocks* to;
  int first_tile;
  int tiles;
  float* values;    ///< Room for values_size(): of the patches, at the points.
  float* products;  ///< Room for kProductsSize.
};
constexpr int kMostGroup = 3;  // blocks of outputs at a time
// By place, block, tile. The line more keeps places of a tile from falling into the same few lines
// of the nearest cache.
constexpr std::size_t place_stride(int blocks) {
  return std::size_t(blocks * kTilesPerGroup + 1) * kBlock;
}
constexpr std::size_t values_size(int inputs) { return kPlaces * place_stride(inputs); }
constexpr std::size_t kProductsSize = kPlaces * place_stride(kMostGroup);

int tiles_across(int pixels) { return (pixels + kTile - 1) / kTile; }

/// A row or column of a patch as a polynomial's values.
template <class Numbers>
[[gnu::always_inline]] inline void to_points(const Numbers (&in)[kPatch], Numbers (&out)[kPatch]) {
  const Numbers near_even = in[4] - kFar2 * in[2];
  const Numbers near_odd = in[3] - kFar2 * in[1];
  const Numbers far_even = in[4] - kNear2 * in[2];
  const Numbers far_odd = in[3] - kNear2 * in[1];
  out[0] = in[0] - (kNear2 + kFar2) * in[2] + in[4];
  out[1] = near_even + kNear * near_odd;
  out[2] = near_even - kNear * near_odd;
  out[3] = far_even + kFar * far_odd;
  out[4] = far_even - kFar * far_odd;
  out[5] = in[1] - (kNear2 + kFar2) * in[3] + in[5];
}

/// Products of such values as a row or column of a tile.
template <class Numbers>
[[gnu::always_inline]] inline void from_points(const Numbers (&in)[kPatch], Numbers (&out)[kTile]) {
  const Numbers near_even = in[1] + in[2];
  const Numbers near_odd = in[1] - in[2];
  const Numbers far_even = in[3] + in[4];
  const Numbers far_odd = in[3] - in[4];
  out[0] = in[0] + near_even + far_even;
  out[1] = kNear * near_odd + kFar * far_odd;
  out[2] = kNear2 * near_even + kFar2 * far_even;
  out[3] = kNear * kNear2 * near_odd + kFar * kFar2 * far_odd + in[5];
}

/// A block of a patch; `out` is its tile's at the first place.
template <int kWide>
[[gnu::always_inline]] inline void transform_patch(const float* in, std::size_t in_row_stride,
                                                   float* out, std::size_t out_place_stride) {
  using Numbers = typename Wide<kWide>::Numbers;
  using Loose = typename Wide<kWide>::Loose;
  for (int i = 0; i < kBlock; i += kWide) {
    Numbers lines[kPatch][kPatch];
#pragma GCC unroll 6
    for (int x = 0; x < kPatch; ++x) {
      Numbers column[kPatch];
#pragma GCC unroll 6
      for (int y = 0; y < kPatch; ++y) {
        column[y] =
            *reinterpret_cast<const Loose*>(in + std::size_t(y) * in_row_stride + x * kBlock + i);
      }
      Numbers values[kPatch];
      to_points(column, values);
#pragma GCC unroll 6
      for (int y = 0; y < kPatch; ++y) lines[y][x] = values[y];
    }
#pragma GCC unroll 6
    for (int y = 0; y < kPatch; ++y) {
      Numbers row[kPatch];
      to_points(lines[y], row);
#pragma GCC unroll 6
      for (int x = 0; x < kPatch; ++x) {
        *reinterpret_cast<Loose*>(out + std::size_t(y * kPatch + x) * out_place_stride + i) =
            row[x];
      }
    }
  }
}

/// The values of all patches. Those of the last tile are repeated until the group is full.
template <int kWide>
[[gnu::always_inline]] inline void transform_inputs(const TileTask& task) {
  const ChannelBlocks& from = *task.from;
  const int across = tiles_across(from.width());
  const std::size_t stride = place_stride(from.blocks());
  for (int block = 0; block < from.blocks(); ++block) {
    float* out = task.values + std::size_t(block * kTilesPerGroup) * kBlock;
    for (int t = 0; t < kTilesPerGroup; ++t, out += kBlock) {
      const int tile = task.first_tile + std::min(t, task.tiles - 1);
      const int x = tile % across * kTile - 1;
      const int y = tile / across * kTile - 1;
      // With the frame, beyond which there is nothing to be read.
      const int columns = std::min(kPatch, from.width() + 1 - x);
      const int rows = std::min(kPatch, from.height() + 1 - y);
      const float* in = from.at(block, x, y);
      if (columns == kPatch && rows == kPatch) {
        transform_patch<kWide>(in, from.row_stride(), out, stride);
        continue;
      }
      alignas(64) float patch[kPlaces * kBlock] = {};
      for (int row = 0; row < rows; ++row, in += from.row_stride()) {
        std::copy_n(in, columns * kBlock, patch + row * kPatch * kBlock);
      }
      transform_patch<kWide>(patch, kPatch * kBlock, out, stride);
    }
  }
}

/// A tile's pixels of a block of outputs; `in` is its tile's at the first place.
template <int kWide>
[[gnu::always_inline]] inline void write_tile(const float* in, const float* biases,
                                              const ChannelBlocks& to, int block, int x, int y) {
  using Numbers = typename Wide<kWide>::Numbers;
  using Loose = typename Wide<kWide>::Loose;
  constexpr std::size_t kStride = place_stride(kMostGroup);
  const int rows = std::min(kTile, to.height() - y);
  const int columns = std::min(kTile, to.width() - x);
  for (int i = 0; i < kBlock; i += kWide) {
    Numbers lines[kTile][kPatch];
#pragma GCC unroll 6
    for (int px = 0; px < kPatch; ++px) {
      Numbers column[kPatch];
#pragma GCC unroll 6
      for (int py = 0; py < kPatch; ++py) {
        column[py] =
            *reinterpret_cast<const Loose*>(in + std::size_t(py * kPatch + px) * kStride + i);
      }
      Numbers done[kTile];
      from_points(column, done);
#pragma GCC unroll 4
      for (int row = 0; row < kTile; ++row) lines[row][px] = done[row];
    }
    const Numbers bias = *reinterpret_cast<const Loose*>(biases + i);
#pragma GCC unroll 4
    for (int row = 0; row < kTile; ++row) {
      if (row >= rows) break;
      float* const out = to.at(block, x, y + row) + i;
      Numbers done[kTile];
      from_points(lines[row], done);
#pragma GCC unroll 4
      for (int column = 0; column < kTile; ++column) {
        if (column >= columns) break;
        const Numbers sum = done[column] + bias;
        *reinterpret_cast<Loose*>(out + column * kBlock) = sum > 0.0f ? sum : Numbers{};
      }
    }
  }
}

/// kGroup blocks of outputs, kCount tiles at a time.
template <int kWide, int kGroup, int kCount>
[[gnu::always_inline]] inline void convolve_blocks(const TileTask& task, int first_block) {
  static_assert(kTilesPerGroup % kCount == 0 && kGroup <= kMostGroup);
  const Convolution& c = *task.convolution;
  const std::size_t per_place = std::size_t(c.inputs) * kBlock * kBlock;
  for (int place = 0; place < kPlaces; ++place) {
    const float* const weights =
        c.weights.data() + std::size_t(first_block * kPlaces + place) * per_place;
    const float* const in = task.values + std::size_t(place) * place_stride(c.inputs);
    float* const out = task.products + std::size_t(place) * place_stride(kMostGroup);
    for (int t = 0; t < task.tiles; t += kCount) {
      multiply<kWide, kGroup, kCount>({in + t * kBlock, kTilesPerGroup * kBlock, c.inputs, weights,
                                       kPlaces * per_place, nullptr, out + t * kBlock,
                                       kTilesPerGroup * kBlock});
    }
  }
  const int across = tiles_across(task.to->width());
  for (int block = 0; block < kGroup; ++block) {
    for (int t = 0; t < task.tiles; ++t) {
      const int tile = task.first_tile + t;
      write_tile<kWide>(task.products + (block * kTilesPerGroup + t) * kBlock,
                        c.biases.data() + (first_block + block) * kBlock, *task.to,
                        first_block + block, tile % across * kTile, tile / across * kTile);
    }
  }
}

/// All blocks of outputs, as many pixels or tiles at a time as registers hold.
template <int kWide, class Task>
[[gnu::always_inline]] inline void convolve_outputs(const Task& task) {
  const int outputs = task.convolution->outputs;
  int block = 0;
  if constexpr (kWide == 16) {
    for (; outputs - block >= 5 || outputs - block == 3; block += 3) {
      convolve_blocks<16, 3, 8>(task, block);
    }
    for (; block + 2 <= outputs; block += 2) convolve_blocks<16, 2, 12>(task, block);
  }
  constexpr int kCount = kWide == 16 ? 12 : kWide == 8 ? 6 : 2;
  for (; block < outputs; ++block) convolve_blocks<kWide, 1, kCount>(task, block);
}

template <int kWide>
[[gnu::always_inline]] inline void convolve_by(const RowTask& task) {
  convolve_outputs<kWide>(task);
}
template <int kWide>
[[gnu::always_inline]] inline void convolve_by(const TileTask& task) {
  transform_inputs<kWide>(task);
  convolve_outputs<kWide>(task);
}

template <class Task>
[[gnu::target("arch=x86-64-v4"), gnu::flatten]] void convolve_avx512(const Task& task) {
  convolve_by<16>(task);
}
template <class Task>
[[gnu::target("arch=x86-64-v4"), gnu::flatten]] void convolve_avx512_by_halves(const Task& task) {
  convolve_by<8>(task);
}
template <class Task>
[[gnu::target("arch=x86-64-v3"), gnu::flatten]] void convolve_avx2(const Task& task) {
  convolve_by<8>(task);
}
template <class Task>
[[gnu::target("arch=x86-64-v2"), gnu::flatten]] void convolve_sse42(const Task& task) {
  convolve_by<4>(task);
}
template <class Task>
[[gnu::flatten]] void convolve_sse2(const Task& task) {
  convolve_by<4>(task);
}

template <class Task>
void convolve(const Task& task, Isa isa) {
  switch (isa) {
    case Isa::Sse2:
      return convolve_sse2(task);
    case Isa::Sse42:
      return convolve_sse42(task);
    case Isa::Avx2:
      return convolve_avx2(task);
    case Isa::Avx512:
      // AMD's family 19h (Zen 4) splits vectors of AVX-512, and is an eighth slower with these
      // than with twice as many registers of half the size. The sums are the same.
      return __builtin_cpu_is("amdfam19h") ? convolve_avx512_by_halves(task)
                                           : convolve_avx512(task);
  }
}

/// With 3 x 3 pixels. Tasks take groups of tiles as long as there are some, so that each needs room
/// for one group only.
void convolve_tiles(const Convolution& c, const ChannelBlocks& from, const ChannelBlocks& to,
                    Isa isa, Host& host, SpareMemory& spare) {
  const int tiles = tiles_across(from.width()) * tiles_across(from.height());
  const int groups = (tiles + kTilesPerGroup - 1) / kTilesPerGroup;
  const std::size_t tasks = std::size_t(std::min(host.thread_count(), groups));
  const std::size_t per_task = values_size(c.inputs) + kProductsSize;
  HugePages<float> scratch = spare.take(tasks * per_task);
  std::atomic<int> next = 0;
  host.parallel_for(tasks, [&](std::size_t task) {
    float* const values = scratch.data() + task * per_task;
    for (int group = next++; group < groups; group = next++) {
      const int first = group * kTilesPerGroup;
      const int count = std::min(kTilesPerGroup, tiles - first);
      float* const products = values + values_size(c.inputs);
      convolve(TileTask{&c, &from, &to, first, count, values, products}, isa);
    }
  });
  spare.give(std::move(scratch));
}

void for_rows(int height, Host& host, const std::function<void(int)>& body) {
  host.parallel_for(std::size_t((height + kRowsPerTask - 1) / kRowsPerTask), [&](std::size_t task) {
    const int begin = int(task) * kRowsPerTask;
    for (int y = begin; y < std::min(height, begin + kRowsPerTask); ++y) body(y);
  });
}

/// The largest of 2 x 2 pixels.
ChannelBlocks halved(const ChannelBlocks& from, Host& host, SpareMemory& spare) {
  ChannelBlocks to(from.blocks() * kBlock, from.width() / 2, from.height() / 2, spare);
  for_rows(to.height(), host, [&](int y) {
    for (int block = 0; block < to.blocks(); ++block) {
      float* out = to.at(block, 0, y);
      const float* upper = from.at(block, 0, 2 * y);
      const float* lower = from.at(block, 0, 2 * y + 1);
      for (int x = 0; x < to.width(); ++x) {
        for (int i = 0; i < kBlock; ++i) {
          out[i] = std::max(std::max(upper[i], upper[kBlock + i]),
                            std::max(lower[i], lower[kBlock + i]));
        }
        out += kBlock;
        upper += 2 * kBlock;
        lower += 2 * kBlock;
      }
    }
  });
  return to;
}

/// Adds to every pixel that of the next level which covers it.
void add_next_level(const ChannelBlocks& to, const ChannelBlocks& next, Host& host) {
  for_rows(to.height(), host, [&](int y) {
    for (int block = 0; block < to.blocks(); ++block) {
      float* out = to.at(block, 0, y);
      const float* from = next.at(block, 0, y / 2);
      for (int x = 0; x < next.width(); ++x, from += kBlock, out += 2 * kBlock) {
        for (int i = 0; i < kBlock; ++i) {
          out[i] += from[i];
          out[kBlock + i] += from[i];
        }
      }
    }
  });
}

}  // namespace

HugePages<float> SpareMemory::take(std::size_t count) {
  auto best = spare_.end();
  for (auto it = spare_.begin(); it != spare_.end(); ++it) {
    if (it->size() >= count && (best == spare_.end() || it->size() < best->size())) best = it;
  }
  if (best == spare_.end()) return HugePages<float>(count);
  HugePages<float> found = std::move(*best);
  spare_.erase(best);
  return found;
}

void SpareMemory::give(HugePages<float> memory) {
  if (memory.size() > 0) spare_.push_back(std::move(memory));
}

ChannelBlocks::ChannelBlocks(int channels, int width, int height, SpareMemory& spare)
    : blocks_(blocks_of(channels)),
      width_(width),
      height_(height),
      row_stride_(std::size_t(width + 2) * kWidth),
      block_stride_(row_stride_ * std::size_t(height + 2)),
      values_(spare.take(block_stride_ * std::size_t(blocks_))) {
  for (int block = 0; block < blocks_; ++block) {
    std::fill_n(at(block, -1, -1), row_stride_, 0.0f);
    std::fill_n(at(block, -1, height), row_stride_, 0.0f);
    for (int y = 0; y < height; ++y) {
      std::fill_n(at(block, -1, y), kWidth, 0.0f);
      std::fill_n(at(block, width, y), kWidth, 0.0f);
    }
  }
}

DenoiserNetwork::DenoiserNetwork(std::span<const std::byte> file) {
  WeightReader reader(file);
  if (reader.number() != kMagic || reader.number() != kVersion) {
    throw Error(ErrorKind::Internal, "denoiser: these are no weights of version 3");
  }
  constexpr int kMostChannels = 1024;
  constexpr int kMostConvolutions = 16;
  const auto number = [&](int most) {
    const int value = reader.number();
    if (value >= 0 && value <= most) return value;
    throw Error(ErrorKind::Internal, "denoiser: weights of a network that cannot be");
  };
  std::array<int, kDepth> widths;
  std::array<int, kDepth> encoders;
  std::array<int, kDepth - 1> decoders;
  for (int& width : widths) width = number(kMostChannels);
  for (int& count : encoders) count = number(kMostConvolutions);
  for (int& count : decoders) count = number(kMostConvolutions);
  int inputs = 4 * kFeatures;
  for (std::size_t level = 0; level < kDepth; ++level) {
    for (int i = 0; i < encoders[level]; ++i, inputs = widths[level]) {
      encoder_[level].push_back(read_convolution(reader, inputs, widths[level], 3));
    }
  }
  for (std::size_t level = kDepth - 1; level-- > 0;) {
    narrow_[level] = read_convolution(reader, widths[level + 1], widths[level], 1);
    for (int i = 0; i < decoders[level]; ++i) {
      decoder_[level].push_back(read_convolution(reader, widths[level], widths[level], 3));
    }
  }
  // The first head stands for two: of its own level, and of single pixels.
  constexpr int kLevel = kGain + 1;
  constexpr int kTaps = 4 * kKernels;
  constexpr int kOthers = 4 * (kPixelLogits - kKernels);
  const PlainWeights first(reader, widths[0], kLevel + kTaps + 4 + kOthers, 1);
  heads_[0] = empty_convolution(widths[0], kLevel + 4, 1);
  add_outputs(heads_[0], first, 0, kLevel, 0);
  add_outputs(heads_[0], first, kLevel + kTaps, 4, kPixelKeep);
  pixels_ = empty_convolution(widths[0], kTaps + kOthers, 1);
  add_outputs(pixels_, first, kLevel, kTaps, 0);
  add_outputs(pixels_, first, kLevel + kTaps + 4, kOthers, kTaps);
  for (std::size_t level = 1; level < kDepth; ++level) {
    heads_[level] = read_convolution(reader, widths[level], kLevel, 1);
  }
  if (!reader.is_at_end()) throw Error(ErrorKind::Internal, "denoiser: weights too many");
}

DenoiserNetwork::Logits DenoiserNetwork::run(ChannelBlocks features, Isa isa, Host& host,
                                             SpareMemory& spare) const {
  const auto convolved_1x1 = [&](const Convolution& c, const ChannelBlocks& from) {
    ChannelBlocks to(c.outputs * kBlock, from.width(), from.height(), spare);
    for_rows(from.height(), host, [&](int y) {
      convolve(RowTask{&c, &from, y, to.at(0, 0, y), to.block_stride()}, isa);
    });
    return to;
  };
  const auto convolved_3x3 = [&](const Convolution& c, const ChannelBlocks& from) {
    ChannelBlocks to(c.outputs * kBlock, from.width(), from.height(), spare);
    convolve_tiles(c, from, to, isa, host, spare);
    return to;
  };
  const auto move_on = [&](ChannelBlocks& now, ChannelBlocks next) {
    now.hand_on(spare);
    now = std::move(next);
  };
  std::array<ChannelBlocks, kDepth> levels;
  const auto encode = [&](std::size_t level, ChannelBlocks now) {
    for (const Convolution& c : encoder_[level]) move_on(now, convolved_3x3(c, now));
    levels[level] = std::move(now);
  };
  encode(0, std::move(features));
  for (std::size_t level = 1; level < kDepth; ++level) {
    encode(level, halved(levels[level - 1], host, spare));
  }
  Logits logits;
  ChannelBlocks now = std::move(levels[kDepth - 1]);
  logits.levels[kDepth - 1] = convolved_1x1(heads_[kDepth - 1], now);
  for (std::size_t level = kDepth - 1; level-- > 0;) {
    ChannelBlocks next = convolved_1x1(narrow_[level], now);
    move_on(now, std::move(levels[level]));
    add_next_level(now, next, host);
    next.hand_on(spare);
    for (const Convolution& c : decoder_[level]) move_on(now, convolved_3x3(c, now));
    logits.levels[level] = convolved_1x1(heads_[level], now);
  }
  logits.last = std::move(now);
  return logits;
}

void DenoiserNetwork::pixel_logits(const Logits& logits, int y, Isa isa, float* out) const {
  const std::size_t stride = std::size_t(logits.last.width()) * kBlock;
  convolve(RowTask{&pixels_, &logits.last, y, out, stride}, isa);
}

}  // namespace diorama
