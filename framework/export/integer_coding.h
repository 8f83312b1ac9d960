// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

/// The two compressions of crate files.
namespace diorama::usd_export {

using Bytes = std::vector<std::byte>;

/// One LZ4 block behind a zero byte ("fast compression"). Throws Error(Output) beyond 2 GB.
Bytes compress(std::span<const std::byte> raw);

/// Differences in 0, 1, 2 or 4 bytes each, then compressed: the coding of 32-bit integers.
Bytes code_integers(std::span<const std::int32_t> values);

}  // namespace diorama::usd_export
