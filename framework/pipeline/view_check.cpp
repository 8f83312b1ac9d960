// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/view_check.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <span>
#include <utility>

#include "framework/annotators/instance_ids.h"
#include "framework/annotators/instances.h"
#include "framework/annotators/visibility.h"

namespace diorama {
namespace {

// A view that fails before anything is traced is farther from holding than any that is traced.
constexpr double kUntraced = 1000.0;
// More than any target is short of.
constexpr double kNoTarget = 100.0;

constexpr double degrees(double radians) { return radians * 180.0 / kPi; }

const Limits kSeen{1.0, std::nullopt};

/// A labelled thing that rules may ask for.
struct Target {
  LabelledInstance instance;
  std::string path;
  Labels labels;
  Affine node_from_world;
  Vec3 middle_node;
  Vec3 middle_world;
  double radius_m = 0.0;  ///< Of a ball round its box.
  std::array<Vec3, 8> corners_world;
};

/// Everything that rules ask of a target, as far as it is known.
struct Measures {
  double distance_m = 0.0;
  double azimuth_deg = 0.0;
  double elevation_deg = 0.0;
  double visible_pixels = 0.0;
  double visible_share = 0.0;
  double occlusion = 0.0;
  double truncation = 0.0;
  double size_px = 0.0;
  double size_share = 0.0;
  double occluders = 0.0;
  double all_pixels = 0.0;  ///< Of what the shares are of: covered ones, and those outside.
};

/// Numbers that a measure may stand for.
struct Margin {
  double low = 0.0;
  double high = 0.0;
};

/// How a target does: the first condition that it misses, and how far it is off in all.
struct Score {
  const char* failed = nullptr;
  double shortfall = 0.0;
  bool is_sure = true;  ///< It holds wherever in their margins the numbers lie.
  void take(const char* key, const Limits& limits, double value) {
    take(key, limits, value, {value, value});
  }
  void take(const char* key, const Limits& limits, double value, const Margin& margin) {
    if (!limits.hold(margin.low) || !limits.hold(margin.high)) is_sure = false;
    const bool is_below = limits.min && margin.high < *limits.min;
    const bool is_above = limits.max && margin.low > *limits.max;
    if (!is_below && !is_above) return;
    if (!failed) failed = key;
    shortfall += std::max(limits.shortfall(value), 1e-3);
  }
};

/// Where the exact numbers lie for all that can be believed, when a grid of pixels `step` apart was
/// looked at instead of all of them. Of a thing that it meets n times, the grid tells the area as
/// well as chance would, or better.
class Margins {
 public:
  explicit Margins(int step) : step_(step) {}

  bool are_exact() const { return step_ == 1; }
  Margin pixels(double pixels) const {
    if (are_exact()) return {pixels, pixels};
    const double met = pixels / (double(step_) * step_);
    const double off = double(step_) * step_ * (kDeviations * std::sqrt(met) + kEdge);
    // Whatever the grid meets is seen.
    return {std::max(met, pixels - off), pixels + off};
  }
  /// Of a box's longer side; `pixel`: one of the picture's in the same unit.
  Margin size(double size, double pixel) const {
    if (are_exact()) return {size, size};
    // Thin ends may lie between the lines of the grid.
    const double off = 2.0 * step_ * pixel;
    return {std::max(0.0, size - off), 1.25 * size + off};
  }
  /// Of a thing with so many pixels, of which part is outside or covered.
  Margin share(double share, double pixels) const {
    if (are_exact()) return {share, share};
    const double met = pixels / (double(step_) * step_);
    const double off = met > 0.0 ? 0.5 * kDeviations / std::sqrt(met) : 1.0;
    return {std::max(0.0, share - off), std::min(1.0, share + off)};
  }
  /// All that the grid meets are there; slivers may be missing.
  Margin things(double count) const { return {count, are_exact() ? count : count + 1.0}; }

