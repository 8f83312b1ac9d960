// SPDX-License-Identifier: Apache-2.0
#include "modelling/shapes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace diorama::modelling {
namespace {

Vec2 box_uv(const Vec3& p, int face_axis, Axis grain) {
  const int a = (face_axis + 1) % 3;
  const int b = (face_axis + 2) % 3;
  // On faces across the grain either direction will do.
  return int(grain) == b ? Vec2(p[b], p[a]) : Vec2(p[a], p[b]);
}

/// Coordinates of the grid lines over one side: the rounded ends in equal angles.
std::vector<double> box_lines(double half, double bevel, int segments) {
  std::vector<double> lines;
  for (int i = 0; i <= segments; ++i) {
    lines.push_back(-half + bevel * (1 - std::tan(kPi / 4 * (segments - i) / segments)));
  }
  for (int i = segments; i >= 0; --i) lines.push_back(-lines[std::size_t(i)]);
  return lines;
}

using BoxUv = std::function<Vec2(const Vec3& point, int axis, double sign)>;

void add_box_face(MeshBuilder& builder, const Vec3& half, double bevel, int segments, int axis,
                  double sign, const BoxUv& uv) {
  const int a = (axis + 1) % 3;
  const int b = (axis + 2) % 3;
  const std::vector<double> lines_a = box_lines(half[a], bevel, segments);
  const std::vector<double> lines_b = box_lines(half[b], bevel, segments);
  const Vec3 inner = half - Vec3::Constant(bevel);
  const auto columns = std::uint32_t(lines_a.size());
  std::uint32_t first = 0;
  for (std::uint32_t j = 0; j < lines_b.size(); ++j) {
    for (std::uint32_t i = 0; i < columns; ++i) {
      Vec3 q;
      q[axis] = sign * half[axis];
      q[a] = lines_a[i];
      q[b] = lines_b[j];
      const Vec3 core = q.cwiseMax(-inner).cwiseMin(inner);
      const Vec3 normal = (q - core).normalized();
      const Vec3 point = core + bevel * normal;
      const std::uint32_t id = builder.add_vertex(point, normal, uv(point, axis, sign));
      if (i == 0 && j == 0) first = id;
    }
  }
  for (std::uint32_t j = 0; j + 1 < lines_b.size(); ++j) {
    for (std::uint32_t i = 0; i + 1 < columns; ++i) {
      const std::uint32_t v = first + j * columns + i;
      if (sign > 0) {
        builder.add_quad(v, v + 1, v + columns + 1, v + columns);
      } else {
        builder.add_quad(v, v + columns, v + columns + 1, v + 1);
      }
    }
  }
}

void add_box_faces(MeshBuilder& builder, const Vec3& size, double bevel, int segments,
                   const BoxUv& uv) {
  const double round = std::min(bevel, 0.45 * size.minCoeff());
  for (int axis = 0; axis < 3; ++axis) {
    add_box_face(builder, size / 2, round, segments, axis, 1.0, uv);
    add_box_face(builder, size / 2, round, segments, axis, -1.0, uv);
  }
}

/// Normal of a profile's segment: its right hand side.
Vec2 segment_normal(const ProfilePoint& a, const ProfilePoint& b) {
  return Vec2(b.z - a.z, -(b.r - a.r)).normalized();
}

struct LathePoint {
  ProfilePoint at;
  Vec2 normal;
  double length;
};

/// Splits the profile's points where it bends sharply: two entries per segment.
std::vector<LathePoint> lathe_points(std::span<const ProfilePoint> profile, double crease) {
  std::vector<LathePoint> points;
  const std::size_t count = profile.size();
  const bool is_ring =
      profile.front().r == profile.back().r && profile.front().z == profile.back().z;
  double length = 0.0;
  const auto normal_at = [&](std::size_t segment, bool at_end) {
    const Vec2 own = segment_normal(profile[segment], profile[segment + 1]);
    std::ptrdiff_t other = at_end ? std::ptrdiff_t(segment) + 1 : std::ptrdiff_t(segment) - 1;
    const auto segments = std::ptrdiff_t(count) - 1;
    if (is_ring) other = (other + segments) % segments;
    if (other < 0 || other >= segments) return own;
    const Vec2 next = segment_normal(profile[std::size_t(other)], profile[std::size_t(other) + 1]);
    return own.dot(next) > std::cos(crease) ? Vec2((own + next).normalized()) : own;
  };
  for (std::size_t i = 0; i + 1 < count; ++i) {
    const double step =
        std::hypot(profile[i + 1].r - profile[i].r, profile[i + 1].z - profile[i].z);
    if (step == 0.0) continue;
    points.push_back({profile[i], normal_at(i, false), length});
    length += step;
    points.push_back({profile[i + 1], normal_at(i, true), length});
  }
  return points;
}

void add_lathe_points(MeshBuilder& builder, std::span<const LathePoint> points, int segments,
                      const std::function<Vec2(double, const LathePoint&)>& uv) {
  for (std::size_t i = 0; i + 1 < points.size(); i += 2) {
    const LathePoint& low = points[i];
    const LathePoint& high = points[i + 1];
    std::uint32_t first = 0;
    for (int s = 0; s <= segments; ++s) {
      const double angle = 2 * kPi * s / segments;
      const double c = s == segments ? 1.0 : std::cos(angle);
      const double n = s == segments ? 0.0 : std::sin(angle);
      for (const LathePoint* p : {&low, &high}) {
        const std::uint32_t id =
            builder.add_vertex(Vec3(p->at.r * c, p->at.r * n, p->at.z),
                               Vec3(p->normal.x() * c, p->normal.x() * n, p->normal.y()),
                               uv(double(s) / segments, *p));
        if (s == 0 && p == &low) first = id;
      }
    }
    for (int s = 0; s < segments; ++s) {
      const std::uint32_t v = first + 2 * std::uint32_t(s);
      if (low.at.r > 0) builder.add_triangle(v, v + 2, v + 3);
      if (high.at.r > 0) builder.add_triangle(v, v + 3, v + 1);
    }
  }
}

double cross(const Vec2& a, const Vec2& b) { return a.x() * b.y() - a.y() * b.x(); }

bool is_inside(const Vec2& p, const Vec2& a, const Vec2& b, const Vec2& c) {
  return cross(b - a, p - a) >= 0 && cross(c - b, p - b) >= 0 && cross(a - c, p - c) >= 0;
}

/// Ear clipping (Meisters 1975); indices into the outline, which turns counter-clockwise.
std::vector<std::array<std::size_t, 3>> triangulate(std::span<const Vec2> outline) {
  std::vector<std::size_t> left(outline.size());
  for (std::size_t i = 0; i < left.size(); ++i) left[i] = i;
  std::vector<std::array<std::size_t, 3>> triangles;
  const auto is_ear = [&](std::size_t i) {
    const std::size_t n = left.size();
    const std::size_t a = left[(i + n - 1) % n];
    const std::size_t b = left[i];
    const std::size_t c = left[(i + 1) % n];
    if (cross(outline[b] - outline[a], outline[c] - outline[b]) <= 1e-14) return false;
    return std::none_of(left.begin(), left.end(), [&](std::size_t k) {
      return k != a && k != b && k != c &&
             is_inside(outline[k], outline[a], outline[b], outline[c]);
    });
  };
  while (left.size() > 3) {
    std::size_t ear = 0;
    while (ear < left.size() && !is_ear(ear)) ++ear;
    if (ear == left.size()) ear = 0;  // rounding: any corner will do
    const std::size_t n = left.size();
    triangles.push_back({left[(ear + n - 1) % n], left[ear], left[(ear + 1) % n]});
    left.erase(left.begin() + std::ptrdiff_t(ear));
  }
  triangles.push_back({left[0], left[1], left[2]});
  return triangles;
}

/// The outline moved inwards by `inset`, corners mitred.
std::vector<Vec2> inset_outline(std::span<const Vec2> outline, double inset) {
  std::vector<Vec2> result;
  const std::size_t n = outline.size();
  for (std::size_t i = 0; i < n; ++i) {
    const Vec2 before = (outline[i] - outline[(i + n - 1) % n]).normalized();
    const Vec2 after = (outline[(i + 1) % n] - outline[i]).normalized();
    const Vec2 left_before(-before.y(), before.x());
    const Vec2 left_after(-after.y(), after.x());
    const Vec2 bisector = (left_before + left_after).normalized();
    const double stretch = 1.0 / std::max(0.35, bisector.dot(left_after));
    result.push_back(outline[i] + inset * stretch * bisector);
  }
  return result;
}

Vec2 outward(const Vec2& from, const Vec2& to) {
  const Vec2 d = (to - from).normalized();
  return {d.y(), -d.x()};
}

/// One band between two copies of an outline at two heights.
void add_band(MeshBuilder& builder, std::span<const Vec2> low, double z_low,
              std::span<const Vec2> high, double z_high, double slope) {
  const std::size_t n = low.size();
  const auto normal_at = [&](std::size_t edge, bool at_end) {
    const Vec2 own = outward(low[edge], low[(edge + 1) % n]);
    const std::size_t other = at_end ? (edge + 1) % n : (edge + n - 1) % n;
    const Vec2 next = outward(low[other], low[(other + 1) % n]);
    const Vec2 flat = own.dot(next) > 0.86 ? Vec2((own + next).normalized()) : own;
    return Vec3(flat.x(), flat.y(), slope);
  };
  double u = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t j = (i + 1) % n;
    const double step = (low[j] - low[i]).norm();
    const auto vertex = [&](const Vec2& p, double z, const Vec3& normal, double at_u) {
      return builder.add_vertex(Vec3(p.x(), p.y(), z), normal, Vec2(at_u, z));
    };
    const Vec3 start = normal_at(i, false);
    const Vec3 end = normal_at(i, true);
    const auto a = vertex(low[i], z_low, start, u);
    const auto b = vertex(low[j], z_low, end, u + step);
    const auto c = vertex(high[j], z_high, end, u + step);
    const auto d = vertex(high[i], z_high, start, u);
    builder.add_quad(a, b, c, d);
    u += step;
  }
}

