// SPDX-License-Identifier: Apache-2.0
#include "bsdf.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace diorama {
namespace {

constexpr float kCoatF0 = 0.04f;
constexpr float kMeanSchlickWeight = 1.0f / 21.0f;  // 2 * integral of (1 - c)^5 c

/// Smith's height-correlated masking and shadowing over masking alone: what is left of a sample of
/// the visible normals.
float shadowing(float cos_o, float cos_i, float alpha) {
  const float masking = 1.0f + ggx_lambda(cos_o, alpha);
  return masking / (masking + ggx_lambda(cos_i, alpha));
}

/// Linear interpolation in a row-major table over [0, 1]^2.
template <int Size, class Get>
auto interpolate(float x, float y, Get&& get) {
  const float px = std::clamp(x, 0.0f, 1.0f) * float(Size - 1);
  const float py = std::clamp(y, 0.0f, 1.0f) * float(Size - 1);
  const int ix = std::min(int(px), Size - 2);
  const int iy = std::min(int(py), Size - 2);
  return get(ix, iy, px - float(ix), py - float(iy));
}

/// Tables are denser where things bend: at grazing angles and low roughness.
float table_cos(int i, int size) {
  const float x = float(i) / float(size - 1);
  return std::max(1e-3f, x * x);
}
float table_alpha(int i, int size) { return std::max(Bsdf::kMinAlpha, table_cos(i, size)); }
float table_x(float cos_or_alpha) { return std::sqrt(std::max(0.0f, cos_or_alpha)); }

/// Mean over the hemisphere weighted by the cosine.
template <class Albedo>
float hemispherical_mean(Albedo&& albedo) {
  constexpr int kSteps = 256;
  float sum = 0.0f;
  for (int i = 0; i < kSteps; ++i) sum += albedo(std::sqrt((float(i) + 0.5f) / float(kSteps)));
  return sum / float(kSteps);
}

constexpr int kPoints = 1024;  // of the numeric integrals

/// An additive recurrence of two dimensions (Roberts 2018): fine along every radius of the disk,
/// which a square grid is not.
Vec2f spread_point(int i) {
  const double x = 0.5 + double(i) * 0.75487766624669276;
  const double y = 0.5 + double(i) * 0.56984029099805327;
  return {float(x - std::floor(x)), float(y - std::floor(y))};
}

Vec3f direction_at(float cos_theta) {
  return {std::sqrt(std::max(0.0f, 1.0f - cos_theta * cos_theta)), 0.0f, cos_theta};
}

Vec3f reflected(const Vec3f& wo, const Vec3f& h) { return 2.0f * wo.dot(h) * h - wo; }

/// The refracted direction behind a facet h with wo.h > 0, or zero under total reflection.
Vec3f refracted(const Vec3f& wo, const Vec3f& h, float eta) {
  const float cos_o = wo.dot(h);
  const float sin2_t = (1.0f - cos_o * cos_o) / (eta * eta);
  if (sin2_t >= 1.0f) return Vec3f::Zero();
  const float cos_t = std::sqrt(1.0f - sin2_t);
  return (-wo / eta + (cos_o / eta - cos_t) * h).normalized();
}

/// Shadowing of a transmitted sample: both sides see the microsurface independently.
float transmitted_shadowing(float cos_i, float alpha) {
  return 1.0f / (1.0f + ggx_lambda(std::abs(cos_i), alpha));
}

AlbedoTables::Split conductor_albedo(float cos_theta, float alpha) {
  const Vec3f wo = direction_at(cos_theta);
  AlbedoTables::Split sum;
  for (int i = 0; i < kPoints; ++i) {
    const Vec3f h = ggx_visible_normal(wo, alpha, spread_point(i));
    const Vec3f wi = reflected(wo, h);
    if (wi.z() <= 0.0f) continue;
    const float rest = shadowing(wo.z(), wi.z(), alpha);
    const float weight = schlick_weight(wo.dot(h));
    sum.a += rest * (1.0f - weight);
    sum.b += rest * weight;
  }
  return {sum.a / float(kPoints), sum.b / float(kPoints)};
}

float glass_albedo(float cos_theta, float alpha, float eta) {
  const Vec3f wo = direction_at(cos_theta);
  float sum = 0.0f;
  for (int i = 0; i < kPoints; ++i) {
    const Vec3f h = ggx_visible_normal(wo, alpha, spread_point(i));
    const float f = fresnel_dielectric(wo.dot(h), eta);
    const Vec3f mirrored = reflected(wo, h);
    if (mirrored.z() > 0.0f) sum += f * shadowing(wo.z(), mirrored.z(), alpha);
    const Vec3f bent = refracted(wo, h, eta);
    if (bent.z() < 0.0f) sum += (1.0f - f) * transmitted_shadowing(bent.z(), alpha);
  }
  return std::min(sum / float(kPoints), 0.9999f);
}

}  // namespace

