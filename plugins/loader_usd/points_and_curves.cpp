// SPDX-License-Identifier: Apache-2.0
#include "loader_usd/points_and_curves.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "loader_usd/usd/geometry.h"

namespace diorama::loader_usd {
namespace {

using usd::Prim;
using usd::Stage;

// A mesh that is worth half a gigabyte is too much for dust and hair.
constexpr std::size_t kMostTriangles = 8'000'000;
constexpr const char* kNoWidths = "without widths";
constexpr const char* kTooMany = "with too many points";
constexpr const char* kTooFewWidths = "has fewer widths than points, of which the rest is left out";

bool is_finite(const float* p) {
  return std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]);
}

Vec3f to_vector(const float* p) { return p ? Vec3f(p[0], p[1], p[2]) : Vec3f(Vec3f::Ones()); }

// --- Points -----------------------------------------------------------------------------------

// An octahedron, each of whose triangles is split into four `splits` times; of radius one.
Mesh make_ball(int splits) {
  Mesh ball;
  for (const float sign : {1.0f, -1.0f}) {
    for (int axis = 0; axis < 3; ++axis) ball.positions.push_back(sign * Vec3f::Unit(axis));
  }
  ball.triangles = {{0, 1, 2}, {1, 3, 2}, {3, 4, 2}, {4, 0, 2},
                    {1, 0, 5}, {3, 1, 5}, {4, 3, 5}, {0, 4, 5}};
  for (int i = 0; i < splits; ++i) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middles;
    const auto middle = [&](std::uint32_t a, std::uint32_t b) {
      const auto [entry, is_new] =
          middles.try_emplace(std::minmax(a, b), std::uint32_t(ball.positions.size()));
      if (is_new) {
        ball.positions.push_back((ball.positions[a] + ball.positions[b]).normalized());
      }
      return entry->second;
    };
    std::vector<std::array<std::uint32_t, 3>> finer;
    for (const auto& [a, b, c] : ball.triangles) {
      const std::uint32_t ab = middle(a, b);
      const std::uint32_t bc = middle(b, c);
      const std::uint32_t ca = middle(c, a);
      finer.insert(finer.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
    }
    ball.triangles = std::move(finer);
  }
  return ball;
}

