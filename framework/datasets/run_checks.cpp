// SPDX-License-Identifier: Apache-2.0
#include "framework/datasets/run_checks.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "diorama/writer.h"
#include "framework/config/json_text.h"
#include "framework/datasets/capture_sweep.h"
#include "framework/datasets/check_names.h"
#include "framework/datasets/frame_checks.h"
#include "framework/datasets/level_agreement.h"
#include "framework/datasets/track_agreement.h"
#include "framework/output/file_system.h"

namespace diorama {
namespace {

using Json = nlohmann::json;

constexpr const char* kBetween = "writers of one run agree";

/// Lossy pictures of the same thing differ by less than this in the mean, of 255.
constexpr double kLossyMean = 12.0;
/// What is as frequent as this is another choice of objects or classes, not a fault.
constexpr double kRare = 0.2;
constexpr std::size_t kMostExamples = 100;
/// A box that is so much larger than another one's has as many pixels, whatever its shape.
constexpr double kMuchLarger = 5.0;
/// Shares are quotients of pixel counts, which formats round.
constexpr double kShareSlack = 1e-3;
/// Keypoints are rounded to a few digits.
constexpr double kKeypointSlack = 0.05;
/// Boxes that are rounded to more do not tell objects apart.
constexpr int kTellingPixels = 16;

/// What the page of the run plans; nothing when there is none.
struct RunPlan {
  int captures = 0;
  std::vector<std::string> cameras;
  std::vector<DatasetClip> clips;
  std::set<std::string> folders;  ///< Of its writers.
  Json seed;
};

std::vector<DatasetClip> planned_clips(const Json& page) {
  std::vector<DatasetClip> clips;
  for (const Json& clip : page.value("clips", Json::array())) {
    clips.push_back({whole_of_json<int>(clip.at("first_capture")),
                     whole_of_json<int>(clip.at("frame_count")), clip.at("fps").get<double>()});
  }
  return clips;
}

std::optional<RunPlan> read_plan(const std::filesystem::path& run, ReadLog& log) {
  LocalFileSystem file_system;
  if (!file_system.exists(run / "dataset.json")) return std::nullopt;
  ++log.files;
  try {
    const Json page = parse_json(file_system.read(run / "dataset.json"));
    std::set<std::string> folders;
    for (const Json& writer : page.value("writers", Json::array())) {
      if (writer.is_object()) folders.insert(writer.at("folder").get<std::string>());
    }
    return RunPlan{whole_of_json<int>(page.at("captures")),
                   page.at("cameras").get<std::vector<std::string>>(), planned_clips(page),
                   std::move(folders), page.value("seed", Json())};
  } catch (const std::exception& error) {
    log.findings.push_back(
        {kFilesCanBeRead, "dataset.json", std::nullopt, "", "", error.what(), ""});
    return std::nullopt;
  }
}

/// Captures that a clip of the plan begins with begin one in the dataset, as long and as fast.
void check_clips(const RunPlan& plan, const RunDataset& dataset, ReadLog& log) {
  const StoredInfo& info = dataset.data->info();
  if (!info.holds.contains(kHoldsClips)) return;
  for (std::size_t i = 0; i < plan.clips.size(); ++i) {
    const DatasetClip& clip = plan.clips[i];
    const auto place = std::ranges::lower_bound(info.captures, clip.first);
    if (place == info.captures.end() || *place != clip.first) continue;
    const auto stored = dataset.data->read(std::size_t(place - info.captures.begin()), {});
    const auto& found = stored.capture.clip;
    const bool is_same = found && found->clip == int(i) && found->frame == 0 &&
                         found->frame_count == clip.count && found->fps == clip.fps;
    log.check(is_same, {kCountsAgree, dataset.name, clip.first, "", "clip " + std::to_string(i),
                        !found ? "is none"
                               : "has " + std::to_string(found->frame_count) + " frames, " +
                                     std::to_string(found->fps) + " per second",
                        "dataset.json plans " + std::to_string(clip.count) + ", " +
                            std::to_string(clip.fps) + " per second"});
  }
}

void check_plan(const RunPlan& plan, const RunDataset& dataset, ReadLog& log) {
  const StoredInfo& info = dataset.data->info();
  // What holds no pictures may leave captures out.
  const bool is_whole = info.holds.contains(kColor.name) || info.holds.contains(kColorHdr.name);
  log.check(!is_whole || int(info.captures.size()) == plan.captures,
            {kNothingIsMissing, dataset.name, std::nullopt, "", "",
             "holds " + std::to_string(info.captures.size()) + " captures",
             "dataset.json plans " + std::to_string(plan.captures)});
  // A folder without any picture is one that was asked for nothing: what lost all of them has
  // nothing that it could be known by.
  const bool has_names = !info.camera_names.empty() &&
                         info.camera_names != std::vector<std::string>{"camera"} &&
                         !info.steps.contains(kAskCamerasOfPairs);
  for (const std::string& camera : plan.cameras) {
    log.check(!has_names || std::ranges::find(info.camera_names, camera) != info.camera_names.end(),
              {kNothingIsMissing, dataset.name, std::nullopt, camera, "",
               "has no pictures of this camera", ""});
  }
  check_clips(plan, dataset, log);
}

/// A writer's folder may have been taken away, but not have become one that no writer has.
void check_folders(const std::filesystem::path& run, const RunPlan& plan,
                   const std::vector<RunDataset>& datasets, ReadLog& log) {
  LocalFileSystem file_system;
  const auto stranger = std::ranges::find_if(datasets, [&](const RunDataset& dataset) {
    return !plan.folders.empty() && !plan.folders.contains(dataset.name);
  });
  for (const std::string& folder : plan.folders) {
    log.check(stranger == datasets.end() || file_system.exists(run / folder),
              {kCountsAgree, "dataset.json", std::nullopt, "", folder,
               "is a writer's folder that is not there",
               stranger == datasets.end() ? "" : "no writer has the folder " + stranger->name});
  }
}

/// The pages of a run's datasets say its seed.
void check_seed(const std::filesystem::path& run, const RunPlan& plan, const RunDataset& dataset,
                ReadLog& log) {
  LocalFileSystem file_system;
  const std::string file = dataset.name + "/dataset.json";
  if (plan.seed.is_null() || !file_system.exists(run / file)) return;
  const Json page = parse_json_or_nothing<Json>(file_system.read(run / file));
  if (!page.is_object() || !page.contains("seed")) return;
  log.check(page["seed"] == plan.seed,
            {kCountsAgree, file, std::nullopt, "", "seed", "is " + page["seed"].dump(),
             plan.seed.dump() + " by the run's dataset.json"});
}

/// An object of one dataset without a partner in the other, or with one of a rare class.
struct Example {
  Finding finding;
  std::int64_t count = 0;
};

Affine camera_from_object(const Frame& frame, const Instance& object) {
  return frame.world_from_camera.inverse() * object.world_from_node;
}

bool has_box_3d(const Frame& frame, const Instance& object) {
  const Affine pose = camera_from_object(frame, object);
  return !object.bounds_node.is_empty() && pose.matrix().allFinite() &&
         std::abs(pose.linear().determinant()) > 0.0;
}

/// How far, in metres, the least box along the axes of `box` that holds the other's corners is from
/// `box`: 0 for equal boxes, and for an upright box around a tilted one.
double misfit(const Affine& camera_from_box, const Aabb& box, const Affine& camera_from_other,
              const Aabb& other) {
  const Affine box_from_other = camera_from_box.inverse() * camera_from_other;
  Aabb extent;
  for (int i = 0; i < 8; ++i) extent.add(box_from_other * other.corner(i));
  const Vec3 off = (extent.min - box.min).cwiseAbs().cwiseMax((extent.max - box.max).cwiseAbs());
  return off.cwiseProduct(camera_from_box.linear().colwise().norm().transpose()).maxCoeff();
}

/// Channels of which few formats have any, so that the dataset that holds most may not.
constexpr std::array kRareChannels{std::string_view(kNormals.name), std::string_view(kMotion.name),
                                   std::string_view(kFlowForward.name),
                                   std::string_view(kFlowBackward.name)};

/// What two datasets say beside pictures and the places of objects.
NameSet shared_facts(const StoredInfo& a, const StoredInfo& b) {
  NameSet facts;
  for (const std::string_view channel : kRareChannels) {
    if (a.holds.contains(channel) && b.holds.contains(channel)) facts.emplace(channel);
  }
  const auto add = [&](std::string_view held, const char* asked) {
    if (!a.holds.contains(held)) return;
    if (b.holds.contains(held))
      facts.emplace(held);
    else if (b.steps.contains(std::string_view(asked)))
      facts.emplace(asked);
  };
  add(kHoldsOcclusion, kAskOcclusionLevels);
  add(kHoldsTruncation, kAskTruncationLevels);
  const auto holds_share = [](const StoredInfo& info) {
    return info.holds.contains(kHoldsOcclusion) && info.holds.contains(kHoldsTruncation);
  };
  if (holds_share(a) && b.steps.contains(std::string_view(kAskSeenShares))) {
    facts.emplace(kAskSeenShares);
  }
  if (a.holds.contains(kHoldsKeypoints) && b.holds.contains(kHoldsKeypoints)) {
    facts.emplace(kHoldsKeypoints);
  }
  return facts;
}

/// Compares a dataset with the one that holds most, or, with a third one, in what that does not
/// tell: `facts` is of shared_facts().
class RunComparison {
 public:
  RunComparison(const RunDataset& reference, const RunDataset& other, NameSet facts, bool is_all)
      : reference_(reference),
        other_(other),
        a_(reference.data->info()),
        b_(other.data->info()),
        facts_(std::move(facts)),
        is_all_(is_all) {}

