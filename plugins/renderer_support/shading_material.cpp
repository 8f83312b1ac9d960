// SPDX-License-Identifier: Apache-2.0
#include "shading_material.h"

#include <set>

namespace diorama {
namespace {

// Of roughnesses that are kept for the next materials; jobs may draw new ones for every capture.
constexpr std::size_t kMostAlbedoRows = 1024;

std::array<const TextureInput*, 6> texture_inputs(const Material& m) {
  return {&m.base_color_texture, &m.metallic_texture, &m.roughness_texture,
          &m.normal_texture,     &m.opacity_texture,  &m.emission_texture};
}

/// What a cache entry holds, made when it is gone.
template <class T, class Make>
std::shared_ptr<const T> shared(std::weak_ptr<const T>& entry, Make&& make) {
  std::shared_ptr<const T> value = entry.lock();
  if (!value) entry = value = make();
  return value;
}

}  // namespace

void MaterialLibrary::keep(const std::vector<std::shared_ptr<const Material>>& used) {
  std::set<const Material*> wanted;
  for (const auto& material : used) wanted.insert(material.get());
  std::erase_if(materials_, [&](const auto& entry) { return !wanted.contains(entry.first); });
  std::erase_if(textures_, [](const auto& entry) { return entry.second.owner.expired(); });
  std::erase_if(layer_tables_, [](const auto& entry) { return entry.second.expired(); });
  std::erase_if(glass_tables_, [](const auto& entry) { return entry.second.expired(); });
  albedo_tables_.forget_beyond(kMostAlbedoRows);
  load_textures(used);
  for (const auto& material : used) {
    auto& made = materials_[material.get()];
    if (!made) made = make(material);
  }
}

void MaterialLibrary::load_textures(const std::vector<std::shared_ptr<const Material>>& used) {
  std::vector<std::shared_ptr<const Texture>> missing;
  std::set<const Texture*> seen;
  for (const auto& material : used) {
    for (const TextureInput* input : texture_inputs(*material)) {
      if (!*input || !seen.insert(input->texture.get()).second) continue;
      const auto it = textures_.find(input->texture.get());
      if (it == textures_.end()) missing.push_back(input->texture);
    }
  }
  std::vector<std::shared_ptr<const MipTexture>> made(missing.size());
  host_.parallel_for(missing.size(), [&](std::size_t i) {
    made[i] = std::make_shared<const MipTexture>(*missing[i]);
  });
  for (std::size_t i = 0; i < missing.size(); ++i) {
    textures_[missing[i].get()] = {missing[i], made[i]};
  }
}

TextureSlot MaterialLibrary::slot(const TextureInput& input) const {
  if (!input) return {};
  return {&input, textures_.at(input.texture.get()).mips.get()};
}

SurfaceBsdf MaterialLibrary::make_surface(ShadingMaterial& material, bool is_soft) {
  const Material& m = *material.source;
  const bool is_solid_glass = m.transmission > 0.0f && !m.is_thin_walled;
  // Soft glass would blur what is seen through it.
  const bool softens_base = is_soft && !is_solid_glass;
  const float ratio = (m.ior - 1.0f) / (m.ior + 1.0f);
  SurfaceBsdf s;
  s.base = m.base_color.cwiseMax(0.0f).cwiseMin(1.0f);
  s.metallic = std::clamp(m.metallic, 0.0f, 1.0f);
  s.transmission = std::clamp(m.transmission, 0.0f, 1.0f);
  s.alpha = ShadingMaterial::alpha_of(m.roughness, softens_base);
  s.layers = {ratio * ratio, std::clamp(m.specular, 0.0f, 1.0f),
              std::clamp(m.clearcoat, 0.0f, 1.0f),
              ShadingMaterial::alpha_of(m.clearcoat_roughness, is_soft)};
  s.stacks_lobes = stacks_lobes_;
  if (s.layers.coat <= 0.0f) s.layers.coat_alpha = kMinAlpha;  // fewer different tables
  const bool is_constant = !m.roughness_texture;
  const auto alpha = is_constant ? std::optional<float>(s.alpha) : std::nullopt;
  const float alpha_key = alpha.value_or(-1.0f);
  // Plain Lambert surfaces need no tables.
  const bool is_metallic = m.metallic_texture || s.metallic > 0.0f;
  if (!is_metallic && !is_solid_glass && s.is_lambert()) return s;
  const auto layers = shared(layer_tables_[{s.layers, alpha_key}], [&] {
    return std::make_shared<const LayerTable>(albedo_tables_, s.layers, alpha);
  });
  material.tables.push_back(layers);
  s.table = layers.get();
  if (is_solid_glass) {
    const float eta = std::max(1.0001f, m.ior);
    const auto glass = shared(glass_tables_[{eta, alpha_key}],
                              [&] { return std::make_shared<const GlassTable>(eta, alpha); });
    material.tables.push_back(glass);
    s.glass = glass.get();
  }
  return s;
}

std::unique_ptr<ShadingMaterial> MaterialLibrary::make(std::shared_ptr<const Material> source) {
  auto material = std::make_unique<ShadingMaterial>();
  material->source = std::move(source);
  const Material& m = *material->source;
  material->sharp = make_surface(*material, false);
  material->soft = make_surface(*material, true);
  material->sharp.finish();
  material->soft.finish();
  material->base_color = slot(m.base_color_texture);
  material->metallic = slot(m.metallic_texture);
  material->roughness = slot(m.roughness_texture);
  material->normal = slot(m.normal_texture);
  material->opacity = slot(m.opacity_texture);
  material->emission = slot(m.emission_texture);
  material->is_textured =
      material->base_color || material->metallic || material->roughness || material->normal;
  material->reads_uv = material->is_textured || material->opacity || material->emission;
  material->is_cut_out = material->opacity || m.opacity < 1.0f;
  material->is_blended = material->is_cut_out && m.opacity_threshold <= 0.0f;
  material->is_thin_glass = m.is_thin_walled && m.transmission > 0.0f;
  material->dims_shadows = material->is_cut_out || m.transmission > 0.0f;
  material->emits = m.emission.maxCoeff() > 0.0f;
  material->has_constant_lobes = !material->metallic && !material->roughness && !material->emits &&
                                 !material->is_blended && !material->is_thin_glass;
  material->is_special = material->is_textured || material->is_blended || material->is_thin_glass ||
                         material->emits || material->sharp.glass;
  return material;
}

}  // namespace diorama
