// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

#include "diorama/frame.h"
#include "support/plain_host.h"

namespace diorama::test {

/// Works through loops from the end.
class BackwardHost final : public PlainHost {
 public:
  void parallel_for(std::size_t count, const std::function<void(std::size_t)>& body) override {
    for (std::size_t i = count; i > 0; --i) body(i - 1);
  }
};

inline Frame frame_of(const Camera& camera) {
  Frame frame;
  frame.camera = camera;
  frame.seed = 5;
  return frame;
}

/// One value per pixel, from its place.
template <class Pixel>
Image<Pixel> image_of(const Camera& camera, const std::function<Pixel(int x, int y)>& value) {
  Image<Pixel> image(camera.width, camera.height, value(0, 0));
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) image.at(x, y) = value(x, y);
  }
  return image;
}

}  // namespace diorama::test