  NameSet wanted() const {
    NameSet both = facts_;
    // Levels and the like go with shares of the other.
    both.insert({std::string(kHoldsInstances), std::string(kHoldsTightBoxes),
                 std::string(kHoldsOcclusion), std::string(kHoldsTruncation)});
    if (!is_all_) return both;
    for (const std::string& name : b_.holds) {
      if (a_.holds.contains(name) && name != "amodal_mask" && name != "pointcloud") {
        both.insert(name);
      }
    }
    if (knows_sights()) both.emplace(kInstanceId.name);
    return both;
  }

  void compare(const StoredCapture& a, const StoredCapture& b, ReadLog& log) {
    for (std::size_t k = 0; k < b.capture.frames.size(); ++k) {
      const std::size_t camera = camera_of(b_, b.capture.frames[k]);
      for (std::size_t i = 0; i < a.capture.frames.size(); ++i) {
        if (is_same_camera(a.capture.frames[i], b.capture.frames[k], camera)) {
          compare_frames(a, i, b, k, log);
        }
      }
    }
  }

  /// What was rare enough to be a fault.
  void finish(ReadLog& log) {
    find_lost(log);
    const bool is_other_choice =
        double(unmatched_) > kRare * double(std::max<std::int64_t>(objects_, 1));
    for (Unmatched& object : unmatched_examples_) {
      // The reference may leave out what is small.
      const bool is_small = !object.is_over_some && object.area < kMuchLarger * least_area_;
      if (!is_other_choice && !is_small) log.findings.push_back(std::move(object.finding));
    }
    for (auto& [what, agreement] : agreements_) {
      ++log.checks;
      const double rare = std::max(1.0, kRare * double(agreement.count));
      if (agreement.count < 2 || double(agreement.wrong_count) > rare) continue;
      for (Finding& finding : agreement.wrong) log.findings.push_back(std::move(finding));
    }
    for (auto& [asked, levels] : levels_) levels.finish(log);
    tracks_.finish(log);
    for (auto& [labels, classes] : classes_of_labels_) {
      std::int64_t all = 0;
      for (const auto& [name, example] : classes) all += example.count;
      for (auto& [name, example] : classes) {
        ++log.checks;
        if (double(example.count) > kRare * double(all)) continue;
        example.finding.expected += "; most such objects are called otherwise";
        log.findings.push_back(std::move(example.finding));
      }
    }
  }