 private:
  static constexpr double kDeviations = 3.0;
  static constexpr double kEdge = 4.0;
  double step_;
};

bool is_about_place(const std::string& of) {
  return of == "label" || of == "direction" || of == "distance_m" || of == "azimuth_deg" ||
         of == "elevation_deg";
}

bool needs_coverage(const ViewRule& rule) {
  const bool by_limits = rule.visible_share.is_set() || rule.occlusion.is_set() ||
                         rule.truncation.is_set() || rule.occluders.is_set();
  return by_limits || std::any_of(rule.quotas.begin(), rule.quotas.end(), [](const Quota& quota) {
           return quota.of == "visible_share" || quota.of == "occlusion" ||
                  quota.of == "truncation" || quota.of == "occluders";
         });
}

Target target_of(const Scene& scene, const LabelledInstance& instance) {
  Target target;
  target.instance = instance;
  target.path = scene.path(instance.node);
  target.labels = scene.effective_labels(instance.node);
  const Affine world_from_node = scene.world_from_node(instance.node);
  target.node_from_world = world_from_node.inverse();
  const Aabb box = instance_bounds(scene, instance);
  target.middle_node = box.centre();
  target.middle_world = world_from_node * target.middle_node;
  for (int corner = 0; corner < 8; ++corner) {
    const Vec3 point((corner & 1 ? box.max : box.min).x(), (corner & 2 ? box.max : box.min).y(),
                     (corner & 4 ? box.max : box.min).z());
    target.corners_world[std::size_t(corner)] = world_from_node * point;
    target.radius_m = std::max(
        target.radius_m, (target.corners_world[std::size_t(corner)] - target.middle_world).norm());
  }
  return target;
}

void measure_place(const Target& target, const ViewRule& rule, const Vec3& camera_world,
                   Measures& measures) {
  measures.distance_m = (target.middle_world - camera_world).norm();
  const Vec3 view = rule.direction_space == "world"
                        ? Vec3(camera_world - target.middle_world)
                        : Vec3(target.node_from_world * camera_world - target.middle_node);
  if (!view.allFinite() || view.norm() == 0.0) return;
  measures.azimuth_deg = turned_into(rule.azimuth_deg, degrees(std::atan2(view.y(), view.x())));
  measures.elevation_deg = degrees(std::asin(std::clamp(view.z() / view.norm(), -1.0, 1.0)));
}

void score_place(const ViewRule& rule, const Measures& measures, Score& score) {
  score.take("distance_m", rule.distance_m, measures.distance_m);
  score.take("azimuth_deg", rule.azimuth_deg, measures.azimuth_deg);
  score.take("elevation_deg", rule.elevation_deg, measures.elevation_deg);
}

void score_pixels(const ViewRule& rule, const Measures& measures, const Margins& margins,
                  Score& score) {
  const Margin pixels = margins.pixels(measures.visible_pixels);
  score.take("visible_pixels", kSeen, measures.visible_pixels, pixels);
  score.take("visible_pixels", rule.visible_pixels, measures.visible_pixels, pixels);
  const double pixel = measures.size_px > 0.0 ? measures.size_share / measures.size_px : 1.0;
  score.take("size_px", rule.size_px, measures.size_px, margins.size(measures.size_px, 1.0));
  score.take("size_share", rule.size_share, measures.size_share,
             margins.size(measures.size_share, pixel));
}

void score_coverage(const ViewRule& rule, const Measures& measures, const Margins& margins,
                    bool is_whole, Score& score) {
  const auto take_share = [&](const char* key, const Limits& limits, double share) {
    score.take(key, limits, share, margins.share(share, measures.all_pixels));
  };
  if (is_whole) {
    score.take("truncation", rule.truncation, 0.0);
  } else {
    take_share("truncation", rule.truncation, measures.truncation);
  }
  take_share("occlusion", rule.occlusion, measures.occlusion);
  take_share("visible_share", rule.visible_share, measures.visible_share);
  score.take("occluders", rule.occluders, measures.occluders, margins.things(measures.occluders));
}

std::string label_of(const Target& target, const ViewRule& rule) {
  const auto label = target.labels.find(rule.taxonomy);
  return label == target.labels.end() ? std::string() : label->second;
}

std::optional<std::size_t> bin_of(const Quota& quota, const ViewRule& rule, const Target& target,
                                  const Measures& measures) {
  if (quota.of == "label") return quota.bin_of_label(label_of(target, rule));
  if (quota.of == "direction") {
    return rule.direction_bin(quota, measures.azimuth_deg, measures.elevation_deg);
  }
  const std::pair<const char*, double> numbers[] = {
      {"distance_m", measures.distance_m},       {"azimuth_deg", measures.azimuth_deg},
      {"elevation_deg", measures.elevation_deg}, {"visible_pixels", measures.visible_pixels},
      {"visible_share", measures.visible_share}, {"occlusion", measures.occlusion},
      {"truncation", measures.truncation},       {"size_px", measures.size_px},
      {"size_share", measures.size_share},       {"occluders", measures.occluders}};
  for (const auto& [key, value] : numbers) {
    if (quota.of == key) return quota.bin_of(value);
  }
  return std::nullopt;
}

std::string full_name(const ViewRule& rule, const std::string& key) {
  return rule.name + "." + key;
}

/// The largest angle off the axis that the picture shows; pi where its edge shows nothing.
double widest_angle(const Camera& camera) {
  constexpr int kSteps = 8;
  double widest = 0.0;
  for (int i = 0; i <= kSteps; ++i) {
    const double x = double(camera.width) * i / kSteps;
    const double y = double(camera.height) * i / kSteps;
    for (const Vec2& pixel :
         {Vec2(x, 0), Vec2(x, camera.height), Vec2(0, y), Vec2(camera.width, y)}) {
      const auto ray = ray_direction(camera, pixel);
      if (!ray) return kPi;
      widest = std::max(widest, std::acos(std::clamp(-ray->z(), -1.0, 1.0)));
    }
  }
  return widest;
}

bool may_be_seen(const Target& target, const Affine& camera_from_world, double widest) {
  const Vec3 place = camera_from_world * target.middle_world;
  const double distance = place.norm();
  if (distance <= target.radius_m) return true;
  const double angle = std::acos(std::clamp(-place.z() / distance, -1.0, 1.0));
  return angle - std::asin(target.radius_m / distance) <= widest + 1e-6;
}

/// Where in a picture a target lies, with some room round it, by the corners of its box.
struct Reach {
  double left = kInfinity;
  double top = kInfinity;
  double right = -kInfinity;
  double bottom = -kInfinity;
  bool is_whole = false;  ///< All of it lies inside.
  /// Of what lies inside; both are 0 where nothing does.
  double most_pixels = 0.0;
  double longest_px = 0.0;
  double longest_share = 0.0;
};

/// Null: the corners do not tell, through lenses that bend lines, and of what is not before the
/// camera as a whole.
std::optional<Reach> reach_of(const Target& target, const Affine& camera_from_world,
                              const Camera& camera) {
  if (camera.lens != LensModel::Pinhole) return std::nullopt;
  Reach reach;
  for (const Vec3& corner : target.corners_world) {
    const Vec3 place = camera_from_world * corner;
    const std::optional<Vec2> pixel = project(camera, place);
    if (!pixel || -place.z() <= camera.near_m || -place.z() >= camera.far_m) return std::nullopt;
    reach.left = std::min(reach.left, pixel->x());
    reach.right = std::max(reach.right, pixel->x());
    reach.top = std::min(reach.top, pixel->y());
    reach.bottom = std::max(reach.bottom, pixel->y());
  }
  // What is displaced may stick out of its box.
  constexpr double kRoom = 0.02;
  const double across = 1.0 + kRoom * (reach.right - reach.left);
  const double down = 1.0 + kRoom * (reach.bottom - reach.top);
  reach.left -= across;
  reach.right += across;
  reach.top -= down;
  reach.bottom += down;
  reach.is_whole = reach.left >= 0.0 && reach.top >= 0.0 && reach.right <= camera.width &&
                   reach.bottom <= camera.height;
  const double width = std::min<double>(reach.right, camera.width) - std::max(reach.left, 0.0);
  const double height = std::min<double>(reach.bottom, camera.height) - std::max(reach.top, 0.0);
  if (width <= 0.0 || height <= 0.0) return reach;
  reach.most_pixels = width * height;
  reach.longest_px = std::max(width, height);
  reach.longest_share = std::max(width / camera.width, height / camera.height);
  return reach;
}

/// What has too few pixels even when all of its box is seen.
void score_reach(const ViewRule& rule, const Reach& reach, Score& score) {
  const auto take = [&](const char* key, const Limits& limits, double most) {
    score.take(key, limits, most, {0.0, most});
  };
  take("visible_pixels", kSeen, reach.most_pixels);
  take("visible_pixels", rule.visible_pixels, reach.most_pixels);
  take("size_px", rule.size_px, reach.longest_px);
  take("size_share", rule.size_share, reach.longest_share);
}

/// How many different things are seen where the target would be.
int occluders_of(const CoverageMask& mask, std::uint32_t target,
                 const Image<std::uint32_t>& instances, const Image<std::uint32_t>& leaves) {
  std::set<std::uint32_t> things;
  const PixelBox box = mask.box.clipped(instances.width(), instances.height());
  std::uint32_t last = 0;
  for (int y = box.y_min; y < box.y_max; ++y) {
    for (int x = box.x_min; x < box.x_max; ++x) {
      if (!mask.covers(x, y) || instances.at(x, y) == target) continue;
      const std::uint32_t labelled = instances.at(x, y);
      // No labelled node's id is that of a leaf below another one.
      const std::uint32_t thing = labelled != 0 ? labelled : leaves.at(x, y);
      if (thing == 0 || thing == last) continue;
      things.insert(last = thing);
    }
  }
  return int(things.size());
}

/// Which of the targets of a rule score how; as many entries as the rule has targets.
struct Scored {
  const Target* target = nullptr;
  Measures measures;
  Score score;
};

/// What stands in the way of `count` targets that hold: the misses of those that are nearest to it.
ViewVerdict missing_targets(const ViewRule& rule, std::vector<Scored> scored, std::size_t holding) {
  ViewVerdict verdict;
  std::erase_if(scored, [](const Scored& one) { return !one.score.failed; });
  std::stable_sort(scored.begin(), scored.end(), [](const Scored& a, const Scored& b) {
    return a.score.shortfall < b.score.shortfall;
  });
  const double wanted = rule.count.min.value_or(0.0) - double(holding);
  for (std::size_t i = 0; double(i) < wanted; ++i) {
    verdict.shortfall += i < scored.size() ? scored[i].score.shortfall : kNoTarget;
  }
  verdict.failed = {full_name(rule, scored.empty() ? "count" : scored.front().score.failed)};
  return verdict;
}

}  // namespace

void ViewVerdict::add(const ViewVerdict& other) {
  failed.insert(failed.end(), other.failed.begin(), other.failed.end());
  shortfall += other.shortfall;
}

struct ViewCheck::State {
  std::vector<LabelledInstance> instances;
  std::vector<std::uint32_t> instance_of_leaf;
  std::vector<Target> targets;
  std::map<const ViewRule*, std::vector<const Target*>> of_rule;

