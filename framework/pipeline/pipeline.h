// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "diorama/writer.h"
#include "framework/host/host_services.h"
#include "framework/output/output_store.h"
#include "framework/pipeline/capture_plan.h"
#include "framework/pipeline/environment_patterns.h"
#include "framework/pipeline/job.h"
#include "framework/pipeline/job_components.h"
#include "framework/pipeline/settling.h"
#include "framework/pipeline/view_report.h"
#include "framework/pipeline/visit_run.h"
#include "framework/pipeline/writer_queue.h"

namespace diorama {

/// How far a run is.
struct RunProgress {
  int done = 0;              ///< On disk, with `resumed`.
  int total = 0;             ///< Of this shard; of the whole job with RunOptions::takes_visits.
  int resumed = 0;           ///< Were there before.
  int respawned = 0;         ///< Objects that had left the room and were placed anew.
  std::int64_t refused = 0;  ///< Views that did not hold and were drawn again.
};

struct RunOptions {
  int shard = 0;
  int shards = 1;
  bool takes_visits = false;               ///< Instead of a shard: visits that no other worker has.
  bool only_finishes = false;              ///< Makes no captures.
  std::optional<std::set<int>> only = {};  ///< Captures to make; the others are left out.
  std::size_t queue_bytes = std::size_t(256) << 20;  ///< Of captures that wait to be written.
  /// Whether writers get captures in their order, and none of a visit before all of those before it
  /// were made. If not, later visits are encoded meanwhile; either way they are published in order.
  bool encodes_in_order = false;
  const std::atomic<bool>* stop = nullptr;  ///< True asks the run to end soon.
  /// Called on the main thread after each capture, and while and after the last ones are written.
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
  double wall_s = 0.0;
  std::map<std::string, double> seconds;  ///< Phase to wall time, summed over all visits.
  SettleSummary settled;                  ///< Of all visits.
  ViewCounts views;                       ///< Of the captures that this run made.
};

std::string summary_text(const RunSummary& summary);

/// Runs a planned job: as many visits at a time as there are sets of components, each by a thread
/// of its own (a single one by the calling thread), their captures handed on in planned order. What
/// is on disk, and what is thrown, is what the visits would have left one after the other (ADR
/// 0052).
class Pipeline {
 public:
  /// All references must outlive the pipeline. Made and run by the thread that made the host.
  Pipeline(const Job& job, const CapturePlan& plan, JobComponents& components, HostServices& host,
           OutputStore& store, RunOptions options);
  ~Pipeline();

  /// `dataset_json` is the text of dataset.json. Throws Error, Busy when other processes have this
  /// part of the job, and Interrupted when asked to stop.
  RunSummary run(const DatasetInfo& dataset, const std::string& dataset_json);

 private:
  struct Flight;
  struct Turn;
  void run_visits();
  void take_turns(VisitComponents& components);
  std::optional<Turn> next_turn();
  std::optional<PlannedVisit> next_visit();
  VisitResult run_visit(const Turn& turn, VisitComponents& components);
  void end_turn(const Turn& turn, VisitResult result);
  void fail_turn(const Turn& turn, std::exception_ptr error);
  void add_up(VisitResult result);
  void wait_for_output(const Turn& turn);
  void hand_over(const Turn& turn, PendingCapture pending, const VisitResult& result);
  void tell_written();
  void call_on_main_thread(const std::function<void()>& call);
  void serve_visits();
  bool has_to_stop(const Turn& turn) const;
  /// Calls `visit` with every planned visit of this shard.
  void for_each_visit(const std::function<void(const PlannedVisit&)>& visit) const;
  void end_early();
  bool is_needed(const PlannedVisit& planned) const;
  bool is_needed(int capture) const;
  void begin_output();
  Transaction encode(const PendingCapture& pending);
  void finish_output(const DatasetInfo& dataset);

  const Job& job_;
  const CapturePlan& plan_;
  JobComponents& components_;
  HostServices& host_;
  OutputStore& store_;
  RunOptions options_;
  JobStreams streams_;
  EnvironmentPatterns environment_patterns_;
  const DatasetInfo* dataset_ = nullptr;
  const std::string* dataset_json_ = nullptr;
  int total_ = 0;
  std::atomic<int> written_ = 0;  ///< Captures, by this run.
  std::optional<RunProgress> told_;
  RunSummary summary_;
  std::unique_ptr<Flight> flight_;
  std::unique_ptr<WriterQueue> queue_;
};

}  // namespace diorama
