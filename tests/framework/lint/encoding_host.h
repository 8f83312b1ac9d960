// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "framework/images/image_codecs.h"
#include "plugins/writer_support/fake_host.h"

namespace diorama::test {

/// Encodes and decodes pictures for real.
class EncodingHost final : public FakeHost {
 public:
  std::vector<std::byte> encode_image(const ImageView& image, ImageFormat format) const override {
    return diorama::encode_image(image, format);
  }
  std::shared_ptr<const Texture> decode_texture(std::span<const std::byte> bytes,
                                                std::string_view name) const override {
    return decode_image(bytes, name);
  }
};

}  // namespace diorama::test