  const std::vector<const Target*>& targets_of(const ViewRule& rule) const {
    return of_rule.at(&rule);
  }

  std::vector<Scored> by_place(const ViewRule& rule, const Vec3& camera_world) const {
    std::vector<Scored> list;
    for (const Target* target : targets_of(rule)) {
      Scored scored;
      scored.target = target;
      measure_place(*target, rule, camera_world, scored.measures);
      score_place(rule, scored.measures, scored.score);
      list.push_back(std::move(scored));
    }
    return list;
  }
};

namespace {

std::size_t count_holding(const std::vector<Scored>& scored) {
  return std::size_t(std::count_if(scored.begin(), scored.end(),
                                   [](const Scored& one) { return !one.score.failed; }));
}

/// How short those are that fail by their coverage alone, the nearest `missing` of them; infinity
/// when there are fewer. `uncovered`: the same targets before.
double shortfall_of_missing(const std::vector<Scored>& covered,
                            const std::vector<Scored>& uncovered, double missing) {
  std::vector<double> shortfalls;
  for (std::size_t i = 0; i < covered.size(); ++i) {
    const bool fails_by_coverage = covered[i].score.failed && !uncovered[i].score.failed;
    if (fails_by_coverage) shortfalls.push_back(covered[i].score.shortfall);
  }
  if (double(shortfalls.size()) < missing) return kInfinity;
  std::sort(shortfalls.begin(), shortfalls.end());
  return shortfalls[std::size_t(std::ceil(missing)) - 1];
}

/// Whether the target lies in the wanted bins; the first one that it misses.
const Quota* missed_quota(const WantedView& wanted, const Scored& scored, bool only_of_place) {
  for (std::size_t i = 0; i < wanted.bins.size(); ++i) {
    const Quota& quota = wanted.rule->quotas[i];
    if (!wanted.bins[i] || (only_of_place && !is_about_place(quota.of))) continue;
    if (bin_of(quota, *wanted.rule, *scored.target, scored.measures) != wanted.bins[i]) {
      return &quota;
    }
  }
  return nullptr;
}

ViewVerdict refused(const ViewRule& rule, const std::string& key, double shortfall) {
  return {{full_name(rule, key)}, shortfall};
}

bool wants_bins(const WantedView& wanted) {
  return std::any_of(wanted.bins.begin(), wanted.bins.end(),
                     [](const auto& bin) { return bin.has_value(); });
}

/// The indices of those that did not fail.
std::vector<std::size_t> largest_first(const std::vector<Scored>& scored) {
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < scored.size(); ++i) {
    if (!scored[i].score.failed) order.push_back(i);
  }
  std::ranges::stable_sort(order, std::ranges::greater(),
                           [&](std::size_t i) { return scored[i].measures.visible_pixels; });
  return order;
}

/// Refuses where every target that may turn out as the main one misses a quota about its place.
ViewVerdict judge_quotas_by_place(const WantedView& wanted, const std::vector<Scored>& scored,
                                  const auto& may_be_main, double shortfall) {
  const Quota* missed = nullptr;
  double most = -1.0;
  for (const Scored& one : scored) {
    if (one.score.failed || !may_be_main(one)) continue;
    const Quota* own = missed_quota(wanted, one, true);
    if (!own) return {};
    if (one.measures.visible_pixels > most) missed = own;
    most = std::max(most, one.measures.visible_pixels);
  }
  if (!missed) return {};
  return refused(*wanted.rule, "quotas." + missed->of, shortfall);
}

ViewVerdict judge_quotas_by_place(const WantedView& wanted, const std::vector<Scored>& scored,
                                  double shortfall) {
  return judge_quotas_by_place(
      wanted, scored, [](const Scored&) { return true; }, shortfall);
}

/// The pixels that the main target has at least.
double least_of_main(const std::vector<Scored>& scored, const Margins& margins) {
  double least = 0.0;
  for (const Scored& one : scored) {
    if (one.score.failed || !one.score.is_sure) continue;
    least = std::max(least, margins.pixels(one.measures.visible_pixels).low);
  }
  return least;
}

/// All that a rule says, once its targets have been scored.
ViewVerdict judge(const WantedView& wanted, const std::vector<Scored>& scored,
                  const Margins& margins) {
  const ViewRule& rule = *wanted.rule;
  const std::size_t holding = count_holding(scored);
  if (rule.count.min && double(holding) < *rule.count.min) {
    return missing_targets(rule, scored, holding);
  }
  const bool are_counted = margins.are_exact();
  if (are_counted && rule.count.max && double(holding) > *rule.count.max) {
    return refused(rule, "count", double(holding) - *rule.count.max);
  }
  if (rule.every_target) {
    ViewVerdict verdict;
    for (const Scored& one : scored) {
      if (one.measures.visible_pixels < 1.0 || !one.score.failed) continue;
      if (verdict.failed.empty()) verdict.failed = {full_name(rule, one.score.failed)};
      verdict.shortfall += one.score.shortfall;
    }
    if (!verdict.holds()) return verdict;
  }
  if (!wants_bins(wanted)) return {};
  if (!margins.are_exact()) {
    const double least = least_of_main(scored, margins);
    const auto may_be_main = [&](const Scored& one) {
      return margins.pixels(one.measures.visible_pixels).high >= least;
    };
    return judge_quotas_by_place(wanted, scored, may_be_main, 1.0);
  }
  const Scored* main = nullptr;
  for (const Scored& one : scored) {
    const bool is_larger =
        !one.score.failed && (!main || one.measures.visible_pixels > main->measures.visible_pixels);
    if (is_larger) main = &one;
  }
  if (!main) return refused(rule, "count", 1.0);
  if (const Quota* missed = missed_quota(wanted, *main, false)) {
    return refused(rule, "quotas." + missed->of, 1.0);
  }
  return {};
}

/// What one camera shows of the targets, each thing measured when it is first asked for.
class SeenTargets {
 public:
  SeenTargets(const std::vector<Target>& targets, const Scene& scene, NodeId camera,
              Image<std::uint32_t> leaves, const std::vector<std::uint32_t>& instance_of_leaf,
              int step)
      : leaves_(std::move(leaves)), step_(step) {
    frame_.camera_path = scene.path(camera);
    frame_.camera = *scene[camera].camera;
    frame_.set(kInstanceId, instance_ids(instance_of_leaf, leaves_));
    const auto& ids = frame_.get(kInstanceId);
    const std::map<std::uint32_t, std::int64_t> pixels = count_pixels(ids);
    std::vector<Instance> seen;
    for (const Target& target : targets) {
      const std::uint32_t id = target.instance.node.index;
      if (!pixels.contains(id)) continue;
      seen.push_back({});
      seen.back().id = id;
      seen.back().node_path = target.path;
    }
    measure_tight_boxes(ids, seen);
    for (const Instance& instance : seen) {
      Measures& own = known_[instance.id];
      own.visible_pixels = step_ * step_ * double(pixels.at(instance.id));
      const PixelBox& box = *instance.tight_box;
      own.size_px = step_ * std::max(box.width(), box.height());
      own.size_share =
          std::max(double(box.width()) / ids.width(), double(box.height()) / ids.height());
    }
  }

