// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "framework/images/image_codecs.h"
#include "plugins/writer_support/fake_host.h"

namespace diorama::test {

/// Encodes pictures for real.
class EncodingHost final : public FakeHost {
 public:
  std::vector<std::byte> encode_image(const ImageView& image, ImageFormat format) const override {
    return diorama::encode_image(image, format);
  }
};

}  // namespace diorama::test
