// SPDX-License-Identifier: Apache-2.0
#include "albedo_tables.h"

#include <algorithm>
#include <numeric>

namespace diorama {
namespace {

constexpr std::size_t kPoints = 1024;  // of the numeric integrals

/// Tables are denser where things bend: at grazing angles and low roughness.
float squared_node(int i, int size) {
  const float x = float(i) / float(size - 1);
  return std::max(1e-3f, x * x);
}
float node_alpha(int i, int size) { return std::max(kMinAlpha, squared_node(i, size)); }

/// Mean over the hemisphere weighted by the cosine.
template <class Albedo>
float hemispherical_mean(Albedo&& albedo) {
  constexpr int kSteps = 1024;
  double sum = 0.0;
  for (int i = 0; i < kSteps; ++i) {
    sum += double(albedo(std::sqrt((float(i) + 0.5f) / float(kSteps))));
  }
  return float(sum / kSteps);
}

/// Points of the unit square by an additive recurrence of two dimensions (Roberts 2018): fine along
/// every radius of the disk, which a square grid is not.
struct SpreadPoints {
  std::array<float, kPoints> x;
  std::array<float, kPoints> y;

  SpreadPoints() {
    for (std::size_t i = 0; i < kPoints; ++i) {
      const double u = 0.5 + double(i) * 0.75487766624669276;
      const double v = 0.5 + double(i) * 0.56984029099805327;
      x[i] = float(u - std::floor(u));
      y[i] = float(v - std::floor(v));
    }
  }
  Vec2f operator[](std::size_t i) const { return {x[i], y[i]}; }
};

const SpreadPoints& spread_points() {
  static const SpreadPoints points;
  return points;
}

Vec3f direction_at(float cos_theta) {
  return {std::sqrt(std::max(0.0f, 1.0f - cos_theta * cos_theta)), 0.0f, cos_theta};
}

/// Split albedo of a conductor seen through something that lets pass(cos_i) of it through.
template <class Pass>
AlbedoTables::Split conductor_albedo(float cos_theta, float alpha, Pass&& pass) {
  const Vec3f wo = direction_at(cos_theta);
  const SpreadPoints& points = spread_points();
  // Sums side by side: vector code, in an order that no compiler changes.
  constexpr std::size_t kSums = 8;
  std::array<float, kSums> a{};
  std::array<float, kSums> b{};
  for (std::size_t i = 0; i < kPoints; i += kSums) {
    for (std::size_t k = 0; k < kSums; ++k) {
      const Vec3f h = ggx_visible_normal(wo, alpha, points[i + k]);
      const Vec3f wi = mirrored(wo, h);
      const float cos_i = std::max(wi.z(), 1e-6f);
      const float share =
          select(wi.z() > 0.0f, ggx_shadowing(wo.z(), cos_i, alpha) * pass(cos_i), 0.0f);
      const float weight = schlick_weight(wo.dot(h));
      a[k] += share * (1.0f - weight);
      b[k] += share * weight;
    }
  }
  const auto mean = [](const auto& sums) {
    return std::accumulate(sums.begin(), sums.end(), 0.0f) / float(kPoints);
  };
  return {mean(a), mean(b)};
}

float glass_albedo(float cos_theta, float alpha, float eta) {
  const Vec3f wo = direction_at(cos_theta);
  const SpreadPoints& points = spread_points();
  float sum = 0.0f;
  for (std::size_t i = 0; i < kPoints; ++i) {
    const Vec3f h = ggx_visible_normal(wo, alpha, points[i]);
    const float f = fresnel_dielectric(wo.dot(h), eta);
    const Vec3f back = mirrored(wo, h);
    if (back.z() > 0.0f) sum += f * ggx_shadowing(wo.z(), back.z(), alpha);
    const Vec3f bent = refracted(wo, h, eta);
    if (bent.z() < 0.0f) sum += (1.0f - f) * ggx_transmitted_shadowing(bent.z(), alpha);
  }
  return std::min(sum / float(kPoints), 0.9999f);
}

}  // namespace

AlbedoTables::Row::Row(float alpha) {
  for (std::size_t i = 0; i < kSize; ++i) {
    const float cosine = squared_node(int(i), int(kSize));
    nodes_[i] = conductor_albedo(cosine, alpha, [](float) { return 1.0f; });
  }
}

AlbedoTables::Split AlbedoTables::Row::at(float cos_theta) const {
  const float x = std::sqrt(std::clamp(cos_theta, 0.0f, 1.0f)) * float(kSize - 1);
  const std::size_t i = std::min(std::size_t(x), kSize - 2);
  const float t = x - float(i);
  const Split& p = nodes_[i];
  const Split& q = nodes_[i + 1];
  return {p.a + (q.a - p.a) * t, p.b + (q.b - p.b) * t};
}

LayerTable::LayerTable(AlbedoTables& tables, const Layers& layers, std::optional<float> alpha) {
  if (alpha) {
    add_row(tables, layers, *alpha);
    return;
  }
  for (int i = 0; i < kRows; ++i) add_row(tables, layers, node_alpha(i, kRows));
}

void LayerTable::add_row(AlbedoTables& tables, const Layers& layers, float alpha) {
  const AlbedoTables::Row* coat_row = layers.coat > 0.0f ? &tables.row(layers.coat_alpha) : nullptr;
  const auto coat_at = [&](float cosine) {
    if (!coat_row) return 0.0f;
    const AlbedoTables::Split e = coat_row->at(cosine);
    return layers.coat * (kCoatF0 * e.a + e.b);
  };
  const std::size_t begin = nodes_.size();
  for (int i = 0; i < kNodes; ++i) {
    const float cosine = squared_node(i, kNodes);
    const float coat = coat_at(cosine);
    // Reciprocal, and exact for smooth layers, whose light leaves at the angle of its arrival.
    const auto pass = [&](float cos_i) { return 1.0f - std::max(coat, coat_at(cos_i)); };
    const AlbedoTables::Split e =
        coat_row ? conductor_albedo(cosine, alpha, pass) : tables.row(alpha).at(cosine);
    nodes_.emplace_back(e.a, e.b, coat, 0.0f);
  }
  Row row;
  row.low_ = row.high_ = &nodes_[begin];
  Means means;
  means.missing = hemispherical_mean([&](float c) { return missing(row.at(c)); });
  const float single = hemispherical_mean([&](float c) { return row.at(c)[0] + row.at(c)[1]; });
  means.kept = single / (single + means.missing);
  means.plastic = between_facets(layers.f0, means.kept);
  for (std::size_t i = begin; i < nodes_.size(); ++i) {
    Node& n = nodes_[i];
    n[3] = n[2] + layers.specular * (layers.f0 * n[0] + n[1] + means.plastic * missing(n));
  }
  means.above = hemispherical_mean([&](float c) { return row.at(c)[3]; });
  means_.push_back(means);
}

GlassTable::GlassTable(float eta, std::optional<float> alpha)
    : eta_(eta), rows_(alpha ? (*alpha > kSmoothAlpha ? 1 : 0) : kRows) {
  for (int side = 0; side < 2; ++side) {
    for (int y = 0; y < rows_; ++y) {
      const float row_alpha = alpha ? *alpha : node_alpha(y, kRows);
      for (int x = 0; x < kNodes; ++x) {
        directional_.push_back(
            glass_albedo(squared_node(x, kNodes), row_alpha, side == 0 ? eta_ : 1.0f / eta_));
      }
    }
  }
  for (int side = 0; side < 2; ++side) {
    for (int y = 0; y < rows_; ++y) {
      const float row_alpha = alpha ? *alpha : node_alpha(y, kRows);
      mean_.push_back(hemispherical_mean([&](float c) { return at(side, c, row_alpha); }));
    }
  }
}

std::size_t GlassTable::row_of(int side, float alpha, float& rest) const {
  rest = 0.0f;
  if (rows_ == 1) return std::size_t(side);
  const float x = std::min(std::sqrt(alpha), 1.0f) * float(rows_ - 1);
  const int i = std::min(int(x), rows_ - 2);
  rest = x - float(i);
  return std::size_t(side * rows_ + i);
}

float GlassTable::at(int side, float cos_theta, float alpha) const {
  float rest;
  const float* row = &directional_[row_of(side, alpha, rest) * kNodes];
  const float x = std::sqrt(std::clamp(cos_theta, 0.0f, 1.0f)) * float(kNodes - 1);
  const int i = std::min(int(x), kNodes - 2);
  const float t = x - float(i);
  const float low = row[i] + (row[i + 1] - row[i]) * t;
  if (rest == 0.0f) return low;
  const float* next = row + kNodes;
  return low + (next[i] + (next[i + 1] - next[i]) * t - low) * rest;
}

float GlassTable::mean(int side, float alpha) const {
  float rest;
  const std::size_t row = row_of(side, alpha, rest);
  return rest == 0.0f ? mean_[row] : mean_[row] + (mean_[row + 1] - mean_[row]) * rest;
}

}  // namespace diorama