  void measure_pixels(Scored& target) const {
    const auto known = known_.find(target.target->instance.node.index);
    if (known == known_.end()) return;
    target.measures.visible_pixels = known->second.visible_pixels;
    target.measures.size_px = known->second.size_px;
    target.measures.size_share = known->second.size_share;
  }

  /// Finds the coverage of those that are seen and not covered yet; on demand not of those that
  /// failed already.
  void cover(const std::vector<Scored>& targets, bool only_holding, const auto& cover_targets) {
    std::vector<LabelledInstance> missing;
    frame_.instances.clear();
    for (const Scored& target : targets) {
      const std::uint32_t id = target.target->instance.node.index;
      if (!known_.contains(id) || covered_.contains(id)) continue;
      if (only_holding && target.score.failed) continue;
      covered_.insert(id);
      missing.push_back(target.target->instance);
      frame_.instances.push_back({});
      frame_.instances.back().id = id;
      frame_.instances.back().node_path = target.target->path;
    }
    if (missing.empty()) return;
    const std::vector<CoverageMask> masks = cover_targets(missing);
    measure_visibility(masks, false, frame_);
    for (std::size_t i = 0; i < missing.size(); ++i) {
      const Instance& instance = frame_.instances[i];
      const Visibility& visibility = *instance.visibility;
      Measures& own = known_.at(instance.id);
      const double all = double(visibility.amodal_pixels + visibility.outside_pixels);
      own.all_pixels = step_ * step_ * all;
      own.visible_share = all > 0.0 ? double(visibility.visible_pixels) / all : 0.0;
      own.occlusion = visibility.occlusion().value_or(1.0);
      own.truncation = visibility.truncation();
      own.occluders = occluders_of(masks[i], instance.id, frame_.get(kInstanceId), leaves_);
    }
  }