 private:
  static std::size_t camera_of(const StoredInfo& info, const Frame& frame) {
    return std::size_t(std::ranges::find(info.camera_names, frame.camera_name) -
                       info.camera_names.begin());
  }

  /// One camera alone may have no name in a format.
  bool is_same_camera(const Frame& a, const Frame& b, std::size_t camera_of_b) const {
    if (a.camera_name == b.camera_name) return true;
    const bool is_nameless = a_.camera_names.size() == 1 && b_.camera_names.size() == 1;
    return is_nameless && camera_of(a_, a) == camera_of_b;
  }

  Finding about(const StoredCapture& b, std::size_t k, std::string_view held,
                const std::string& object, const std::string& found,
                const std::string& expected) const {
    return {kBetween,        other_.name + "/" + file_of(b, k, held),
            b.capture.index, b.capture.frames[k].camera_name,
            object,          found,
            expected};
  }

  void compare_frames(const StoredCapture& a, std::size_t i, const StoredCapture& b, std::size_t k,
                      ReadLog& log) {
    const Frame& one = a.capture.frames[i];
    const Frame& other = b.capture.frames[k];
    const auto in_reference = [&](std::string_view held) {
      return reference_.name + "/" + file_of(a, i, held);
    };
    const bool is_same_size =
        one.camera.width == other.camera.width && one.camera.height == other.camera.height;
    log.check(is_same_size, about(b, k, kColor.name, "", "has another size of picture",
                                  "that of " + in_reference(kColor.name)));
    if (!is_same_size) return;
    if (is_all_ && one.has(kColor.name) && other.has(kColor.name)) {
      log.check(is_same_picture(one, other),
                about(b, k, kColor.name, "", "is another picture than", in_reference(kColor.name)));
    }
    compare_depth(one, other, b, k, in_reference(kDistanceToImagePlane.name), log);
    compare_vectors(kNormals, one, other, b, k, in_reference(kNormals.name), log);
    for (const Channel<Vec2f>& channel : {kMotion, kFlowForward, kFlowBackward}) {
      compare_vectors(channel, one, other, b, k, in_reference(channel.name), log);
    }
    if (have_partners()) compare_objects(a, i, b, k, in_reference(kHoldsInstances), log);
  }

