// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <tuple>
#include <vector>

#include "bsdf.h"
#include "diorama/host.h"
#include "mip_texture.h"

namespace diorama {

/// A material with its textures found and its tables made. Textured scalars replace constants.
struct ShadingMaterial {
  std::shared_ptr<const Material> source;
  /// With the constants of all inputs. The soft one's lobes are at least a little rough: for
  /// surfaces seen over a diffuse one, without caustics.
  SurfaceBsdf sharp;
  SurfaceBsdf soft;
  std::vector<std::shared_ptr<const void>> tables;  ///< That the two above point to.
  TextureSlot base_color;
  TextureSlot metallic;
  TextureSlot roughness;
  TextureSlot normal;
  TextureSlot opacity;
  TextureSlot emission;
  bool is_thin_glass = false;  ///< Thin-walled glass.
  bool is_blended = false;     ///< Lets a share of the rays pass straight.
  bool reads_uv = false;       ///< In any input.
  bool is_textured = false;    ///< In one of the inputs that scattering reads.
  bool is_cut_out = false;     ///< Rays may pass where the opacity says so.
  bool dims_shadows = false;   ///< Shadow rays may pass, weakened.
  bool emits = false;
  /// Textures change only its colours and normals; no light comes from it or passes it straight.
  bool has_constant_lobes = false;
  bool is_special = false;  ///< Any of the above but cut-outs, or solid glass.

  /// For roughness read from a texture.
  static float alpha_of(float roughness, bool is_soft);

  float opacity_at(const Vec2f& uv, float footprint) const {
    return opacity ? opacity.scalar(uv, footprint) : source->opacity;
  }
  Vec3f emission_at(const Vec2f& uv, float footprint) const {
    if (!emission) return source->emission;
    const Vec3f texel = emission.at(uv, footprint).head<3>().matrix().cwiseMax(0.0f);
    return source->emission.cwiseProduct(texel);
  }
};

/// The shading materials of a scene with their textures and tables, kept between captures.
class MaterialLibrary {
 public:
  /// `stacks_lobes`: see SurfaceBsdf.
  MaterialLibrary(Host& host, bool stacks_lobes) : host_(host), stacks_lobes_(stacks_lobes) {}

  /// Makes what is missing for these materials and forgets what belongs to no other. Pointers from
  /// at() stay valid for materials that are in both the last call and this one.
  void keep(const std::vector<std::shared_ptr<const Material>>& used);
  const ShadingMaterial* at(const std::shared_ptr<const Material>& material) const {
    return materials_.at(material.get()).get();
  }
  std::size_t material_count() const { return materials_.size(); }
  std::size_t texture_count() const { return textures_.size(); }
  std::size_t albedo_row_count() const { return albedo_tables_.row_count(); }

 private:
  using LayerKey = std::tuple<LayerTable::Layers, float>;  ///< Alpha below 0: for all.
  using GlassKey = std::tuple<float, float>;               ///< eta, alpha as above.
  /// Kept while anybody else, a scene or a cache of assets, keeps the texture.
  struct CachedTexture {
    std::weak_ptr<const Texture> owner;
    std::shared_ptr<const MipTexture> mips;
  };

  void load_textures(const std::vector<std::shared_ptr<const Material>>& used);
  std::unique_ptr<ShadingMaterial> make(std::shared_ptr<const Material> source);
  SurfaceBsdf make_surface(ShadingMaterial& material, bool is_soft);
  TextureSlot slot(const TextureInput& input) const;

  Host& host_;
  bool stacks_lobes_;
  AlbedoTables albedo_tables_;
  std::map<LayerKey, std::weak_ptr<const LayerTable>> layer_tables_;
  std::map<GlassKey, std::weak_ptr<const GlassTable>> glass_tables_;
  std::map<const Texture*, CachedTexture> textures_;
  std::map<const Material*, std::unique_ptr<ShadingMaterial>> materials_;
};

inline float ShadingMaterial::alpha_of(float roughness, bool is_soft) {
  constexpr float kSoftAlpha = 0.15f;
  const float r = std::clamp(roughness, 0.0f, 1.0f);
  return std::max(is_soft ? kSoftAlpha : kMinAlpha, r * r);
}

}  // namespace diorama
