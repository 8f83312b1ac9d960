// SPDX-License-Identifier: Apache-2.0
#include "diorama/component.h"

#include "diorama/host.h"
#include "diorama/loader.h"
#include "diorama/plugin.h"
#include "diorama/randomizer.h"

namespace diorama {

std::string_view kind_name(ComponentKind kind) {
  switch (kind) {
    case ComponentKind::Loader:
      return "loader";
    case ComponentKind::Physics:
      return "physics";
    case ComponentKind::Randomizer:
      return "randomizer";
    case ComponentKind::Renderer:
      return "renderer";
    case ComponentKind::Annotator:
      return "annotator";
    case ComponentKind::Writer:
      return "writer";
    case ComponentKind::Reader:
      return "reader";
  }
  return "unknown";
}

// The virtual tables of the interfaces live here, once, and not in every plugin.
Component::~Component() = default;
Loader::~Loader() = default;
Randomizer::~Randomizer() = default;
void Randomizer::play(Scene&, const ClipFrame&) {}
void Randomizer::lead(Scene&, const ClipFrame&) {}
Registrar::~Registrar() = default;

std::vector<std::string> Loader::assets() const { return {}; }
std::vector<std::filesystem::path> Loader::files(std::string_view asset) const {
  if (!std::filesystem::is_regular_file(asset)) return {};
  return {asset};
}

}  // namespace diorama