  bool is_same_picture(const Frame& one, const Frame& other) const {
    const auto a = one.get(kColor).pixels();
    const auto b = other.get(kColor).pixels();
    const bool is_lossy = step_of(a_, kColor.name) > 0.0 || step_of(b_, kColor.name) > 0.0;
    std::uint64_t sum = 0;
    for (std::size_t i = 0; i < a.size(); ++i) {
      for (std::size_t c = 0; c < 3; ++c)
        sum += std::uint64_t(std::abs(int(a[i][c]) - int(b[i][c])));
    }
    if (!is_lossy) return sum == 0;
    return double(sum) <= kLossyMean * 3.0 * double(std::max<std::size_t>(a.size(), 1));
  }

  void compare_depth(const Frame& one, const Frame& other, const StoredCapture& b, std::size_t k,
                     const std::string& in_reference, ReadLog& log) const {
    const Channel<float>& channel = kDistanceToImagePlane;
    if (!one.has(channel.name) || !other.has(channel.name)) return;
    const auto p = one.get(channel).pixels();
    const auto q = other.get(channel).pixels();
    const double step = step_of(a_, channel.name) + step_of(b_, channel.name) + 1e-5;
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < p.size(); ++i) {
      // A format of 16 bits ends before far walls do.
      if (!std::isfinite(p[i]) || !std::isfinite(q[i])) continue;
      if (std::abs(double(p[i]) - double(q[i])) > step) ++wrong;
    }
    log.check(wrong == 0,
              about(b, k, channel.name, "",
                    std::to_string(wrong) + " pixels have another depth than in", in_reference));
  }

  template <class Vector>
  void compare_vectors(const Channel<Vector>& channel, const Frame& one, const Frame& other,
                       const StoredCapture& b, std::size_t k, const std::string& in_reference,
                       ReadLog& log) const {
    if (!one.has(channel.name) || !other.has(channel.name)) return;
    const auto p = one.get(channel).pixels();
    const auto q = other.get(channel).pixels();
    const double step = 2.0 * (step_of(a_, channel.name) + step_of(b_, channel.name)) + 1e-4;
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < p.size(); ++i) {
      if (!p[i].allFinite() || !q[i].allFinite()) continue;  // said where it stands
      if (double((p[i] - q[i]).cwiseAbs().maxCoeff()) > step) ++wrong;
    }
    log.check(wrong == 0,
              about(b, k, channel.name, "", std::to_string(wrong) + " pixels have others than in",
                    in_reference));
  }

  /// Objects are the same by name, or else by place.
  bool have_partners() const { return are_named() || have_boxes(); }
  bool are_named() const {
    return a_.holds.contains(kHoldsNodePaths) && b_.holds.contains(kHoldsNodePaths);
  }
  bool have_boxes() const {
    return a_.holds.contains(kHoldsTightBoxes) && b_.holds.contains(kHoldsTightBoxes) &&
           box_slack() < kTellingPixels;
  }
  int box_slack() const {
    return int(std::ceil(step_of(a_, kHoldsTightBoxes) + step_of(b_, kHoldsTightBoxes)));
  }

  bool is_namesake(const Instance& one, const Instance& other) const {
    return are_named() && one.node_path == other.node_path;
  }
  bool is_in_place(const Instance& one, const Instance& other) const {
    return have_boxes() && one.tight_box && other.tight_box &&
           is_near(*one.tight_box, *other.tight_box, box_slack());
  }

  /// The one of the same name, or else all in the same place.
  std::vector<const Instance*> partners_of(const Frame& one, const Instance& object) const {
    std::vector<const Instance*> partners;
    for (const Instance& candidate : one.instances) {
      if (is_namesake(candidate, object)) return {&candidate};
      if (is_in_place(candidate, object)) partners.push_back(&candidate);
    }
    return partners;
  }

