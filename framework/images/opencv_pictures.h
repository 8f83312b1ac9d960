// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>

#include "diorama/material.h"

namespace diorama::images {

/// Pictures that OpenCV decodes. In a library of its own, because its codecs bring more than a
/// hundred others. Several threads may call it.
class OpencvPictures {
 public:
  /// Name and colour space stay as they are by default. Throws std::runtime_error with the reason.
  virtual Texture decode(std::span<const std::byte> bytes) const = 0;

 protected:
  ~OpencvPictures() = default;
};

}  // namespace diorama::images
