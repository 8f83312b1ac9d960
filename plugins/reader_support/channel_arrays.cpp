// SPDX-License-Identifier: Apache-2.0
#include "reader_support/channel_arrays.h"

#include <algorithm>
#include <cstring>
#include <stdexcept>

#include "reader_support/object_masks.h"

namespace diorama {
namespace {

struct Extents {
  int width = 0;
  int height = 0;
};

/// Of the first two axes. Throws for what is no picture of a size that can be.
Extents extents_of(const StoredArray& array) {
  if (array.shape.size() < 2) throw std::runtime_error(array_text(array) + " is no picture");
  const std::size_t height = array.shape[0];
  const std::size_t width = array.shape[1];
  const bool is_sound = height > 0 && width > 0 && height <= std::size_t(kMostPixels) &&
                        width <= std::size_t(kMostPixels) / height;
  if (!is_sound) throw std::runtime_error(array_text(array) + " is no picture");
  return {int(width), int(height)};
}

template <class Pixel>
Pixel zero() {
  if constexpr (requires { Pixel::Zero(); }) {
    return Pixel::Zero();
  } else {
    return Pixel{};
  }
}

template <class Pixel>
Image<Pixel> copied(const StoredArray& array) {
  const Extents size = extents_of(array);
  Image<Pixel> image(size.width, size.height, zero<Pixel>());
  const auto pixels = image.pixels();
  if (array.data.size() != pixels.size_bytes()) {
    throw std::runtime_error(array_text(array) + " is no picture");
  }
  std::memcpy(static_cast<void*>(pixels.data()), array.data.data(), pixels.size_bytes());
  return image;
}

template <class Number>
Image<std::uint32_t> ids_of(const StoredArray& array) {
  const Extents size = extents_of(array);
  Image<std::uint32_t> ids(size.width, size.height, 0);
  for (std::size_t i = 0; i < ids.pixels().size(); ++i) {
    Number value{};
    std::memcpy(&value, array.data.data() + i * sizeof value, sizeof value);
    const auto id = std::uint32_t(value);
    if (value < Number(0) || Number(id) != value) {
      throw std::runtime_error("holds values that are no ids");
    }
    ids.pixels()[i] = id;
  }
  return ids;
}

/// One number per pixel, whether or not an axis of length 1 says so.
bool is_flat(const StoredArray& array) {
  return array.shape.size() == 2 || (array.shape.size() == 3 && array.shape[2] == 1);
}

}  // namespace

std::string array_text(const StoredArray& array) {
  std::string text = array.fields.size() == 1 ? array.fields[0].type : "records";
  if (array.shape.empty()) return text + " alone";
  text += " of ";
  for (std::size_t i = 0; i < array.shape.size(); ++i) {
    text += (i == 0 ? "" : " x ") + std::to_string(array.shape[i]);
  }
  return text;
}

std::optional<AnyImage> image_of_array(const StoredArray& array) {
  const std::size_t numbers = array.shape.size() == 3 ? array.shape[2] : 1;
  if (array.shape.size() != 2 && array.shape.size() != 3) return std::nullopt;
  if (array.is_plain("|u1") && numbers == 4) return copied<Rgba8>(array);
  if (array.is_plain("<u4") && numbers == 1) return copied<std::uint32_t>(array);
  if (!array.is_plain("<f4")) return std::nullopt;
  if (numbers == 1) return copied<float>(array);
  if (numbers == 2) return copied<Vec2f>(array);
  if (numbers == 3) return copied<Vec3f>(array);
  return std::nullopt;
}

void set_channel(Frame& frame, const std::string& name, const StoredArray& array) {
  auto image = image_of_array(array);
  if (!image) throw std::runtime_error(array_text(array) + " is no channel");
  Frame probe;
  probe.camera = frame.camera;
  probe.camera_path = "'" + name + "'";
  const auto put = [&](Frame& to) {
    std::visit([&]<class Pixel>(Image<Pixel>& pixels) { to.set(Channel<Pixel>{name}, pixels); },
               *image);
  };
  put(probe);
  probe.check_channel(name);
  put(frame);
}

Image<std::uint32_t> ids_of_array(const StoredArray& array) {
  if (is_flat(array)) {
    if (array.is_plain("|u1")) return ids_of<std::uint8_t>(array);
    if (array.is_plain("|i1")) return ids_of<std::int8_t>(array);
    if (array.is_plain("<u2")) return ids_of<std::uint16_t>(array);
    if (array.is_plain("<i2")) return ids_of<std::int16_t>(array);
    if (array.is_plain("<u4")) return ids_of<std::uint32_t>(array);
    if (array.is_plain("<i4")) return ids_of<std::int32_t>(array);
    if (array.is_plain("<u8")) return ids_of<std::uint64_t>(array);
    if (array.is_plain("<i8")) return ids_of<std::int64_t>(array);
  }
  throw std::runtime_error(array_text(array) + " is no picture of ids");
}

Image<float> floats_of_array(const StoredArray& array) {
  if (is_flat(array) && array.is_plain("<f4")) return copied<float>(array);
  if (!is_flat(array) || !array.is_plain("<f8")) {
    throw std::runtime_error(array_text(array) + " is no picture of floats");
  }
  const Extents size = extents_of(array);
  Image<float> image(size.width, size.height, 0.0f);
  for (std::size_t i = 0; i < image.pixels().size(); ++i) {
    image.pixels()[i] = float(array.value<double>(i, array.fields[0]));
  }
  return image;
}

Image<Rgba8> color_of_array(const StoredArray& array) {
  const std::size_t channels = array.shape.size() == 3 ? array.shape[2] : 0;
  if (!array.is_plain("|u1") || (channels != 3 && channels != 4)) {
    throw std::runtime_error(array_text(array) + " is no picture of colours");
  }
  const Extents size = extents_of(array);
  Image<Rgba8> image(size.width, size.height, {0, 0, 0, 255});
  for (std::size_t i = 0; i < image.pixels().size(); ++i) {
    std::memcpy(image.pixels()[i].data(), array.data.data() + i * channels, 3);
  }
  return image;
}

}  // namespace diorama
