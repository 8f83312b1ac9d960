// SPDX-License-Identifier: Apache-2.0
#include "loader_assimp/material_translator.h"

#include <assimp/GltfMaterial.h>
#include <assimp/material.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "diorama/math.h"

namespace diorama::loader_assimp {
namespace {

constexpr aiTextureType kReadTypes[] = {
    aiTextureType_BASE_COLOR,        aiTextureType_DIFFUSE,  aiTextureType_METALNESS,
    aiTextureType_DIFFUSE_ROUGHNESS, aiTextureType_NORMALS,  aiTextureType_HEIGHT,
    aiTextureType_EMISSION_COLOR,    aiTextureType_EMISSIVE, aiTextureType_OPACITY};

struct TextureSlot {
  aiTextureType type = aiTextureType_NONE;
  std::string name;
};

// The first of the types that has a texture.
std::optional<TextureSlot> find_texture(const aiMaterial& material,
                                        std::initializer_list<aiTextureType> types) {
  for (const aiTextureType type : types) {
    aiString name;
    if (material.Get(AI_MATKEY_TEXTURE(type, 0), name) == AI_SUCCESS && name.length > 0) {
      return TextureSlot{type, name.C_Str()};
    }
  }
  return std::nullopt;
}

std::optional<float> number(const aiMaterial& material, const char* key, unsigned type = 0,
                            unsigned index = 0) {
  ai_real value = 0;
  if (material.Get(key, type, index, value) != AI_SUCCESS || !std::isfinite(value)) {
    return std::nullopt;
  }
  return static_cast<float>(value);
}

std::optional<Vec3f> color(const aiMaterial& material, const char* key, unsigned type,
                           unsigned index) {
  aiColor4D value;
  if (material.Get(key, type, index, value) != AI_SUCCESS) return std::nullopt;
  const Vec3f rgb(value.r, value.g, value.b);
  if (!rgb.allFinite()) return std::nullopt;
  return Vec3f(rgb.cwiseMax(0.0f));
}

std::string text(const aiMaterial& material, const char* key, unsigned type, unsigned index) {
  aiString value;
  return material.Get(key, type, index, value) == AI_SUCCESS ? value.C_Str() : "";
}

Wrap wrap(const aiMaterial& material, const char* key, aiTextureType type) {
  int mode = aiTextureMapMode_Wrap;
  material.Get(key, type, 0, mode);
  if (mode == aiTextureMapMode_Clamp) return Wrap::Clamp;
  if (mode == aiTextureMapMode_Mirror) return Wrap::Mirror;
  if (mode == aiTextureMapMode_Decal) return Wrap::Black;
  return Wrap::Repeat;
}

// Scales, turns (counter-clockwise, about the origin) and moves.
Eigen::Matrix3f uv_matrix(const Vec2f& scale, float angle, const Vec2f& offset) {
  Eigen::Matrix3f map;
  map << scale.x() * std::cos(angle), -scale.y() * std::sin(angle), offset.x(),
      scale.x() * std::sin(angle), scale.y() * std::cos(angle), offset.y(), 0.0f, 0.0f, 1.0f;
  return map;
}

// assimp turns glTF's transforms, which are about the upper left corner, into its own about the
// middle, in a way that holds for glTF's offset only; here they are turned back.
Eigen::Matrix3f gltf_uv_matrix(const aiUVTransform& stated) {
  const float angle = -stated.mRotation;
  const float c = std::cos(angle);
  const float s = std::sin(angle);
  const Vec2f scale(stated.mScaling.x, stated.mScaling.y);
  const Vec2f offset(stated.mTranslation.x - 0.5f * scale.x() * (-c + s + 1.0f),
                     0.5f * scale.y() * (s + c - 1.0f) + 1.0f - scale.y() - stated.mTranslation.y);
  Eigen::Matrix3f flip;
  flip << 1.0f, 0.0f, 0.0f, 0.0f, -1.0f, 1.0f, 0.0f, 0.0f, 1.0f;
  // In glTF v points down, so that counter-clockwise is the other way round.
  return flip * uv_matrix(scale, -angle, offset) * flip;
}

Eigen::Matrix<float, 2, 3> uv_map(const aiMaterial& material, aiTextureType type, bool is_gltf) {
  aiUVTransform stated;
  if (material.Get(AI_MATKEY_UVTRANSFORM(type, 0), stated) != AI_SUCCESS) {
    return Eigen::Matrix<float, 2, 3>::Identity();
  }
  Eigen::Matrix3f map = Eigen::Matrix3f::Identity();
  if (is_gltf) {
    map = gltf_uv_matrix(stated);
  } else {
    const Vec2f middle = Vec2f::Constant(0.5f);
    const Vec2f offset(stated.mTranslation.x, stated.mTranslation.y);
    map = uv_matrix(Vec2f::Ones(), 0.0f, middle + offset) *
          uv_matrix(Vec2f::Ones(), stated.mRotation, Vec2f::Zero()) *
          uv_matrix({stated.mScaling.x, stated.mScaling.y}, 0.0f, -middle);
  }
  if (!map.allFinite()) map.setIdentity();
  return map.topRows<2>();
}

// Of a texture that is one number per pixel: alpha where there is one.
int opacity_channel(const Texture& texture) {
  return texture.channels == 4 || texture.channels == 2 ? texture.channels - 1 : 0;
}

// MTL's map_bump holds heights or, more often, normals: those are bluish all over.
bool looks_like_normals(const Texture& texture) {
  if (texture.channels < 3 || texture.bytes.empty()) return false;
  const auto width = static_cast<std::size_t>(texture.channels);
  const std::size_t count = texture.bytes.size() / width;
  const std::size_t step = std::max<std::size_t>(count / 4096, 1);
  Vec3 sum = Vec3::Zero();
  double samples = 0.0;
  for (std::size_t i = 0; i < count; i += step, samples += 255.0) {
    const std::uint8_t* texel = texture.bytes.data() + i * width;
    sum += Vec3(texel[0], texel[1], texel[2]);
  }
  const Vec3 mean = sum / samples;
  return mean.z() > 0.7 && std::abs(mean.x() - 0.5) < 0.15 && std::abs(mean.y() - 0.5) < 0.15;
}

const aiMaterial* material_of(const SceneFile& file, unsigned index) {
  const aiScene& scene = file.scene();
  return index < scene.mNumMaterials ? scene.mMaterials[index] : nullptr;
}

}  // namespace

unsigned uv_set_of(const SceneFile& file, unsigned material) {
  const aiMaterial* source = material_of(file, material);
  if (!source) return 0;
  const auto slot =
      find_texture(*source, {aiTextureType_BASE_COLOR, aiTextureType_DIFFUSE, aiTextureType_NORMALS,
                             aiTextureType_DIFFUSE_ROUGHNESS, aiTextureType_EMISSIVE});
  int set = 0;
  if (slot) source->Get(AI_MATKEY_UVWSRC(slot->type, 0), set);
  return set >= 0 && set < AI_MAX_NUMBER_OF_TEXTURECOORDS ? static_cast<unsigned>(set) : 0;
}

bool is_two_sided(const SceneFile& file, unsigned material) {
  const aiMaterial* source = material_of(file, material);
  int value = 0;
  return source && source->Get(AI_MATKEY_TWOSIDED, value) == AI_SUCCESS && value != 0;
}

void MaterialTranslator::read_textures(const std::set<unsigned>& materials) {
  for (const unsigned index : materials) {
    const aiMaterial* source = material_of(file_, index);
    for (const aiTextureType type : kReadTypes) {
      const auto slot = source ? find_texture(*source, {type}) : std::nullopt;
      if (slot) textures_.announce(slot->name);
    }
  }
  textures_.decode_announced();
}

std::shared_ptr<const Material> MaterialTranslator::translate(unsigned index) {
  auto [entry, is_new] = materials_.try_emplace(index);
  const aiMaterial* source = material_of(file_, index);
  if (!is_new || !source) return entry->second;
  Material material;
  material.name = source->GetName().C_Str();
  translate_base_color(*source, material);
  translate_metal(*source, material);
  translate_specular(*source, material);
  translate_normals(*source, material);
  translate_emission(*source, material);
  translate_opacity(*source, material);
  translate_glass(*source, material);
  return entry->second = std::make_shared<const Material>(std::move(material));
}

TextureInput MaterialTranslator::texture(const aiMaterial& source,
                                         std::initializer_list<aiTextureType> types,
                                         ColorSpace space) {
  TextureInput input;
  const auto slot = find_texture(source, types);
  if (!slot) return input;
  input.texture = textures_.read(slot->name, space, source.GetName().C_Str());
  input.wrap_u = wrap(source, _AI_MATKEY_MAPPINGMODE_U_BASE, slot->type);
  input.wrap_v = wrap(source, _AI_MATKEY_MAPPINGMODE_V_BASE, slot->type);
  input.uv_from_mesh_uv = uv_map(source, slot->type, is_gltf());
  return input;
}

void MaterialTranslator::translate_base_color(const aiMaterial& source, Material& material) {
  material.base_color_texture =
      texture(source, {aiTextureType_BASE_COLOR, aiTextureType_DIFFUSE}, ColorSpace::Srgb);
  const auto base = color(source, AI_MATKEY_BASE_COLOR);
  const auto diffuse = color(source, AI_MATKEY_COLOR_DIFFUSE);
  material.base_color = base.value_or(diffuse.value_or(Vec3f::Constant(0.8f)));
  // glTF multiplies the two; elsewhere a texture stands in for the colour, which often is left
  // over.
  if (material.base_color_texture && !is_gltf()) material.base_color = Vec3f::Ones();
}

void MaterialTranslator::translate_metal(const aiMaterial& source, Material& material) {
  material.metallic = number(source, AI_MATKEY_METALLIC_FACTOR).value_or(0.0f);
  material.metallic_texture = texture(source, {aiTextureType_METALNESS}, ColorSpace::Linear);
  material.roughness_texture =
      texture(source, {aiTextureType_DIFFUSE_ROUGHNESS}, ColorSpace::Linear);
  if (const auto roughness = number(source, AI_MATKEY_ROUGHNESS_FACTOR)) {
    material.roughness = std::clamp(*roughness, 0.0f, 1.0f);
  } else if (const auto glossiness = number(source, AI_MATKEY_GLOSSINESS_FACTOR)) {
    material.roughness = std::clamp(1.0f - *glossiness, 0.0f, 1.0f);
  } else if (const auto exponent = number(source, AI_MATKEY_SHININESS); exponent && *exponent > 0) {
    // Blinn and Phong's lobe of this exponent is as wide as one of this roughness.
    material.roughness = std::pow(2.0f / (*exponent + 2.0f), 0.25f);
  }
  if (is_gltf()) {
    material.roughness_texture.channel = 1;
    material.metallic_texture.channel = 2;
    material.roughness_texture.scale.fill(material.roughness);
    material.metallic_texture.scale.fill(material.metallic);
  }
}

void MaterialTranslator::translate_specular(const aiMaterial& source, Material& material) const {
  const auto ior = number(source, AI_MATKEY_REFRACTI);
  if (ior && *ior > 1.0f) material.ior = *ior;
  material.clearcoat = number(source, AI_MATKEY_CLEARCOAT_FACTOR).value_or(0.0f);
  material.clearcoat_roughness =
      number(source, AI_MATKEY_CLEARCOAT_ROUGHNESS_FACTOR).value_or(material.clearcoat_roughness);
  if (is_gltf()) {
    material.specular = number(source, AI_MATKEY_SPECULAR_FACTOR).value_or(1.0f);
  } else if (const auto specular = color(source, AI_MATKEY_COLOR_SPECULAR)) {
    // Half grey is what modelling programs write for an ordinary dielectric.
    const float strength = number(source, AI_MATKEY_SHININESS_STRENGTH).value_or(1.0f);
    material.specular = std::clamp(2.0f * strength * specular->mean(), 0.0f, 1.0f);
  }
}

void MaterialTranslator::translate_normals(const aiMaterial& source, Material& material) {
  TextureInput& input = material.normal_texture;
  input = texture(source, {aiTextureType_NORMALS}, ColorSpace::Linear);
  if (!input) {
    input = texture(source, {aiTextureType_HEIGHT}, ColorSpace::Linear);
    if (input && !looks_like_normals(*input.texture)) input = {};
  }
  const float strength =
      number(source, AI_MATKEY_GLTF_TEXTURE_SCALE(aiTextureType_NORMALS, 0)).value_or(1.0f);
  input.scale = {2.0f * strength, 2.0f * strength, 2.0f, 1.0f};
  input.bias = {-strength, -strength, -1.0f, 0.0f};
}

void MaterialTranslator::translate_emission(const aiMaterial& source, Material& material) {
  material.emission_texture =
      texture(source, {aiTextureType_EMISSION_COLOR, aiTextureType_EMISSIVE}, ColorSpace::Srgb);
  material.emission = color(source, AI_MATKEY_COLOR_EMISSIVE).value_or(Vec3f::Zero());
  if (material.emission_texture && !is_gltf()) material.emission = Vec3f::Ones();
  material.emission *= number(source, AI_MATKEY_EMISSIVE_INTENSITY).value_or(1.0f);
}

void MaterialTranslator::translate_opacity(const aiMaterial& source, Material& material) {
  const float opacity = std::clamp(number(source, AI_MATKEY_OPACITY).value_or(1.0f), 0.0f, 1.0f);
  if (is_gltf()) {
    const std::string mode = text(source, AI_MATKEY_GLTF_ALPHAMODE);
    if (mode != "MASK" && mode != "BLEND") return;
    material.opacity = opacity;
    if (const auto& base = material.base_color_texture; base && base.texture->channels == 4) {
      material.opacity_texture = base;
      material.opacity_texture.channel = 3;
      material.opacity_texture.scale[3] = opacity;
    }
    if (mode == "MASK") {
      material.opacity_threshold = number(source, AI_MATKEY_GLTF_ALPHACUTOFF).value_or(0.5f);
    }
    return;
  }
  // What nobody could see was not meant: some exporters write how transparent things are instead.
  material.opacity = opacity > 0.0f ? opacity : 1.0f;
  material.opacity_texture = texture(source, {aiTextureType_OPACITY}, ColorSpace::Linear);
  if (material.opacity_texture) {
    material.opacity_texture.channel = opacity_channel(*material.opacity_texture.texture);
  }
}

// Glass says so in glTF. Elsewhere an even opacity below one is glass: it still reflects, and what
// passes goes straight on.
void MaterialTranslator::translate_glass(const aiMaterial& source, Material& material) const {
  if (is_gltf()) {
    material.transmission = number(source, AI_MATKEY_TRANSMISSION_FACTOR).value_or(0.0f);
    const float thickness = number(source, AI_MATKEY_VOLUME_THICKNESS_FACTOR).value_or(0.0f);
    material.is_thin_walled = material.transmission > 0.0f && !(thickness > 0.0f);
  } else if (material.opacity < 1.0f && !material.opacity_texture) {
    material.transmission = 1.0f - material.opacity;
    material.opacity = 1.0f;
    material.is_thin_walled = true;
  }
}

}  // namespace diorama::loader_assimp
