// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace diorama::loader_support {

/// Whether a time is one that names of assets may ask for: a number below 1e9 s, to either side.
bool is_time(double seconds);

/// The number of "{time=1.5}". Throws Error(Asset) that begins with the asset's name.
double parse_time(std::string_view word, std::string_view asset);

struct TimedAsset {
  std::string file;
  std::optional<std::string> animation;  ///< Name or number, as it is said.
  std::optional<double> seconds;

  /// The name without a time.
  std::string timeless() const;
};

/// The name of an asset as another one is made of it: "mug.usd" and "look", "red" give
/// "mug.usd{look=red}". What it says of the same thing goes.
std::string named_with(std::string asset, std::string_view key, std::string_view word);

/// The name of an asset as it is at a time.
std::string named_at(std::string asset, double seconds);

/// "walker.glb{animation=run}{time=1.5}" in its parts, of which the last two may be left out. A
/// file that has such a name is a file. Throws Error(Asset) that begins with the asset's name.
TimedAsset split_time(std::string_view asset);

}  // namespace diorama::loader_support
