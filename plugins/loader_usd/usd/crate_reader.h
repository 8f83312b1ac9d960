// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include "layer.h"
#include "mapped_file.h"

namespace diorama::usd {

/// Whether the bytes begin as a crate file does.
bool is_crate(std::span<const std::byte> bytes);

/// Reads the structure of a crate file, versions 0.0.1 to 0.12; values stay in `bytes` until they
/// are asked for. Every count, index and offset is checked before it is used, so that a damaged
/// file costs little time and memory. `identifier` names the file in messages. Throws FormatError.
std::shared_ptr<Layer> read_crate(const std::string& identifier, ByteView bytes);

}  // namespace diorama::usd
