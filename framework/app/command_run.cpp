// SPDX-License-Identifier: Apache-2.0
#include "framework/app/command_run.h"

#include <atomic>
#include <csignal>
#include <cstdlib>
#include <iostream>
#include <optional>

#include "framework/app/assemble.h"
#include "framework/app/assemble_job.h"
#include "framework/app/job_file.h"
#include "framework/app/output_check.h"
#include "framework/config/clean_text.h"
#include "framework/host/progress_bar.h"
#include "framework/pipeline/dataset_description.h"
#include "framework/plugins/plugin_search.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

constexpr int kInterrupted = 130;

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
  if (options.overwrite && options.shards > 1) {
    throw Error(ErrorKind::Usage,
                "--overwrite and --shard exclude each other, as one shard would remove the work of "
                "the others");
  }
  if (options.overwrite) return OutputStore::Existing::Overwrite;
  // Shards join a dataset.
  return options.resume || options.shards > 1 ? OutputStore::Existing::Resume
                                              : OutputStore::Existing::Refuse;
}

RunSummary run_job(JobAssembly& assembly, Host& host, const RunCommandOptions& options,
                   ConsoleLog& log) {
  const StopOnSignal stop;
  LocalFileSystem file_system;
  OutputStore store(file_system, output_folders(assembly.job), assembly.plan.capture_count());
  std::optional<ProgressBar> bar;
  RunOptions run;
  run.shard = options.shard;
  run.shards = options.shards;
  run.existing = existing_policy(options);
  run.queue_bytes = std::size_t(options.queue_mib) << 20;
  run.stop = &stop_requested;
  run.progress = [&](int done, int total, int resumed) {
    if (!bar) bar.emplace(log, "captures", total);
    bar->update(done, resumed);
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

}  // namespace

int command_run(const GlobalOptions& global, const RunCommandOptions& options, ConsoleLog& log) {
  existing_policy(options);
  const Value job = load_job(options.job, log.sink());
  const std::unique_ptr<Registry> registry = make_registry(global, log.sink());
  warn_of_rejected(*registry, log.sink());
  const std::optional<std::string> job_root = assets_root_of(job);
  const std::unique_ptr<HostServices> host = make_host(*registry, global, job_root, log.sink());
  const std::optional<fs::path> assets_root =
      choose_assets_root(global.assets_root, std::getenv("DIORAMA_ASSETS_ROOT"), job_root,
                         sample_pack_folder(global.program));
  JobAssembly assembly = assemble_job(job, *registry, *host, assets_root, program_version(),
                                      options.dry_run ? AssembleFor::Plan : AssembleFor::Run);
  if (options.dry_run) {
    std::cout << printable(plan_text(assembly.plan, assembly.job, assets_root));
    return 0;
  }
  check_folders_are_free(output_folders(assembly.job));
  try {
    const RunSummary summary = run_job(assembly, *host, options, log);
    log_lines(summary_text(summary), log);
    return 0;
  } catch (const Interrupted&) {
    log.write(LogLevel::Warning, "interrupted; `--resume` goes on");
    return kInterrupted;
  }
}

}  // namespace diorama
