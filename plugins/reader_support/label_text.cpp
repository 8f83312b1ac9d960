// SPDX-License-Identifier: Apache-2.0
#include "reader_support/label_text.h"

#include <charconv>
#include <cmath>
#include <stdexcept>

namespace diorama {
namespace {

constexpr std::string_view kBlanks = " \t\r\f\v";

}  // namespace

std::vector<std::string> text_lines(std::string_view text) {
  std::vector<std::string> lines;
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  while (!text.empty()) {
    const std::size_t end = text.find('\n');
    std::string_view line = text.substr(0, end);
    if (line.ends_with('\r')) line.remove_suffix(1);
    lines.emplace_back(line);
    if (end == text.npos) break;
    text.remove_prefix(end + 1);
  }
  return lines;
}

std::vector<std::string> text_words(std::string_view line) {
  std::vector<std::string> words;
  while (true) {
    const std::size_t begin = line.find_first_not_of(kBlanks);
    if (begin == line.npos) return words;
    line.remove_prefix(begin);
    const std::size_t end = line.find_first_of(kBlanks);
    words.emplace_back(line.substr(0, end));
    if (end == line.npos) return words;
    line.remove_prefix(end);
  }
}

std::uint64_t text_hash(std::string_view text) {
  std::uint64_t hash = 0xcbf29ce484222325ull;
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3ull;
  return hash;
}

double number_of(std::string_view word) {
  if (word.starts_with('+')) word.remove_prefix(1);
  double value = 0.0;
  const char* end = word.data() + word.size();
  const auto result = std::from_chars(word.data(), end, value);
  if (result.ec != std::errc() || result.ptr != end) {
    throw std::runtime_error("'" + std::string(word) + "' is not a number");
  }
  if (!std::isfinite(value)) throw std::runtime_error("'" + std::string(word) + "' is not finite");
  return value;
}

int integer_of(std::string_view word) {
  // "3.0" is an integer to most readers of label files.
  const double value = number_of(word);
  if (value != std::floor(value) || std::abs(value) > 2147483647.0) {
    throw std::runtime_error("'" + std::string(word) + "' is not a whole number");
  }
  return int(value);
}

std::vector<double> numbers_from(const std::vector<std::string>& words, std::size_t first) {
  std::vector<double> numbers;
  for (std::size_t i = first; i < words.size(); ++i) numbers.push_back(number_of(words[i]));
  return numbers;
}

}  // namespace diorama
