// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "value.h"

namespace diorama::usd {

/// Maps paths from the namespace of a referenced site (source) to the one of the referring site
/// (target), by pairs of prefixes; the longest one counts. A path maps only if it maps back to
/// itself, so a reference hides what the referring prim covers.
class MapFunction {
 public:
  /// Maps everything to itself.
  static MapFunction identity();
  static MapFunction between(std::string source, std::string target, LayerOffset offset = {});
  /// Also maps paths outside of the pairs to themselves.
  MapFunction with_root_identity() const;

  std::optional<std::string> to_target(std::string_view path) const;
  std::optional<std::string> to_source(std::string_view path) const;

  /// First `inner`, then this.
  MapFunction compose(const MapFunction& inner) const;
  MapFunction inverse() const;

  bool is_identity() const;
  std::size_t bytes() const;  ///< That it takes, about.
  const LayerOffset& offset() const { return offset_; }
  friend bool operator==(const MapFunction&, const MapFunction&) = default;

 private:
  using Pairs = std::vector<std::pair<std::string, std::string>>;
  void simplify();

  Pairs pairs_;  ///< Sorted, without pairs that follow from others.
  LayerOffset offset_;
};

}  // namespace diorama::usd
