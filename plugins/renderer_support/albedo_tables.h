// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <vector>

#include "microfacet.h"

namespace diorama {

/// How much light one rough interface returns under uniform light, by single scattering between its
/// microfacets (GGX). `cos` and alpha in (0, 1]. Schlick's F splits the albedo: E = f0 a + f90 b.
class AlbedoTables {
 public:
  struct Split {
    float a = 0.0f;
    float b = 0.0f;
  };
  /// One roughness.
  class Row {
   public:
    explicit Row(float alpha);
    Split at(float cos_theta) const;

   private:
    static constexpr std::size_t kSize = 32;
    std::array<Split, kSize> nodes_;  ///< Over the square root of the cosine.
  };
  /// Made when it is first asked for; stays where it is.
  const Row& row(float alpha) { return rows_.try_emplace(alpha, alpha).first->second; }
  /// Forgets all rows if there are more.
  void forget_beyond(std::size_t most_rows) {
    if (rows_.size() > most_rows) rows_.clear();
  }
  std::size_t row_count() const { return rows_.size(); }

 private:
  std::map<float, Row> rows_;
};

/// What the layers of one material return to a direction, tabulated when the material is made: a
/// clear coat, below it metal, or a dielectric interface over a diffuse base. The numbers conserve
/// energy: what neither coat nor facets return at once (`missing`) leaves by a lobe of its own
/// (Kulla and Conty 2017), and the diffuse base gets what is left above it.
class LayerTable {
 public:
  struct Layers {
    float f0 = 0.04f;       ///< Of the dielectric interface below the coat.
    float specular = 1.0f;  ///< Its weight.
    float coat = 0.0f;      ///< Weight of the clear coat.
    float coat_alpha = kMinAlpha;
    auto operator<=>(const Layers&) const = default;
  };

  /// For one direction: [0], [1] the interface's split albedo as it shows through the coat; [2] the
  /// coat's; [3] all that the dielectric returns above its diffuse base.
  using Node = Eigen::Array4f;
  static float missing(const Node& n) { return std::max(0.0f, 1.0f - n[0] - n[1] - n[2]); }

  /// For one roughness: what has no direction.
  struct Means {
    float kept = 1.0f;     ///< Share of the light below the coat that single scattering returns.
    float plastic = 0.0f;  ///< Colour of the dielectric's light scattered between facets.
    float missing = 0.0f;  ///< Cosine-weighted means over the hemisphere.
    float above = 0.0f;
  };

  /// The table at one roughness.
  class Row {
   public:
    explicit operator bool() const { return low_ != nullptr; }
    /// Any number will do: who looks up many at once has some that nobody asks for.
    Node at(float cos_theta) const {
      const float x = std::sqrt(std::max(0.0f, cos_theta)) * float(kNodes - 1);
      const int i = int(std::min(x, float(kNodes - 2)));
      const float t = x - float(i);
      const Node low = low_[i] + (low_[i + 1] - low_[i]) * t;
      if (rest_ == 0.0f) return low;
      const Node high = high_[i] + (high_[i + 1] - high_[i]) * t;
      return low + (high - low) * rest_;
    }
    const Means& means() const { return means_; }

   private:
    friend class LayerTable;
    const Node* low_ = nullptr;
    const Node* high_ = nullptr;
    float rest_ = 0.0f;
    Means means_;
  };

  /// For one alpha, or for all of them (textured roughness).
  LayerTable(AlbedoTables& tables, const Layers& layers, std::optional<float> alpha);

  /// The nodes row by row, and the means of the rows: one row, or one per node of alpha.
  const std::vector<Node>& nodes() const { return nodes_; }
  const std::vector<Means>& means() const { return means_; }

  /// `alpha` does not count in a table for one alpha.
  Row row(float alpha) const {
    Row row;
    row.low_ = row.high_ = nodes_.data();
    if (means_.size() == 1) {
      row.means_ = means_[0];
      return row;
    }
    const float x = std::min(std::sqrt(alpha), 1.0f) * float(kRows - 1);
    const int i = std::min(int(x), kRows - 2);
    row.rest_ = x - float(i);
    row.low_ += i * kNodes;
    row.high_ = row.low_ + kNodes;
    const Means& p = means_[std::size_t(i)];
    const Means& q = means_[std::size_t(i) + 1];
    const auto mix = [&](float from, float to) { return from + (to - from) * row.rest_; };
    row.means_ = {mix(p.kept, q.kept), mix(p.plastic, q.plastic), mix(p.missing, q.missing),
                  mix(p.above, q.above)};
    return row;
  }

 private:
  static constexpr int kNodes = 32;  ///< Over the square root of the cosine.
  static constexpr int kRows = 32;   ///< Over the square root of alpha.

  void add_row(AlbedoTables& tables, const Layers& layers, float alpha);

  std::vector<Node> nodes_;
  std::vector<Means> means_;
};

/// The single-scatter albedo of one rough interface between two dielectrics, reflection and
/// transmission together, for light from in front (side 0) and from behind (1).
class GlassTable {
 public:
  /// For one alpha, or for all of them (textured roughness). Smooth glass needs no numbers.
  GlassTable(float eta, std::optional<float> alpha);

  float eta() const { return eta_; }
  /// Rows per side; the albedos of both sides, row by row; and their means.
  int rows() const { return rows_; }
  const std::vector<float>& directional() const { return directional_; }
  const std::vector<float>& means() const { return mean_; }
  float at(int side, float cos_theta, float alpha) const;
  /// Cosine-weighted mean over the hemisphere.
  float mean(int side, float alpha) const;

 private:
  static constexpr int kNodes = 48;
  static constexpr int kRows = 24;
  std::size_t row_of(int side, float alpha, float& rest) const;

  float eta_;
  int rows_;
  std::vector<float> directional_;  ///< [side][alpha][cos]
  std::vector<float> mean_;
};

}  // namespace diorama