void add_cap(MeshBuilder& builder, std::span<const Vec2> outline, double z, bool is_top) {
  std::vector<std::uint32_t> ids;
  for (const Vec2& p : outline) {
    ids.push_back(builder.add_vertex(Vec3(p.x(), p.y(), z), Vec3(0, 0, is_top ? 1 : -1), p));
  }
  for (const auto& [a, b, c] : triangulate(outline)) {
    if (is_top) {
      builder.add_triangle(ids[a], ids[b], ids[c]);
    } else {
      builder.add_triangle(ids[a], ids[c], ids[b]);
    }
  }
}

struct SweepFrame {
  Vec3 side;
  Vec3 up;
  Vec3 along;
};

std::vector<SweepFrame> sweep_frames(std::span<const PathPoint> path, const Vec3& up) {
  std::vector<SweepFrame> frames;
  Vec3 previous_up = up;
  for (std::size_t i = 0; i < path.size(); ++i) {
    const Vec3& before = path[i == 0 ? 0 : i - 1].place;
    const Vec3& after = path[i + 1 == path.size() ? i : i + 1].place;
    const Vec3 along = (after - before).normalized();
    Vec3 side = along.cross(previous_up);
    if (side.norm() < 1e-6) side = along.unitOrthogonal();
    side.normalize();
    previous_up = side.cross(along);
    frames.push_back({side, previous_up, along});
  }
  return frames;
}

