// SPDX-License-Identifier: Apache-2.0
#include "framework/app/command_run.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <functional>
#include <iostream>
#include <mutex>
#include <optional>
#include <set>
#include <string_view>
#include <utility>

#include "framework/app/exit_codes.h"
#include "framework/app/heap.h"
#include "framework/app/shell_text.h"
#include "framework/app/standard_output.h"
#include "framework/config/job_overrides.h"
#include "framework/datasets/dataset_difference.h"
#include "framework/host/machine_limits.h"
#include "framework/host/progress_bar.h"
#include "framework/host/progress_lines.h"
#include "framework/jobs/assemble.h"
#include "framework/jobs/assemble_job.h"
#include "framework/jobs/job_file.h"
#include "framework/jobs/trial_run.h"
#include "framework/output/free_folders.h"
#include "framework/pipeline/capture_memory.h"
#include "framework/pipeline/dataset_description.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

// The one thing that a signal handler may reach.
std::atomic<bool> stop_requested = false;
static_assert(std::atomic<bool>::is_always_lock_free);

/// While it lives, the first Ctrl-C (or SIGTERM) asks the run to end, the second one ends the
/// program.
class StopOnSignal {
 public:
  StopOnSignal() {
    stop_requested = false;
    std::signal(SIGINT, &StopOnSignal::handle);
    std::signal(SIGTERM, &StopOnSignal::handle);
  }
  ~StopOnSignal() {
    std::signal(SIGINT, SIG_DFL);
    std::signal(SIGTERM, SIG_DFL);
  }
  StopOnSignal(const StopOnSignal&) = delete;
  StopOnSignal& operator=(const StopOnSignal&) = delete;

 private:
  static void handle(int signal) {
    stop_requested = true;
    std::signal(signal, SIG_DFL);
  }
};

OutputStore::Existing existing_policy(const RunCommandOptions& options) {
  if (options.resume && options.overwrite) {
    throw Error(ErrorKind::Usage, "--resume and --overwrite exclude each other");
  }
  if (options.overwrite && (options.shards > 1 || options.takes_visits)) {
    throw Error(ErrorKind::Usage,
                "--overwrite and --shard exclude each other, as one shard would remove the work of "
                "the others");
  }
  if (options.overwrite) return OutputStore::Existing::Overwrite;
  // Shards join a dataset.
  const bool joins = options.resume || options.shards > 1 || options.takes_visits;
  return joins ? OutputStore::Existing::Resume : OutputStore::Existing::Refuse;
}

/// `has_begun` becomes true with the first thing that the run says of itself.
RunSummary run_job(JobAssembly& assembly, HostServices& host, const RunCommandOptions& options,
                   ConsoleLog& log, bool& has_begun) {
  const StopOnSignal stop;
  host.stop_on(stop_requested);
  LocalFileSystem file_system;
  OutputStore::Options store_options;
  store_options.existing = existing_policy(options);
  store_options.shard = options.shard;
  store_options.shards = options.shards;
  store_options.takes_visits = options.takes_visits;
  store_options.verifies_all = options.verify;
  store_options.lease_timeout = std::chrono::seconds(options.lease_timeout_s);
  store_options.warn = [&](const std::string& text) { log.write(LogLevel::Warning, text); };
  OutputStore store(file_system, output_folders(assembly.job), assembly.plan.capture_count(),
                    store_options);
  std::optional<ProgressBar> bar;
  std::optional<ProgressLines> lines;
  if (options.progress != RunCommandOptions::Progress::Bar) {
    lines.emplace(options.progress == RunCommandOptions::Progress::Json
                      ? ProgressLines::Format::Json
                      : ProgressLines::Format::OpenJd,
                  std::cout);
  }
  RunOptions run;
  run.shard = options.shard;
  run.shards = options.shards;
  run.takes_visits = options.takes_visits;
  run.queue_bytes =
      options.queue_mib > 0
          ? std::size_t(options.queue_mib) << 20
          : default_queue_bytes(host.thread_count(), available_memory(), memory_of(assembly));
  run.stop = &stop_requested;
  run.only_finishes = options.only_finishes;
  run.only = options.only;
  using Clock = std::chrono::steady_clock;
  run.progress = [&, next_trim = Clock::now()](const RunProgress& progress) mutable {
    constexpr Clock::duration kBetweenTrims = std::chrono::milliseconds(100);
    constexpr int kOfTime = 10;  // trims take at most one part of so many
    has_begun = true;
    if (const auto now = Clock::now(); now >= next_trim) {
      next_trim = now + std::max(kBetweenTrims, kOfTime * give_free_pages_back());
    }
    if (lines) {
      lines->update(progress.done, progress.total, progress.resumed, progress.respawned,
                    progress.refused);
      return;
    }
    if (!bar) bar.emplace(log, "captures", progress.total);
    bar->update(progress.done, progress.resumed);
  };
  Pipeline pipeline(assembly.job, assembly.plan, assembly.components, host, store, run);
  return pipeline.run(assembly.dataset, assembly.dataset_json);
}

