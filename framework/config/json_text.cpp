// SPDX-License-Identifier: Apache-2.0
#include "framework/config/json_text.h"

#include <stdexcept>
#include <string>

namespace diorama {

void check_json_depth(std::string_view text) {
  constexpr int kMostLevels = 100;
  int depth = 0;
  bool is_in_string = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (is_in_string) {
      if (c == '\\') ++i;
      if (c == '"') is_in_string = false;
    } else if (c == '"') {
      is_in_string = true;
    } else if (c == '[' || c == '{') {
      if (++depth > kMostLevels) {
        throw std::runtime_error("nests deeper than " + std::to_string(kMostLevels) + " levels");
      }
    } else if (c == ']' || c == '}') {
      --depth;
    }
  }
}

}  // namespace diorama