double signed_power(double value, double exponent) {
  return std::copysign(std::pow(std::abs(value), exponent), value);
}

void add_sweep_cap(MeshBuilder& builder, std::span<const Vec3> ring, const Vec3& normal,
                   const SweepFrame& frame) {
  Vec3 centre = Vec3::Zero();
  for (const Vec3& p : ring) centre += p / double(ring.size());
  const auto uv = [&](const Vec3& p) { return Vec2(p.dot(frame.side), p.dot(frame.up)); };
  const std::uint32_t hub = builder.add_vertex(centre, normal, uv(centre));
  for (const Vec3& p : ring) builder.add_vertex(p, normal, uv(p));
  const auto n = std::uint32_t(ring.size());
  const bool faces_along = normal.dot(frame.along) > 0;
  for (std::uint32_t i = 0; i < n; ++i) {
    const std::uint32_t a = hub + 1 + i;
    const std::uint32_t b = hub + 1 + (i + 1) % n;
    if (faces_along) {
      builder.add_triangle(hub, a, b);
    } else {
      builder.add_triangle(hub, b, a);
    }
  }
}

}  // namespace

void add_box(MeshBuilder& builder, const Vec3& size, double bevel, Axis grain, int segments) {
  add_box_faces(builder, size, bevel, segments,
                [grain](const Vec3& p, int axis, double) { return box_uv(p, axis, grain); });
}

