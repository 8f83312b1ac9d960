// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "loader_usd/usd/layer.h"

namespace diorama::usd::test {

/// A version of the crate format, 0.minor.patch.
struct CrateVersion {
  int minor = 0;
  int patch = 0;
};

/// The versions whose files differ in something.
inline constexpr CrateVersion kCrateVersions[] = {{0, 1}, {1, 0},  {2, 0},  {4, 0},
                                                  {5, 0}, {6, 0},  {7, 0},  {8, 0},
                                                  {9, 0}, {10, 0}, {11, 0}, {12, 0}};

/// The layer as a crate of that version, or of the next one that can hold it (prepended items need
/// 0.2, lists of payloads 0.8 ...), as OpenUSD's writer does it. What our reader does not keep is
/// left out: splines, values of unknown types, what references carry along.
std::string encode_crate(const Layer& layer, CrateVersion version);

/// Where two layers differ, in words; empty when they hold the same.
std::string first_difference(const Layer& a, const Layer& b);

}  // namespace diorama::usd::test
