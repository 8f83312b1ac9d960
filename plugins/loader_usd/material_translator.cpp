// SPDX-License-Identifier: Apache-2.0
#include "loader_usd/material_translator.h"

#include <algorithm>
#include <cctype>
#include <cmath>

#include "loader_usd/usd/geometry.h"
#include "loader_usd/usd/path.h"

namespace diorama::loader_usd {
namespace {

using usd::Prim;
using usd::Stage;

constexpr int kMaxConnections = 64;
constexpr std::string_view kInputs = "inputs:";
constexpr std::string_view kOutputs = "outputs:";

std::optional<Vec3f> to_color(const usd::Value& value) {
  std::array<double, 3> three{};
  std::array<double, 4> four{};
  if (value.read(three)) return Vec3f(three[0], three[1], three[2]);
  if (value.read(four)) return Vec3f(four[0], four[1], four[2]);
  if (value.is_array()) return std::nullopt;
  if (const auto number = value.as_number()) return Vec3f::Constant(static_cast<float>(*number));
  return std::nullopt;
}

Wrap to_wrap(const std::string& word) {
  if (word == "clamp") return Wrap::Clamp;
  if (word == "mirror") return Wrap::Mirror;
  if (word == "black") return Wrap::Black;
  return Wrap::Repeat;
}

int to_channel(std::string_view output) {
  if (output == "g" || output == "y") return 1;
  if (output == "b" || output == "z") return 2;
  if (output == "a" || output == "w") return 3;
  return 0;
}

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

// A 2 x 3 map of texture coordinates that first scales, then turns, then moves.
Eigen::Matrix<float, 2, 3> uv_map(const Vec2f& scale, float degrees, const Vec2f& offset) {
  const float angle = degrees * static_cast<float>(kPi / 180.0);
  Eigen::Matrix<float, 2, 3> map;
  map << scale.x() * std::cos(angle), -scale.y() * std::sin(angle), offset.x(),
      scale.x() * std::sin(angle), scale.y() * std::cos(angle), offset.y();
  return map;
}

}  // namespace

const TranslatedMaterial& MaterialTranslator::translate(const std::string& path) {
  auto [entry, is_new] = by_path_.try_emplace(path);
  if (!is_new) return entry->second;
  const Prim* prim = path.empty() ? nullptr : stage_.find(path);
  if (!prim) return entry->second;

  // The same opinions, seen through another instance, are the same material.
  std::vector<std::pair<const void*, std::string>> sites;
  for (const int i : prim->order) {
    const usd::IndexNode& node = prim->index.nodes[static_cast<std::size_t>(i)];
    sites.emplace_back(node.stack, node.path);
  }
  if (const auto known = by_sites_.find(sites); known != by_sites_.end()) {
    return entry->second = known->second;
  }
  TranslatedMaterial& result = entry->second;
  Material material;
  material.name = std::string(usd::path::name(path));
  if (const Prim* shader = surface(*prim, "outputs:surface");
      shader && usd::token_or(stage_, *shader, "info:id", "") == "UsdPreviewSurface") {
    translate_preview_surface(*shader, material, result);
    result.material = std::make_shared<const Material>(std::move(material));
  } else if (const Prim* mdl = surface(*prim, "outputs:mdl:surface"); mdl || shader) {
    translate_mdl(mdl ? *mdl : *shader, material);
    result.material = std::make_shared<const Material>(std::move(material));
  }
  by_sites_.emplace(std::move(sites), result);
  return result;
}

// Follows connections through materials and node graphs to a shader's output or a value.
MaterialTranslator::Source MaterialTranslator::follow(const Prim& prim,
                                                      const std::string& attribute) const {
  const Prim* at = &prim;
  std::string name = attribute;
  for (int i = 0; i < kMaxConnections; ++i) {
    const usd::Strings connections = stage_.connections(*at, name);
    if (connections.empty()) return {at, name, {}};
    const std::string& target = connections.front();
    const Prim* next = stage_.find(usd::path::prim_part(target));
    const std::string_view property = usd::path::property_part(target);
    if (!next || property.empty()) return {};
    if (next->type_name == "Shader" && property.starts_with(kOutputs)) {
      return {next, {}, std::string(property.substr(kOutputs.size()))};
    }
    at = next;
    name = property;
  }
  return {};
}

const Prim* MaterialTranslator::surface(const Prim& material, std::string_view output) const {
  const Source source = follow(material, std::string(output));
  return source.output.empty() ? nullptr : source.prim;
}

usd::FoundValue MaterialTranslator::input(const Prim& shader, const std::string& name) const {
  const Source source = follow(shader, std::string(kInputs) + name);
  if (!source.prim || !source.output.empty()) return {};
  return stage_.find_value(*source.prim, source.attribute);
}

float MaterialTranslator::number(const Prim& shader, const std::string& name,
                                 float fallback) const {
  const usd::Value value = input(shader, name).value;
  const auto number = value.as_number();
  return number && !value.is_array() && std::isfinite(*number) ? static_cast<float>(*number)
                                                               : fallback;
}

bool MaterialTranslator::boolean(const Prim& shader, const std::string& name, bool fallback) const {
  return input(shader, name).value.as_bool().value_or(fallback);
}

Vec3f MaterialTranslator::color(const Prim& shader, const std::string& name,
                                const Vec3f& fallback) const {
  const auto color = to_color(input(shader, name).value);
  return color && color->allFinite() ? *color : fallback;
}

// --- UsdPreviewSurface ------------------------------------------------------------------------

void MaterialTranslator::read_layout(const Prim& texture, TextureInput& input,
                                     TranslatedMaterial& result) {
  Eigen::Matrix3f map = Eigen::Matrix3f::Identity();
  const Prim* at = &texture;
  std::string name = "inputs:st";
  for (int i = 0; i < kMaxConnections; ++i) {
    const Source source = follow(*at, name);
    if (!source.prim || source.output.empty()) break;
    const std::string id = usd::token_or(stage_, *source.prim, "info:id", "");
    if (id == "UsdTransform2d") {
      const auto pair = [&](const char* input_name, const Vec2f& fallback) {
        std::array<double, 2> value{};
        return this->input(*source.prim, input_name).value.read(value)
                   ? Vec2f(static_cast<float>(value[0]), static_cast<float>(value[1]))
                   : fallback;
      };
      Eigen::Matrix3f step = Eigen::Matrix3f::Identity();
      step.topRows<2>() =
          uv_map(pair("scale", Vec2f::Ones()), number(*source.prim, "rotation", 0.0f),
                 pair("translation", Vec2f::Zero()));
      map = map * step;
      at = source.prim;
      name = "inputs:in";
      continue;
    }
    if (id.starts_with("UsdPrimvarReader")) {
      const usd::FoundValue varname = this->input(*source.prim, "varname");
      if (varname.value.as_text()) result.uv_names.push_back(*varname.value.as_text());
    }
    break;
  }
  input.uv_from_mesh_uv = map.topRows<2>();
}

// `is_data`: numbers, not colours, so that "auto" does not mean a colour space.
TextureInput MaterialTranslator::texture(const Prim& shader, const std::string& name, bool is_data,
                                         TranslatedMaterial& result) {
  TextureInput input;
  const Source source = follow(shader, std::string(kInputs) + name);
  if (!source.prim || source.output.empty()) return input;
  const Prim& node = *source.prim;
  if (usd::token_or(stage_, node, "info:id", "") != "UsdUVTexture") return input;
  const usd::FoundValue file = this->input(node, "file");
  const usd::FoundValue word = this->input(node, "sourceColorSpace");
  const std::string space_name = word.value.as_text() ? *word.value.as_text() : "auto";
  const TextureSpace space = space_name == "sRGB"             ? TextureSpace::Srgb
                             : space_name == "raw" || is_data ? TextureSpace::Raw
                                                              : TextureSpace::Auto;
  input.texture = textures_.read(file, space);
  if (!input.texture) return input;
  const auto wrap = [&](const char* name_of_wrap) {
    const usd::FoundValue value = this->input(node, name_of_wrap);
    return to_wrap(value.value.as_text() ? *value.value.as_text() : "");
  };
  input.wrap_u = wrap("wrapS");
  input.wrap_v = wrap("wrapT");
  const auto read4 = [&](const char* name_of_list, std::array<float, 4>& list) {
    std::array<double, 4> value{};
    if (!this->input(node, name_of_list).value.read(value)) return false;
    for (std::size_t i = 0; i < 4; ++i) list[i] = static_cast<float>(value[i]);
    return true;
  };
  const bool has_scale = read4("scale", input.scale);
  const bool has_bias = read4("bias", input.bias);
  if (name == "normal" && !has_scale && !has_bias && input.texture->floats.empty()) {
    // Eight bits hold 0..1; files often forget to say that this stands for -1..1.
    input.scale = {2, 2, 2, 1};
    input.bias = {-1, -1, -1, 0};
  }
  input.channel = std::min(to_channel(source.output), std::max(input.texture->channels - 1, 0));
  read_layout(node, input, result);
  return input;
}

void MaterialTranslator::translate_preview_surface(const Prim& shader, Material& material,
                                                   TranslatedMaterial& result) {
  const bool is_specular = number(shader, "useSpecularWorkflow", 0.0f) != 0.0f;
  material.base_color_texture = texture(shader, "diffuseColor", false, result);
  material.base_color = material.base_color_texture
                            ? Vec3f::Ones()
                            : color(shader, "diffuseColor", Vec3f::Constant(0.18f));
  material.roughness_texture = texture(shader, "roughness", true, result);
  material.roughness = number(shader, "roughness", 0.5f);
  if (!is_specular) {
    material.metallic_texture = texture(shader, "metallic", true, result);
    material.metallic = number(shader, "metallic", 0.0f);
  }
  material.normal_texture = texture(shader, "normal", true, result);
  material.ior = number(shader, "ior", 1.5f);
  material.clearcoat = number(shader, "clearcoat", 0.0f);
  material.clearcoat_roughness = number(shader, "clearcoatRoughness", 0.01f);
  material.opacity_texture = texture(shader, "opacity", true, result);
  material.opacity = number(shader, "opacity", 1.0f);
  material.opacity_threshold = number(shader, "opacityThreshold", 0.0f);
  material.emission_texture = texture(shader, "emissiveColor", false, result);
  material.emission =
      material.emission_texture ? Vec3f::Ones() : color(shader, "emissiveColor", Vec3f::Zero());
  if (is_specular) {
    // Dielectrics reflect (ior - 1)^2 / (ior + 1)^2; 0.04 of it is a specular weight of one.
    const float strength = color(shader, "specularColor", Vec3f::Zero()).mean() / 0.04f;
    material.specular = std::clamp(strength, 0.0f, 1.0f);
  }
  // An even opacity below one is glass: it still reflects, and what passes goes straight on.
  const bool is_glass =
      !material.opacity_texture && material.opacity < 1.0f && material.opacity_threshold <= 0.0f;
  if (is_glass) {
    material.transmission = 1.0f - std::max(material.opacity, 0.0f);
    material.opacity = 1.0f;
    material.is_thin_walled = true;
    if (material.transmission > 0.99f) material.base_color = Vec3f::Ones();
  }
}

// --- MDL by names -----------------------------------------------------------------------------

std::string MaterialTranslator::mdl_name(const Prim& shader) const {
  const usd::Value asset = stage_.value(shader, "info:mdl:sourceAsset");
  return asset.as_text() ? *asset.as_text() : usd::token_or(stage_, shader, "info:id", "");
}

TextureInput MaterialTranslator::mdl_texture(const Prim& shader,
                                             std::initializer_list<const char*> names,
                                             TextureSpace space) {
  TextureInput result;
  const usd::Strings properties = stage_.property_names(shader);
  for (const char* wanted : names) {
    for (const std::string& property : properties) {
      if (!property.starts_with(kInputs)) continue;
      const std::string name = property.substr(kInputs.size());
      const bool fits =
          name == wanted || (wanted[0] == '*' && lower(name).find(wanted + 1) != std::string::npos);
      if (!fits) continue;
      const usd::FoundValue value = input(shader, name);
      if (value.value.type() != usd::Type::AssetPath || value.value.is_array()) continue;
      result.texture = textures_.read(value, space);
      if (result.texture) return result;
    }
  }
  return result;
}

void MaterialTranslator::translate_mdl(const Prim& shader, Material& material) {
  const std::string module = mdl_name(shader);
  if (noticed_modules_.insert(module).second) {
    host_.log(LogLevel::Info, stage_.root_layer().identifier() + ": shader " + module +
                                  " is taken by the names of its common inputs");
  }
  const std::string kind = lower(module);
  const bool is_glass = kind.find("glass") != std::string::npos;
  material.base_color_texture = mdl_texture(
      shader,
      {"diffuse_texture", "BaseColor_Tex", "*basecolor", "*base_color", "*albedo", "*diffuse"},
      TextureSpace::Auto);
  const Vec3f tint =
      color(shader, "diffuse_tint", Vec3f::Ones()) * number(shader, "albedo_brightness", 1.0f);
  material.base_color =
      material.base_color_texture
          ? tint
          : Vec3f(color(shader, "diffuse_color_constant",
                        kind.find("omnipbr") != std::string::npos ? Vec3f::Constant(0.2f)
                                                                  : Vec3f::Constant(0.5f))
                      .cwiseProduct(tint));
  material.roughness = number(shader, "reflection_roughness_constant", 0.5f);
  material.metallic = number(shader, "metallic_constant", 0.0f);
  if (number(shader, "reflection_roughness_texture_influence", 0.0f) > 0.0f) {
    material.roughness_texture =
        mdl_texture(shader, {"reflectionroughness_texture"}, TextureSpace::Raw);
  }
  if (number(shader, "metallic_texture_influence", 0.0f) > 0.0f) {
    material.metallic_texture = mdl_texture(shader, {"metallic_texture"}, TextureSpace::Raw);
  }
  if (boolean(shader, "enable_ORM_texture", false)) {
    material.roughness_texture = mdl_texture(shader, {"ORM_texture"}, TextureSpace::Raw);
    material.metallic_texture = material.roughness_texture;
    material.roughness_texture.channel = 1;
    material.metallic_texture.channel = 2;
  }
  material.normal_texture =
      mdl_texture(shader, {"normalmap_texture", "Normal_Tex", "*normal"}, TextureSpace::Raw);
  material.normal_texture.scale = {2, 2, 2, 1};
  material.normal_texture.bias = {-1, -1, -1, 0};
  if (boolean(shader, "enable_opacity", false)) {
    material.opacity_texture = mdl_texture(shader, {"opacity_texture"}, TextureSpace::Raw);
    material.opacity = number(shader, "opacity_constant", 1.0f);
    material.opacity_threshold = number(shader, "opacity_threshold", 0.0f);
  }
  if (boolean(shader, "enable_emission", false)) {
    material.emission = color(shader, "emissive_color", Vec3f::Ones()) *
                        number(shader, "emissive_intensity", 40.0f);
    material.emission_texture = mdl_texture(shader, {"emissive_mask_texture"}, TextureSpace::Auto);
  }
  if (is_glass) {
    material.transmission = 1.0f;
    material.base_color = color(shader, "glass_color", Vec3f::Ones());
    material.ior = number(shader, "glass_ior", 1.491f);
    material.roughness = number(shader, "frosting_roughness", 0.0f);
    material.is_thin_walled = boolean(shader, "thin_walled", false);
  }
  const auto pair = [&](const char* name, const Vec2f& fallback) {
    std::array<double, 2> value{};
    return input(shader, name).value.read(value)
               ? Vec2f(static_cast<float>(value[0]), static_cast<float>(value[1]))
               : fallback;
  };
  const auto map =
      uv_map(pair("texture_scale", Vec2f::Ones()), number(shader, "texture_rotate", 0.0f),
             pair("texture_translate", Vec2f::Zero()));
  for (TextureInput* each :
       {&material.base_color_texture, &material.roughness_texture, &material.metallic_texture,
        &material.normal_texture, &material.opacity_texture, &material.emission_texture}) {
    each->uv_from_mesh_uv = map;
  }
}

}  // namespace diorama::loader_usd
