// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <assimp/DefaultIOSystem.h>

namespace diorama::loader_assimp {

/// Opens files as assimp does by itself, but no pipes and devices: they would be waited for.
class RegularFiles : public Assimp::DefaultIOSystem {
 public:
  using DefaultIOSystem::Exists;
  using DefaultIOSystem::Open;
  bool Exists(const char* file) const override;
  Assimp::IOStream* Open(const char* file, const char* mode) override;
};

}  // namespace diorama::loader_assimp
