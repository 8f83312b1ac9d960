// SPDX-License-Identifier: Apache-2.0
#include "hull_shape.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>

namespace diorama {
namespace {

constexpr std::size_t kLanes = 8;

// As wide as the instruction set.
template <int kWide>
struct Wide {
  using Numbers [[gnu::vector_size(8 * kWide)]] = double;
  /// The same anywhere in memory.
  using Loose [[gnu::vector_size(8 * kWide), gnu::aligned(8), gnu::may_alias]] = double;
  using Places [[gnu::vector_size(8 * kWide)]] = std::int64_t;
};

/// The first of the points that are farthest along the direction. Sums are made in the order in
/// which Bullet makes them.
template <int kWide>
[[gnu::always_inline]] inline std::size_t first_farthest(const double* columns, std::size_t count,
                                                         const btVector3& direction) {
  using Numbers = typename Wide<kWide>::Numbers;
  using Loose = typename Wide<kWide>::Loose;
  using Places = typename Wide<kWide>::Places;
  const double dx = direction.x();
  const double dy = direction.y();
  const double dz = direction.z();
  Numbers most = Numbers{} - std::numeric_limits<double>::infinity();
  Places places{};
  for (std::size_t group = 0; group < count; group += kLanes, columns += 3 * kLanes) {
    for (std::size_t part = 0; part < kLanes; part += kWide) {
      const Numbers x = *reinterpret_cast<const Loose*>(columns + part);
      const Numbers y = *reinterpret_cast<const Loose*>(columns + kLanes + part);
      const Numbers z = *reinterpret_cast<const Loose*>(columns + 2 * kLanes + part);
      const Numbers along = x * dx + y * dy + z * dz;
      const auto is_farther = along > most;
      most = is_farther ? along : most;
      places = is_farther ? Places{} + std::int64_t(group + part) : places;
    }
  }
  std::size_t first = 0;
  double farthest = -std::numeric_limits<double>::infinity();
  for (int lane = 0; lane < kWide; ++lane) {
    const auto place = std::size_t(places[lane] + lane);
    if (most[lane] > farthest || (most[lane] == farthest && place < first)) {
      farthest = most[lane];
      first = place;
    }
  }
  return first;
}

using Farthest = std::size_t (*)(const double*, std::size_t, const btVector3&);

std::size_t farthest_of_2(const double* columns, std::size_t count, const btVector3& direction) {
  return first_farthest<2>(columns, count, direction);
}
[[gnu::target("avx2")]] std::size_t farthest_of_4(const double* columns, std::size_t count,
                                                  const btVector3& direction) {
  return first_farthest<4>(columns, count, direction);
}
[[gnu::target("avx512f,avx512dq,avx512vl")]] std::size_t farthest_of_8(const double* columns,
                                                                       std::size_t count,
                                                                       const btVector3& direction) {
  return first_farthest<8>(columns, count, direction);
}

Farthest farthest_here() {
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512vl")) {
    return farthest_of_8;
  }
  return __builtin_cpu_supports("avx2") ? farthest_of_4 : farthest_of_2;
}

const Farthest kFarthest = farthest_here();

}  // namespace

HullShape::HullShape(const std::vector<btVector3>& points, double margin) {
  m_shapeType = kShapeType;
  // Before the points: the shape keeps a box that includes the margin.
  setMargin(margin);
  for (const btVector3& point : points) addPoint(point, false);
  columns_.resize((points.size() + kLanes - 1) / kLanes * kLanes * 3);
  for (std::size_t i = 0; i < columns_.size() / 3; ++i) {
    const btVector3& point = points[i < points.size() ? i : 0];
    double* const group = &columns_[i / kLanes * kLanes * 3 + i % kLanes];
    for (int axis = 0; axis < 3; ++axis) group[std::size_t(axis) * kLanes] = point[axis];
  }
  recalcLocalAabb();
}

btVector3 HullShape::localGetSupportingVertexWithoutMargin(const btVector3& direction) const {
  if (columns_.empty()) return {0.0, 0.0, 0.0};
  const std::size_t place = kFarthest(columns_.data(), columns_.size() / 3, direction);
  return getUnscaledPoints()[place];
}

}  // namespace diorama