int splits_for(std::size_t points) {
  if (points <= 5'000) return 2;
  return points <= 50'000 ? 1 : 0;
}

// --- Curves -----------------------------------------------------------------------------------

using Weights = std::array<double, 4>;

Weights weights_of(const std::string& basis, double t) {
  const double t2 = t * t;
  const double t3 = t2 * t;
  const double s = 1.0 - t;
  if (basis == "bspline") {
    return {s * s * s / 6.0, (3.0 * t3 - 6.0 * t2 + 4.0) / 6.0,
            (-3.0 * t3 + 3.0 * t2 + 3.0 * t + 1.0) / 6.0, t3 / 6.0};
  }
  if (basis == "catmullRom") {
    return {(-t3 + 2.0 * t2 - t) / 2.0, (3.0 * t3 - 5.0 * t2 + 2.0) / 2.0,
            (-3.0 * t3 + 4.0 * t2 + t) / 2.0, (t3 - t2) / 2.0};
  }
  return {s * s * s, 3.0 * t * s * s, 3.0 * t2 * s, t3};  // bezier
}

// How finely tubes are made.
struct Detail {
  int sides;
  int steps;  // of each cubic segment
};
constexpr Detail kDetails[] = {{12, 16}, {6, 6}, {4, 3}, {3, 2}};

// What the curves of a prim have in common.
struct CurveKind {
  bool is_linear = false;
  bool is_periodic = false;
  bool is_pinned = false;
  std::string basis;

  // Segments of a curve of that many points.
  std::size_t segments(std::size_t points) const {
    if (is_linear) return points < 2 ? 0 : points - 1 + (is_periodic ? 1 : 0);
    if (basis == "bezier") return is_periodic ? points / 3 : points < 4 ? 0 : (points - 1) / 3;
    if (is_periodic) return points < 3 ? 0 : points;
    if (is_pinned) return points < 2 ? 0 : points - 1;
    return points < 4 ? 0 : points - 3;
  }
  // The first of a segment's control points; pinned curves begin with one more than they have.
  std::ptrdiff_t first_point(std::size_t segment) const {
    if (is_linear) return std::ptrdiff_t(segment);
    if (basis == "bezier") return std::ptrdiff_t(3 * segment);
    return std::ptrdiff_t(segment) - (is_pinned ? 1 : 0);
  }
};

CurveKind kind_of(const Stage& stage, const Prim& prim) {
  CurveKind kind;
  kind.is_linear = usd::token_or(stage, prim, "type", "cubic") == "linear";
  kind.basis = usd::token_or(stage, prim, "basis", "bezier");
  const std::string wrap = usd::token_or(stage, prim, "wrap", "nonperiodic");
  kind.is_periodic = wrap == "periodic";
  kind.is_pinned = wrap == "pinned" && !kind.is_linear && kind.basis != "bezier";
  return kind;
}

// One curve's part of the prim's data.
struct CurvePart {
  std::size_t number = 0;
  std::size_t first_point = 0;
  std::size_t points = 0;
  std::size_t first_varying = 0;  // a value per end of a segment
};

// A place on a curve: weighted control points, between two ends of segments.
struct Place {
  std::array<std::ptrdiff_t, 4> points{};
  Weights weights{};
  std::size_t segment = 0;
  double t = 0.0;
};

class TubeBuilder {
 public:
  TubeBuilder(const CurveKind& kind, const float* points, const CornerData& widths,
              const CornerData* colors, Detail detail)
      : kind_(kind), points_(points), widths_(widths), colors_(colors), detail_(detail) {}

  /// False when it has points that are not finite; then nothing is added.
  bool add(const CurvePart& curve);
  Mesh take() { return std::move(mesh_); }

 private:
  struct Sample {
    Vec3 centre;
    double radius;
    Vec3 color;
  };
  static constexpr double kLeastStep = 1e-12;

  Place place_at(std::size_t segment, double t) const;
  Vec3 position_at(const CurvePart& curve, const Place& place) const;
  /// Three equal numbers where the data have but one.
  Vec3 value_at(const CornerData& data, const CurvePart& curve, const Place& place) const;
  std::vector<Sample> sample(const CurvePart& curve) const;
  Vec3 direction(const std::vector<Sample>& samples, std::size_t i) const;
  void add_ring(const Sample& sample, const Vec3& x, const Vec3& y);
  void add_cap(const Vec3& centre, std::uint32_t ring, const Vec3& outward, bool is_start);

  const CurveKind& kind_;
  const float* points_;
  const CornerData& widths_;
  const CornerData* colors_;
  Detail detail_;
  Mesh mesh_;
};

Place TubeBuilder::place_at(std::size_t segment, double t) const {
  Place place;
  place.segment = segment;
  place.t = t;
  place.weights = kind_.is_linear ? Weights{1.0 - t, t, 0.0, 0.0} : weights_of(kind_.basis, t);
  const std::ptrdiff_t first = kind_.first_point(segment);
  for (std::size_t i = 0; i < 4; ++i) place.points[i] = first + std::ptrdiff_t(i);
  return place;
}

// Weighs control values. Those before the first and behind the last one of a pinned curve continue
// it straight on.
template <class Value, class Get>
Value weigh(const Place& place, std::size_t count, bool is_periodic, const Get& get) {
  const auto n = std::ptrdiff_t(count);
  Value sum = Value::Zero();
  for (std::size_t i = 0; i < 4; ++i) {
    if (place.weights[i] == 0.0) continue;
    std::ptrdiff_t k = place.points[i];
    Value value;
    if (is_periodic) {
      value = get(std::size_t((k % n + n) % n));
    } else if (k < 0) {
      value = 2.0 * get(0) - get(1);
    } else if (k >= n) {
      value = 2.0 * get(std::size_t(n - 1)) - get(std::size_t(n - 2));
    } else {
      value = get(std::size_t(k));
    }
    sum += place.weights[i] * value;
  }
  return sum;
}

Vec3 TubeBuilder::position_at(const CurvePart& curve, const Place& place) const {
  return weigh<Vec3>(place, curve.points, kind_.is_periodic, [&](std::size_t k) -> Vec3 {
    return to_vector(points_ + 3 * (curve.first_point + k)).cast<double>();
  });
}

Vec3 TubeBuilder::value_at(const CornerData& data, const CurvePart& curve,
                           const Place& place) const {
  const auto get = [&](std::size_t i) -> Vec3 {
    const float* value = data.element(i);
    if (!value) return Vec3::Zero();
    return data.width == 1 ? Vec3::Constant(value[0]) : Vec3(value[0], value[1], value[2]);
  };
  switch (data.interpolation) {
    case Interpolation::Uniform:
      return get(curve.number);
    case Interpolation::Vertex:
      return weigh<Vec3>(place, curve.points, kind_.is_periodic,
                         [&](std::size_t k) { return get(curve.first_point + k); });
    case Interpolation::Varying:
    case Interpolation::FaceVarying: {
      const std::size_t ends = kind_.segments(curve.points) + (kind_.is_periodic ? 0 : 1);
      const std::size_t next = (place.segment + 1) % ends;
      return (1.0 - place.t) * get(curve.first_varying + place.segment) +
             place.t * get(curve.first_varying + next);
    }
    default:
      return get(0);
  }
}

void TubeBuilder::add_ring(const Sample& sample, const Vec3& x, const Vec3& y) {
  for (int i = 0; i < detail_.sides; ++i) {
    const double angle = 2.0 * kPi * i / detail_.sides;
    const Vec3 outward = std::cos(angle) * x + std::sin(angle) * y;
    mesh_.positions.push_back((sample.centre + sample.radius * outward).cast<float>());
    mesh_.normals.push_back(outward.cast<float>());
    if (colors_) mesh_.colors.push_back(sample.color.cast<float>());
  }
}

// A disc over a ring, with vertices of its own for the sake of its normal.
void TubeBuilder::add_cap(const Vec3& centre, std::uint32_t ring, const Vec3& outward,
                          bool is_start) {
  const auto sides = std::uint32_t(detail_.sides);
  const auto first = std::uint32_t(mesh_.positions.size());
  for (std::uint32_t i = 0; i <= sides; ++i) {
    const Vec3f position = i < sides ? mesh_.positions[ring + i] : Vec3f(centre.cast<float>());
    mesh_.positions.push_back(position);
    mesh_.normals.push_back(outward.cast<float>());
    if (colors_) mesh_.colors.push_back(Vec3f(mesh_.colors[ring]));
  }
  for (std::uint32_t i = 0; i < sides; ++i) {
    const std::uint32_t a = first + i;
    const std::uint32_t b = first + (i + 1) % sides;
    if (is_start) {
      mesh_.triangles.push_back({first + sides, b, a});
    } else {
      mesh_.triangles.push_back({first + sides, a, b});
    }
  }
}

std::vector<TubeBuilder::Sample> TubeBuilder::sample(const CurvePart& curve) const {
  std::vector<Sample> samples;
  const std::size_t segments = kind_.segments(curve.points);
  const auto add_sample = [&](std::size_t segment, double t) {
    const Place place = place_at(segment, t);
    const Vec3 centre = position_at(curve, place);
    // Between points at the same place there is no direction.
    if (!samples.empty() && (centre - samples.back().centre).norm() < kLeastStep) return;
    const double width = value_at(widths_, curve, place).x();
    const Vec3 color = colors_ ? value_at(*colors_, curve, place) : Vec3(Vec3::Ones());
    samples.push_back({centre, std::isfinite(width) ? 0.5 * std::abs(width) : 0.0, color});
  };
  const int steps = kind_.is_linear ? 1 : detail_.steps;
  for (std::size_t segment = 0; segment < segments; ++segment) {
    for (int step = 0; step < steps; ++step) add_sample(segment, double(step) / steps);
  }
  if (segments > 0) add_sample(segments - 1, 1.0);
  return samples;
}

// Along the tube, by its neighbours; a periodic tube ends where it begins.
Vec3 TubeBuilder::direction(const std::vector<Sample>& samples, std::size_t i) const {
  const std::size_t last = samples.size() - 1;
  const std::size_t before = i > 0 ? i - 1 : kind_.is_periodic ? last - 1 : 0;
  const std::size_t after = i < last ? i + 1 : kind_.is_periodic ? 1 : last;
  const Vec3 step = samples[after].centre - samples[before].centre;
  return step.norm() > 0.0 ? Vec3(step.normalized()) : Vec3(Vec3::UnitZ());
}

bool TubeBuilder::add(const CurvePart& curve) {
  for (std::size_t i = 0; i < curve.points; ++i) {
    if (!is_finite(points_ + 3 * (curve.first_point + i))) return false;
  }
  const std::vector<Sample> samples = sample(curve);
  if (samples.size() < 2) return true;
  const auto rings = std::uint32_t(samples.size());
  const auto sides = std::uint32_t(detail_.sides);
  const auto first = std::uint32_t(mesh_.positions.size());
  Vec3 along = direction(samples, 0);
  Vec3 x = along.unitOrthogonal();
  for (std::size_t i = 0; i < samples.size(); ++i) {
    // The frame is carried along without twist.
    const Vec3 next = direction(samples, i);
    x = Quat::FromTwoVectors(along, next) * x;
    x = (x - x.dot(next) * next).normalized();
    along = next;
    add_ring(samples[i], x, along.cross(x));
  }
  for (std::uint32_t i = 0; i + 1 < rings; ++i) {
    for (std::uint32_t k = 0; k < sides; ++k) {
      const std::uint32_t a = first + i * sides + k;
      const std::uint32_t b = first + i * sides + (k + 1) % sides;
      mesh_.triangles.push_back({a, b, b + sides});
      mesh_.triangles.push_back({a, b + sides, a + sides});
    }
  }
  if (kind_.is_periodic) return true;
  add_cap(samples.front().centre, first, -direction(samples, 0), true);
  add_cap(samples.back().centre, first + (rings - 1) * sides, along, false);
  return true;
}

std::vector<CurvePart> parts_of(const CurveKind& kind, std::span<const std::int32_t> counts,
                                std::size_t points) {
  std::vector<CurvePart> parts;
  CurvePart next;
  for (const std::int32_t count : counts) {
    if (count < 0 || static_cast<std::size_t>(count) > points - next.first_point) break;
    next.points = static_cast<std::size_t>(count);
    parts.push_back(next);
    ++next.number;
    next.first_point += next.points;
    next.first_varying += kind.segments(next.points) + (kind.is_periodic ? 0 : 1);
  }
  return parts;
}

}  // namespace