void add_printed_box(MeshBuilder& builder, const Vec3& size, double bevel, const BoxPrint& print,
                     int segments) {
  add_box_faces(builder, size, bevel, segments, [&](const Vec3& p, int axis, double sign) {
    const Vec3 t = p.cwiseQuotient(size) + Vec3::Constant(0.5);
    // Left to right and bottom to top as seen from outside.
    const double across = axis == 0 ? t.y() : t.x();
    const bool runs_backwards = axis == 0 ? sign < 0 : axis == 1 ? sign > 0 : sign < 0;
    const Vec2 local(runs_backwards ? 1 - across : across, axis == 2 ? t.y() : t.z());
    const UvRect& rect = print[std::size_t(axis * 2 + (sign > 0 ? 1 : 0))];
    return Vec2(rect.low + local.cwiseProduct(rect.high - rect.low));
  });
}

void add_lathe(MeshBuilder& builder, std::span<const ProfilePoint> profile, int segments,
               double crease) {
  double radius = 0.0;
  for (const ProfilePoint& p : profile) radius = std::max(radius, p.r);
  add_lathe_points(
      builder, lathe_points(profile, crease), segments,
      [&](double turn, const LathePoint& p) { return Vec2(turn * 2 * kPi * radius, p.length); });
}

void add_lathe_unit_uv(MeshBuilder& builder, std::span<const ProfilePoint> profile, int segments,
                       double v_low, double v_high, double crease) {
  double z_low = kInfinity;
  double z_high = -kInfinity;
  for (const ProfilePoint& p : profile) {
    z_low = std::min(z_low, p.z);
    z_high = std::max(z_high, p.z);
  }
  const double height = std::max(1e-9, z_high - z_low);
  add_lathe_points(builder, lathe_points(profile, crease), segments,
                   [&](double turn, const LathePoint& p) {
                     return Vec2(turn, std::lerp(v_low, v_high, (p.at.z - z_low) / height));
                   });
}

void add_sweep(MeshBuilder& builder, std::span<const PathPoint> path, int segments, const Vec3& up,
               double exponent) {
  const std::vector<SweepFrame> frames = sweep_frames(path, up);
  const auto ring_size = std::uint32_t(segments) + 1;
  std::vector<std::vector<Vec3>> rings;
  std::uint32_t first = 0;
  double length = 0.0;
  for (std::size_t i = 0; i < path.size(); ++i) {
    const PathPoint& at_point = path[i];
    if (i > 0) length += (at_point.place - path[i - 1].place).norm();
    // How fast the section grows tilts the normals.
    const PathPoint& before = path[i == 0 ? 0 : i - 1];
    const PathPoint& after = path[i + 1 == path.size() ? i : i + 1];
    const double run = std::max(1e-9, (after.place - before.place).norm());
    const double growth =
        0.5 * (after.radius_x + after.radius_y - before.radius_x - before.radius_y) / run;
    std::vector<Vec3> ring;
    for (std::uint32_t s = 0; s < ring_size; ++s) {
      const double angle = s == ring_size - 1 ? 0.0 : 2 * kPi * s / segments;
      const double c = signed_power(std::cos(angle), 2 / exponent);
      const double n = signed_power(std::sin(angle), 2 / exponent);
      const Vec3 point = at_point.place + at_point.radius_x * c * frames[i].side +
                         at_point.radius_y * n * frames[i].up;
      const Vec3 across =
          (signed_power(std::cos(angle), 2 - 2 / exponent) / at_point.radius_x * frames[i].side +
           signed_power(std::sin(angle), 2 - 2 / exponent) / at_point.radius_y * frames[i].up)
              .normalized();
      const double arc = (at_point.radius_x + at_point.radius_y) * kPi * s / segments;
      const std::uint32_t id =
          builder.add_vertex(point, across - growth * frames[i].along, Vec2(length, arc));
      if (i == 0 && s == 0) first = id;
      if (s + 1 < ring_size) ring.push_back(point);
    }
    rings.push_back(std::move(ring));
  }
  for (std::uint32_t i = 0; i + 1 < path.size(); ++i) {
    for (std::uint32_t s = 0; s + 1 < ring_size; ++s) {
      const std::uint32_t v = first + i * ring_size + s;
      // side x up points against `along`, so angles run clockwise seen from ahead.
      builder.add_quad(v, v + ring_size, v + ring_size + 1, v + 1);
    }
  }
  std::reverse(rings.front().begin(), rings.front().end());
  std::reverse(rings.back().begin(), rings.back().end());
  add_sweep_cap(builder, rings.front(), -frames.front().along, frames.front());
  add_sweep_cap(builder, rings.back(), frames.back().along, frames.back());
}

