// SPDX-License-Identifier: Apache-2.0
#include "writer_voc/class_list_names.h"

#include <algorithm>
#include <cctype>

namespace diorama {

std::vector<std::string> class_list_names(const std::vector<std::string>& classes) {
  std::vector<std::string> names;
  for (const std::string& label : classes) {
    std::string name = label;
    for (char& c : name) {
      const auto byte = static_cast<unsigned char>(c);
      if (byte < 0x80 && !std::isalnum(byte) && c != '-' && c != '.') c = '_';
    }
    std::string free = name;
    for (int number = 2; std::ranges::count(names, free) > 0; ++number) {
      free = name + "_" + std::to_string(number);
    }
    names.push_back(free);
  }
  return names;
}

}  // namespace diorama
