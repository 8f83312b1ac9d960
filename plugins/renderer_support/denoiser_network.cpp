// SPDX-License-Identifier: Apache-2.0
#include "denoiser_network.h"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <utility>

#include "diorama/error.h"

namespace diorama {
namespace {

constexpr int kBlock = ChannelBlocks::kWidth;
constexpr std::int32_t kMagic = 0x574E4544;  // "DENW"
constexpr std::int32_t kVersion = 3;
constexpr int kRowsPerTask = 4;

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

/// With the outputs from `begin` on, `count` of them, after those of `before`.
void add_outputs(Convolution& to, const PlainWeights& from, int begin, int count, int before) {
  const int taps = from.side * from.side;
  for (int o = 0; o < count; ++o) {
    const int out = before + o;
    to.biases[std::size_t(out)] = from.biases[std::size_t(begin + o)];
    for (int in = 0; in < from.inputs; ++in) {
      for (int tap = 0; tap < taps; ++tap) {
        const std::size_t row = std::size_t(
            ((out / kBlock * to.inputs + in / kBlock) * taps + tap) * kBlock + in % kBlock);
        to.weights[row * kBlock + std::size_t(out % kBlock)] =
            from.weights[std::size_t(((begin + o) * from.inputs + in) * taps + tap)];
      }
    }
  }
}

Convolution empty_convolution(int inputs, int outputs, int side) {
  Convolution c{blocks_of(inputs), blocks_of(outputs), side, {}, {}};
  c.weights.assign(std::size_t(c.inputs * c.outputs * side * side) * kBlock * kBlock, 0.0f);
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

struct RowTask {
  const Convolution* convolution;
  const ChannelBlocks* from;
  bool is_cut;  ///< Below zero.
  int y;        ///< Of the row that is read.
  float* out;   ///< The row's first pixel of the first block.
  std::size_t out_block_stride;
};

/// kGroup blocks of outputs of kPixels pixels side by side.
template <int kWide, int kGroup, int kPixels>
[[gnu::always_inline]] inline void convolve_pixels(const RowTask& task, int first_block, int x) {
  using Numbers = typename Wide<kWide>::Numbers;
  using Loose = typename Wide<kWide>::Loose;
  constexpr int kPerBlock = kBlock / kWide;
  constexpr int kVectors = kGroup * kPerBlock;
  const Convolution& c = *task.convolution;
  const int reach = c.side / 2;
  Numbers sums[kVectors][kPixels];
#pragma GCC unroll 16
  for (int v = 0; v < kVectors; ++v) {
    const Numbers bias =
        *reinterpret_cast<const Loose*>(&c.biases[std::size_t(first_block * kBlock + v * kWide)]);
#pragma GCC unroll 16
    for (int p = 0; p < kPixels; ++p) sums[v][p] = bias;
  }
  const std::size_t per_block = std::size_t(c.inputs * c.side * c.side) * kBlock * kBlock;
  const float* weights = c.weights.data() + std::size_t(first_block) * per_block;
  for (int block = 0; block < c.inputs; ++block) {
    for (int dy = -reach; dy <= reach; ++dy) {
      for (int dx = -reach; dx <= reach; ++dx) {
        const float* in = task.from->at(block, x + dx, task.y + dy);
        for (int i = 0; i < kBlock; ++i, ++in, weights += kBlock) {
          Numbers w[kVectors];
#pragma GCC unroll 16
          for (int v = 0; v < kVectors; ++v) {
            w[v] = *reinterpret_cast<const Loose*>(weights + (v / kPerBlock) * per_block +
                                                   (v % kPerBlock) * kWide);
          }
#pragma GCC unroll 16
          for (int p = 0; p < kPixels; ++p) {
            const float value = in[p * kBlock];
#pragma GCC unroll 16
            for (int v = 0; v < kVectors; ++v) sums[v][p] += w[v] * value;
          }
        }
      }
    }
  }
#pragma GCC unroll 16
  for (int v = 0; v < kVectors; ++v) {
    float* const out = task.out + std::size_t(first_block + v / kPerBlock) * task.out_block_stride +
                       std::size_t(x) * kBlock + (v % kPerBlock) * kWide;
#pragma GCC unroll 16
    for (int p = 0; p < kPixels; ++p) {
      const Numbers sum = sums[v][p];
      *reinterpret_cast<Loose*>(out + p * kBlock) =
          task.is_cut ? (sum > 0.0f ? sum : Numbers{}) : sum;
    }
  }
}

/// The last pixels of a row that is no multiple of kPixels are found twice.
template <int kWide, int kGroup, int kPixels>
[[gnu::always_inline]] inline void convolve_group(const RowTask& task, int first_block) {
  const int width = task.from->width();
  if (width < kPixels) {
    for (int x = 0; x < width; ++x) convolve_pixels<kWide, kGroup, 1>(task, first_block, x);
    return;
  }
  for (int x = 0; x < width; x += kPixels) {
    convolve_pixels<kWide, kGroup, kPixels>(task, first_block, std::min(x, width - kPixels));
  }
}

inline void row_of_16(const RowTask& task) {
  const int outputs = task.convolution->outputs;
  int block = 0;
  for (; outputs - block >= 5 || outputs - block == 3; block += 3) {
    convolve_group<16, 3, 8>(task, block);
  }
  for (; block + 2 <= outputs; block += 2) convolve_group<16, 2, 12>(task, block);
  if (block < outputs) convolve_group<16, 1, 12>(task, block);
}
inline void row_of_8(const RowTask& task) {
  for (int block = 0; block < task.convolution->outputs; ++block) {
    convolve_group<8, 1, 6>(task, block);
  }
}
inline void row_of_4(const RowTask& task) {
  for (int block = 0; block < task.convolution->outputs; ++block) {
    convolve_group<4, 1, 2>(task, block);
  }
}

[[gnu::target("arch=x86-64-v4"), gnu::flatten]] void row_avx512(const RowTask& task) {
  row_of_16(task);
}
[[gnu::target("arch=x86-64-v3"), gnu::flatten]] void row_avx2(const RowTask& task) {
  row_of_8(task);
}
[[gnu::target("arch=x86-64-v2"), gnu::flatten]] void row_sse42(const RowTask& task) {
  row_of_4(task);
}

void convolve_row(const RowTask& task, Isa isa) {
  switch (isa) {
    case Isa::Sse2:
      return row_of_4(task);
    case Isa::Sse42:
      return row_sse42(task);
    case Isa::Avx2:
      return row_avx2(task);
    case Isa::Avx512:
      return row_avx512(task);
  }
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
  const auto convolved = [&](const Convolution& c, const ChannelBlocks& from, bool is_cut) {
    ChannelBlocks to(c.outputs * kBlock, from.width(), from.height(), spare);
    for_rows(from.height(), host, [&](int y) {
      convolve_row({&c, &from, is_cut, y, to.at(0, 0, y), to.block_stride()}, isa);
    });
    return to;
  };
  const auto move_on = [&](ChannelBlocks& now, ChannelBlocks next) {
    now.hand_on(spare);
    now = std::move(next);
  };
  std::array<ChannelBlocks, kDepth> levels;
  const auto encode = [&](std::size_t level, ChannelBlocks now) {
    for (const Convolution& c : encoder_[level]) move_on(now, convolved(c, now, true));
    levels[level] = std::move(now);
  };
  encode(0, std::move(features));
  for (std::size_t level = 1; level < kDepth; ++level) {
    encode(level, halved(levels[level - 1], host, spare));
  }
  Logits logits;
  ChannelBlocks now = std::move(levels[kDepth - 1]);
  logits.levels[kDepth - 1] = convolved(heads_[kDepth - 1], now, false);
  for (std::size_t level = kDepth - 1; level-- > 0;) {
    ChannelBlocks next = convolved(narrow_[level], now, false);
    move_on(now, std::move(levels[level]));
    add_next_level(now, next, host);
    next.hand_on(spare);
    for (const Convolution& c : decoder_[level]) move_on(now, convolved(c, now, true));
    logits.levels[level] = convolved(heads_[level], now, false);
  }
  logits.last = std::move(now);
  return logits;
}

void DenoiserNetwork::pixel_logits(const Logits& logits, int y, Isa isa, float* out) const {
  const std::size_t stride = std::size_t(logits.last.width()) * kBlock;
  convolve_row({&pixels_, &logits.last, false, y, out, stride}, isa);
}

}  // namespace diorama
