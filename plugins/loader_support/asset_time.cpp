// SPDX-License-Identifier: Apache-2.0
#include "loader_support/asset_time.h"

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

TimedAsset split_time(std::string_view asset) {
  constexpr std::string_view kKey = "{time=";
  TimedAsset result{std::string(asset), std::nullopt};
  std::error_code error;
  const std::size_t start = asset.rfind(kKey);
  const bool is_timed = start != std::string_view::npos && asset.ends_with('}') &&
                        !std::filesystem::exists(result.file, error);
  if (!is_timed) return result;
  const std::size_t begin = start + kKey.size();
  result.seconds = parse_time(asset.substr(begin, asset.size() - begin - 1), asset);
  result.file = asset.substr(0, start);
  return result;
}

}  // namespace diorama::loader_support
