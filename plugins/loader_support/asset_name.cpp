// SPDX-License-Identifier: Apache-2.0
#include "loader_support/asset_name.h"

#include <array>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <system_error>

#include "diorama/error.h"

namespace diorama::loader_support {

bool is_time(double seconds) { return std::abs(seconds) < 1e9; }

double parse_time(std::string_view word, std::string_view asset) {
  double seconds = 0.0;
  const auto parsed = std::from_chars(word.data(), word.data() + word.size(), seconds);
  const bool is_number = parsed.ec == std::errc() && parsed.ptr == word.data() + word.size();
  if (is_number && is_time(seconds)) return seconds;
  throw Error(ErrorKind::Asset, std::string(asset) + ": found the time '" + std::string(word) +
                                    "', expected seconds as {time=1.5}");
}

std::string TimedAsset::timeless() const {
  return animation ? file + "{animation=" + *animation + "}" : file;
}

TimedAsset split_time(std::string_view asset) {
  TimedAsset result{std::string(asset), std::nullopt, std::nullopt};
  std::error_code error;
  if (!asset.ends_with('}') || std::filesystem::exists(result.file, error)) return result;
  // What stands behind a key at the end of `rest`, which loses both.
  std::string_view rest = asset;
  const auto take = [&](std::string_view key) -> std::optional<std::string_view> {
    const std::size_t start = rest.rfind(key);
    if (start == std::string_view::npos || !rest.ends_with('}')) return std::nullopt;
    const std::size_t begin = start + key.size();
    const std::string_view word = rest.substr(begin, rest.size() - begin - 1);
    rest = rest.substr(0, start);
    return word;
  };
  if (const auto word = take("{time=")) result.seconds = parse_time(*word, asset);
  if (const auto word = take("{animation=")) result.animation = *word;
  result.file = rest;
  return result;
}

std::string named_with(std::string asset, std::string_view key, std::string_view word) {
  const std::string begin = "{" + std::string(key) + "=";
  const std::size_t known = asset.find(begin);
  if (known != std::string::npos) {
    const std::size_t end = asset.find('}', known);
    asset.erase(known, end == std::string::npos ? end : end + 1 - known);
  }
  return asset + begin + std::string(word) + "}";
}

std::string named_at(std::string asset, double seconds) {
  std::array<char, 512> digits{};  // enough for every number
  const auto end =
      std::to_chars(digits.data(), digits.data() + digits.size(), seconds, std::chars_format::fixed)
          .ptr;
  return named_with(std::move(asset), "time", {digits.data(), end});
}

}  // namespace diorama::loader_support
