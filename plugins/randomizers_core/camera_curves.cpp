// SPDX-License-Identifier: Apache-2.0
#include "camera_curves.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

namespace diorama {
namespace {

constexpr int kPointsPerCorner = 32;

Vec3 log_of(const Quat& q) {
  const double norm = q.vec().norm();
  if (norm < 1e-12) return q.vec();
  return q.vec() * (std::atan2(norm, q.w()) / norm);
}

Quat exp_of(const Vec3& v) {
  const double angle = v.norm();
  Quat q(std::cos(angle), 0.0, 0.0, 0.0);
  q.vec() = angle < 1e-12 ? v : Vec3(v * (std::sin(angle) / angle));
  return q.normalized();
}

}  // namespace

KeyCurve::KeyCurve(std::vector<Key> keys) : keys_(std::move(keys)) {
  // Of the two quaternions of a rotation the one nearer to the key before: the shorter turn.
  for (std::size_t i = 1; i < keys_.size(); ++i) {
    Quat& rotation = keys_[i].rotation;
    if (keys_[i - 1].rotation.dot(rotation) < 0.0) rotation.coeffs() = -rotation.coeffs();
  }
}

Vec3 KeyCurve::tangent(std::size_t key) const {
  const Key& before = keys_[key == 0 ? 0 : key - 1];
  const Key& after = keys_[std::min(key + 1, keys_.size() - 1)];
  return (after.position - before.position) / (after.time_s - before.time_s);
}

/// Shoemake, "Quaternion calculus and fast animation", 1987.
Quat KeyCurve::control(std::size_t key) const {
  const Quat& own = keys_[key].rotation;
  if (key == 0 || key + 1 == keys_.size()) return own;
  const Quat back = own.conjugate();
  const Vec3 sum = log_of(back * keys_[key + 1].rotation) + log_of(back * keys_[key - 1].rotation);
  return own * exp_of(-0.25 * sum);
}

Affine KeyCurve::pose(double time_s) const {
  const auto behind = std::upper_bound(keys_.begin(), keys_.end(), time_s,
                                       [](double t, const Key& key) { return t < key.time_s; });
  if (behind == keys_.begin() || behind == keys_.end()) {
    const Key& key = behind == keys_.begin() ? keys_.front() : keys_.back();
    return Affine(Eigen::Translation3d(key.position) * key.rotation);
  }
  const auto i = std::size_t(behind - keys_.begin()) - 1;
  const Key& a = keys_[i];
  const Key& b = keys_[i + 1];
  const double span = b.time_s - a.time_s;
  const double u = (time_s - a.time_s) / span;
  const double u2 = u * u;
  const double u3 = u2 * u;
  const Vec3 position = (2.0 * u3 - 3.0 * u2 + 1.0) * a.position +
                        (u3 - 2.0 * u2 + u) * span * tangent(i) +
                        (3.0 * u2 - 2.0 * u3) * b.position + (u3 - u2) * span * tangent(i + 1);
  const Quat outer = a.rotation.slerp(u, b.rotation);
  const Quat inner = control(i).slerp(u, control(i + 1));
  const Quat rotation = outer.slerp(2.0 * u * (1.0 - u), inner).normalized();
  return Affine(Eigen::Translation3d(position) * rotation);
}

std::vector<Vec3> WalkCurve::corner(const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 from = 0.5 * (a + b);
  const Vec3 to = 0.5 * (b + c);
  std::vector<Vec3> points;
  for (int i = 0; i <= kPointsPerCorner; ++i) {
    const double u = double(i) / kPointsPerCorner;
    points.push_back((1.0 - u) * (1.0 - u) * from + 2.0 * u * (1.0 - u) * b + u * u * to);
  }
  return points;
}

WalkCurve::WalkCurve(const std::vector<Vec3>& places) {
  points_.push_back(places.front());
  for (std::size_t i = 1; i + 1 < places.size(); ++i) {
    const auto bend = corner(places[i - 1], places[i], places[i + 1]);
    points_.insert(points_.end(), bend.begin(), bend.end());
  }
  points_.push_back(places.back());
  const auto is_same = [](const Vec3& a, const Vec3& b) { return (a - b).norm() < 1e-9; };
  points_.erase(std::unique(points_.begin(), points_.end(), is_same), points_.end());
  double length = 0.0;
  for (std::size_t i = 0; i < points_.size(); ++i) {
    if (i > 0) length += (points_[i] - points_[i - 1]).norm();
    lengths_.push_back(length);
  }
}

Vec3 WalkCurve::place(double distance_m) const {
  const auto behind = std::upper_bound(lengths_.begin(), lengths_.end(), distance_m);
  if (behind == lengths_.begin()) return points_.front();
  if (behind == lengths_.end()) return points_.back();
  const auto i = std::size_t(behind - lengths_.begin());
  const double u = (distance_m - lengths_[i - 1]) / (lengths_[i] - lengths_[i - 1]);
  return points_[i - 1] + u * (points_[i] - points_[i - 1]);
}

Vec3 WalkCurve::direction(double distance_m) const {
  // Who walks looks a little ahead, and so turns before a corner and evenly.
  constexpr double kReach = 0.25;
  const Vec3 way = place(distance_m + kReach) - place(distance_m - kReach);
  return way.norm() > 1e-9 ? Vec3(way.normalized()) : Vec3(Vec3::UnitX());
}

HandShake::HandShake(double position_m, double angle_rad, double frequency_hz, Rng rng)
    : position_m_(position_m), angle_rad_(angle_rad) {
  for (auto& axis : waves_) {
    for (Wave& wave : axis) {
      wave.frequency_hz = frequency_hz * rng.uniform(0.1, 1.0);
      wave.phase = rng.uniform(0.0, 2.0 * kPi);
    }
  }
}

double HandShake::sum(std::size_t axis, double time_s) const {
  double sum = 0.0;
  for (const Wave& wave : waves_[axis]) {
    sum += std::sin(2.0 * kPi * wave.frequency_hz * time_s + wave.phase);
  }
  return sum * std::sqrt(2.0 / double(kWaves));
}

double HandShake::reach_m(int frames, double fps) const {
  double reach = 0.0;
  for (int frame = 0; frame < frames; ++frame) {
    reach = std::max(reach, at(frame / fps).translation().norm());
  }
  return reach;
}

Affine HandShake::at(double time_s) const {
  Vec3 offset = Vec3::Zero();
  Vec3 turn = Vec3::Zero();
  for (std::size_t i = 0; i < 3; ++i) {
    if (position_m_ > 0.0) offset[Eigen::Index(i)] = position_m_ * sum(i, time_s);
    if (angle_rad_ > 0.0) turn[Eigen::Index(i)] = angle_rad_ * sum(3 + i, time_s);
  }
  return Affine(Eigen::Translation3d(offset) * exp_of(0.5 * turn));
}

}  // namespace diorama