AlbedoTables::AlbedoTables() {
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      directional_.push_back(conductor_albedo(table_cos(x, kSize), table_alpha(y, kSize)));
    }
  }
  for (int y = 0; y < kSize; ++y) {
    const float alpha = table_alpha(y, kSize);
    mean_.push_back({hemispherical_mean([&](float c) { return at(c, alpha).a; }),
                     hemispherical_mean([&](float c) { return at(c, alpha).b; })});
  }
}

AlbedoTables::Split AlbedoTables::at(float cos_theta, float alpha) const {
  return interpolate<kSize>(
      table_x(cos_theta), table_x(alpha), [&](int x, int y, float fx, float fy) {
        const Split* row = &directional_[std::size_t(y * kSize + x)];
        const Split* next = row + kSize;
        const auto mix = [](float p, float q, float t) { return p + (q - p) * t; };
        return Split{mix(mix(row[0].a, row[1].a, fx), mix(next[0].a, next[1].a, fx), fy),
                     mix(mix(row[0].b, row[1].b, fx), mix(next[0].b, next[1].b, fx), fy)};
      });
}

AlbedoTables::Split AlbedoTables::mean(float alpha) const {
  return interpolate<kSize>(0.0f, table_x(alpha), [&](int, int y, float, float fy) {
    const Split& p = mean_[std::size_t(y)];
    const Split& q = mean_[std::size_t(y) + 1];
    return Split{p.a + (q.a - p.a) * fy, p.b + (q.b - p.b) * fy};
  });
}

GlassTables::GlassTables(float eta) : eta_(eta) {
  for (int side = 0; side < 2; ++side) {
    for (int y = 0; y < kSize; ++y) {
      for (int x = 0; x < kSize; ++x) {
        directional_.push_back(glass_albedo(table_cos(x, kSize), table_alpha(y, kSize),
                                            side == 0 ? eta_ : 1.0f / eta_));
      }
    }
  }
  for (int side = 0; side < 2; ++side) {
    for (int y = 0; y < kSize; ++y) {
      const float alpha = table_alpha(y, kSize);
      mean_.push_back(hemispherical_mean([&](float c) { return at(side, c, alpha); }));
    }
  }
}

float GlassTables::at(int side, float cos_theta, float alpha) const {
  return interpolate<kSize>(
      table_x(cos_theta), table_x(alpha), [&](int x, int y, float fx, float fy) {
        const float* row = &directional_[std::size_t((side * kSize + y) * kSize + x)];
        const float* next = row + kSize;
        const float low = row[0] + (row[1] - row[0]) * fx;
        const float high = next[0] + (next[1] - next[0]) * fx;
        return low + (high - low) * fy;
      });
}

float GlassTables::mean(int side, float alpha) const {
  return interpolate<kSize>(0.0f, table_x(alpha), [&](int, int y, float, float fy) {
    const float* p = &mean_[std::size_t(side * kSize + y)];
    return p[0] + (p[1] - p[0]) * fy;
  });
}

