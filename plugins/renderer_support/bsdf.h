// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>

#include "lobes.h"

namespace diorama {

/// By a material's row, or of plain Lambert surfaces, which have none.
inline LayerAlbedo albedo_at(const LayerTable::Row& row, float cos_theta) {
  if (!row) return {};
  const LayerTable::Node n = row.at(cos_theta);
  return {n[0], n[1], n[2], n[3]};
}

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

  /// Finds what follows from the values above; to be called when they have changed.
  void finish();
  LayerTable::Row row;  ///< At alpha; none where plain Lambert leaves nothing to look up.
  LobeWeights lobes;

  /// Weight of the glass.
  float glass_share() const { return glass ? (1.0f - metallic) * transmission : 0.0f; }
  /// Diffuse and nothing else.
  bool is_lambert() const {
    return metallic <= 0.0f && layers.specular <= 0.0f && layers.coat <= 0.0f && !glass;
  }
  /// Whether all lobes are wide, so that light samples alone find light well.
  bool is_rough() const {
    constexpr float kRoughAlpha = 0.25f;
    return is_lambert() || (glass_share() <= 0.0f && alpha >= kRoughAlpha &&
                            (layers.coat <= 0.0f || layers.coat_alpha >= kRoughAlpha));
  }
  bool is_mirror() const {
    constexpr float kMirrorSpread = 0.05f;
    return metallic > 0.9f && alpha < kMirrorSpread * kMirrorSpread;
  }
  LayerAlbedo albedo_at(float cos_theta) const { return diorama::albedo_at(row, cos_theta); }
  /// Share of uniform light returned to a direction: guides the denoiser.
  Vec3f albedo(const LayerAlbedo& n) const {
    const Vec3f white = Vec3f::Constant((1.0f - lobes.glass) * n.coat + lobes.f90 * n.f90);
    return white + Vec3f::Constant(lobes.glass) + lobes.f0 * n.f0 + lobes.multiple * n.missing() +
           lobes.diffuse * (1.0f - n.above);
  }
};

/// Samples less likely than this end their path.
inline constexpr float kLeastDensity = 1e-12f;

/// The tables are right to a quarter of a percent: light must not grow by what they are wrong.
inline constexpr float kKeptByTables = 0.9977f;

inline void SurfaceBsdf::finish() {
  row = {};
  lobes = {};
  lobes.diffuse = base;
  if (is_lambert()) return;
  row = table->row(alpha);
  const float share = glass_share();
  const float plastic = (1.0f - metallic) - share;
  const float dielectric = plastic * layers.specular;
  lobes.diffuse *= plastic;
  lobes.f0 = Vec3f::Constant(dielectric * layers.f0) + metallic * base;
  lobes.f90 = dielectric + metallic;
  lobes.alpha = alpha;
  lobes.coat = (1.0f - share) * layers.coat;
  lobes.coat_alpha = layers.coat_alpha;
  lobes.glass = share;
  lobes.dielectric_f0 = layers.f0;
  if (stacks_lobes) {
    lobes.burley = 1.0f;
    return;
  }
  const LayerTable::Means& means = row.means();
  lobes.multiple.setConstant(dielectric * means.plastic);
  for (int k = 0; k < 3; ++k) {
    lobes.multiple[k] += metallic * between_facets(base[k], means.kept);
  }
  lobes.mean_missing = std::max(1e-6f, means.missing);
  lobes.mean_above = means.above;
  lobes.diffuse *= kKeptByTables;
  lobes.f0 *= kKeptByTables;
  lobes.f90 *= kKeptByTables;
  lobes.multiple *= kKeptByTables;
  lobes.coat *= kKeptByTables;
}

struct BsdfSample {
  Vec3f wi = Vec3f::Zero();
  Vec3f weight = Vec3f::Zero();  ///< f |cos| / density. Zero: the path ends.
  float density = 0.0f;          ///< Infinite for mirror-like directions.
  float spread = 0.0f;           ///< Rough half width of the lobe, radians, for footprints.
  bool is_transmitted = false;   ///< wi.z < 0.
};

/// Evaluates and samples a finished SurfaceBsdf, glass and all, for one wo. Keeps references. All
/// inline: it is compiled into each of the render kernels.
class Bsdf {
 public:
  /// wo.z > 0.
  Bsdf(const SurfaceBsdf& surface, const Vec3f& wo)
      : s_(surface),
        wo_(wo),
        albedo_o_(surface.albedo_at(wo.z())),
        lobes_(surface.lobes, albedo_o_, wo, surface.stacks_lobes),
        p_glass_(lobes_.p_glass()),
        is_smooth_glass_(surface.alpha <= kSmoothAlpha) {}

  /// False when all that scatters is mirror-like, so that light samples are pointless.
  bool has_smooth_part() const { return p_glass_ <= 0.0f || !is_smooth_glass_ || lobes_.is_lit(); }
  Vec3f albedo() const { return s_.albedo(albedo_o_); }

  BsdfValue evaluate(const Vec3f& wi) const;
  /// `lobe` in [0, 1) chooses, `u` places.
  BsdfSample sample(float lobe, const Vec2f& u) const;

 private:
  BsdfValue evaluate_glass(const Vec3f& wi) const;
  BsdfSample sample_smooth_glass(float choice) const;
  /// Zero when the microfacet sends the light into the surface again.
  Vec3f sample_rough_glass(float choice, const Vec2f& u) const;

  const SurfaceBsdf& s_;
  Vec3f wo_;
  LayerAlbedo albedo_o_;
  Lobes lobes_;
  float p_glass_;
  bool is_smooth_glass_;
};

inline BsdfValue Bsdf::evaluate(const Vec3f& wi) const {
  BsdfValue value;
  if (p_glass_ > 0.0f && !is_smooth_glass_) value = evaluate_glass(wi);
  if (wi.z() <= 0.0f) return value;
  const BsdfValue opaque = lobes_.evaluate(wi, s_.albedo_at(wi.z()));
  return {value.f_cos + opaque.f_cos, value.density + opaque.density};
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
  return {kKeptByTables * s_.lobes.glass * f_cos * tint, p_glass_ * density};
}

[[gnu::noinline]] inline BsdfSample Bsdf::sample_smooth_glass(float choice) const {
  const float eta = s_.is_inside ? 1.0f / s_.glass->eta() : s_.glass->eta();
  const float f = fresnel_dielectric(wo_.z(), eta);
  BsdfSample sample;
  sample.density = kInfinite;
  const float scale = s_.lobes.glass / p_glass_;
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

inline BsdfSample Bsdf::sample(float lobe, const Vec2f& u) const {
  const bool is_glass = lobe < p_glass_;
  BsdfSample sample;
  if (is_glass) {
    const float choice = lobe / p_glass_;
    if (is_smooth_glass_) return sample_smooth_glass(choice);
    sample.wi = sample_rough_glass(choice, u);
    sample.spread = s_.alpha;
  } else {
    const Lobes::Draw draw = lobes_.sample(lobe - p_glass_, u, cosine_hemisphere(u));
    sample.wi = draw.wi;
    sample.spread = draw.spread;
  }
  sample.is_transmitted = sample.wi.z() < 0.0f;
  if (sample.wi.isZero() || (sample.is_transmitted && !is_glass)) return {};
  const BsdfValue value = evaluate(sample.wi);
  if (!(value.density > kLeastDensity)) return {};
  sample.density = value.density;
  sample.weight = value.f_cos * (1.0f / value.density);
  return sample;
}

}  // namespace diorama