  void compare_objects(const StoredCapture& a, std::size_t i, const StoredCapture& b, std::size_t k,
                       const std::string& in_reference, ReadLog& log) {
    const Frame& one = a.capture.frames[i];
    std::map<std::uint32_t, std::int64_t> pixels;
    if (one.has(kInstanceId.name)) {
      for (const std::uint32_t id : one.get(kInstanceId).pixels()) ++pixels[id];
    }
    for (const Instance& object : b.capture.frames[k].instances) {
      if (have_boxes() && !object.tight_box) continue;
      ++objects_;
      ++log.checks;
      const std::vector<const Instance*> partners = partners_of(one, object);
      if (partners.empty()) {
        ++unmatched_;
        if (is_all_ && unmatched_examples_.size() < kMostExamples) {
          const PixelBox box = object.tight_box.value_or(PixelBox());
          unmatched_examples_.push_back(
              {about(b, k, kHoldsTightBoxes, object.node_path,
                     have_boxes() ? "lies where no object is" : "is no object",
                     (have_boxes() ? "the place of an object in " : "one of those in ") +
                         in_reference),
               area_of(box), !have_boxes() || is_over_some(one, box)});
        }
        continue;
      }
      // Of several in one place, none says which is meant.
      if (partners.size() != 1) continue;
      const Instance& partner = *partners.front();
      remember_facts(partner, b, k, object, in_reference);
      remember_keypoints(a, i, partner, b, k, object, in_reference);
      if (!is_all_) continue;
      if (have_boxes() && partner.tight_box) {
        remember("box", is_in_place(partner, object), [&] {
          return about(b, k, kHoldsTightBoxes, object.node_path, "lies elsewhere than",
                       "it does in " + in_reference);
        });
      }
      if (!is_namesake(partner, object)) remember_track(partner, b, k, object, in_reference);
      remember_class(partner, object, b, k, in_reference);
      remember_box(one, partner, b, k, object, in_reference);
      remember_place(partner, b, k, object, in_reference);
      const auto seen = pixels.find(partner.id);
      if (seen != pixels.end()) remember_pixels(seen->second, b, k, object, in_reference);
    }
    if (!is_all_) return;
    remember_areas(one);
    if (knows_sights()) remember_choice(one, b, k, in_reference, pixels);
  }

  static double area_of(const PixelBox& box) {
    return (double(box.x_max) - box.x_min) * (double(box.y_max) - box.y_min);
  }

  /// Whether the reference has an object in about the same place.
  static bool is_over_some(const Frame& one, const PixelBox& box) {
    return std::ranges::any_of(one.instances, [&](const Instance& other) {
      if (!other.tight_box) return false;
      const PixelBox& at = *other.tight_box;
      const PixelBox both{std::max(at.x_min, box.x_min), std::max(at.y_min, box.y_min),
                          std::min(at.x_max, box.x_max), std::min(at.y_max, box.y_max)};
      return !both.is_empty() && 2.0 * area_of(both) > std::max(area_of(at), area_of(box));
    });
  }

  void remember_areas(const Frame& one) {
    for (const Instance& object : one.instances) {
      if (object.tight_box) least_area_ = std::min(least_area_, area_of(*object.tight_box));
    }
  }

  /// Where most objects differ in something, a format measures it in its own way.
  template <class Make>
  void remember(const std::string& what, bool is_same, Make&& make) {
    Agreement& agreement = agreements_[what];
    ++agreement.count;
    if (is_same) return;
    ++agreement.wrong_count;
    if (agreement.wrong.size() < kMostExamples) agreement.wrong.push_back(make());
  }

  void remember_number(const std::string& what, std::string_view held, double first, double second,
                       double slack, const StoredCapture& b, std::size_t k, const Instance& object,
                       const std::string& in_reference) {
    remember(what, std::abs(first - second) <= slack, [&] {
      return about(b, k, held, object.node_path, "its " + what + " is " + std::to_string(second),
                   std::to_string(first) + ", as in " + in_reference);
    });
  }

