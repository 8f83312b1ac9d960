// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "diorama/frame.h"
#include "diorama/rng.h"
#include "diorama/scene.h"
#include "diorama/writer.h"
#include "framework/pipeline/job.h"

namespace diorama {

/// What a job will do, known in full before anything is loaded, so that every capture can be made
/// alone: by a shard, or by a run that goes on after an interruption.

/// An environment and the entry of the job's list that names it.
struct EnvironmentChoice {
  std::string asset;
  std::size_t entry = 0;
};

/// An object that a visit spawns.
struct PlannedObject {
  std::size_t group = 0;  ///< Index into Job::objects.
  std::string asset;
  std::string name;  ///< Of its node; unique below ObjectGroup::under.
  std::string path;
  Labels labels;
  bool floats = false;  ///< Without gravity.
};

struct PlannedCapture {
  int index = 0;  ///< Capture::index.
  std::string phase;
  int number = 0;  ///< From 0 within its series and visit; of a clip's frames that of the clip.
  std::optional<ClipFrame> clip;
};

struct PlannedVisit {
  int index = 0;
  std::size_t environment = 0;  ///< Index into CapturePlan::environments.
  int first_capture = 0;        ///< Those of a visit are numbered in a row.
  int capture_count = 0;        ///< At least 1; the last visit of a job may have fewer than others.
};

/// Captures that follow each other in one visit and belong to one series.
struct PlannedSeries {
  std::string phase;
  int count = 0;
  double fps = 0.0;  ///< Above 0: the frames of one clip.
};

/// Visits and captures follow from the timeline by a formula, so a plan takes the same memory for
/// any number of them. Both are counted from 0.
class CapturePlan {
 public:
  CapturePlan() = default;
  /// Throws Error(Config) when captures are wanted and the timeline has none.
  CapturePlan(const Job& job, std::vector<EnvironmentChoice> environments);

  std::vector<EnvironmentChoice> environments;
  std::vector<std::vector<std::string>> object_assets;  ///< Per group, what is picked from.
  std::vector<PlannedObject> objects;                   ///< Of the first visit.

  int capture_count() const { return capture_count_; }
  int visit_count() const;
  PlannedVisit visit(int index) const;
  PlannedCapture capture(int index) const;
  std::vector<PlannedSeries> series(const PlannedVisit& visit) const;
  /// Of all visits.
  std::vector<DatasetClip> clips() const;

 private:
  /// Captures of one series that follow each other in the timeline.
  struct Step {
    std::string phase;
    std::int64_t first = 0;  // of the visit's captures
    std::int64_t count = 0;
    std::int64_t first_number = 0;
    double fps = 0.0;       // of a clip; 0: single captures
    std::int64_t clip = 0;  // of the visit's
  };
  std::vector<Step> steps_;
  std::int64_t captures_per_visit_ = 0;
  std::int64_t clips_per_visit_ = 0;
  int capture_count_ = 0;
};

/// `environments` is not empty. `object_assets` holds, per group of the job, what to pick from.
/// Throws Error(Config) when a group wants objects and has nothing to pick from.
CapturePlan plan_captures(const Job& job, std::vector<EnvironmentChoice> environments,
                          const std::vector<std::vector<std::string>>& object_assets);

/// The objects of any visit, found without those before it.
std::vector<PlannedObject> plan_objects(const Job& job,
                                        const std::vector<std::vector<std::string>>& object_assets,
                                        int visit);

/// Calls body(object) for objects of the job's visits until every asset and its labels came up.
void visit_planned_objects(const Job& job, const CapturePlan& plan,
                           const std::function<void(const PlannedObject&)>& body);

/// The assets of each group that no visit uses, in the loader's order.
std::vector<std::vector<std::string>> unused_assets(const Job& job, const CapturePlan& plan);

/// Visits of a shard: those whose index leaves remainder `shard` when divided by `shards`.
inline bool is_in_shard(int visit, int shard, int shards) { return visit % shards == shard; }

/// How a randomizer is called at one moment.
struct RandomizerCall {
  int visit = 0;       ///< The visit whose random stream it draws from.
  int occurrence = 0;  ///< RandomizeContext::occurrence.
};

/// Whether and how `entry` acts at the `number`th moment called `moment` (from 0) of a visit. Of
/// captures and events it acts at every RandomizerEntry::every'th; what it did stays until then. A
/// visit starts with a fresh scene, so at the moment "environment" it acts always, and repeats what
/// it drew in the last visit that was its turn.
std::optional<RandomizerCall> randomizer_call(const Job& job, const RandomizerEntry& entry,
                                              const std::string& moment, int visit, int number);

/// "banana" of "/a/011_banana.usd" and of "sample:banana".
std::string asset_stem(std::string_view asset);

/// The random streams of a job. Each depends on the seed and on what it is for, and on nothing
/// else.
class JobStreams {
 public:
  explicit JobStreams(std::uint64_t seed) : root_(seed) {}

  /// `visit` is -1 for what is picked once per job.
  Rng object(std::string_view group, int number, int visit) const;
  /// For how many objects of a group a visit has.
  Rng fewer(std::string_view group, int visit) const;
  /// For the order of a group's assets in one round through all of them.
  Rng round(std::string_view group, std::uint64_t number) const;
  /// `occurrence` tells calls at the same moment of one visit apart: the capture's index, or a
  /// running number for events.
  Rng randomizer(std::string_view name, int visit, std::string_view moment, int occurrence) const;
  /// For the order in which the parts of a quota come up.
  Rng views(std::string_view rule, std::size_t quota) const;
  std::uint64_t render_seed(int capture, std::string_view camera) const;

 private:
  Rng root_;
};

}  // namespace diorama