void add_tube(MeshBuilder& builder, std::span<const Vec3> path, double radius, int segments) {
  std::vector<PathPoint> points;
  for (const Vec3& place : path) points.push_back({place, radius, radius});
  add_sweep(builder, points, segments);
}

std::vector<Vec3> smooth_path(std::span<const Vec3> knots, int steps) {
  std::vector<Vec3> points;
  const auto knot = [&](std::ptrdiff_t i) -> Vec3 {
    const auto last = std::ptrdiff_t(knots.size()) - 1;
    if (i < 0) return 2 * knots[0] - knots[1];
    if (i > last) return 2 * knots[std::size_t(last)] - knots[std::size_t(last) - 1];
    return knots[std::size_t(i)];
  };
  for (std::ptrdiff_t i = 0; i + 1 < std::ptrdiff_t(knots.size()); ++i) {
    const Vec3 a = knot(i - 1), b = knot(i), c = knot(i + 1), d = knot(i + 2);
    for (int s = 0; s < steps; ++s) {
      const double t = double(s) / steps;
      points.push_back(0.5 * (2 * b + (c - a) * t + (2 * a - 5 * b + 4 * c - d) * t * t +
                              (3 * b - a - 3 * c + d) * t * t * t));
    }
  }
  points.push_back(knots.back());
  return points;
}

void add_prism(MeshBuilder& builder, std::span<const Vec2> outline, double height, double bevel) {
  const double cut = std::min(bevel, 0.45 * height);
  if (cut <= 0) {
    add_band(builder, outline, 0, outline, height, 0);
    add_cap(builder, outline, 0, false);
    add_cap(builder, outline, height, true);
    return;
  }
  const std::vector<Vec2> inner = inset_outline(outline, cut);
  add_band(builder, inner, 0, outline, cut, -1);
  add_band(builder, outline, cut, outline, height - cut, 0);
  add_band(builder, outline, height - cut, inner, height, 1);
  add_cap(builder, inner, 0, false);
  add_cap(builder, inner, height, true);
}

std::vector<Vec2> rounded_rectangle(double width, double length, double radius, int segments) {
  std::vector<Vec2> outline;
  const std::array<Vec2, 4> corners{Vec2(1, 1), Vec2(-1, 1), Vec2(-1, -1), Vec2(1, -1)};
  for (std::size_t k = 0; k < 4; ++k) {
    const Vec2 centre(corners[k].x() * (width / 2 - radius),
                      corners[k].y() * (length / 2 - radius));
    for (int s = 0; s <= segments; ++s) {
      const double angle = kPi / 2 * (double(k) + double(s) / segments);
      outline.push_back(centre + radius * Vec2(std::cos(angle), std::sin(angle)));
    }
  }
  return outline;
}