Bsdf::Bsdf(const SurfaceBsdf& surface, const AlbedoTables& tables, const Vec3f& wo)
    : s_(surface), tables_(tables), wo_(wo) {
  glass_ = s_.glass ? (1.0f - s_.metallic) * s_.transmission : 0.0f;
  plastic_ = (1.0f - s_.metallic) - glass_;
  is_smooth_glass_ = s_.alpha <= kSmoothAlpha;

  const float dielectric = plastic_ * s_.specular;
  specular_f0_ = s_.metallic * s_.base + Vec3f::Constant(dielectric * s_.f0);
  specular_f90_ = s_.metallic + dielectric;
  has_specular_ = specular_f90_ > 0.0f;
  split_o_ = specular_split(wo_.z());
  single_o_ = split_o_.total();
  single_mean_ = tables_.mean(s_.alpha).total();
  const auto multiple = [&](float f0) {
    const float mean = f0 + (1.0f - f0) * kMeanSchlickWeight;
    return mean * mean * single_mean_ / (1.0f - mean * (1.0f - single_mean_));
  };
  plastic_multiple_ = multiple(s_.f0);
  multiple_ =
      s_.metallic * s_.base.unaryExpr(multiple) + Vec3f::Constant(dielectric * plastic_multiple_);

  if (s_.coat > 0.0f) {
    coat_o_ = coat_albedo(wo_.z());
    const AlbedoTables::Split mean = tables_.mean(s_.coat_alpha);
    coat_mean_ = s_.coat * (kCoatF0 * mean.a + mean.b);
  }
  if (plastic_ > 0.0f) {
    above_o_ = albedo_above_diffuse(wo_.z(), split_o_);
    const AlbedoTables::Split mean = tables_.mean(s_.alpha);
    above_mean_ =
        s_.specular * (s_.f0 * mean.a + mean.b + plastic_multiple_ * (1.0f - single_mean_));
    if (s_.coat > 0.0f) {
      // The product of two layers has no table: four-point Gauss rule over cos^2.
      constexpr std::array<float, 4> kNodes{0.0694318f, 0.3300095f, 0.6699905f, 0.9305682f};
      constexpr std::array<float, 4> kWeights{0.1739274f, 0.3260726f, 0.3260726f, 0.1739274f};
      above_mean_ = 0.0f;
      for (std::size_t i = 0; i < kNodes.size(); ++i) {
        const float cosine = std::sqrt(kNodes[i]);
        above_mean_ += kWeights[i] * albedo_above_diffuse(cosine, specular_split(cosine));
      }
    }
  }
  choose_probabilities();
}

float Bsdf::coat_albedo(float cos_theta) const {
  const AlbedoTables::Split e = tables_.at(cos_theta, s_.coat_alpha);
  return s_.coat * (kCoatF0 * e.a + e.b);
}

AlbedoTables::Split Bsdf::specular_split(float cos_theta) const {
  if (!has_specular_) return {0.0f, 1.0f};
  return tables_.at(cos_theta, s_.alpha);
}

float Bsdf::plastic_albedo(const AlbedoTables::Split& e) const {
  return s_.specular * (s_.f0 * e.a + e.b + plastic_multiple_ * (1.0f - e.total()));
}

float Bsdf::albedo_above_diffuse(float cos_theta, const AlbedoTables::Split& e) const {
  const float specular = plastic_albedo(e);
  if (s_.coat <= 0.0f) return specular;
  const float coat = coat_albedo(cos_theta);
  return coat + (1.0f - coat) * specular;
}

// Smooth lobes leave at the angle at which they came in, so the smaller of the two transmittances
// is what passes; for wide lobes the exact form is that of a diffuse base.
float Bsdf::past_coat(float cos_i) const {
  if (s_.coat <= 0.0f) return 1.0f;
  const float o = 1.0f - coat_o_;
  const float i = 1.0f - coat_albedo(std::abs(cos_i));
  const float narrow = std::min(o, i);
  return narrow + s_.alpha * (o * i / (1.0f - coat_mean_) - narrow);
}

void Bsdf::choose_probabilities() {
  const AlbedoTables::Split& e = split_o_;
  const float past = 1.0f - coat_o_;
  p_coat_ = coat_o_;
  p_specular_ = past * (luminance(specular_f0_) * e.a + specular_f90_ * e.b);
  p_diffuse_ = plastic_ * luminance(s_.base) * (1.0f - above_o_) +
               past * luminance(multiple_) * (1.0f - single_o_);
  p_glass_ = past * glass_;
  has_smooth_part_ =
      p_coat_ + p_specular_ + p_diffuse_ > 1e-6f || (p_glass_ > 0 && !is_smooth_glass_);
  const float sum = p_coat_ + p_specular_ + p_diffuse_ + p_glass_;
  if (sum <= 0.0f) {
    p_diffuse_ = 1.0f;
    return;
  }
  for (float* p : {&p_coat_, &p_specular_, &p_diffuse_, &p_glass_}) *p /= sum;
}

