// SPDX-License-Identifier: Apache-2.0
#include "modelling/surfaces.h"

#include <string>
#include <utility>

namespace diorama::modelling {

MaterialPtr make_plain(std::string_view name, const Color& color, double roughness,
                       double metallic) {
  Material material;
  material.name = std::string(name);
  material.base_color = linear(color);
  material.roughness = float(roughness);
  material.metallic = float(metallic);
  return std::make_shared<const Material>(std::move(material));
}

MaterialPtr make_textured(std::string_view name, const TextureSet& textures, double roughness,
                          double clearcoat) {
  Material material;
  material.name = std::string(name);
  material.base_color = Vec3f::Ones();
  material.base_color_texture.texture = textures.color;
  if (textures.normal) {
    material.normal_texture.texture = textures.normal;
    material.normal_texture.scale = {2, 2, 2, 1};
    material.normal_texture.bias = {-1, -1, -1, 0};
  }
  material.roughness = float(roughness);
  material.clearcoat = float(clearcoat);
  material.clearcoat_roughness = 0.12f;
  return std::make_shared<const Material>(std::move(material));
}

MaterialPtr make_picture_material(std::string_view name, std::shared_ptr<const Texture> picture,
                                  double roughness, Wrap around) {
  Material material;
  material.name = std::string(name);
  material.base_color = Vec3f::Ones();
  material.base_color_texture.texture = std::move(picture);
  material.base_color_texture.wrap_u = around;
  material.base_color_texture.wrap_v = Wrap::Clamp;
  material.roughness = float(roughness);
  return std::make_shared<const Material>(std::move(material));
}

MaterialPtr make_pane(std::string_view name) {
  Material material;
  material.name = std::string(name);
  material.base_color = Vec3f::Ones();
  material.roughness = 0.0f;
  material.transmission = 1.0f;
  material.is_thin_walled = true;
  return std::make_shared<const Material>(std::move(material));
}

}  // namespace diorama::modelling
