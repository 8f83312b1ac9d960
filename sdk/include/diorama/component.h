// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string_view>

#include "diorama/abi.h"

namespace diorama {

enum class ComponentKind : std::uint8_t {
  Loader,
  Physics,
  Randomizer,
  Renderer,
  Annotator,
  Writer,
  Reader,
};

/// "loader", "physics", "randomizer", "renderer", "annotator", "writer", "reader".
DIORAMA_SDK_API std::string_view kind_name(ComponentKind kind);

/// Base of everything that a plugin provides. Owned by the host; plugin libraries are never
/// unloaded, so they outlive every component.
class DIORAMA_SDK_API Component {
 public:
  Component() = default;
  Component(const Component&) = delete;
  Component& operator=(const Component&) = delete;
  virtual ~Component();
};

}  // namespace diorama