  /// Of what cover() was asked for.
  void measure_coverage(Scored& target) const {
    const auto known = known_.find(target.target->instance.node.index);
    if (known == known_.end()) return;
    target.measures.all_pixels = known->second.all_pixels;
    target.measures.visible_share = known->second.visible_share;
    target.measures.occlusion = known->second.occlusion;
    target.measures.truncation = known->second.truncation;
    target.measures.occluders = known->second.occluders;
  }

 private:
  Frame frame_;  ///< Instances are those that are being covered.
  Image<std::uint32_t> leaves_;
  double step_;  ///< Pixels of the picture from one of these to the next.
  std::map<std::uint32_t, Measures> known_;  ///< By id, of what has pixels.
  std::set<std::uint32_t> covered_;
};

}  // namespace

ViewCheck::ViewCheck(const Scene& scene, const std::vector<const ViewRule*>& rules)
    : state_(std::make_unique<State>()) {
  state_->instances = labelled_instances(scene);
  state_->instance_of_leaf = instance_of_leaf(state_->instances);
  std::map<const ViewRule*, std::set<NodeId>> wanted;
  std::set<NodeId> all;
  for (const ViewRule* rule : rules) {
    const std::vector<NodeId> nodes = scene.match(rule->targets);
    wanted[rule] = {nodes.begin(), nodes.end()};
    all.insert(nodes.begin(), nodes.end());
  }
  for (const LabelledInstance& instance : state_->instances) {
    if (all.contains(instance.node)) state_->targets.push_back(target_of(scene, instance));
  }
  for (const ViewRule* rule : rules) {
    std::vector<const Target*>& own = state_->of_rule[rule];
    for (const Target& target : state_->targets) {
      if (!wanted[rule].contains(target.instance.node)) continue;
      const bool has_label =
          rule->labels.empty() || std::find(rule->labels.begin(), rule->labels.end(),
                                            label_of(target, *rule)) != rule->labels.end();
      if (has_label) own.push_back(&target);
    }
  }
}

