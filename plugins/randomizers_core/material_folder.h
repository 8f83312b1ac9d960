// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "diorama/host.h"
#include "diorama/material.h"

namespace diorama {

/// What one picture of a material says.
enum class MapRole : std::uint8_t {
  Color,
  Roughness,
  Metalness,
  NormalGl,
  NormalDx,
  Opacity,
  Emission,
  Arm,           ///< Occlusion, roughness and metalness in red, green and blue.
  Displacement,  ///< Told, but renderers move no surface.
  Ignored,       ///< Occlusion, which renderers find themselves.
};

/// A picture's name, taken apart: "brick_wall_nor_gl_1k.png" is the map NormalGl of "brick_wall".
struct MapName {
  std::string material;
  MapRole role = MapRole::Ignored;
};

/// By the words that ambientCG and Poly Haven use; nothing for other pictures.
std::optional<MapName> map_name(std::string_view file_name);

/// The pictures of one material.
struct MaterialMaps {
  std::string name;
  std::map<MapRole, std::filesystem::path> files;
};

/// The materials of a folder and of those below it, sorted by folder and name: pictures whose names
/// differ in their role alone, a colour among them. Throws Error(Asset), beginning with `folder`,
/// when there is none. Logs how many of them have displacement, which is left out.
std::vector<MaterialMaps> find_materials(const std::string& folder, Host& host);

/// Makes materials of maps. Pictures are read when they are first wanted and kept as long as a
/// scene uses them.
class MaterialReader {
 public:
  explicit MaterialReader(const Host& host) : host_(host) {}
  Material read(const MaterialMaps& maps);

 private:
  std::shared_ptr<const Texture> texture(const std::filesystem::path& file, ColorSpace space);

  const Host& host_;
  std::map<std::filesystem::path, std::weak_ptr<const Texture>> read_;
};

}  // namespace diorama
