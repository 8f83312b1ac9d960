// SPDX-License-Identifier: Apache-2.0
#include "framework/images/opencv_pictures.h"

#include <algorithm>
#include <cstdint>
#include <iostream>
#include <limits>
#include <mutex>
#include <opencv2/core.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>
#include <streambuf>
#include <string>
#include <vector>

namespace diorama::images {
namespace {

class Nowhere final : public std::streambuf {
 protected:
  int_type overflow(int_type c) override { return traits_type::not_eof(c); }
};

/// OpenCV tells std::cerr what its caller is told, too. Nobody else here writes to it.
class Silence {
 public:
  Silence() {
    const std::lock_guard lock(mutex_);
    if (count_++ == 0) usual_ = std::cerr.rdbuf(&nowhere_);
  }
  ~Silence() {
    const std::lock_guard lock(mutex_);
    if (--count_ == 0) std::cerr.rdbuf(usual_);
  }
  Silence(const Silence&) = delete;
  Silence& operator=(const Silence&) = delete;

 private:
  static inline std::mutex mutex_;
  static inline int count_ = 0;
  static inline std::streambuf* usual_ = nullptr;
  static inline Nowhere nowhere_;
};

/// Blue, green and red become red, green and blue.
template <class From, class To>
std::vector<To> samples_of(const cv::Mat& picture, double scale) {
  const int channels = picture.channels();
  std::vector<To> samples;
  samples.reserve(picture.total() * std::size_t(channels));
  for (int y = 0; y < picture.rows; ++y) {
    const From* from = picture.ptr<From>(y);
    for (int x = 0; x < picture.cols; ++x, from += channels) {
      for (int c = 0; c < channels; ++c) {
        const int place = channels >= 3 && c < 3 ? 2 - c : c;
        samples.push_back(scale == 1.0 ? To(from[place]) : To(double(from[place]) * scale));
      }
    }
  }
  return samples;
}

cv::Mat decoded(std::span<const std::byte> bytes) {
  if (bytes.size() > std::size_t(std::numeric_limits<int>::max())) {
    throw std::runtime_error("the file has 2 GiB or more");
  }
  const Silence silence;
  try {
    // It is read only.
    const cv::Mat file(1, int(bytes.size()), CV_8UC1, const_cast<std::byte*>(bytes.data()));
    cv::Mat picture = cv::imdecode(file, cv::IMREAD_UNCHANGED);
    if (picture.empty()) throw std::runtime_error("its pixels cannot be decoded");
    return picture;
  } catch (const cv::Exception& error) {
    std::string reason = error.err;
    std::ranges::replace(reason, '\n', ' ');
    throw std::runtime_error(reason);
  }
}

class Pictures final : public OpencvPictures {
 public:
  Texture decode(std::span<const std::byte> bytes) const override {
    const cv::Mat picture = decoded(bytes);
    Texture texture;
    texture.width = picture.cols;
    texture.height = picture.rows;
    texture.channels = picture.channels();
    if (texture.channels > 4) {
      throw std::runtime_error("it has " + std::to_string(texture.channels) + " channels");
    }
    switch (picture.depth()) {
      case CV_8U:
        texture.bytes = samples_of<std::uint8_t, std::uint8_t>(picture, 1.0);
        return texture;
      case CV_16U:
        texture.floats = samples_of<std::uint16_t, float>(picture, 1.0 / 65535.0);
        return texture;
      case CV_32F:
        texture.floats = samples_of<float, float>(picture, 1.0);
        return texture;
      case CV_64F:
        texture.floats = samples_of<double, float>(picture, 1.0);
        return texture;
      default:
        throw std::runtime_error("its pixels are signed integers");
    }
  }
};

}  // namespace
}  // namespace diorama::images

extern "C" __attribute__((visibility("default"))) const void* diorama_opencv_pictures() {
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  static const diorama::images::Pictures pictures;
  return static_cast<const diorama::images::OpencvPictures*>(&pictures);
}
