// SPDX-License-Identifier: Apache-2.0
#include "walk_plan.h"

#include <algorithm>

#include "camera_curves.h"

namespace diorama {
namespace {

// Shorter ones make a walk of corners, longer ones seldom fit.
constexpr double kShortestLine = 0.3;
constexpr double kLongestLine = 2.0;
// Cosine of the sharpest turn, about 75 degrees: nobody turns on his heel.
constexpr double kSharpest = 0.25;

std::vector<Aabb> columns_of_falling(const Scene& scene) {
  std::vector<Aabb> columns;
  for (const NodeId node : scene.subtree(scene.root())) {
    if (!scene[node].rigid_body || !scene[node].rigid_body->has_gravity) continue;
    const Aabb box = scene.world_bounds(node);
    if (!box.is_empty()) columns.push_back(box);
  }
  return columns;
}

}  // namespace

WalkSpace::WalkSpace(const Scene& scene, double clearance_m)
    : obstacles_(scene, "/**"), falling_(columns_of_falling(scene)), clearance_m_(clearance_m) {}

double WalkSpace::clearance_at(const Vec3& place) const {
  double clear_m = obstacles_.distance(place, kLongestLine + clearance_m_);
  for (const Aabb& box : falling_) {
    // Whatever its height: things fall, roll and jump.
    const Vec3 off = (box.min - place).cwiseMax(place - box.max).cwiseMax(0.0);
    clear_m = std::min(clear_m, off.head<2>().norm());
  }
  return clear_m;
}

double WalkSpace::spare_at(const Vec3& place) const { return clearance_at(place) - clearance_m_; }

bool WalkSpace::holds(const Vec3& place) const {
  return spare_at(place) >= 0.0 && !obstacles_.encloser(place);
}

bool WalkSpace::holds(const Vec3& from, const Vec3& to) const {
  // What is nowhere nearer than so much more than it has to be is free between two such places.
  constexpr double kLeast = 0.01;
  const double length = (to - from).norm();
  double gone = 0.0;
  while (true) {
    const double spare = spare_at(from + (length > 0.0 ? gone / length : 0.0) * (to - from));
    if (spare < kLeast) return false;
    if (gone >= length) return true;
    gone = std::min(gone + spare, length);
  }
}

MovingThings::MovingThings(const Scene& scene) {
  for (const NodeId node : scene.subtree(scene.root())) {
    if (scene[node].rigid_body) bodies_.push_back(node);
  }
}

void MovingThings::look(const Scene& scene) {
  boxes_.clear();
  for (const NodeId body : bodies_) {
    const Aabb box = scene.contains(body) ? scene.world_bounds(body) : Aabb();
    if (!box.is_empty()) boxes_.push_back(box);
  }
}

double MovingThings::distance(const Vec3& place) const {
  double distance = kInfinity;
  for (const Aabb& box : boxes_) {
    const Vec3 off = (box.min - place).cwiseMax(place - box.max).cwiseMax(0.0);
    distance = std::min(distance, off.norm());
  }
  return distance;
}

std::vector<Vec3> plan_walk(const WalkSpace& space, const std::function<Vec3(Rng&)>& draw_place,
                            double length_m, int max_tries, const Rng& rng) {
  std::vector<Vec3> best;
  double best_m = -1.0;
  std::vector<Vec3> places;
  double walked_m = 0.0;
  int misses = 0;
  const auto fits = [&](const Vec3& next) {
    const Vec3& last = places.back();
    const double line_m = (next - last).norm();
    if (line_m < kShortestLine || line_m > kLongestLine || !space.holds(last, next)) return false;
    if (places.size() < 2) return true;
    const Vec3& before = places[places.size() - 2];
    if ((next - last).normalized().dot((last - before).normalized()) < kSharpest) return false;
    const auto bend = WalkCurve::corner(before, last, next);
    return std::adjacent_find(bend.begin(), bend.end(), [&](const Vec3& a, const Vec3& b) {
             return !space.holds(a, b);
           }) == bend.end();
  };
  // A way that leads nowhere is left after so many draws, and another one begun.
  const int most_misses = std::max(8, max_tries / 10);
  for (int i = 0; i < max_tries; ++i) {
    Rng draws = rng.fork(std::uint64_t(i));
    const Vec3 place = draw_place(draws);
    if (places.empty()) {
      if (space.holds(place)) places = {place};
    } else if (fits(place)) {
      places.push_back(place);
      walked_m = WalkCurve(places).length_m();
      misses = 0;
    } else if (++misses > most_misses) {
      places.clear();
      walked_m = 0.0;
      misses = 0;
      continue;
    }
    if (!places.empty() && walked_m > best_m) {
      best = places;
      best_m = walked_m;
    }
    if (best_m >= length_m && !best.empty()) break;
  }
  return best;
}

}  // namespace diorama
