// SPDX-License-Identifier: Apache-2.0
#include "framework/config/clean_text.h"

#include <algorithm>
#include <cstdint>

namespace diorama {
namespace {

std::uint32_t byte_at(std::string_view text, std::size_t i) {
  return static_cast<unsigned char>(text[i]);
}

/// Of a sequence that utf8_length() has measured.
std::uint32_t code_point(std::string_view sequence) {
  if (sequence.size() == 1) return byte_at(sequence, 0);
  std::uint32_t code = byte_at(sequence, 0) & (0xFFu >> (sequence.size() + 1));
  for (std::size_t i = 1; i < sequence.size(); ++i) {
    code = code << 6 | (byte_at(sequence, i) & 0x3F);
  }
  return code;
}

bool is_control(std::uint32_t code) { return code < 0x20 || (code >= 0x7F && code < 0xA0); }

bool turns_direction(std::uint32_t code) {
  return (code >= 0x202A && code <= 0x202E) || (code >= 0x2066 && code <= 0x2069);
}

/// Copies the sequences that `keeps` accepts and spells out the bytes of all others.
template <class Keeps>
std::string spelt_out(std::string_view text, Keeps keeps) {
  constexpr std::string_view kHex = "0123456789ABCDEF";
  std::string out;
  while (!text.empty()) {
    const std::size_t length = utf8_length(text);
    const std::string_view sequence = text.substr(0, std::max<std::size_t>(length, 1));
    if (length > 0 && keeps(code_point(sequence))) {
      out += sequence;
    } else {
      for (std::size_t i = 0; i < sequence.size(); ++i) {
        out += "\\x";
        out += kHex[byte_at(sequence, i) >> 4];
        out += kHex[byte_at(sequence, i) & 15];
      }
    }
    text.remove_prefix(sequence.size());
  }
  return out;
}

}  // namespace

std::size_t utf8_length(std::string_view text) {
  if (text.empty()) return 0;
  const std::uint32_t first = byte_at(text, 0);
  const std::size_t length = first < 0x80                     ? 1
                             : first >= 0xC2 && first <= 0xDF ? 2
                             : first >> 4 == 0xE              ? 3
                             : first >= 0xF0 && first <= 0xF4 ? 4
                                                              : 0;
  if (length > text.size()) return 0;
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte_at(text, i) & 0xC0) != 0x80) return 0;
  }
  if (length < 3) return length;
  const std::uint32_t code = code_point(text.substr(0, length));
  const bool is_good = length == 3 ? code >= 0x800 && (code < 0xD800 || code > 0xDFFF)
                                   : code >= 0x10000 && code <= 0x10FFFF;
  return is_good ? length : 0;
}

bool is_clean_name(std::string_view text) {
  while (!text.empty()) {
    const std::size_t length = utf8_length(text);
    if (length == 0 || is_control(code_point(text.substr(0, length)))) return false;
    text.remove_prefix(length);
  }
  return true;
}

std::string clean_name(std::string_view text) {
  return spelt_out(text, [](std::uint32_t code) { return !is_control(code); });
}

std::string printable(std::string_view text) {
  return spelt_out(text, [](std::uint32_t code) {
    return code == '\n' || code == '\t' || (!is_control(code) && !turns_direction(code));
  });
}

}  // namespace diorama
