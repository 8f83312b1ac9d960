// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "diorama/annotator.h"
#include "diorama/host.h"
#include "diorama/loader.h"
#include "diorama/physics_backend.h"
#include "diorama/randomizer.h"
#include "diorama/renderer.h"
#include "diorama/writer.h"
#include "framework/output/output_store.h"
#include "framework/pipeline/capture_plan.h"
#include "framework/pipeline/demand.h"
#include "framework/pipeline/job.h"
#include "framework/pipeline/pattern_check.h"
#include "framework/pipeline/settle_check.h"
#include "framework/pipeline/settling.h"
#include "framework/pipeline/view_report.h"
#include "framework/pipeline/writer_queue.h"

namespace diorama {

/// Everything that a job's entries turned into, in the order of the job.
struct JobComponents {
  std::vector<std::unique_ptr<Loader>> environments;
  std::vector<std::unique_ptr<PhysicsBackend>> physics;  ///< Empty or one.
  std::unique_ptr<Renderer> renderer;
  std::vector<std::unique_ptr<Randomizer>> randomizers;
  std::vector<std::unique_ptr<Writer>> writers;
  /// Those that the writers' needs ask for, in working order.
  struct NamedAnnotator {
    std::string type;
    std::unique_ptr<Annotator> annotator;
  };
  std::vector<NamedAnnotator> annotators;
  Demand demand;
  /// Of randomizers; they can be tried only once an environment is there.
  std::vector<EnvironmentPattern> environment_patterns;
};

/// How far a run is.
struct RunProgress {
  int done = 0;       ///< With `resumed`.
  int total = 0;      ///< Of this shard; of the whole job with RunOptions::takes_visits.
  int resumed = 0;    ///< Were there before.
  int respawned = 0;  ///< Objects that had left the room and were placed anew.
};

struct RunOptions {
  int shard = 0;
  int shards = 1;
  bool takes_visits = false;               ///< Instead of a shard: visits that no other worker has.
  bool only_finishes = false;              ///< Makes no captures.
  std::optional<std::set<int>> only = {};  ///< Captures to make; the others are left out.
  std::size_t queue_bytes = std::size_t(256) << 20;  ///< Of captures that wait to be written.
  const std::atomic<bool>* stop = nullptr;           ///< True asks the run to end soon.
  /// Called on the main thread after each capture.
  std::function<void(const RunProgress&)> progress;
};

struct RunSummary {
  int captures = 0;  ///< Made by this run.
  int resumed = 0;   ///< Were there before.
  int cameras = 0;
  int respawned = 0;         ///< Objects that had left the room and were placed anew.
  int missing = 0;           ///< Captures of the job that other workers have to make.
  bool is_finished = false;  ///< The dataset is complete, whoever finished it.
  std::uint64_t bytes_written = 0;
  std::map<std::string, double> seconds;  ///< Phase to wall time.
  std::vector<VisitReport> visits;
  ViewCounts views;  ///< Of the captures that this run made.
};

std::string summary_text(const RunSummary& summary);

/// The run was asked to stop; what is on disk can be resumed.
class Interrupted final : public std::exception {
 public:
  ~Interrupted() override;
  const char* what() const noexcept override { return "interrupted"; }
};

/// Runs a planned job. The source reads in the order in which things happen.
class Pipeline {
 public:
  /// All references must outlive the pipeline.
  Pipeline(const Job& job, const CapturePlan& plan, JobComponents& components, Host& host,
           OutputStore& store, RunOptions options);
  ~Pipeline();

  /// `dataset_json` is the text of dataset.json. Throws Error, Busy when other processes have this
  /// part of the job, and Interrupted when asked to stop.
  RunSummary run(const DatasetInfo& dataset, const std::string& dataset_json);

 private:
  struct Visit;
  class Clock;
  void run_visit(const PlannedVisit& planned);
  Visit set_up(const PlannedVisit& planned);
  void randomize(Visit& visit, const std::string& moment, int number, int capture);
  struct Draw;
  std::vector<std::size_t> call_randomizers(Visit& visit, const std::string& moment, int number,
                                            int capture, const Draw& draw);
  void simulate(Visit& visit, const TimelineStep& step);
  void advance(Visit& visit, const TimelineStep& step);
  std::vector<Flaw> unsettled(const Visit& visit, const TimelineStep& step) const;
  void respawn(Visit& visit, const std::vector<Flaw>& flaws);
  void drop(Visit& visit, const std::vector<Flaw>& flaws);
  void reset_physics(Visit& visit);
  void take_captures(Visit& visit, const TimelineStep& step);
  void take(Visit& visit, const PlannedCapture& planned);
  std::vector<ViewOutcome> take_frames(Visit& visit, const PlannedCapture& planned,
                                       std::vector<Frame>& frames);
  void prepare_renderer(const Visit& visit);
  Frame make_frame(Visit& visit, std::size_t camera, int capture);
  Image<Rgba8> make_overview(Visit& visit, int capture);
  VisitReport report_on(const Visit& visit) const;
  /// Calls `visit` with every planned visit of this shard.
  void for_each_visit(const std::function<void(const PlannedVisit&)>& visit) const;
  void end_early();
  bool is_needed(const PlannedVisit& planned) const;
  bool is_needed(int capture) const;
  void run_visits();
  void begin_output();
  void write(const PendingCapture& pending);
  void finish_output(const DatasetInfo& dataset);
  void stop_if_asked() const;

  const Job& job_;
  const CapturePlan& plan_;
  JobComponents& components_;
  Host& host_;
  OutputStore& store_;
  RunOptions options_;
  JobStreams streams_;
  const DatasetInfo* dataset_ = nullptr;
  const std::string* dataset_json_ = nullptr;
  bool has_begun_ = false;
  int total_ = 0;
  RunSummary summary_;
  std::unique_ptr<WriterQueue> queue_;
};

}  // namespace diorama
