// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include "diorama/host.h"
#include "huge_pages.h"
#include "isa.h"

namespace diorama {

/// Memory that layers of one picture hand on to each other: to map new pages takes as long as a
/// small layer.
class SpareMemory {
 public:
  /// The smallest that is large enough, or new memory.
  HugePages<float> take(std::size_t count);
  void give(HugePages<float> memory);

 private:
  std::vector<HugePages<float>> spare_;
};

/// Numbers of a picture in blocks of 16 channels: block by block, row by row, pixel by pixel, the
/// channels of a block side by side. Around each block lies a frame of zeros, one pixel wide.
class ChannelBlocks {
 public:
  static constexpr int kWidth = 16;

  ChannelBlocks() = default;
  /// Without values as yet, but for the frame.
  ChannelBlocks(int channels, int width, int height, SpareMemory& spare);
  /// Is empty afterwards.
  void hand_on(SpareMemory& spare) { spare.give(std::move(values_)); }

  int blocks() const { return blocks_; }
  int width() const { return width_; }
  int height() const { return height_; }
  /// Of pixels: from -1 to width and height.
  float* at(int block, int x, int y) const {
    return values_.data() + std::size_t(block) * block_stride_ + std::size_t(y + 1) * row_stride_ +
           std::size_t(x + 1) * kWidth;
  }
  std::size_t row_stride() const { return row_stride_; }
  std::size_t block_stride() const { return block_stride_; }

 private:
  int blocks_ = 0;
  int width_ = 0;
  int height_ = 0;
  std::size_t row_stride_ = 0;
  std::size_t block_stride_ = 0;
  HugePages<float> values_;
};

/// A convolution's weights in the order in which they are used; channels are filled up with zeros
/// to whole blocks.
struct Convolution {
  int inputs = 0;   ///< Blocks.
  int outputs = 0;  ///< Blocks.
  /// Per block of outputs: of 1 x 1 pixel one matrix, inputs x 16; of 3 x 3 pixels 36, by which
  /// tiles of 4 x 4 pixels are multiplied.
  std::vector<float> weights;
  std::vector<float> biases;
};

/// The U-Net that tells the denoiser how to average: see tests/denoiser_training/README.md.
class DenoiserNetwork {
 public:
  static constexpr int kFeatures = 20;  ///< Per pixel; in blocks of 2 x 2 they are its channels.
  static constexpr int kDepth = 5;      ///< Levels, from half the resolution on.
  static constexpr int kAlignment = 1 << kDepth;  ///< Of the sizes of pictures that it takes.
  static constexpr int kFine = 25;                ///< Taps among a level's own pixels ...
  static constexpr int kCoarse = 9;               ///< ... among the results of the next level ...
  static constexpr int kOwn = 9;                  ///< ... and of the pixel's own colour.

  /// From the bytes of a file of weights. Throws Error(Internal) when they are none.
  explicit DenoiserNetwork(std::span<const std::byte> file);

  /// What it says of a picture.
  struct Logits {
    /// Per level from half the resolution on: kFine, kCoarse (not of the last one), how much the
    /// pixel counts for the next level and how much brighter or darker it becomes. The first has
    /// also what the 2 x 2 pixels count that it stands for.
    std::array<ChannelBlocks, kDepth> levels;
    /// To be turned into the logits of single pixels by `pixels`, row by row.
    ChannelBlocks last;
  };
  static constexpr int kKeep = kFine + kCoarse;  ///< Channel of `levels`.
  static constexpr int kGain = kKeep + 1;
  static constexpr int kPixelKeep = kGain + 1;  ///< Four channels of the first of `levels`.
  /// Of single pixels: the taps, how much brighter or darker the pixel becomes, the share that
  /// another filter's result has, and that of the pixel as it was.
  static constexpr int kKernels = kFine + kCoarse + kOwn;
  static constexpr int kPixelGain = kKernels;
  static constexpr int kOther = kKernels + 1;
  static constexpr int kStays = kKernels + 2;
  static constexpr int kPixelLogits = kKernels + 3;

  /// `features` holds kFeatures x 4 channels of blocks of 2 x 2 pixels: number 4 f + 2 y + x.
  Logits run(ChannelBlocks features, Isa isa, Host& host, SpareMemory& spare) const;

  /// Row `y` of the logits of single pixels, for blocks of 2 x 2, which have four channels for
  /// each: number 4 k + 2 y + x. `out` has room for pixel_blocks() x width x 16 numbers, as in
  /// ChannelBlocks without a frame.
  void pixel_logits(const Logits& logits, int y, Isa isa, float* out) const;
  int pixel_blocks() const { return pixels_.outputs; }

 private:
  std::array<std::vector<Convolution>, kDepth> encoder_;
  std::array<Convolution, kDepth - 1> narrow_;
  std::array<std::vector<Convolution>, kDepth - 1> decoder_;
  std::array<Convolution, kDepth> heads_;
  Convolution pixels_;
};

}  // namespace diorama
