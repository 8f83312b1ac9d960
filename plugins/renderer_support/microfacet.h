// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>

#include "sampling.h"

/// Rough interfaces as fields of small mirrors: the GGX distribution of Walter et al. 2007,
/// isotropic, in local space (z along the surface normal).
namespace diorama {

/// Below this alpha glass is smooth: a mirror and a window instead of lobes.
inline constexpr float kSmoothAlpha = 2e-3f;
inline constexpr float kMinAlpha = 1e-3f;
inline constexpr float kCoatF0 = 0.04f;

inline Vec3f mirrored(const Vec3f& wo, const Vec3f& h) { return 2.0f * wo.dot(h) * h - wo; }

/// The refracted direction behind a facet h with wo.h > 0, or zero under total reflection; eta =
/// index behind over index in front.
inline Vec3f refracted(const Vec3f& wo, const Vec3f& h, float eta) {
  const float cos_o = wo.dot(h);
  const float sin2_t = (1.0f - cos_o * cos_o) / (eta * eta);
  if (sin2_t >= 1.0f) return Vec3f::Zero();
  const float cos_t = std::sqrt(1.0f - sin2_t);
  return unit(-wo / eta + (cos_o / eta - cos_t) * h);
}

/// GGX distribution of normals (Walter et al. 2007), isotropic; cos_h in (0, 1].
inline float ggx_distribution(float cos_h, float alpha) {
  const float a2 = alpha * alpha;
  const float sin2 = std::max(0.0f, 1.0f - cos_h * cos_h);
  const float k = sin2 + a2 * cos_h * cos_h;  // cos^2 (a2 - 1) + 1 without cancellation
  return a2 / (kPiF * k * k);
}

/// Smith's Lambda of GGX; cos > 0.
inline float ggx_lambda(float cos_theta, float alpha) {
  const float c2 = cos_theta * cos_theta;
  const float tan2 = std::max(0.0f, 1.0f - c2) / std::max(c2, 1e-12f);
  return 0.5f * (std::sqrt(1.0f + alpha * alpha * tan2) - 1.0f);
}

/// A visible normal for the local direction w, w.z > 0: the reflections of w by the normals of a
/// hemisphere fill a spherical cap evenly (Dupuy and Benyoub 2023). Density
/// D(h) G1(w) max(0, w.h) / w.z.
inline Vec3f ggx_visible_normal(const Vec3f& w, float alpha, const Vec2f& u) {
  const Vec3f stretched = unit(Vec3f(alpha * w.x(), alpha * w.y(), w.z()));
  const float z = (1.0f - u.y()) * (1.0f + stretched.z()) - stretched.z();
  const float r = std::sqrt(std::max(0.0f, 1.0f - z * z));
  const CosSin p = unit_circle(u.x());
  const Vec3f h = Vec3f(r * p.cosine, r * p.sine, z) + stretched;
  return unit(Vec3f(alpha * h.x(), alpha * h.y(), std::max(1e-6f, h.z())));
}

inline float ggx_visible_normal_density(const Vec3f& w, const Vec3f& h, float alpha) {
  const float w_dot_h = std::max(0.0f, w.dot(h));
  return ggx_distribution(h.z(), alpha) * w_dot_h / (w.z() * (1.0f + ggx_lambda(w.z(), alpha)));
}

/// Unpolarised reflectance of a smooth dielectric; cos_i > 0 on the incoming side, eta = index
/// behind over index in front. Returns 1 under total reflection.
inline float fresnel_dielectric(float cos_i, float eta) {
  const float sin2_t = std::max(0.0f, 1.0f - cos_i * cos_i) / (eta * eta);
  const float cos_t = std::sqrt(std::max(0.0f, 1.0f - sin2_t));
  const float parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
  const float perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
  const float reflected = 0.5f * (parallel * parallel + perpendicular * perpendicular);
  return sin2_t < 1.0f ? reflected : 1.0f;
}

/// (1 - cos)^5 of Schlick's approximation.
inline float schlick_weight(float cos_theta) {
  const float m = std::clamp(1.0f - cos_theta, 0.0f, 1.0f);
  const float m2 = m * m;
  return m2 * m2 * m;
}

/// Smith's height-correlated masking and shadowing over masking alone: what is left of a sample of
/// the visible normals.
inline float ggx_shadowing(float cos_o, float cos_i, float alpha) {
  const float masking = 1.0f + ggx_lambda(cos_o, alpha);
  return masking / (masking + ggx_lambda(cos_i, alpha));
}

/// The same for a transmitted sample: both sides see the microsurface independently.
inline float ggx_transmitted_shadowing(float cos_i, float alpha) {
  return 1.0f / (1.0f + ggx_lambda(std::abs(cos_i), alpha));
}

/// Colour of the light that leaves after several reflections between facets of reflectance f0, when
/// single reflections return the share `kept` under f0 = 1.
inline float between_facets(float f0, float kept) {
  constexpr float kMeanSchlickWeight = 1.0f / 21.0f;  // 2 * integral of (1 - c)^5 c
  const float mean = f0 + (1.0f - f0) * kMeanSchlickWeight;
  return mean * mean * kept / (1.0f - mean * (1.0f - kept));
}

}  // namespace diorama
