// SPDX-License-Identifier: Apache-2.0
#include "framework/lint/tar_reader.h"

#include <algorithm>
#include <stdexcept>
#include <string_view>

namespace diorama::lint {
namespace {

std::size_t octal_number(std::string_view field) {
  std::size_t value = 0;
  for (const char c : field) {
    if (c == '\0' || (c == ' ' && value > 0)) break;
    if (c == ' ') continue;
    if (c < '0' || c > '7') throw std::runtime_error("a header is damaged");
    value = value * 8 + std::size_t(c - '0');
  }
  return value;
}

std::string text_of(std::string_view field) {
  return std::string(field.substr(0, std::min(field.find('\0'), field.size())));
}

}  // namespace

std::map<std::string, std::string> read_tar(const std::string& tar) {
  constexpr std::size_t kBlock = 512;
  const std::string_view bytes = tar;
  std::map<std::string, std::string> members;
  std::size_t at = 0;
  while (at + kBlock <= tar.size() && tar[at] != '\0') {
    std::size_t sum = 0;
    for (std::size_t i = 0; i < kBlock; ++i) {
      sum += i >= 148 && i < 156 ? ' ' : static_cast<unsigned char>(tar[at + i]);
    }
    if (sum != octal_number(bytes.substr(at + 148, 8))) {
      throw std::runtime_error("a header is damaged");
    }
    const std::string name = text_of(bytes.substr(at, 100));
    // Twelve octal digits: nothing overflows below.
    const std::size_t size = octal_number(bytes.substr(at + 124, 12));
    if (at + kBlock + size > tar.size()) throw std::runtime_error(name + " is cut short");
    members.emplace(name, tar.substr(at + kBlock, size));
    at += kBlock + (size + kBlock - 1) / kBlock * kBlock;
  }
  if (at + 2 * kBlock > tar.size()) throw std::runtime_error("the end of the archive is missing");
  return members;
}

}  // namespace diorama::lint
