// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <unordered_map>

#include "diorama/geometry.h"

namespace diorama::loader_support {

/// The meshes of one asset: what is equal in every number is one mesh. Exporters write the same
/// chair six times.
class MeshPool {
 public:
  /// The mesh, or the equal one that came before it.
  std::shared_ptr<const Mesh> share(Mesh mesh);

 private:
  std::unordered_multimap<std::uint64_t, std::shared_ptr<const Mesh>> meshes_;
};

}  // namespace diorama::loader_support
