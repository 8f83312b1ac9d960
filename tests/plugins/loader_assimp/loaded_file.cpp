// SPDX-License-Identifier: Apache-2.0
#include "plugins/loader_assimp/loaded_file.h"

#include <cstdint>

namespace diorama::test {

std::string red_green_png() {
  const std::uint8_t pixels[] = {255, 0, 0, 0, 255, 0};
  const RenderHost host{1};
  const auto bytes = host.encode_image({pixels, 2, 1, 3, 8}, ImageFormat::Png);
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

std::string base64(const std::string& bytes) {
  static constexpr char kDigits[] =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      group = group << 8 | (i + k < bytes.size() ? std::uint8_t(bytes[i + k]) : 0u);
    }
    for (std::size_t k = 0; k < 4; ++k) {
      text += i + k > bytes.size() ? '=' : kDigits[group >> (18 - 6 * k) & 63];
    }
  }
  return text;
}

}  // namespace diorama::test