void log_lines(const std::string& text, ConsoleLog& log) {
  std::size_t start = 0;
  while (start < text.size()) {
    const std::size_t end = std::min(text.find('\n', start), text.size());
    log.write(LogLevel::Info, text.substr(start, end - start));
    start = end + 1;
  }
}

/// Where the dataset is, and what comes after it.
void log_next_step(const RunSummary& summary, const fs::path& dataset, ConsoleLog& log) {
  const std::string folder = shell_word(dataset.string());
  log.write(LogLevel::Info, "dataset: " + dataset.string());
  log.write(LogLevel::Info, summary.is_finished
                                ? "next: diorama lint " + folder + ", diorama view " + folder
                                : "next: diorama status " + folder);
}

/// The same for what stopped or failed before its end.
void log_way_on(const fs::path& dataset, ConsoleLog& log) {
  log.write(LogLevel::Info, "dataset: " + dataset.string());
  log.write(LogLevel::Info,
            "next: the same command with --resume, diorama view " + shell_word(dataset.string()));
}

/// The plan, and what a capture needs.
void print_plan(const GlobalOptions& global, const Value& job, const Log& log) {
  const JobServices services = make_job_services(global, job, log);
  const JobAssembly assembly =
      assemble_job(job, *services.registry, *services.host, services.assets_root, program_version(),
                   AssembleFor::Plan);
  print_text(plan_text(assembly.plan, assembly.job, services.assets_root) +
             memory_text(memory_of(assembly)));
}

/// The plan, then what a trial of it says. Both read the job; what they say about it is said once.
void print_estimate(const GlobalOptions& global, const Value& job, int visits_in_flight,
                    ConsoleLog& log) {
  std::set<std::string, std::less<>> said;
  std::mutex mutex;
  const Log once = [&](LogLevel level, std::string_view text) {
    {
      const std::lock_guard lock(mutex);
      if (!said.emplace(text).second) return;
    }
    log.write(level, text);
  };
  print_plan(global, job, once);
  std::cout.flush();
  TrialOptions trial;
  trial.is_within_visit = true;
  trial.spread = 2;
  trial.max_samples = 2;
  trial.visits_in_flight = visits_in_flight;
  print_text(estimate_text(run_trial(global, job, trial, once)));
}

int run_value(const GlobalOptions& global, const Value& job, const RunCommandOptions& options,
              ConsoleLog& log) {
  give_large_blocks_back();
  share_heaps(thread_count(global));
  const JobServices services = make_job_services(global, job, log.sink());
  JobAssembly assembly =
      assemble_job(job, *services.registry, *services.host, services.assets_root, program_version(),
                   AssembleFor::Run, options.visits_in_flight);
  if (options.again_of) {
    require_same_assets(*options.again_of, assembly.dataset_json, services.assets_root);
  }
  check_folders_are_free(output_folders(assembly.job));
  const fs::path dataset = output_folders(assembly.job).records_path();
  bool has_begun = false;
  try {
    const RunSummary summary = run_job(assembly, *services.host, options, log, has_begun);
    log_lines(summary_text(summary), log);
    if (!options.only) log_next_step(summary, dataset, log);
    return 0;
  } catch (const Interrupted&) {
    log.write(LogLevel::Warning, "interrupted; '--resume' goes on");
    if (!options.only) log_way_on(dataset, log);
    return options.stopped_exit_code;
  } catch (const std::exception&) {
    if (has_begun && !options.only) log_way_on(dataset, log);
    throw;
  }
}

}  // namespace

int command_run(const GlobalOptions& global, const RunCommandOptions& options, ConsoleLog& log) {
  existing_policy(options);
  const Value job = load_job(options.job, log.sink());
  if (options.plan) {
    print_plan(global, job, log.sink());
    return 0;
  }
  if (options.dry_run) {
    print_estimate(global, job, options.visits_in_flight, log);
    return 0;
  }
  return run_value(global, job, options, log);
}

int finish_dataset(const GlobalOptions& global, const DatasetStatus& status, ConsoleLog& log) {
  const Value job = job_of(status, status.base);
  RunCommandOptions options;
  options.resume = true;
  options.takes_visits = true;
  options.only_finishes = true;
  return run_value(global, job, options, log);
}

fs::path make_captures_again(const GlobalOptions& global, const fs::path& dataset,
                             const DatasetStatus& status, const fs::path& output,
                             std::set<int> captures, const std::vector<std::string>& sets,
                             ConsoleLog& log) {
  Value job = job_of(status, output);
  for (const std::string& assignment : sets) apply_set(job, assignment);
  RunCommandOptions options;
  options.only = std::move(captures);
  if (sets.empty()) options.again_of = dataset;
  run_value(global, job, options, log);
  const Value* section = job.find("output");
  const Value* records = section ? section->find("records") : nullptr;
  return records ? output / records->scalar : output;
}

}  // namespace diorama
