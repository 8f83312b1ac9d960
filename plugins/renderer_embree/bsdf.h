// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "diorama/math.h"
#include "sampling.h"

namespace diorama {

/// How much light a rough conductor or dielectric interface returns under uniform light, tabulated
/// once. `cos` and alpha in (0, 1]. Schlick's F splits the albedo: E = f0 a + f90 b.
class AlbedoTables {
 public:
  AlbedoTables();

  struct Split {
    float a = 0.0f;
    float b = 0.0f;
    float total() const { return a + b; }  ///< Albedo under F = 1.
  };
  Split at(float cos_theta, float alpha) const;
  /// Cosine-weighted mean over the hemisphere.
  Split mean(float alpha) const;

 private:
  static constexpr int kSize = 32;
  std::vector<Split> directional_;  ///< [alpha][cos]
  std::vector<Split> mean_;
};

/// The single-scatter albedo of one rough interface between two dielectrics, reflection and
/// transmission together, for light from in front (0) and from behind (1).
class GlassTables {
 public:
  explicit GlassTables(float eta);

  float eta() const { return eta_; }
  float at(int side, float cos_theta, float alpha) const;
  float mean(int side, float alpha) const;

 private:
  static constexpr int kSize = 16;
  float eta_;
  std::vector<float> directional_;  ///< [side][alpha][cos]
  std::vector<float> mean_;
};

/// A principled surface at one point. Local space: z along the shading normal, on the side of wo.
/// Reciprocal; loses no energy by scattering between microfacets (Kulla and Conty 2017).
struct SurfaceBsdf {
  Vec3f base = Vec3f::Zero();  ///< Base colour.
  float metallic = 0.0f;
  float transmission = 0.0f;
  float alpha = 0.25f;
  float f0 = 0.04f;       ///< Of the dielectric specular lobe.
  float specular = 1.0f;  ///< Its weight.
  float coat = 0.0f;
  float coat_alpha = 1e-4f;
  const GlassTables* glass = nullptr;  ///< Needed where transmission > 0.
  bool is_inside = false;              ///< wo lies behind the surface: glass is left, not entered.
};

struct BsdfValue {
  Vec3f f_cos = Vec3f::Zero();  ///< BSDF times |cos| of wi.
  float density = 0.0f;         ///< Of wi under sample(), per solid angle.
};

struct BsdfSample {
  Vec3f wi = Vec3f::Zero();
  Vec3f weight = Vec3f::Zero();  ///< f |cos| / density. Zero: the path ends.
  float density = 0.0f;          ///< Infinite for mirror-like directions.
  float spread = 0.0f;           ///< Rough half width of the lobe, radians, for footprints.
  bool is_transmitted = false;   ///< wi.z < 0.
};

/// Evaluates and samples a SurfaceBsdf for one wo. Cheap to make; keeps references.
class Bsdf {
 public:
  /// wo.z > 0.
  Bsdf(const SurfaceBsdf& surface, const AlbedoTables& tables, const Vec3f& wo);

  /// False when all that scatters is mirror-like, so that light samples are pointless.
  bool has_smooth_part() const { return has_smooth_part_; }
  /// Share of uniform light returned to wo: guides the denoiser.
  Vec3f albedo() const;
  /// Whether light through the back of the surface can matter here.
  bool transmits() const { return p_glass_ > 0.0f; }

  BsdfValue evaluate(const Vec3f& wi) const;
  /// `lobe` in [0, 1) chooses, `u` places.
  BsdfSample sample(float lobe, const Vec2f& u) const;

  /// Below this alpha glass is smooth: a mirror and a window instead of lobes.
  static constexpr float kSmoothAlpha = 2e-3f;
  static constexpr float kMinAlpha = 1e-3f;

 private:
  float coat_albedo(float cos_theta) const;
  /// Albedo of the opaque dielectric's specular lobe, scattering between facets included.
  float plastic_albedo(const AlbedoTables::Split& e) const;
  float albedo_above_diffuse(float cos_theta, const AlbedoTables::Split& e) const;
  /// Of the specular lobe's alpha; without such a lobe nothing is lost.
  AlbedoTables::Split specular_split(float cos_theta) const;
  /// Share of the light that passes the coat on its way in and out.
  float past_coat(float cos_i) const;
  BsdfValue evaluate_glass(const Vec3f& wi) const;
  BsdfSample sample_smooth_glass(float choice) const;
  /// Zero when the microfacet sends the light into the surface again.
  Vec3f sample_rough_glass(float choice, const Vec2f& u) const;
  Vec3f sample_microfacet(float alpha, const Vec2f& u) const;
  void choose_probabilities();

  const SurfaceBsdf& s_;
  const AlbedoTables& tables_;
  Vec3f wo_;
  float plastic_ = 0.0f;  ///< Weights of the opaque dielectric and of glass; the rest is metal.
  float glass_ = 0.0f;
  Vec3f specular_f0_ = Vec3f::Zero();  ///< Of metal and opaque dielectric together.
  float specular_f90_ = 0.0f;
  float plastic_multiple_ = 0.0f;
  Vec3f multiple_ = Vec3f::Zero();  ///< Colour of the light scattered between facets.
  AlbedoTables::Split split_o_;
  float single_o_ = 1.0f;  ///< E(wo) under F = 1.
  float single_mean_ = 1.0f;
  float coat_o_ = 0.0f;
  float coat_mean_ = 0.0f;
  float above_o_ = 0.0f;  ///< What coat and specular lobe return before the diffuse base.
  float above_mean_ = 0.0f;
  float p_coat_ = 0.0f;  ///< Choice probabilities of the lobes.
  float p_specular_ = 0.0f;
  float p_diffuse_ = 0.0f;
  float p_glass_ = 0.0f;
  bool has_specular_ = false;
  bool is_smooth_glass_ = false;
  bool has_smooth_part_ = true;
};

}  // namespace diorama
