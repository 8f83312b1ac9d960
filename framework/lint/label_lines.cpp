// SPDX-License-Identifier: Apache-2.0
#include "framework/lint/label_lines.h"

#include <charconv>
#include <iterator>
#include <sstream>
#include <stdexcept>

namespace diorama::lint {

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

std::vector<std::string> whole_lines_of(const std::string& text) {
  if (!text.empty() && text.back() != '\n') throw std::runtime_error("its last line is cut short");
  return lines_of(text);
}

std::vector<double> numbers_of(const std::vector<std::string>& words, std::size_t first) {
  std::vector<double> numbers;
  for (std::size_t i = first; i < words.size(); ++i) {
    double value = 0.0;
    const char* end = words[i].data() + words[i].size();
    const auto result = std::from_chars(words[i].data(), end, value);
    if (result.ec != std::errc() || result.ptr != end) {
      throw std::runtime_error("'" + words[i] + "' is not a number");
    }
    numbers.push_back(value);
  }
  return numbers;
}

std::vector<std::string> words_of(const std::string& line) {
  std::istringstream in(line);
  return {std::istream_iterator<std::string>(in), {}};
}

std::string picture_file(const Dataset& dataset, const std::string& stem) {
  for (const char* ending : {".png", ".jpg", ".jpeg"}) {
    if (dataset.has(stem + ending)) return stem + ending;
  }
  return {};
}

}  // namespace diorama::lint
