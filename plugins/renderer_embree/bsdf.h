// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>

#include "albedo_tables.h"
#include "microfacet.h"
#include "sampling.h"

namespace diorama {

/// A principled surface at one point. Local space: z along the shading normal, on the side of wo.
/// Reciprocal; loses no energy, unless it `stacks_lobes`.
struct SurfaceBsdf {
  Vec3f base = Vec3f::Zero();  ///< Base colour.
  float metallic = 0.0f;
  float transmission = 0.0f;  ///< Counts with `glass` only.
  float alpha = 0.25f;
  LayerTable::Layers layers;
  const LayerTable* table = nullptr;  ///< Of `layers`; not needed by plain Lambert surfaces.
  const GlassTable* glass = nullptr;
  bool is_inside = false;  ///< wo lies behind the surface: glass is left, not entered.
  /// As Blender 3.4's Principled BSDF: the specular lobe is added to a whole diffuse base (Burley
  /// 2012), and light between facets is lost. Returns more light than arrives at grazing angles.
  bool stacks_lobes = false;

  /// Weight of the glass.
  float glass_share() const { return glass ? (1.0f - metallic) * transmission : 0.0f; }
  /// Diffuse and nothing else.
  bool is_lambert() const {
    return metallic <= 0.0f && layers.specular <= 0.0f && layers.coat <= 0.0f && !glass;
  }
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

/// Evaluates and samples a SurfaceBsdf for one wo. Cheap to make; keeps references. All inline: it
/// is compiled into each of the render kernels.
class Bsdf {
 public:
  /// wo.z > 0.
  Bsdf(const SurfaceBsdf& surface, const Vec3f& wo);

  /// False when all that scatters is mirror-like, so that light samples are pointless.
  bool has_smooth_part() const { return has_smooth_part_; }
  /// Share of uniform light returned to wo: guides the denoiser.
  Vec3f albedo() const;
  /// Whether all lobes are wide, so that light samples alone find light well.
  bool is_rough() const {
    constexpr float kRoughAlpha = 0.25f;
    return is_lambert_ || (p_glass_ <= 0.0f && s_.alpha >= kRoughAlpha &&
                           (p_coat_ <= 0.0f || s_.layers.coat_alpha >= kRoughAlpha));
  }

  BsdfValue evaluate(const Vec3f& wi) const;
  /// `lobe` in [0, 1) chooses, `u` places; `by_cosine` is cosine_hemisphere(u), which is cheaper
  /// made for many at once.
  BsdfSample sample(float lobe, const Vec2f& u, const Vec3f& by_cosine) const;
  BsdfSample sample(float lobe, const Vec2f& u) const {
    return sample(lobe, u, cosine_hemisphere(u));
  }

 private:
  /// D G / (4 cos_o cos_i) * cos_i and the density of reflections by visible normals.
  struct Facets {
    float value = 0.0f;
    float density = 0.0f;
  };
  Facets facets(float cos_h, float cos_i, float alpha, float lambda_o) const {
    const float d = ggx_distribution(cos_h, alpha) / (4.0f * wo_.z());
    return {d / (1.0f + lambda_o + ggx_lambda(cos_i, alpha)), d / (1.0f + lambda_o)};
  }
  void choose_probabilities(const LayerTable::Node& node);
  BsdfValue evaluate_stacked(const Vec3f& wi) const;
  BsdfValue evaluate_glass(const Vec3f& wi) const;
  BsdfSample sample_smooth_glass(float choice) const;
  /// Zero when the microfacet sends the light into the surface again.
  Vec3f sample_rough_glass(float choice, const Vec2f& u) const;

