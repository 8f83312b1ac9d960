// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

#include "diorama/math.h"

/// Maps from the unit square to directions and points, with their densities. All directions are
/// unit length; "local" means z along the surface normal.
namespace diorama {

inline constexpr float kPiF = std::numbers::pi_v<float>;

inline float luminance(const Vec3f& rgb) {
  return 0.2126f * rgb.x() + 0.7152f * rgb.y() + 0.0722f * rgb.z();
}

/// Right-handed orthonormal axes with z = n.
struct Basis {
  Vec3f x;
  Vec3f y;
  Vec3f z;

  Vec3f to_local(const Vec3f& v) const { return {x.dot(v), y.dot(v), z.dot(v)}; }
  Vec3f to_world(const Vec3f& v) const { return x * v.x() + y * v.y() + z * v.z(); }
};

/// Duff et al., "Building an orthonormal basis, revisited", 2017.
inline Basis basis_around(const Vec3f& n) {
  const float sign = std::copysign(1.0f, n.z());
  const float a = -1.0f / (sign + n.z());
  const float b = n.x() * n.y() * a;
  return {{1.0f + sign * n.x() * n.x() * a, sign * b, -sign * n.x()},
          {b, sign + n.y() * n.y() * a, -n.y()},
          n};
}

/// Uniform on the unit disk, keeping neighbours together (Shirley and Chiu 1997).
inline Vec2f disk_from_square(const Vec2f& u) {
  const float a = 2.0f * u.x() - 1.0f;
  const float b = 2.0f * u.y() - 1.0f;
  if (a == 0.0f && b == 0.0f) return Vec2f::Zero();
  const bool is_wide = std::abs(a) > std::abs(b);
  const float r = is_wide ? a : b;
  const float phi = is_wide ? 0.25f * kPiF * (b / a) : 0.5f * kPiF - 0.25f * kPiF * (a / b);
  return {r * std::cos(phi), r * std::sin(phi)};
}

/// Density cos(theta) / pi.
inline Vec3f cosine_hemisphere(const Vec2f& u) {
  const Vec2f d = disk_from_square(u);
  return {d.x(), d.y(), std::sqrt(std::max(0.0f, 1.0f - d.squaredNorm()))};
}

/// Uniform in the cone around z; `one_minus_cos` of its half angle, exact for narrow cones. Density
/// 1 / (2 pi one_minus_cos).
inline Vec3f uniform_cone(const Vec2f& u, float one_minus_cos) {
  const float h = u.x() * one_minus_cos;  // 1 - cos(theta)
  const float sin_theta = std::sqrt(std::max(0.0f, h * (2.0f - h)));
  const float phi = 2.0f * kPiF * u.y();
  return {sin_theta * std::cos(phi), sin_theta * std::sin(phi), 1.0f - h};
}

inline Vec3f uniform_sphere(const Vec2f& u) { return uniform_cone(u, 2.0f); }

/// Barycentric weights of the second and third corner, uniform over the triangle.
inline Vec2f triangle_from_square(const Vec2f& u) {
  const float root = std::sqrt(u.x());
  return {root * (1.0f - u.y()), root * u.y()};
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

/// A visible normal for the local direction w, w.z > 0 (Heitz 2018). Density
/// D(h) G1(w) max(0, w.h) / w.z.
inline Vec3f ggx_visible_normal(const Vec3f& w, float alpha, const Vec2f& u) {
  const Vec3f stretched = Vec3f(alpha * w.x(), alpha * w.y(), w.z()).normalized();
  const Basis basis = basis_around(stretched);
  Vec2f t = disk_from_square(u);
  const float s = 0.5f * (1.0f + stretched.z());
  // The half of the projected hemisphere that the stretched direction sees; basis.x/.y are any pair
  // perpendicular to it, so the split must follow the direction that lies level.
  const float sin_theta = std::hypot(stretched.x(), stretched.y());
  const Vec3f level = sin_theta > 1e-7f
                          ? Vec3f(-stretched.y() / sin_theta, stretched.x() / sin_theta, 0.0f)
                          : basis.x;
  const Vec3f up = stretched.cross(level);
  t.y() = (1.0f - s) * std::sqrt(std::max(0.0f, 1.0f - t.x() * t.x())) + s * t.y();
  const float z = std::sqrt(std::max(0.0f, 1.0f - t.squaredNorm()));
  const Vec3f h = t.x() * level + t.y() * up + z * stretched;
  return Vec3f(alpha * h.x(), alpha * h.y(), std::max(1e-6f, h.z())).normalized();
}

inline float ggx_visible_normal_density(const Vec3f& w, const Vec3f& h, float alpha) {
  const float w_dot_h = std::max(0.0f, w.dot(h));
  return ggx_distribution(h.z(), alpha) * w_dot_h / (w.z() * (1.0f + ggx_lambda(w.z(), alpha)));
}

/// Unpolarised reflectance of a smooth dielectric; cos_i > 0 on the incoming side, eta = index
/// behind over index in front. Returns 1 under total reflection.
inline float fresnel_dielectric(float cos_i, float eta) {
  const float sin2_t = std::max(0.0f, 1.0f - cos_i * cos_i) / (eta * eta);
  if (sin2_t >= 1.0f) return 1.0f;
  const float cos_t = std::sqrt(1.0f - sin2_t);
  const float parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
  const float perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
  return 0.5f * (parallel * parallel + perpendicular * perpendicular);
}

/// (1 - cos)^5 of Schlick's approximation.
inline float schlick_weight(float cos_theta) {
  const float m = std::clamp(1.0f - cos_theta, 0.0f, 1.0f);
  const float m2 = m * m;
  return m2 * m2 * m;
}

/// Weight of a sample of density `own` against another technique's density (Veach's power
/// heuristic).
inline float mis_weight(float own, float other) {
  if (std::isinf(own)) return 1.0f;
  const float ratio = other / own;
  return 1.0f / (1.0f + ratio * ratio);
}

}  // namespace diorama
