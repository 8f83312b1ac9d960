// SPDX-License-Identifier: Apache-2.0
#include "map_function.h"

#include <algorithm>

#include "path.h"

namespace diorama::usd {
namespace {

using Pairs = std::vector<std::pair<std::string, std::string>>;

const std::string& side(const std::pair<std::string, std::string>& pair, bool second) {
  return second ? pair.second : pair.first;
}

// Maps from one side of the pairs to the other. `skip` leaves one pair out.
std::optional<std::string> map_path(const Pairs& pairs, std::string_view text, bool to_first,
                                    std::size_t skip = std::string::npos) {
  std::size_t best = pairs.size();
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const std::string& from = side(pairs[i], to_first);
    if (i == skip || !path::has_prefix(text, from)) continue;
    if (best == pairs.size() || from.size() > side(pairs[best], to_first).size()) best = i;
  }
  if (best == pairs.size()) return std::nullopt;
  const std::string& to = side(pairs[best], !to_first);
  if (to.empty()) return std::nullopt;
  std::string result = path::replace_prefix(text, side(pairs[best], to_first), to);
  // A more specific pair owns the result: then nothing maps there from here.
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const std::string& other = side(pairs[i], !to_first);
    if (i == skip || i == best || other.size() <= to.size()) continue;
    if (path::has_prefix(result, other)) return std::nullopt;
  }
  return result;
}

}  // namespace

MapFunction MapFunction::identity() { return between("/", "/"); }

MapFunction MapFunction::between(std::string source, std::string target, LayerOffset offset) {
  MapFunction function;
  function.pairs_.emplace_back(std::move(source), std::move(target));
  function.offset_ = offset;
  return function;
}

MapFunction MapFunction::with_root_identity() const {
  MapFunction result = *this;
  const bool has_root =
      std::any_of(pairs_.begin(), pairs_.end(), [](const auto& pair) { return pair.first == "/"; });
  if (!has_root) result.pairs_.emplace_back("/", "/");
  result.simplify();
  return result;
}

std::optional<std::string> MapFunction::to_target(std::string_view path) const {
  return map_path(pairs_, path, false);
}

std::optional<std::string> MapFunction::to_source(std::string_view path) const {
  return map_path(pairs_, path, true);
}

void MapFunction::simplify() {
  std::sort(pairs_.begin(), pairs_.end());
  pairs_.erase(std::unique(pairs_.begin(), pairs_.end()), pairs_.end());
  for (std::size_t i = 0; i < pairs_.size();) {
    const auto implied = map_path(pairs_, pairs_[i].first, false, i);
    if (implied && *implied == pairs_[i].second) {
      pairs_.erase(pairs_.begin() + static_cast<std::ptrdiff_t>(i));
    } else {
      ++i;
    }
  }
}

MapFunction MapFunction::compose(const MapFunction& inner) const {
  if (is_identity()) return inner;
  if (inner.is_identity()) return *this;
  MapFunction result;
  result.offset_ = offset_.compose(inner.offset_);
  const auto add = [&](const std::string& source, const std::string& target) {
    const bool is_taken = std::any_of(result.pairs_.begin(), result.pairs_.end(),
                                      [&](const auto& pair) { return pair.first == source; });
    if (!is_taken) result.pairs_.emplace_back(source, target);
  };
  for (const auto& [source, middle] : inner.pairs_) {
    if (const auto target = to_target(middle)) add(source, *target);
  }
  for (const auto& [middle, target] : pairs_) {
    if (const auto source = inner.to_source(middle)) add(*source, target);
  }
  result.simplify();
  return result;
}

MapFunction MapFunction::inverse() const {
  MapFunction result;
  for (const auto& [source, target] : pairs_) result.pairs_.emplace_back(target, source);
  std::sort(result.pairs_.begin(), result.pairs_.end());
  if (offset_.scale != 0.0) {
    result.offset_ = {-offset_.offset / offset_.scale, 1.0 / offset_.scale};
  }
  return result;
}

bool MapFunction::is_identity() const {
  return pairs_.size() == 1 && pairs_[0].first == "/" && pairs_[0].second == "/" &&
         offset_.is_identity();
}

std::size_t MapFunction::bytes() const {
  std::size_t bytes = sizeof(MapFunction);
  for (const auto& [source, target] : pairs_) {
    bytes += sizeof(Pairs::value_type) + source.capacity() + target.capacity();
  }
  return bytes;
}

}  // namespace diorama::usd