void add_sheet(MeshBuilder& builder, int columns, int rows, double thickness,
               const std::function<Vec3(double, double)>& surface, const Vec2& uv_size_m) {
  constexpr double kStep = 1e-4;
  const auto normal_at = [&](double u, double v) {
    const double u0 = std::max(0.0, u - kStep), u1 = std::min(1.0, u + kStep);
    const double v0 = std::max(0.0, v - kStep), v1 = std::min(1.0, v + kStep);
    return Vec3(
        (surface(u1, v) - surface(u0, v)).cross(surface(u, v1) - surface(u, v0)).normalized());
  };
  std::array<std::uint32_t, 2> first{};
  const auto stride = std::uint32_t(columns) + 1;
  std::array<std::vector<Vec3>, 2> points;
  for (std::size_t side = 0; side < 2; ++side) {
    const double sign = side == 0 ? 1.0 : -1.0;
    for (int j = 0; j <= rows; ++j) {
      for (int i = 0; i <= columns; ++i) {
        const double u = double(i) / columns, v = double(j) / rows;
        const Vec3 normal = normal_at(u, v);
        const Vec3 point = surface(u, v) + sign * 0.5 * thickness * normal;
        const std::uint32_t id =
            builder.add_vertex(point, sign * normal, Vec2(u * uv_size_m.x(), v * uv_size_m.y()));
        if (i == 0 && j == 0) first[side] = id;
        points[side].push_back(point);
      }
    }
    for (std::uint32_t j = 0; j < std::uint32_t(rows); ++j) {
      for (std::uint32_t i = 0; i < std::uint32_t(columns); ++i) {
        const std::uint32_t v = first[side] + j * stride + i;
        if (side == 0) {
          builder.add_quad(v, v + 1, v + stride + 1, v + stride);
        } else {
          builder.add_quad(v, v + stride, v + stride + 1, v + 1);
        }
      }
    }
  }
  // The rim, once around counter-clockwise as seen from the front.
  std::vector<std::size_t> rim;
  const auto index = [&](int i, int j) { return std::size_t(j) * stride + std::size_t(i); };
  for (int i = 0; i < columns; ++i) rim.push_back(index(i, 0));
  for (int j = 0; j < rows; ++j) rim.push_back(index(columns, j));
  for (int i = columns; i > 0; --i) rim.push_back(index(i, rows));
  for (int j = rows; j > 0; --j) rim.push_back(index(0, j));
  for (std::size_t k = 0; k < rim.size(); ++k) {
    const std::size_t a = rim[k], b = rim[(k + 1) % rim.size()];
    const Vec3 normal =
        (points[1][b] - points[1][a]).cross(points[0][a] - points[1][a]).normalized();
    const auto p = builder.add_vertex(points[1][a], normal, Vec2(0, 0));
    const auto q = builder.add_vertex(points[1][b], normal, Vec2(0.01, 0));
    const auto r = builder.add_vertex(points[0][b], normal, Vec2(0.01, thickness));
    const auto s = builder.add_vertex(points[0][a], normal, Vec2(0, thickness));
    builder.add_quad(p, q, r, s);
  }
}

void add_panel(MeshBuilder& builder, double width, double thickness, double height,
               std::span<const Opening> openings) {
  std::vector<double> xs{0, width}, zs{0, height};
  for (const Opening& o : openings) {
    xs.insert(xs.end(), {o.x_min, o.x_max});
    zs.insert(zs.end(), {o.z_min, o.z_max});
  }
  for (std::vector<double>* lines : {&xs, &zs}) {
    std::sort(lines->begin(), lines->end());
    lines->erase(std::unique(lines->begin(), lines->end()), lines->end());
  }
  const auto is_solid = [&](std::ptrdiff_t i, std::ptrdiff_t j) {
    if (i < 0 || j < 0 || i + 1 >= std::ptrdiff_t(xs.size()) ||
        j + 1 >= std::ptrdiff_t(zs.size())) {
      return false;
    }
    const double x = (xs[std::size_t(i)] + xs[std::size_t(i) + 1]) / 2;
    const double z = (zs[std::size_t(j)] + zs[std::size_t(j) + 1]) / 2;
    return std::none_of(openings.begin(), openings.end(), [&](const Opening& o) {
      return x > o.x_min && x < o.x_max && z > o.z_min && z < o.z_max;
    });
  };
  const auto quad = [&](const std::array<Vec3, 4>& p, const Vec3& normal) {
    std::array<std::uint32_t, 4> id{};
    for (std::size_t k = 0; k < 4; ++k) {
      const Vec2 uv = normal.z() != 0   ? Vec2(p[k].x(), p[k].y())
                      : normal.x() != 0 ? Vec2(p[k].y(), p[k].z())
                                        : Vec2(p[k].x(), p[k].z());
      id[k] = builder.add_vertex(p[k], normal, uv);
    }
    builder.add_quad(id[0], id[1], id[2], id[3]);
  };
  for (std::ptrdiff_t i = 0; i + 1 < std::ptrdiff_t(xs.size()); ++i) {
    for (std::ptrdiff_t j = 0; j + 1 < std::ptrdiff_t(zs.size()); ++j) {
      if (!is_solid(i, j)) continue;
      const double x0 = xs[std::size_t(i)], x1 = xs[std::size_t(i) + 1];
      const double z0 = zs[std::size_t(j)], z1 = zs[std::size_t(j) + 1], t = thickness;
      quad({Vec3(x0, 0, z0), Vec3(x1, 0, z0), Vec3(x1, 0, z1), Vec3(x0, 0, z1)}, -Vec3::UnitY());
      quad({Vec3(x1, t, z0), Vec3(x0, t, z0), Vec3(x0, t, z1), Vec3(x1, t, z1)}, Vec3::UnitY());
      if (!is_solid(i - 1, j))
        quad({Vec3(x0, t, z0), Vec3(x0, 0, z0), Vec3(x0, 0, z1), Vec3(x0, t, z1)}, -Vec3::UnitX());
      if (!is_solid(i + 1, j))
        quad({Vec3(x1, 0, z0), Vec3(x1, t, z0), Vec3(x1, t, z1), Vec3(x1, 0, z1)}, Vec3::UnitX());
      if (!is_solid(i, j - 1))
        quad({Vec3(x0, t, z0), Vec3(x1, t, z0), Vec3(x1, 0, z0), Vec3(x0, 0, z0)}, -Vec3::UnitZ());
      if (!is_solid(i, j + 1))
        quad({Vec3(x0, 0, z1), Vec3(x1, 0, z1), Vec3(x1, t, z1), Vec3(x0, t, z1)}, Vec3::UnitZ());
    }
  }
}