  /// Hidden and cut off shares, or levels of them.
  void remember_facts(const Instance& partner, const StoredCapture& b, std::size_t k,
                      const Instance& object, const std::string& in_reference) {
    if (!partner.visibility || !object.visibility) return;
    const Visibility& said = *object.visibility;
    const auto compare = [&](std::string_view held, const char* asked, std::optional<double> first,
                             std::optional<double> second) {
      if (!first || !second) return;
      if (facts_.contains(held)) {
        const double slack = step_of(a_, held) + step_of(b_, held) + kShareSlack;
        remember_number(std::string(held), held, *first, *second, slack, b, k, object,
                        in_reference);
      }
      if (!facts_.contains(asked)) return;
      if (const double step = step_of(b_, asked); step < 1.0) {
        remember_number(std::string(held), held, *first, *second, step + kShareSlack, b, k, object,
                        in_reference);
        return;
      }
      levels_[asked].add(*second, *first, [&] {
        return about(b, k, held, object.node_path,
                     "its level of " + std::string(held) + " does not go with others",
                     "one for " + std::to_string(*first) + ", as in " + in_reference);
      });
    };
    compare(kHoldsOcclusion, kAskOcclusionLevels, partner.visibility->occlusion(),
            said.occlusion());
    compare(kHoldsTruncation, kAskTruncationLevels, partner.visibility->truncation(),
            said.truncation());
    const auto seen_share = [](const Visibility& seen) {
      return (1.0 - seen.occlusion().value_or(0.0)) * (1.0 - seen.truncation());
    };
    if (facts_.contains(kAskSeenShares)) {
      remember_number("visible share", kHoldsOcclusion, seen_share(*partner.visibility),
                      seen_share(said), kShareSlack, b, k, object, in_reference);
    }
  }

  /// Pixels of the reference's masks against what the other dataset counts.
  void remember_pixels(std::int64_t pixels, const StoredCapture& b, std::size_t k,
                       const Instance& object, const std::string& in_reference) {
    if (!b_.holds.contains(kHoldsOcclusion) || !object.visibility) return;
    remember_number("count of visible pixels", kHoldsOcclusion, double(pixels),
                    double(object.visibility->visible_pixels), 0.5, b, k, object, in_reference);
  }

  /// Poses of named objects; those of boxes are remember_box()'s.
  void remember_place(const Instance& partner, const StoredCapture& b, std::size_t k,
                      const Instance& object, const std::string& in_reference) {
    const auto holds = [](const StoredInfo& info) {
      return info.holds.contains(kHoldsPoses) && info.holds.contains(kHoldsCameraPose);
    };
    if (!are_named() || !holds(a_) || !holds(b_)) return;
    const Vec3 first = partner.world_from_node.translation();
    const double off = (first - object.world_from_node.translation()).norm();
    const double slack =
        step_of(a_, kHoldsPoses) + step_of(b_, kHoldsPoses) + 1e-3 * (1.0 + first.norm());
    remember("place", off <= slack, [&] {
      return about(b, k, kHoldsPoses, object.node_path, "is " + std::to_string(off) + " m beside",
                   "its place in " + in_reference);
    });
  }

  void remember_track(const Instance& partner, const StoredCapture& b, std::size_t k,
                      const Instance& object, const std::string& in_reference) {
    const auto& clip = b.capture.clip;
    const bool is_named = a_.holds.contains(kHoldsNodePaths);
    if (!clip || !b_.holds.contains(kHoldsTracks)) return;
    if (!is_named && !a_.holds.contains(kHoldsTracks)) return;
    const std::string name = is_named ? partner.node_path : std::to_string(partner.id);
    tracks_.add(*clip, b.capture.frames[k].camera_name, name, object.id, [&] {
      return about(b, k, kHoldsInstances, "track " + std::to_string(object.id),
                   "is " + name + " by " + in_reference, "the same object in all of the clip");
    });
  }

  void remember_keypoints(const StoredCapture& a, std::size_t i, const Instance& partner,
                          const StoredCapture& b, std::size_t k, const Instance& object,
                          const std::string& in_reference) {
    if (!facts_.contains(kHoldsKeypoints)) return;
    if (i >= a.keypoints.size() || k >= b.keypoints.size()) return;
    const auto first = a.keypoints[i].find(partner.id);
    const auto second = b.keypoints[k].find(object.id);
    if (first == a.keypoints[i].end() || second == b.keypoints[k].end()) return;
    const double slack =
        kKeypointSlack + step_of(a_, kHoldsKeypoints) + step_of(b_, kHoldsKeypoints);
    const auto is_same = [&](const StoredKeypoint& one, const StoredKeypoint& other) {
      if (one.sight != other.sight) return false;
      if (one.sight == StoredKeypoint::Sight::NotTold) return true;
      return (one.pixel - other.pixel).cwiseAbs().maxCoeff() <= slack;
    };
    remember("keypoints", std::ranges::equal(first->second, second->second, is_same), [&] {
      return about(b, k, kHoldsKeypoints, object.node_path, "its keypoints are others than",
                   "those in " + in_reference);
    });
  }

