// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <nlohmann/json.hpp>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "framework/images/image_codecs.h"

/// A second reader of what writers write, for tests: it trusts the files.
namespace diorama::test {

using Json = nlohmann::json;

/// Decoded samples of a picture.
struct Picture {
  int width = 0;
  int height = 0;
  int channels = 0;
  std::vector<std::uint32_t> samples;

  /// All channels of a pixel in one number, the first in the lowest eight bits.
  std::uint32_t packed(int x, int y) const {
    std::uint32_t value = 0;
    for (int c = channels - 1; c >= 0; --c) {
      const auto place =
          (std::size_t(y) * std::size_t(width) + std::size_t(x)) * std::size_t(channels) +
          std::size_t(c);
      value = (value << 8) | samples.at(place);
    }
    return value;
  }
};

inline Picture parse_picture(const std::string& bytes, const std::string& name) {
  const auto texture = decode_image(std::as_bytes(std::span(bytes.data(), bytes.size())), name);
  Picture picture{texture->width, texture->height, texture->channels, {}};
  picture.samples.assign(texture->bytes.begin(), texture->bytes.end());
  // Samples of 16 bits.
  for (const float value : texture->floats) {
    picture.samples.push_back(std::uint32_t(std::lround(double(value) * 65535.0)));
  }
  return picture;
}

/// What stands behind the header of an array.
struct NpyArray {
  std::vector<std::byte> data;

  template <class T>
  T value(std::size_t offset) const {
    T result{};
    if (offset + sizeof result > data.size()) throw std::runtime_error("an array is too small");
    std::memcpy(&result, data.data() + offset, sizeof result);
    return result;
  }
};

/// Of version 1.0.
inline NpyArray parse_npy(const std::string& bytes) {
  const auto byte = [&](std::size_t at) {
    return std::size_t(static_cast<unsigned char>(bytes.at(at)));
  };
  const std::size_t begin = 10 + byte(8) + 256 * byte(9);
  const auto all = std::as_bytes(std::span(bytes.data(), bytes.size()));
  if (begin > all.size()) throw std::runtime_error("an array ends within its header");
  const auto data = all.subspan(begin);
  return {{data.begin(), data.end()}};
}

}  // namespace diorama::test