  const SurfaceBsdf& s_;
  Vec3f wo_;
  bool is_lambert_;
  bool is_smooth_glass_ = false;
  bool has_smooth_part_ = true;
  float plastic_ = 0.0f;  ///< Weights of the opaque dielectric and of glass; the rest is metal.
  float glass_ = 0.0f;
  Vec3f specular_f0_ = Vec3f::Zero();  ///< Of metal and opaque dielectric together.
  float specular_f90_ = 0.0f;
  Vec3f multiple_ = Vec3f::Zero();  ///< Colour of the light scattered between facets.
  LayerTable::Row row_;
  LayerTable::Node node_o_ = LayerTable::Node::Zero();
  float missing_o_ = 0.0f;
  float lambda_o_ = 0.0f;
  float coat_lambda_o_ = 0.0f;
  float p_coat_ = 0.0f;  ///< Choice probabilities of the lobes.
  float p_specular_ = 0.0f;
  float p_diffuse_ = 1.0f;
  float p_glass_ = 0.0f;
};

inline Bsdf::Bsdf(const SurfaceBsdf& surface, const Vec3f& wo)
    : s_(surface), wo_(wo), is_lambert_(surface.is_lambert()) {
  if (is_lambert_) {
    plastic_ = 1.0f;
    return;
  }
  glass_ = s_.glass_share();
  plastic_ = (1.0f - s_.metallic) - glass_;
  is_smooth_glass_ = s_.alpha <= kSmoothAlpha;
  lambda_o_ = ggx_lambda(wo_.z(), s_.alpha);
  if (s_.layers.coat > 0.0f) coat_lambda_o_ = ggx_lambda(wo_.z(), s_.layers.coat_alpha);

  row_ = s_.table->row(s_.alpha);
  node_o_ = row_.at(wo_.z());
  missing_o_ = LayerTable::missing(node_o_);
  const float dielectric = plastic_ * s_.layers.specular;
  specular_f0_.setConstant(dielectric * s_.layers.f0);
  multiple_.setConstant(dielectric * row_.means().plastic);
  specular_f90_ = dielectric;
  if (s_.metallic > 0.0f) {
    specular_f0_ += s_.metallic * s_.base;
    specular_f90_ += s_.metallic;
    for (int k = 0; k < 3; ++k) {
      multiple_[k] += s_.metallic * between_facets(s_.base[k], row_.means().kept);
    }
  }
  choose_probabilities(node_o_);
}

inline void Bsdf::choose_probabilities(const LayerTable::Node& n) {
  p_coat_ = (1.0f - glass_) * n[2];
  p_specular_ = luminance(specular_f0_) * n[0] + specular_f90_ * n[1];
  p_diffuse_ = plastic_ * luminance(s_.base) * (1.0f - n[3]) + luminance(multiple_) * missing_o_;
  p_glass_ = glass_;
  has_smooth_part_ =
      p_coat_ + p_specular_ + p_diffuse_ > 1e-6f || (p_glass_ > 0.0f && !is_smooth_glass_);
  const float sum = p_coat_ + p_specular_ + p_diffuse_ + p_glass_;
  if (sum <= 0.0f) {
    p_diffuse_ = 1.0f;
    return;
  }
  const float scale = 1.0f / sum;
  p_coat_ *= scale;
  p_specular_ *= scale;
  p_diffuse_ *= scale;
  p_glass_ *= scale;
}

inline Vec3f Bsdf::albedo() const {
  if (is_lambert_) return s_.base;
  const LayerTable::Node& n = node_o_;
  const Vec3f white = Vec3f::Constant((1.0f - glass_) * n[2] + specular_f90_ * n[1] + glass_);
  return white + specular_f0_ * n[0] + multiple_ * missing_o_ + plastic_ * (1.0f - n[3]) * s_.base;
}

inline BsdfValue Bsdf::evaluate(const Vec3f& wi) const {
  // The tables are right to a quarter of a percent: light must not grow by what they are wrong.
  constexpr float kKept = 0.9977f;
  BsdfValue value;
  if (glass_ > 0.0f && !is_smooth_glass_) value = evaluate_glass(wi);
  if (wi.z() <= 0.0f) {
    value.f_cos *= kKept;
    return value;
  }
  const float cos_over_pi = wi.z() * (1.0f / kPiF);
  if (is_lambert_) return {s_.base * cos_over_pi, cos_over_pi};
  if (s_.stacks_lobes) [[unlikely]] {
    const BsdfValue stacked = evaluate_stacked(wi);
    return {value.f_cos + stacked.f_cos, value.density + stacked.density};
  }

  const Vec3f h = unit(wo_ + wi);
  const float schlick = schlick_weight(std::max(0.0f, wo_.dot(h)));
  const LayerTable::Node n = row_.at(wi.z());
  if (specular_f90_ > 0.0f) {
    const Facets facet = facets(h.z(), wi.z(), s_.alpha, lambda_o_);
    const float past_coat = 1.0f - std::max(node_o_[2], n[2]);
    value.f_cos += (past_coat * facet.value) *
                   (specular_f0_ * (1.0f - schlick) + Vec3f::Constant(specular_f90_ * schlick));
    value.density += p_specular_ * facet.density;
    const float missing =
        missing_o_ * LayerTable::missing(n) / std::max(1e-6f, row_.means().missing);
    value.f_cos += (missing * cos_over_pi) * multiple_;
  }
  if (s_.layers.coat > 0.0f) {
    const Facets facet = facets(h.z(), wi.z(), s_.layers.coat_alpha, coat_lambda_o_);
    const float f = (1.0f - glass_) * s_.layers.coat * (kCoatF0 + (1.0f - kCoatF0) * schlick);
    value.f_cos += Vec3f::Constant(f * facet.value);
    value.density += p_coat_ * facet.density;
  }
  if (plastic_ > 0.0f) {
    const float through = (1.0f - node_o_[3]) * (1.0f - n[3]) / (1.0f - row_.means().above);
    value.f_cos += (plastic_ * through * cos_over_pi) * s_.base;
  }
  value.density += p_diffuse_ * cos_over_pi;
  value.f_cos *= kKept;
  return value;
}

// The exact dielectric Fresnel term, scaled to run from 0 to 1, blends the colours of the facets.
[[gnu::noinline]] inline BsdfValue Bsdf::evaluate_stacked(const Vec3f& wi) const {
  const float cos_over_pi = wi.z() * (1.0f / kPiF);
  const Vec3f h = unit(wo_ + wi);
  const float cos_h = std::max(0.0f, wo_.dot(h));
  BsdfValue value;
  const auto add_facets = [&](float alpha, float lambda_o, float p, auto&& reflectance) {
    const float lambda_i = ggx_lambda(wi.z(), alpha);
    const float d = ggx_distribution(h.z(), alpha) / (4.0f * wo_.z() * (1.0f + lambda_o));
    value.f_cos += (d / (1.0f + lambda_i)) * reflectance;
    value.density += p * d;
  };
  if (specular_f90_ > 0.0f) {
    const float f0 = s_.layers.f0;
    const float root = std::sqrt(f0);
    const float fresnel = fresnel_dielectric(std::max(1e-4f, cos_h), (1.0f + root) / (1.0f - root));
    const float white = std::clamp((fresnel - f0) / (1.0f - f0), 0.0f, 1.0f);
    add_facets(s_.alpha, lambda_o_, p_specular_,
               Vec3f(specular_f0_ * (1.0f - white) + Vec3f::Constant(specular_f90_ * white)));
  }
  if (s_.layers.coat > 0.0f) {
    constexpr float kCoatWeight = 0.25f;
    const float f = kCoatF0 + (1.0f - kCoatF0) * schlick_weight(cos_h);
    add_facets(s_.layers.coat_alpha, coat_lambda_o_, p_coat_,
               Vec3f(Vec3f::Constant(kCoatWeight * s_.layers.coat * f)));
  }
  if (plastic_ > 0.0f) {
    const float out = schlick_weight(wo_.z());
    const float in = schlick_weight(wi.z());
    const float back = 2.0f * std::sqrt(s_.alpha) * cos_h * cos_h;
    const float grazing =
        (1.0f - 0.5f * out) * (1.0f - 0.5f * in) + back * (out + in + out * in * (back - 1.0f));
    value.f_cos += (plastic_ * grazing * cos_over_pi) * s_.base;
  }
  value.density += p_diffuse_ * cos_over_pi;
  return value;
}

[[gnu::noinline]] inline BsdfValue Bsdf::evaluate_glass(const Vec3f& wi) const {
  const GlassTable& table = *s_.glass;
  const int side = s_.is_inside ? 1 : 0;
  const float eta = s_.is_inside ? 1.0f / table.eta() : table.eta();
  const bool is_reflected = wi.z() > 0.0f;
  const float cos_i = std::abs(wi.z());
  if (cos_i < 1e-6f) return {};

  // Light lost between the facets leaves on both sides by the cosine.
  const int exit = is_reflected ? side : 1 - side;
  const float lost_o = 1.0f - table.at(side, wo_.z(), s_.alpha);
  const float lost_i = 1.0f - table.at(exit, cos_i, s_.alpha);
  const float lost_all = 2.0f - table.mean(0, s_.alpha) - table.mean(1, s_.alpha);
  const float lost_here = 1.0f - table.mean(exit, s_.alpha);
  float f_cos = lost_o * lost_i / lost_all * cos_i / kPiF;
  float density = lost_o * (lost_here / lost_all) * cos_i / kPiF;

  Vec3f h = unit(is_reflected ? Vec3f(wo_ + wi) : Vec3f(-(wo_ + eta * wi)));
  if (h.z() < 0.0f) h = -h;
  const float o_dot = wo_.dot(h);
  const float i_dot = wi.dot(h);
  const bool is_possible = o_dot > 0.0f && (is_reflected ? i_dot > 0.0f : i_dot < 0.0f);
  if (is_possible) {
    const float f = fresnel_dielectric(o_dot, eta);
    const float visible = ggx_visible_normal_density(wo_, h, s_.alpha);
    float single;
    float rest;
    if (is_reflected) {
      single = f * visible / (4.0f * o_dot);
      rest = ggx_shadowing(wo_.z(), cos_i, s_.alpha);
    } else {
      const float root = o_dot + eta * i_dot;
      single = (1.0f - f) * visible * eta * eta * -i_dot / std::max(root * root, 1e-12f);
      rest = ggx_transmitted_shadowing(cos_i, s_.alpha);
    }
    f_cos += single * rest;
    density += (1.0f - lost_o) * single;
  }
  const Vec3f tint = is_reflected ? Vec3f::Ones() : Vec3f(s_.base.cwiseSqrt());
  return {glass_ * f_cos * tint, p_glass_ * density};
}

[[gnu::noinline]] inline BsdfSample Bsdf::sample_smooth_glass(float choice) const {
  const float eta = s_.is_inside ? 1.0f / s_.glass->eta() : s_.glass->eta();
  const float f = fresnel_dielectric(wo_.z(), eta);
  BsdfSample sample;
  sample.density = kInfinite;
  const float scale = glass_ / p_glass_;
  if (choice < f) {
    sample.wi = {-wo_.x(), -wo_.y(), wo_.z()};
    sample.weight = Vec3f::Constant(scale);
    return sample;
  }
  sample.wi = refracted(wo_, Vec3f::UnitZ(), eta);
  if (sample.wi.z() >= 0.0f) return {};
  sample.is_transmitted = true;
  sample.weight = scale * s_.base.cwiseSqrt();
  return sample;
}

[[gnu::noinline]] inline Vec3f Bsdf::sample_rough_glass(float choice, const Vec2f& u) const {
  const GlassTable& table = *s_.glass;
  const int side = s_.is_inside ? 1 : 0;
  const float eta = s_.is_inside ? 1.0f / table.eta() : table.eta();
  const float kept = table.at(side, wo_.z(), s_.alpha);
  if (choice >= kept) {
    const float again = (choice - kept) / (1.0f - kept);
    const float lost_all = 2.0f - table.mean(0, s_.alpha) - table.mean(1, s_.alpha);
    const Vec3f wi = cosine_hemisphere(u);
    if (again < (1.0f - table.mean(side, s_.alpha)) / lost_all) return wi;
    return {wi.x(), wi.y(), -wi.z()};
  }
  const Vec3f h = ggx_visible_normal(wo_, s_.alpha, u);
  const bool is_reflected = choice < kept * fresnel_dielectric(wo_.dot(h), eta);
  const Vec3f wi = is_reflected ? mirrored(wo_, h) : refracted(wo_, h, eta);
  const bool is_on_its_side = is_reflected ? wi.z() > 0.0f : wi.z() < 0.0f;
  return is_on_its_side ? wi : Vec3f::Zero();
}

inline BsdfSample Bsdf::sample(float lobe, const Vec2f& u, const Vec3f& by_cosine) const {
  BsdfSample sample;
  sample.spread = 0.5f;
  if (is_lambert_) {
    sample.wi = by_cosine;
    sample.weight = s_.base;
    sample.density = sample.wi.z() * (1.0f / kPiF);
    return sample;
  }
  const bool is_glass = lobe < p_glass_;
  if (is_glass) {
    const float choice = lobe / p_glass_;
    if (is_smooth_glass_) return sample_smooth_glass(choice);
    sample.wi = sample_rough_glass(choice, u);
    sample.spread = s_.alpha;
  } else if (lobe < p_glass_ + p_coat_ + p_specular_) {
    const bool is_coat = lobe < p_glass_ + p_coat_;
    sample.spread = is_coat ? s_.layers.coat_alpha : s_.alpha;
    sample.wi = mirrored(wo_, ggx_visible_normal(wo_, sample.spread, u));
  } else {
    sample.wi = by_cosine;
  }
  sample.is_transmitted = sample.wi.z() < 0.0f;
  // A facet that sends a reflection below the horizon loses it.
  if (sample.wi.isZero() || (sample.is_transmitted && !is_glass)) return {};
  const BsdfValue value = evaluate(sample.wi);
  if (!(value.density > 1e-12f)) return {};
  sample.density = value.density;
  sample.weight = value.f_cos * (1.0f / value.density);
  return sample;
}

}  // namespace diorama