  /// What is seen of an object, by which writers leave some out.
  struct Sight {
    std::int64_t pixels = 0;
    double share = 1.0;

    bool is_at_least(const Sight& other) const {
      return pixels >= other.pixels && share >= other.share;
    }
  };

  bool knows_sights() const {
    return a_.holds.contains(kInstanceId.name) && a_.holds.contains(kHoldsOcclusion) &&
           a_.holds.contains(kHoldsTightBoxes) && have_partners() &&
           a_.holds.contains(kHoldsLabels);
  }

  /// Which objects of the reference the other dataset has, and which not.
  void remember_choice(const Frame& one, const StoredCapture& b, std::size_t k,
                       const std::string& in_reference,
                       std::map<std::uint32_t, std::int64_t>& pixels) {
    if (!one.has(kInstanceId.name)) return;
    for (const Instance& object : one.instances) {
      const auto occlusion = object.visibility ? object.visibility->occlusion() : std::nullopt;
      if (!object.tight_box || object.labels.empty() || !occlusion) continue;
      const auto& others = b.capture.frames[k].instances;
      const bool is_there = std::ranges::any_of(others, [&](const Instance& other) {
        return is_namesake(object, other) || is_in_place(object, other);
      });
      const Sight sight{pixels[object.id], 1.0 - *occlusion};
      Choice& choice = choices_[text_of(object.labels)];
      ++(is_there ? choice.kept_count : choice.missing_count);
      if (is_there && kept_.size() < kMostExamples) kept_.push_back(sight);
      if (is_there || choice.missing.size() >= kMostExamples) continue;
      choice.missing.emplace_back(sight, about(b, k, kHoldsTightBoxes, object.node_path,
                                               "is not there", "an object as in " + in_reference));
    }
  }

  /// An object that is not there while another one is of which less was seen has been lost, if that
  /// is rare among its kind: a class may be left out as a whole.
  void find_lost(ReadLog& log) {
    for (auto& [labels, choice] : choices_) {
      ++log.checks;
      const double rare = std::max(1.0, kRare * double(choice.kept_count));
      if (double(choice.missing_count) > rare) continue;
      for (auto& [sight, finding] : choice.missing) {
        const bool is_lost =
            std::ranges::any_of(kept_, [&](const Sight& kept) { return sight.is_at_least(kept); });
        if (is_lost) log.findings.push_back(std::move(finding));
      }
    }
  }

  static bool is_near(const PixelBox& a, const PixelBox& b, int slack) {
    return std::abs(a.x_min - b.x_min) <= slack && std::abs(a.y_min - b.y_min) <= slack &&
           std::abs(a.x_max - b.x_max) <= slack && std::abs(a.y_max - b.y_max) <= slack;
  }

  static std::string text_of(const Labels& labels) {
    std::string text;
    for (const auto& [taxonomy, label] : labels) {
      text += (text.empty() ? "" : ", ") + taxonomy + ": " + label;
    }
    return text;
  }

  void remember_class(const Instance& partner, const Instance& object, const StoredCapture& b,
                      std::size_t k, const std::string& in_reference) {
    if (partner.labels.empty() || object.labels.empty()) return;
    const std::string name = text_of(object.labels);
    Example& example = classes_of_labels_[text_of(partner.labels)][name];
    if (++example.count > 1) return;
    example.finding = about(b, k, kHoldsLabels, object.node_path, "is called " + name,
                            text_of(partner.labels) + ", by " + in_reference);
  }

  /// Formats have boxes along an object's own axes or upright ones. What is wrong with all objects
  /// of a kind is a format's way of measuring it.
  void remember_box(const Frame& one, const Instance& partner, const StoredCapture& b,
                    std::size_t k, const Instance& object, const std::string& in_reference) {
    if (!a_.holds.contains(kHoldsBoxes3d) || !b_.holds.contains(kHoldsBoxes3d)) return;
    const Frame& other = b.capture.frames[k];
    if (!has_box_3d(one, partner) || !has_box_3d(other, object)) return;
    const Affine first = camera_from_object(one, partner);
    const Affine second = camera_from_object(other, object);
    const double off = std::min(misfit(first, partner.bounds_node, second, object.bounds_node),
                                misfit(second, object.bounds_node, first, partner.bounds_node));
    const auto step = [](const StoredInfo& info) {
      return std::max(step_of(info, kHoldsPoses), step_of(info, kHoldsBoxes3d));
    };
    const double size = (first.linear() * partner.bounds_node.size()).norm();
    const double slack =
        2.0 * (step(a_) + step(b_)) + 1e-3 * (size + 0.1 * first.translation().norm());
    remember("3-D box of " + text_of(partner.labels), off <= slack, [&] {
      return about(b, k, kHoldsBoxes3d, object.node_path,
                   "its 3-D box is off by " + std::to_string(off) + " m",
                   "the place, size and turn that it has in " + in_reference);
    });
  }

