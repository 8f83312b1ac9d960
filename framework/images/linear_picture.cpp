// SPDX-License-Identifier: Apache-2.0
#include "framework/images/linear_picture.h"

#include <string>

#include "diorama/error.h"

namespace diorama {

Image<Vec3f> read_linear_picture(const std::filesystem::path& file, int width, int height,
                                 const Host& host) {
  const auto texture = host.read_texture(file);
  const auto channels = std::size_t(texture->channels);
  const auto size = [](int w, int h) { return std::to_string(w) + " x " + std::to_string(h); };
  if (texture->floats.empty() || channels < 3) {
    throw Error(ErrorKind::Asset, file.string() + ": expected colours in linear light");
  }
  if (texture->width != width || texture->height != height) {
    throw Error(ErrorKind::Asset, file.string() + ": expected " + size(width, height) +
                                      " pixels, found " + size(texture->width, texture->height));
  }
  Image<Vec3f> image(width, height, Vec3f::Zero());
  for (std::size_t i = 0; i < image.pixels().size(); ++i) {
    image.pixels()[i] = Eigen::Map<const Vec3f>(&texture->floats[i * channels]);
  }
  return image;
}

}  // namespace diorama