Vec3f Bsdf::albedo() const {
  const AlbedoTables::Split& e = split_o_;
  const Vec3f specular =
      specular_f0_ * e.a + Vec3f::Constant(specular_f90_ * e.b) + multiple_ * (1.0f - single_o_);
  const Vec3f diffuse = plastic_ * (1.0f - above_o_) * s_.base;
  return Vec3f::Constant(coat_o_) + (1.0f - coat_o_) * (specular + Vec3f::Constant(glass_)) +
         diffuse;
}

BsdfValue Bsdf::evaluate(const Vec3f& wi) const {
  BsdfValue value;
  if (glass_ > 0.0f && !is_smooth_glass_) value = evaluate_glass(wi);
  if (wi.z() <= 0.0f) return value;

  const Vec3f h = (wo_ + wi).normalized();
  const float h_dot = std::max(0.0f, wo_.dot(h));
  const float schlick = schlick_weight(h_dot);
  const float past = past_coat(wi.z());
  // D G / (4 cos_o cos_i) * cos_i
  const auto microfacet = [&](float alpha) {
    const float g = 1.0f / (1.0f + ggx_lambda(wo_.z(), alpha) + ggx_lambda(wi.z(), alpha));
    return ggx_distribution(h.z(), alpha) * g / (4.0f * wo_.z());
  };
  const auto density = [&](float alpha) {
    return ggx_visible_normal_density(wo_, h, alpha) / std::max(4.0f * h_dot, 1e-12f);
  };
  if (has_specular_) {
    const Vec3f f = specular_f0_ + (Vec3f::Constant(specular_f90_) - specular_f0_) * schlick;
    value.f_cos += past * microfacet(s_.alpha) * f;
    value.density += p_specular_ * density(s_.alpha);
  }
  if (s_.coat > 0.0f) {
    const float f = s_.coat * (kCoatF0 + (1.0f - kCoatF0) * schlick);
    value.f_cos += Vec3f::Constant(f * microfacet(s_.coat_alpha));
    value.density += p_coat_ * density(s_.coat_alpha);
  }
  const float cos_over_pi = wi.z() / kPiF;
  const AlbedoTables::Split e = specular_split(wi.z());
  const float between =
      (1.0f - single_o_) * (1.0f - e.total()) / std::max(1e-6f, 1.0f - single_mean_);
  value.f_cos += past * between * cos_over_pi * multiple_;
  if (plastic_ > 0.0f) {
    const float through =
        (1.0f - above_o_) * (1.0f - albedo_above_diffuse(wi.z(), e)) / (1.0f - above_mean_);
    value.f_cos += plastic_ * through * cos_over_pi * s_.base;
  }
  value.density += p_diffuse_ * cos_over_pi;
  return value;
}

BsdfValue Bsdf::evaluate_glass(const Vec3f& wi) const {
  const GlassTables& tables = *s_.glass;
  const int side = s_.is_inside ? 1 : 0;
  const float eta = s_.is_inside ? 1.0f / tables.eta() : tables.eta();
  const bool is_reflected = wi.z() > 0.0f;
  const float cos_i = std::abs(wi.z());
  if (cos_i < 1e-6f) return {};

  // Light lost between the facets leaves on both sides by the cosine.
  const float lost_o = 1.0f - tables.at(side, wo_.z(), s_.alpha);
  const float lost_i = 1.0f - tables.at(is_reflected ? side : 1 - side, cos_i, s_.alpha);
  const float lost_all = 2.0f - tables.mean(0, s_.alpha) - tables.mean(1, s_.alpha);
  const float lost_here = 1.0f - tables.mean(is_reflected ? side : 1 - side, s_.alpha);
  float f_cos = lost_o * lost_i / lost_all * cos_i / kPiF;
  float density = lost_o * (lost_here / lost_all) * cos_i / kPiF;

  const Vec3f sum = is_reflected ? Vec3f(wo_ + wi) : Vec3f(-(wo_ + eta * wi));
  Vec3f h = sum.normalized();
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
      rest = shadowing(wo_.z(), cos_i, s_.alpha);
    } else {
      const float root = o_dot + eta * i_dot;
      single = (1.0f - f) * visible * eta * eta * -i_dot / std::max(root * root, 1e-12f);
      rest = transmitted_shadowing(cos_i, s_.alpha);
    }
    f_cos += single * rest;
    density += (1.0f - lost_o) * single;
  }
  const Vec3f tint = is_reflected ? Vec3f::Ones() : Vec3f(s_.base.cwiseSqrt());
  return {glass_ * past_coat(cos_i) * f_cos * tint, p_glass_ * density};
}