ViewCheck::~ViewCheck() = default;
ViewCheck::ViewCheck(ViewCheck&&) noexcept = default;
ViewCheck& ViewCheck::operator=(ViewCheck&&) noexcept = default;

bool ViewCheck::has_targets(const ViewRule& rule) const {
  return double(state_->targets_of(rule).size()) >= rule.count.min.value_or(0.0);
}

bool ViewCheck::has_label(const ViewRule& rule, const std::string& label) const {
  const auto& targets = state_->targets_of(rule);
  return std::any_of(targets.begin(), targets.end(),
                     [&](const Target* target) { return label_of(*target, rule) == label; });
}

ViewVerdict ViewCheck::by_place(const Scene& scene, NodeId camera, const WantedView& wanted) const {
  const ViewRule& rule = *wanted.rule;
  const Affine world_from_camera = scene.world_from_node(camera);
  const Affine camera_from_world = world_from_camera.inverse();
  const double widest = widest_angle(*scene[camera].camera);
  std::vector<Scored> scored = state_->by_place(rule, world_from_camera.translation());
  for (Scored& one : scored) {
    if (may_be_seen(*one.target, camera_from_world, widest)) {
      if (one.score.failed) continue;
      const auto reach = reach_of(*one.target, camera_from_world, *scene[camera].camera);
      if (reach) score_reach(rule, *reach, one.score);
      continue;
    }
    if (!one.score.failed) one.score.failed = "visible_pixels";
    one.score.shortfall += 1.0;
  }
  const std::size_t possible = count_holding(scored);
  if (rule.count.min && double(possible) < *rule.count.min) {
    ViewVerdict verdict = missing_targets(rule, std::move(scored), possible);
    verdict.shortfall += kUntraced;
    return verdict;
  }
  if (!wants_bins(wanted)) return {};
  if (possible == 0) return refused(rule, "count", kUntraced);
  return judge_quotas_by_place(wanted, scored, kUntraced);
}

