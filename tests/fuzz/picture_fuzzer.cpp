// SPDX-License-Identifier: Apache-2.0
//
// One input is one picture of any format; what has no mark is read as TGA. Refusing is fine;
// crashing, hanging, taking more memory than the budget, and pictures whose pixels do not fit their
// size are findings.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>

#include "diorama/error.h"
#include "framework/images/image_codecs.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  constexpr std::uint64_t kBudget = std::uint64_t(64) << 20;
  try {
    const auto texture =
        diorama::decode_image(std::as_bytes(std::span(data, size)), "input.tga", kBudget);
    const std::size_t samples =
        std::size_t(texture->width) * std::size_t(texture->height) * std::size_t(texture->channels);
    if (samples == 0 || samples != texture->bytes.size() + texture->floats.size()) std::abort();
  } catch (const diorama::Error&) {
    return 0;
  }
  return 0;
}