ThinMesh mesh_of_points(const Stage& stage, const Prim& prim, const CornerData* widths,
                        const CornerData* colors) {
  ThinMesh result;
  const auto points = usd::numbers<float>(stage.value(prim, "points"), 3);
  const std::size_t count = points ? points->span.size() / 3 : 0;
  if (count == 0) return result;
  const Mesh ball = make_ball(splits_for(count));
  if (!widths) result.lacks = kNoWidths;
  if (count * ball.triangles.size() > kMostTriangles) result.lacks = kTooMany;
  if (!result.lacks.empty()) return result;
  Mesh& mesh = result.mesh;
  for (std::size_t i = 0; i < count; ++i) {
    const float* point = points->span.data() + 3 * i;
    const float* width = widths->at(0, i, i);
    if (!width) result.losses.insert(kTooFewWidths);
    if (!is_finite(point)) {
      result.losses.insert("has points that are not finite, which are left out");
    }
    const bool is_drawn = width && std::isfinite(*width) && *width > 0.0f && is_finite(point);
    if (!is_drawn) continue;
    const auto first = std::uint32_t(mesh.positions.size());
    for (const Vec3f& direction : ball.positions) {
      mesh.positions.push_back(to_vector(point) + 0.5f * *width * direction);
      mesh.normals.push_back(direction);
      if (colors) mesh.colors.push_back(to_vector(colors->at(0, i, i)));
    }
    for (const auto& [a, b, c] : ball.triangles) {
      mesh.triangles.push_back({first + a, first + b, first + c});
    }
  }
  return result;
}

