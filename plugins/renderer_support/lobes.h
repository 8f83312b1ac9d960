// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>

#include "albedo_tables.h"
#include "batch.h"
#include "microfacet.h"
#include "sampling.h"

namespace diorama {

struct BsdfValue {
  Vec3f f_cos = Vec3f::Zero();  ///< BSDF times |cos| of wi.
  float density = 0.0f;         ///< Of wi under sampling, per solid angle.
};

/// LayerTable::Node as numbers of their own, as loops over many need them. By default that of a
/// surface without facets and coat.
struct LayerAlbedo {
  float f0 = 0.0f;
  float f90 = 0.0f;
  float coat = 0.0f;
  float above = 0.0f;

  float missing() const { return std::max(0.0f, 1.0f - f0 - f90 - coat); }
};

/// What a surface's opaque lobes have in common for all directions.
struct LobeWeights {
  Vec3f diffuse = Vec3f::Zero();
  Vec3f f0 = Vec3f::Zero();        ///< Of metal and dielectric facets together ...
  float f90 = 0.0f;                ///< ... and at grazing angles.
  Vec3f multiple = Vec3f::Zero();  ///< Colour of the light scattered between facets.
  float alpha = 0.25f;
  float coat = 0.0f;
  float coat_alpha = kMinAlpha;
  float glass = 0.0f;         ///< Share of the samples that these lobes leave to glass.
  float mean_missing = 1.0f;  ///< See LayerTable::Means.
  float mean_above = 0.0f;
  // For stacked lobes.
  float dielectric_f0 = 0.04f;
  float burley = 0.0f;  ///< Share of the diffuse lobe that is Burley's; the rest is Lambert's.
};

/// The opaque lobes of a surface, seen from one direction: a clear coat, the facets of metal and
/// dielectric together, what they scatter between them, and diffuse. Local space. Without branches,
/// so that loops over many become vector code; made anew wherever it is needed.
class Lobes {
 public:
  /// wo.z > 0. `stacks`: see SurfaceBsdf::stacks_lobes.
  Lobes(const LobeWeights& weights, const LayerAlbedo& albedo_o, const Vec3f& wo, bool stacks);

  /// wi.z > 0; else the value means nothing.
  BsdfValue evaluate(const Vec3f& wi, const LayerAlbedo& albedo_i) const;

  struct Draw {
    Vec3f wi;  ///< May lie below the surface: a facet sent it there, and it is lost.
    float spread = 0.0f;
  };
  /// `lobe` in [0, 1 - p_glass()) chooses, `u` places; `by_cosine` is cosine_hemisphere(u).
  Draw sample(float lobe, const Vec2f& u, const Vec3f& by_cosine) const;

  float p_glass() const { return w_.glass * scale_; }
  /// Whether anything but glass scatters.
  bool is_lit() const { return p_coat_ + p_facets_ + p_diffuse_ > 1e-6f; }

 private:
  /// Share of the way from f0 to f90.
  float fresnel(float cos_h) const;
  /// Of the diffuse lobe.
  float through(const Vec3f& wi, float cos_h, const LayerAlbedo& albedo_i) const;