void add_moulding(MeshBuilder& builder, std::span<const Vec2> section, std::span<const Vec2> path,
                  bool is_closed) {
  const std::size_t n = path.size();
  const auto left_of = [&](std::size_t i, std::size_t j) {
    const Vec2 d = (path[j] - path[i]).normalized();
    return Vec2(-d.y(), d.x());
  };
  // Where the section's x axis points at each path point, stretched in mitres.
  std::vector<Vec2> across(n);
  for (std::size_t i = 0; i < n; ++i) {
    const bool has_before = is_closed || i > 0;
    const bool has_after = is_closed || i + 1 < n;
    const Vec2 after = has_after ? left_of(i, (i + 1) % n) : left_of(i - 1, i);
    const Vec2 before = has_before ? left_of((i + n - 1) % n, i) : after;
    const Vec2 bisector = (before + after).normalized();
    across[i] = bisector / bisector.dot(after);
  }
  const auto place = [&](std::size_t i, const Vec2& s) {
    const Vec2 p = path[i] + s.x() * across[i];
    return Vec3(p.x(), p.y(), s.y());
  };
  const std::size_t spans = is_closed ? n : n - 1;
  double run = 0.0;
  for (std::size_t i = 0; i < spans; ++i) {
    const std::size_t j = (i + 1) % n;
    const double length = (path[j] - path[i]).norm();
    const Vec2 left = left_of(i, j);
    double around = 0.0;
    for (std::size_t k = 0; k < section.size(); ++k) {
      const Vec2& a = section[k];
      const Vec2& b = section[(k + 1) % section.size()];
      const Vec2 out = outward(a, b);
      const Vec3 normal(out.x() * left.x(), out.x() * left.y(), out.y());
      const double step = (b - a).norm();
      const auto v0 = builder.add_vertex(place(i, a), normal, Vec2(run, around));
      const auto v1 = builder.add_vertex(place(i, b), normal, Vec2(run, around + step));
      const auto v2 = builder.add_vertex(place(j, b), normal, Vec2(run + length, around + step));
      const auto v3 = builder.add_vertex(place(j, a), normal, Vec2(run + length, around));
      builder.add_quad(v0, v1, v2, v3);
      around += step;
    }
    run += length;
  }
  if (is_closed) return;
  for (const bool is_start : {true, false}) {
    const std::size_t i = is_start ? 0 : n - 1;
    const Vec2 d = is_start ? Vec2(path[0] - path[1]) : Vec2(path[n - 1] - path[n - 2]);
    const Vec3 normal(d.x(), d.y(), 0);
    std::vector<std::uint32_t> ids;
    for (const Vec2& s : section) ids.push_back(builder.add_vertex(place(i, s), normal, s));
    for (const auto& [a, b, c] : triangulate(section)) {
      if (is_start) {
        builder.add_triangle(ids[a], ids[c], ids[b]);
      } else {
        builder.add_triangle(ids[a], ids[b], ids[c]);
      }
    }
  }
}

void add_picture(MeshBuilder& builder, double width, double height) {
  const auto corner = [&](double u, double v) {
    return builder.add_vertex(Vec3((u - 0.5) * width, (v - 0.5) * height, 0), Vec3::UnitZ(),
                              Vec2(u, v));
  };
  const auto a = corner(0, 0), b = corner(1, 0), c = corner(1, 1), d = corner(0, 1);
  builder.add_quad(a, b, c, d);
}

}  // namespace diorama::modelling
