// SPDX-License-Identifier: Apache-2.0
#include "writer_webdataset/tar_walk.h"

#include <algorithm>
#include <charconv>
#include <stdexcept>
#include <string_view>

namespace diorama {
namespace {

constexpr std::uint64_t kMostName = 1 << 16;
constexpr std::uint64_t kMostContent = std::uint64_t(1) << 30;

[[noreturn]] void damaged(std::uint64_t at) {
  throw std::runtime_error("the header at byte " + std::to_string(at) + " is damaged");
}

/// Octal digits, or, for what these cannot say, a big-endian number behind a set bit.
std::uint64_t number_of_field(std::string_view field, std::uint64_t at) {
  std::uint64_t value = 0;
  if ((static_cast<unsigned char>(field[0]) & 0x80) != 0) {
    for (std::size_t i = 0; i < field.size(); ++i) {
      if (value >> 55 != 0) damaged(at);
      const auto byte = static_cast<unsigned char>(field[i]);
      value = value << 8 | (i == 0 ? byte & 0x7Fu : byte);
    }
    return value;
  }
  const std::size_t begin = std::min(field.find_first_not_of(' '), field.size());
  for (const char c : field.substr(begin)) {
    if (c == '\0' || c == ' ') break;
    if (c < '0' || c > '7') damaged(at);
    value = value * 8 + std::uint64_t(c - '0');
  }
  return value;
}

std::string text_of(std::string_view field) {
  return std::string(field.substr(0, std::min(field.find('\0'), field.size())));
}

bool has_right_sum(std::string_view header, std::uint64_t at) {
  std::int64_t sum = 0;
  std::int64_t signed_sum = 0;
  for (std::size_t i = 0; i < header.size(); ++i) {
    const char c = i >= 148 && i < 156 ? ' ' : header[i];
    sum += static_cast<unsigned char>(c);
    signed_sum += static_cast<signed char>(c);
  }
  const auto said = std::int64_t(number_of_field(header.substr(148, 8), at));
  return said == sum || said == signed_sum;
}

}  // namespace

std::string TarWalk::bytes(std::uint64_t begin, std::uint64_t size) {
  std::string result(size, '\0');
  in_.clear();
  in_.seekg(std::streamoff(begin));
  in_.read(result.data(), std::streamsize(size));
  if (!in_) {
    throw std::runtime_error(size_ == kAnySize ? "the end of the archive is missing"
                                               : "has become shorter");
  }
  return result;
}

void TarWalk::read_pax(const std::string& records) {
  // "LENGTH KEY=VALUE\n", the length being that of the whole record.
  std::string_view rest = records;
  while (!rest.empty() && rest.front() != '\0') {
    std::size_t length = 0;
    const auto parsed = std::from_chars(rest.data(), rest.data() + rest.size(), length);
    const auto digits = std::size_t(parsed.ptr - rest.data());
    if (parsed.ec != std::errc() || length <= digits + 1 || length > rest.size()) {
      throw std::runtime_error("a pax header is damaged");
    }
    std::string_view record = rest.substr(digits + 1, length - digits - 1);
    if (record.ends_with('\n')) record.remove_suffix(1);
    if (record.starts_with("path=")) long_name_ = record.substr(5);
    if (record.starts_with("size=")) {
      std::uint64_t size = 0;
      const std::string_view value = record.substr(5);
      if (std::from_chars(value.data(), value.data() + value.size(), size).ec != std::errc()) {
        throw std::runtime_error("a pax header is damaged");
      }
      long_size_ = size;
    }
    rest.remove_prefix(length);
  }
}

std::optional<TarMember> TarWalk::next() {
  std::uint64_t first = at_;
  while (true) {
    if (at_ > size_ || size_ - at_ < kTarBlock) {
      throw std::runtime_error("the end of the archive is missing");
    }
    const std::string header = bytes(at_, kTarBlock);
    const std::string_view view = header;
    if (header.find_first_not_of('\0') == std::string::npos) return std::nullopt;
    if (!has_right_sum(view, at_)) damaged(at_);
    const char type = header[156];
    std::uint64_t size = number_of_field(view.substr(124, 12), at_);
    const bool is_extra = type == 'x' || type == 'g' || type == 'L' || type == 'K';
    if (!is_extra && long_size_) size = *long_size_;
    // Links, devices and folders have no content, whatever their size says.
    if (type >= '1' && type <= '6') size = 0;
    std::string name = text_of(view.substr(0, 100));
    if (view.substr(257, 6) == std::string_view("ustar\0", 6)) {
      const std::string front = text_of(view.substr(345, 155));
      if (!front.empty()) name = front + "/" + name;
    }
    if (!is_extra && !long_name_.empty()) name = long_name_;
    const std::uint64_t begin = at_ + kTarBlock;
    if (size > size_ - begin) throw std::runtime_error(name + " is cut short");
    at_ = begin + (size + kTarBlock - 1) / kTarBlock * kTarBlock;
    if (is_extra) {
      if (size > kMostName)
        throw std::runtime_error("a name has " + std::to_string(size) + " bytes");
      if (type == 'L') long_name_ = text_of(bytes(begin, size));
      if (type == 'x') read_pax(bytes(begin, size));
      continue;
    }
    long_name_.clear();
    long_size_.reset();
    if (type == '0' || type == '\0' || type == '7') return TarMember{name, first, begin, size};
    first = at_;
  }
}

std::string TarWalk::content(const TarMember& member) {
  if (member.size > kMostContent) {
    throw std::runtime_error(member.name + " has " + std::to_string(member.size) +
                             " bytes; at most " + std::to_string(kMostContent) + " are read");
  }
  return bytes(member.begin, member.size);
}

}  // namespace diorama