  const RunDataset& reference_;
  const RunDataset& other_;
  const StoredInfo& a_;
  const StoredInfo& b_;
  NameSet facts_;
  bool is_all_;
  std::int64_t objects_ = 0;
  std::int64_t unmatched_ = 0;
  struct Unmatched {
    Finding finding;
    double area = 0.0;          ///< Of its box, pixels.
    bool is_over_some = false;  ///< See is_over_some().
  };
  std::vector<Unmatched> unmatched_examples_;
  double least_area_ = std::numeric_limits<double>::infinity();  ///< In the reference.
  struct Choice {
    std::int64_t kept_count = 0;
    std::int64_t missing_count = 0;
    std::vector<std::pair<Sight, Finding>> missing;
  };
  std::map<std::string, Choice> choices_;  ///< By labels in the reference.
  std::vector<Sight> kept_;                ///< Of all of them.
  struct Agreement {
    std::int64_t count = 0;
    std::int64_t wrong_count = 0;
    std::vector<Finding> wrong;
  };
  std::map<std::string, Agreement> agreements_;   ///< By what is compared.
  std::map<std::string, LevelAgreement> levels_;  ///< By what was asked for.
  TrackAgreement tracks_;
  /// Labels in the reference, then classes in the other dataset.
  std::map<std::string, std::map<std::string, Example>> classes_of_labels_;
};

void compare_datasets(const RunDataset& reference, const RunDataset& other, const NameSet& facts,
                      bool is_all, Host& host, ReadLog& log) {
  RunComparison comparison(reference, other, facts, is_all);
  const NameSet wanted = comparison.wanted();
  const std::vector<int>& captures = reference.data->info().captures;
  struct Pair {
    StoredCapture a;
    StoredCapture b;
  };
  sweep_captures<Pair>(
      *other.data, wanted, host,
      [&](StoredCapture b) {
        Pair pair;
        const auto place = std::ranges::lower_bound(captures, b.capture.index);
        if (place != captures.end() && *place == b.capture.index) {
          pair.a = reference.data->read(std::size_t(place - captures.begin()), wanted);
        }
        pair.b = std::move(b);
        return pair;
      },
      [&](const Pair& pair) { comparison.compare(pair.a, pair.b, log); });
  comparison.finish(log);
}

/// What the reference does not tell and a third dataset does.
void compare_rest(const std::vector<RunDataset>& datasets, const RunDataset& reference,
                  const RunDataset& dataset, const NameSet& compared, Host& host, ReadLog& log) {
  const RunDataset* third = nullptr;
  NameSet rest;
  for (const RunDataset& candidate : datasets) {
    if (&candidate == &reference || &candidate == &dataset) continue;
    NameSet facts = shared_facts(candidate.data->info(), dataset.data->info());
    // Channels are compared with an earlier dataset, once.
    const bool is_later = &candidate > &dataset;
    std::erase_if(facts, [&](const std::string& name) {
      const bool is_channel = std::ranges::find(kRareChannels, name) != kRareChannels.end();
      return compared.contains(name) || (is_later && is_channel);
    });
    if (facts.size() <= rest.size()) continue;
    rest = std::move(facts);
    third = &candidate;
  }
  if (third) compare_datasets(*third, dataset, rest, false, host, log);
}

}  // namespace

ReadLog check_run(const std::filesystem::path& run, const std::vector<RunDataset>& datasets,
                  Host& host) {
  ReadLog log;
  if (const auto plan = read_plan(run, log)) {
    check_folders(run, *plan, datasets, log);
    for (const RunDataset& dataset : datasets) {
      check_plan(*plan, dataset, log);
      check_seed(run, *plan, dataset, log);
    }
  }
  if (datasets.size() < 2) return log;
  const auto reference = std::ranges::max_element(
      datasets, {}, [](const RunDataset& dataset) { return dataset.data->info().holds.size(); });
  for (const RunDataset& dataset : datasets) {
    if (&dataset == &*reference) continue;
    const NameSet facts = shared_facts(reference->data->info(), dataset.data->info());
    compare_datasets(*reference, dataset, facts, true, host, log);
    compare_rest(datasets, *reference, dataset, facts, host, log);
  }
  return log;
}

}  // namespace diorama
