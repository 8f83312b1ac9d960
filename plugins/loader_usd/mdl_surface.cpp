// SPDX-License-Identifier: Apache-2.0
#include "loader_usd/mdl_surface.h"

#include <algorithm>
#include <cctype>
#include <initializer_list>

namespace diorama::loader_usd {
namespace {

using usd::Prim;

constexpr std::string_view kInputs = "inputs:";

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

// The first input that has one of the names, or that holds what follows a '*', any case, and that
// names a picture.
bool connect(const Prim& shader, std::initializer_list<const char*> names,
             TextureInput Material::*target, TextureSpace space, MaterialDraft& draft) {
  const ShaderNetwork& network = draft.network();
  const usd::Strings properties = network.stage().property_names(shader, kInputs);
  for (const char* wanted : names) {
    for (const std::string& property : properties) {
      const std::string name = property.substr(kInputs.size());
      const bool fits =
          name == wanted || (wanted[0] == '*' && lower(name).find(wanted + 1) != std::string::npos);
      if (!fits) continue;
      const usd::FoundValue value = network.input(shader, name);
      if (value.value.type() != usd::Type::AssetPath || value.value.is_array()) continue;
      if (draft.connect(target, value, space)) return true;
    }
  }
  return false;
}

void draft_colors(const Prim& shader, bool is_omni_pbr, MaterialDraft& draft) {
  const ShaderNetwork& network = draft.network();
  const bool has_picture = connect(
      shader,
      {"diffuse_texture", "BaseColor_Tex", "*basecolor", "*base_color", "*albedo", "*diffuse"},
      &Material::base_color_texture, TextureSpace::Auto, draft);
  const Vec3f tint = network.color(shader, "diffuse_tint", Vec3f::Ones()) *
                     network.number(shader, "albedo_brightness", 1.0f);
  const Vec3f fallback = Vec3f::Constant(is_omni_pbr ? 0.2f : 0.5f);
  const Vec3f constant = network.color(shader, "diffuse_color_constant", fallback);
  draft.material().base_color = has_picture ? tint : Vec3f(constant.cwiseProduct(tint));
}

void draft_metal(const Prim& shader, MaterialDraft& draft) {
  const ShaderNetwork& network = draft.network();
  Material& material = draft.material();
  material.roughness = network.number(shader, "reflection_roughness_constant", 0.5f);
  material.metallic = network.number(shader, "metallic_constant", 0.0f);
  if (network.boolean(shader, "enable_ORM_texture", false)) {
    const TextureSpace raw = TextureSpace::Raw;
    connect(shader, {"ORM_texture"}, &Material::roughness_texture, raw, draft);
    connect(shader, {"ORM_texture"}, &Material::metallic_texture, raw, draft);
    material.roughness_texture.channel = 1;
    material.metallic_texture.channel = 2;
    return;
  }
  if (network.number(shader, "reflection_roughness_texture_influence", 0.0f) > 0.0f) {
    connect(shader, {"reflectionroughness_texture"}, &Material::roughness_texture,
            TextureSpace::Raw, draft);
  }
  if (network.number(shader, "metallic_texture_influence", 0.0f) > 0.0f) {
    connect(shader, {"metallic_texture"}, &Material::metallic_texture, TextureSpace::Raw, draft);
  }
}

void draft_effects(const Prim& shader, MaterialDraft& draft) {
  const ShaderNetwork& network = draft.network();
  Material& material = draft.material();
  connect(shader, {"normalmap_texture", "Normal_Tex", "*normal"}, &Material::normal_texture,
          TextureSpace::Raw, draft);
  unpack_normals(material.normal_texture, network.number(shader, "bump_factor", 1.0f));
  if (network.boolean(shader, "enable_opacity", false)) {
    connect(shader, {"opacity_texture"}, &Material::opacity_texture, TextureSpace::Raw, draft);
    material.opacity = network.number(shader, "opacity_constant", 1.0f);
    material.opacity_threshold = network.number(shader, "opacity_threshold", 0.0f);
  }
  if (network.boolean(shader, "enable_emission", false)) {
    material.emission = network.color(shader, "emissive_color", Vec3f::Ones()) *
                        network.number(shader, "emissive_intensity", 40.0f);
    connect(shader, {"emissive_mask_texture"}, &Material::emission_texture, TextureSpace::Auto,
            draft);
  }
}

void draft_glass(const Prim& shader, MaterialDraft& draft) {
  const ShaderNetwork& network = draft.network();
  Material& material = draft.material();
  material.transmission = 1.0f;
  material.base_color = network.color(shader, "glass_color", Vec3f::Ones());
  material.ior = network.number(shader, "glass_ior", 1.491f);
  material.roughness = network.number(shader, "frosting_roughness", 0.0f);
  material.is_thin_walled = network.boolean(shader, "thin_walled", false);
}

}  // namespace

std::string mdl_module(const ShaderNetwork& network, const Prim& shader) {
  const usd::Value asset = network.stage().value(shader, "info:mdl:sourceAsset");
  return asset.as_text() ? *asset.as_text() : network.id(shader);
}

void draft_mdl_surface(const Prim& shader, MaterialDraft& draft) {
  const ShaderNetwork& network = draft.network();
  const std::string kind = lower(mdl_module(network, shader));
  draft_colors(shader, kind.find("omnipbr") != std::string::npos, draft);
  draft_metal(shader, draft);
  draft_effects(shader, draft);
  if (kind.find("glass") != std::string::npos) draft_glass(shader, draft);
  const auto map = uv_map(network.pair(shader, "texture_scale", Vec2f::Ones()),
                          network.number(shader, "texture_rotate", 0.0f),
                          network.pair(shader, "texture_translate", Vec2f::Zero()));
  for (const auto input :
       {&Material::base_color_texture, &Material::roughness_texture, &Material::metallic_texture,
        &Material::normal_texture, &Material::opacity_texture, &Material::emission_texture}) {
    (draft.material().*input).uv_from_mesh_uv = map;
  }
}

}  // namespace diorama::loader_usd
