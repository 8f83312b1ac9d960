// SPDX-License-Identifier: Apache-2.0
#include "gpu_plane_filter.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <span>

#include "renderer_support/denoiser.h"
#include "renderer_support/view_transform.h"

namespace diorama {
namespace {

constexpr int kRounds = 5;
constexpr int kBlock = kExposureBlock;  // Of planes.glsl, too.
static_assert(kBlock == 16);

// Numbers per pixel, in the order in which they lie.
constexpr std::size_t kLayerNumbers = 4 * 4;  // four layers of four
constexpr std::size_t kNoiseNumbers = 3;
constexpr std::size_t kSupportNumbers = 1;
constexpr std::size_t kImageNumbers = 3;
constexpr std::size_t kPixelNumbers =
    kLayerNumbers + kNoiseNumbers + kSupportNumbers + kImageNumbers;
// Per block of pixels.
constexpr std::size_t kMeanNumbers = 3;  // and all sums later: they come after the means were read

std::size_t blocks_of(int size) { return std::size_t((size + kBlock - 1) / kBlock); }

}  // namespace

GpuPlaneFilter::GpuPlaneFilter(const PathDevice& device, Host& host)
    : device_(device.device), kernels_(device.kernels.planes), host_(host) {}

void GpuPlaneFilter::make_room(int width, int height) {
  constexpr const char* kWhat = "the filter of a picture";
  pixels_ = std::size_t(width) * std::size_t(height);
  blocks_ = blocks_of(width) * blocks_of(height);
  layers_.grow(device_, (kPixelNumbers * pixels_ + kMeanNumbers * blocks_) * sizeof(float),
               VulkanBuffer::Place::Device, kWhat);
  film_.grow(device_, pixels_ * sizeof(FilmPixel), VulkanBuffer::Place::Device, kWhat);
  for_host_.grow(device_, std::max(kImageNumbers * pixels_, kMeanNumbers * blocks_) * sizeof(float),
                 VulkanBuffer::Place::ToHost, kWhat);
  push_.averaged = film_.address();
  push_.layers = layers_.address();
  push_.noise = push_.layers + kLayerNumbers * pixels_ * sizeof(float);
  push_.support = push_.noise + kNoiseNumbers * pixels_ * sizeof(float);
  push_.image = push_.support + kSupportNumbers * pixels_ * sizeof(float);
  push_.blocks = push_.image + kImageNumbers * pixels_ * sizeof(float);
  push_.width = std::uint32_t(width);
  push_.height = std::uint32_t(height);
}

/// By the means of blocks that have come back.
float GpuPlaneFilter::brightest_path(double firefly_limit) const {
  Image<Vec3f> means(int(blocks_of(int(push_.width))), int(blocks_of(int(push_.height))),
                     Vec3f::Zero());
  std::memcpy(static_cast<void*>(means.pixels().data()), for_host_.data(),
              means.pixels().size_bytes());
  return float(firefly_limit / automatic_exposure(means));
}

void GpuPlaneFilter::record_rounds(VulkanCommands& commands) {
  const auto most = std::size_t(device_.info().most_groups);
  const auto per_pixel = std::uint32_t(std::min((pixels_ + gpu::kGroup - 1) / gpu::kGroup, most));
  const auto per_block = std::uint32_t(std::min(blocks_, most));
  const auto dispatch = [&](const VulkanKernel& kernel, std::uint32_t groups) {
    commands.constants(push_);
    commands.dispatch(kernel, groups);
    commands.barrier();
  };
  push_.from = 0;
  push_.reach = 0;
  dispatch(kernels_.chances, per_pixel);
  push_.film = push_.averaged;
  dispatch(kernels_.read, per_pixel);
  dispatch(kernels_.sums, per_block);
  dispatch(kernels_.fireflies, per_pixel);
  push_.from = 1;
  for (int round = 0; round < kRounds; ++round) {
    push_.reach = 1u << round;
    dispatch(kernels_.measure, per_pixel);
    dispatch(kernels_.filter, per_pixel);
    push_.from = 1 - push_.from;
  }
  dispatch(kernels_.sums, per_block);
  dispatch(kernels_.lost, per_block);
  dispatch(kernels_.finish, per_pixel);
}

Image<Vec3f> GpuPlaneFilter::filtered(GpuPathTracer& tracer, const Vec3f& view_position,
                                      double firefly_limit) {
  Image<Vec3f> image(tracer.width(), tracer.height(), Vec3f::Zero());
  make_room(image.width(), image.height());
  push_.view_position = view_position;
  push_.brightest_path = 0.0f;
  seconds_ = 0.0;
  const std::span<double> seconds(&seconds_, 1);
  if (firefly_limit > 0.0) {
    const auto record = [&](VulkanCommands& commands) {
      push_.film = tracer.record_film(commands);
      commands.constants(push_);
      commands.dispatch(kernels_.means,
                        std::uint32_t(std::min(blocks_, std::size_t(device_.info().most_groups))));
      commands.barrier();
      commands.copy(layers_, push_.blocks - push_.layers, for_host_, 0,
                    kMeanNumbers * blocks_ * sizeof(float));
      commands.mark(0);
    };
    device_.run(record, seconds);
    push_.brightest_path = brightest_path(firefly_limit);
  }
  const auto record = [&](VulkanCommands& commands) {
    if (!(firefly_limit > 0.0)) push_.film = tracer.record_film(commands);
    record_rounds(commands);
    commands.copy(layers_, push_.image - push_.layers, for_host_, 0, image.pixels().size_bytes());
    commands.mark(0);
  };
  device_.run(record, seconds);
  host_.parallel_for(std::size_t(image.height()), [&](std::size_t row) {
    const auto pixels = image.row(int(row));
    std::memcpy(static_cast<void*>(pixels.data()), for_host_.data() + row * pixels.size_bytes(),
                pixels.size_bytes());
  });
  return image;
}

}  // namespace diorama