ViewVerdict ViewCheck::by_labels(const Scene& scene, NodeId camera,
                                 const std::vector<WantedView>& wanted,
                                 const Labels& labels) const {
  const Margins margins(labels.step);
  SeenTargets seen(state_->targets, scene, camera, labels.render(), state_->instance_of_leaf,
                   labels.step);
  const Affine world_from_camera = scene.world_from_node(camera);
  const Affine camera_from_world = world_from_camera.inverse();
  const Vec3 camera_world = world_from_camera.translation();
  const double widest = margins.are_exact() ? kPi : widest_angle(*scene[camera].camera);
  ViewVerdict verdict;
  for (const WantedView& one : wanted) {
    const ViewRule& rule = *one.rule;
    std::vector<Scored> scored = state_->by_place(rule, camera_world);
    for (Scored& target : scored) {
      seen.measure_pixels(target);
      const bool is_out = !may_be_seen(*target.target, camera_from_world, widest);
      score_pixels(rule, target.measures, is_out ? Margins(1) : margins, target.score);
    }
    // What shares and coverage say makes no target hold that does not hold without them.
    const std::size_t possible = count_holding(scored);
    if (rule.count.min && double(possible) < *rule.count.min) {
      verdict.add(missing_targets(rule, std::move(scored), possible));
      continue;
    }
    if (!needs_coverage(rule)) {
      verdict.add(judge(one, scored, margins));
      continue;
    }
    // Coverage is dear: that of targets which cannot hold any more counts only where too few hold,
    // for what is nearest to holding, or where every target counts.
    if (wants_bins(one)) {
      const ViewVerdict quotas = judge_quotas_by_place(one, scored, 1.0);
      if (!quotas.holds()) {
        verdict.add(quotas);
        continue;
      }
    }
    std::vector<Scored> judged = scored;
    const auto add_coverage = [&](Scored& target) {
      seen.measure_coverage(target);
      // Known from the start, whatever share of the pixels was looked at.
      const auto reach = margins.are_exact()
                             ? std::nullopt
                             : reach_of(*target.target, camera_from_world, *scene[camera].camera);
      score_coverage(rule, target.measures, margins, reach && reach->is_whole, target.score);
    };
    if (rule.every_target) {
      seen.cover(judged, false, labels.cover);
      for (Scored& target : judged) add_coverage(target);
    } else {
      std::size_t covered = 0;  // that hold
      double least = 0.0;       // pixels of the main target
      for (const std::size_t i : largest_first(scored)) {
        const bool are_enough = !rule.count.max && rule.count.min.value_or(0.0) <= double(covered);
        const bool is_smaller = margins.pixels(scored[i].measures.visible_pixels).high < least;
        if (are_enough && (is_smaller || !wants_bins(one))) break;
        seen.cover({judged[i]}, true, labels.cover);
        add_coverage(judged[i]);
        if (judged[i].score.failed) continue;
        ++covered;
        if (!judged[i].score.is_sure) continue;
        least = std::max(least, margins.pixels(scored[i].measures.visible_pixels).low);
      }
    }
    const std::size_t holding = count_holding(judged);
    const bool lacks_targets = rule.count.min && double(holding) < *rule.count.min;
    if (lacks_targets && !rule.every_target) {
      // Coverage takes a target only farther from holding.
      const double nearest =
          shortfall_of_missing(judged, scored, *rule.count.min - double(holding));
      std::vector<Scored> nearer;
      for (const Scored& target : scored) {
        if (target.score.shortfall <= nearest) nearer.push_back(target);
      }
      seen.cover(nearer, false, labels.cover);
      for (std::size_t i = 0; i < scored.size(); ++i) {
        const bool is_new = scored[i].score.failed && scored[i].score.shortfall <= nearest;
        if (is_new) add_coverage(judged[i]);
      }
    }
    verdict.add(judge(one, judged, margins));
  }
  return verdict;
}

ViewVerdict judge_brightness(const ViewRule& rule, const Image<Rgba8>& picture) {
  std::uint64_t sum = 0;
  for (const Rgba8& pixel : picture.pixels()) {
    sum += std::uint64_t(pixel[0]) + pixel[1] + pixel[2];
  }
  const double mean =
      double(sum) / (3.0 * 255.0 * double(std::max<std::size_t>(picture.pixels().size(), 1)));
  if (rule.brightness.hold(mean)) return {};
  return refused(rule, "brightness", rule.brightness.shortfall(mean));
}

}  // namespace diorama