ThinMesh mesh_of_curves(const Stage& stage, const Prim& prim, const CornerData* widths,
                        const CornerData* colors) {
  ThinMesh result;
  const auto points = usd::numbers<float>(stage.value(prim, "points"), 3);
  const auto counts = usd::numbers<std::int32_t>(stage.value(prim, "curveVertexCounts"), 1);
  if (!points || !counts || counts->span.empty()) return result;
  if (!widths) {
    result.lacks = kNoWidths;
    return result;
  }
  const CurveKind kind = kind_of(stage, prim);
  const auto parts = parts_of(kind, counts->span, points->span.size() / 3);
  std::size_t segments = 0;
  for (const CurvePart& part : parts) segments += kind.segments(part.points);
  const auto triangles = [&](const Detail& detail) {
    const auto steps = static_cast<std::size_t>(kind.is_linear ? 1 : detail.steps);
    return (segments * steps + parts.size()) * static_cast<std::size_t>(2 * detail.sides);
  };
  const Detail* detail = std::begin(kDetails);
  // The finest is for few curves only.
  while (detail != std::end(kDetails) && triangles(*detail) > kMostTriangles / 8) ++detail;
  if (detail == std::end(kDetails)) --detail;
  if (triangles(*detail) > kMostTriangles) {
    result.lacks = kTooMany;
    return result;
  }
  TubeBuilder builder(kind, points->span.data(), *widths, colors, *detail);
  for (const CurvePart& part : parts) {
    if (builder.add(part)) continue;
    result.losses.insert("has curves with points that are not finite, which are left out");
  }
  if (parts.size() < counts->span.size()) {
    result.losses.insert(
        "has a curve that reaches behind the points, from which on curves are "
        "left out");
  }
  result.mesh = builder.take();
  return result;
}

}  // namespace diorama::loader_usd