  LobeWeights w_;
  Vec3f wo_;
  bool stacks_;
  LayerAlbedo albedo_o_;
  float lambda_o_;
  float coat_lambda_o_;
  float scale_;  ///< From what lobes return to the probability of their choice.
  float p_coat_;
  float p_facets_;
  float p_diffuse_;
};

inline Lobes::Lobes(const LobeWeights& weights, const LayerAlbedo& albedo_o, const Vec3f& wo,
                    bool stacks)
    : w_(weights),
      wo_(wo),
      stacks_(stacks),
      albedo_o_(albedo_o),
      lambda_o_(ggx_lambda(wo.z(), weights.alpha)),
      coat_lambda_o_(ggx_lambda(wo.z(), weights.coat_alpha)) {
  const float coat = (1.0f - w_.glass) * albedo_o.coat;
  const float facets = luminance(w_.f0) * albedo_o.f0 + w_.f90 * albedo_o.f90;
  const float diffuse =
      luminance(w_.diffuse) * (1.0f - albedo_o.above) + luminance(w_.multiple) * albedo_o.missing();
  const float sum = coat + facets + diffuse + w_.glass;
  const bool is_black = !(sum > 0.0f);
  scale_ = 1.0f / (is_black ? 1.0f : sum);
  p_coat_ = coat * scale_;
  p_facets_ = facets * scale_;
  p_diffuse_ = is_black ? 1.0f : diffuse * scale_;
}

inline float Lobes::fresnel(float cos_h) const {
  if (!stacks_) return schlick_weight(cos_h);
  // The exact dielectric term, scaled to run from 0 to 1.
  const float f0 = w_.dielectric_f0;
  const float root = std::sqrt(f0);
  const float exact = fresnel_dielectric(std::max(1e-4f, cos_h), (1.0f + root) / (1.0f - root));
  return std::clamp((exact - f0) / (1.0f - f0), 0.0f, 1.0f);
}

inline float Lobes::through(const Vec3f& wi, float cos_h, const LayerAlbedo& albedo_i) const {
  if (!stacks_) {
    return (1.0f - albedo_o_.above) * (1.0f - albedo_i.above) / (1.0f - w_.mean_above);
  }
  const float out = schlick_weight(wo_.z());
  const float in = schlick_weight(wi.z());
  const float back = 2.0f * std::sqrt(w_.alpha) * cos_h * cos_h;
  const float burley =
      (1.0f - 0.5f * out) * (1.0f - 0.5f * in) + back * (out + in + out * in * (back - 1.0f));
  return 1.0f + w_.burley * (burley - 1.0f);
}

inline BsdfValue Lobes::evaluate(const Vec3f& wi, const LayerAlbedo& albedo_i) const {
  const float cos_over_pi = wi.z() * (1.0f / kPiF);
  const Vec3f h = unit(wo_ + wi);
  const float cos_h = std::max(0.0f, wo_.dot(h));
  const float white = fresnel(cos_h);
  BsdfValue value;

  // D G / (4 cos_o cos_i) cos_i, and the density of reflections by visible normals.
  const float d = ggx_distribution(h.z(), w_.alpha) / (4.0f * wo_.z());
  const float lambda_i = ggx_lambda(wi.z(), w_.alpha);
  const float seen = d / (1.0f + lambda_o_);
  const float facets = stacks_ ? seen / (1.0f + lambda_i) : d / (1.0f + lambda_o_ + lambda_i);
  const float past_coat = stacks_ ? 1.0f : 1.0f - std::max(albedo_o_.coat, albedo_i.coat);
  value.f_cos = (past_coat * facets) * (w_.f0 * (1.0f - white) + Vec3f::Constant(w_.f90 * white));
  value.density = p_facets_ * seen;

  const float coat_d = ggx_distribution(h.z(), w_.coat_alpha) / (4.0f * wo_.z());
  const float coat_lambda_i = ggx_lambda(wi.z(), w_.coat_alpha);
  const float coat_seen = coat_d / (1.0f + coat_lambda_o_);
  const float coat_facets = stacks_ ? 0.25f * coat_seen / (1.0f + coat_lambda_i)
                                    : coat_d / (1.0f + coat_lambda_o_ + coat_lambda_i);
  const float coat_white = kCoatF0 + (1.0f - kCoatF0) * schlick_weight(cos_h);
  value.f_cos += Vec3f::Constant(w_.coat * coat_white * coat_facets);
  value.density += p_coat_ * coat_seen;

  const float missing = albedo_o_.missing() * albedo_i.missing() / w_.mean_missing;
  value.f_cos += (missing * cos_over_pi) * w_.multiple;
  value.f_cos += (through(wi, cos_h, albedo_i) * cos_over_pi) * w_.diffuse;
  value.density += p_diffuse_ * cos_over_pi;
  return value;
}

inline Lobes::Draw Lobes::sample(float lobe, const Vec2f& u, const Vec3f& by_cosine) const {
  const bool is_facet = lobe < p_coat_ + p_facets_;
  const float alpha = lobe < p_coat_ ? w_.coat_alpha : w_.alpha;
  const Vec3f reflected = mirrored(wo_, ggx_visible_normal(wo_, alpha, u));
  constexpr float kDiffuseSpread = 0.5f;
  return {select(is_facet, reflected, by_cosine), is_facet ? alpha : kDiffuseSpread};
}

}  // namespace diorama