Vec3f Bsdf::sample_microfacet(float alpha, const Vec2f& u) const {
  return reflected(wo_, ggx_visible_normal(wo_, alpha, u));
}

BsdfSample Bsdf::sample_smooth_glass(float choice) const {
  const float eta = s_.is_inside ? 1.0f / s_.glass->eta() : s_.glass->eta();
  const float f = fresnel_dielectric(wo_.z(), eta);
  BsdfSample sample;
  sample.density = std::numeric_limits<float>::infinity();
  const float scale = glass_ / p_glass_;
  if (choice < f) {
    sample.wi = {-wo_.x(), -wo_.y(), wo_.z()};
    sample.weight = Vec3f::Constant(scale * past_coat(wo_.z()));
    return sample;
  }
  sample.wi = refracted(wo_, Vec3f::UnitZ(), eta);
  if (sample.wi.z() >= 0.0f) return {};
  sample.is_transmitted = true;
  sample.weight = scale * past_coat(sample.wi.z()) * s_.base.cwiseSqrt();
  return sample;
}

Vec3f Bsdf::sample_rough_glass(float choice, const Vec2f& u) const {
  const GlassTables& tables = *s_.glass;
  const int side = s_.is_inside ? 1 : 0;
  const float eta = s_.is_inside ? 1.0f / tables.eta() : tables.eta();
  const float kept = tables.at(side, wo_.z(), s_.alpha);
  if (choice >= kept) {
    const float again = (choice - kept) / (1.0f - kept);
    const float lost_all = 2.0f - tables.mean(0, s_.alpha) - tables.mean(1, s_.alpha);
    const Vec3f wi = cosine_hemisphere(u);
    if (again < (1.0f - tables.mean(side, s_.alpha)) / lost_all) return wi;
    return {wi.x(), wi.y(), -wi.z()};
  }
  const Vec3f h = ggx_visible_normal(wo_, s_.alpha, u);
  const bool is_reflected = choice / kept < fresnel_dielectric(wo_.dot(h), eta);
  const Vec3f wi = is_reflected ? reflected(wo_, h) : refracted(wo_, h, eta);
  const bool is_on_its_side = is_reflected ? wi.z() > 0.0f : wi.z() < 0.0f;
  return is_on_its_side ? wi : Vec3f::Zero();
}

BsdfSample Bsdf::sample(float lobe, const Vec2f& u) const {
  BsdfSample sample;
  if (lobe < p_glass_) {
    const float choice = lobe / p_glass_;
    if (is_smooth_glass_) return sample_smooth_glass(choice);
    sample.wi = sample_rough_glass(choice, u);
    sample.spread = s_.alpha;
  } else if (lobe < p_glass_ + p_coat_) {
    sample.wi = sample_microfacet(s_.coat_alpha, u);
    sample.spread = s_.coat_alpha;
  } else if (lobe < p_glass_ + p_coat_ + p_specular_) {
    sample.wi = sample_microfacet(s_.alpha, u);
    sample.spread = s_.alpha;
  } else {
    sample.wi = cosine_hemisphere(u);
    sample.spread = 0.5f;
  }
  sample.is_transmitted = sample.wi.z() < 0.0f;
  // A facet that sends a reflection below the horizon loses it.
  const bool may_transmit = lobe < p_glass_;
  if (sample.wi.isZero() || (sample.is_transmitted && !may_transmit)) return {};
  const BsdfValue value = evaluate(sample.wi);
  if (!(value.density > 1e-12f)) return {};
  sample.density = value.density;
  sample.weight = value.f_cos / value.density;
  return sample;
}

}  // namespace diorama
