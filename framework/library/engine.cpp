// SPDX-License-Identifier: Apache-2.0
#include "diorama/engine.h"

#include <dlfcn.h>

#include <mutex>
#include <optional>
#include <utility>

#include "framework/config/yaml_config.h"
#include "framework/datasets/dataset_readers.h"
#include "framework/host/machine_limits.h"
#include "framework/jobs/assemble.h"
#include "framework/jobs/assemble_job.h"
#include "framework/jobs/job_file.h"
#include "framework/jobs/run_in_memory.h"
#include "framework/output/free_folders.h"
#include "framework/pipeline/capture_memory.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

/// The file that this code was loaded from.
fs::path library_file() {
  Dl_info info{};
  if (dladdr(reinterpret_cast<const void*>(&library_file), &info) == 0 || !info.dli_fname) {
    throw Error(ErrorKind::Internal, "libdiorama does not know where it lies");
  }
  std::error_code failed;
  const fs::path file = fs::canonical(info.dli_fname, failed);
  if (failed) {
    throw Error(ErrorKind::Internal, std::string(info.dli_fname) + ": " + failed.message());
  }
  return file;
}

/// One message at a time.
Log serialized(std::function<void(LogLevel, std::string_view)> sink) {
  if (!sink) return [](LogLevel, std::string_view) {};
  return [sink = std::move(sink), mutex = std::make_shared<std::mutex>()](LogLevel level,
                                                                          std::string_view text) {
    const std::lock_guard lock(*mutex);
    sink(level, text);
  };
}

JobOptions options_of(const JobChanges& changes) {
  JobOptions options;
  options.sets = changes.sets;
  options.seed = changes.seed;
  options.output = changes.output;
  return options;
}

OutputStore::Existing policy_of(RunJobOptions::Existing existing) {
  switch (existing) {
    case RunJobOptions::Existing::Refuse:
      return OutputStore::Existing::Refuse;
    case RunJobOptions::Existing::Resume:
      return OutputStore::Existing::Resume;
    case RunJobOptions::Existing::Overwrite:
      return OutputStore::Existing::Overwrite;
  }
  throw Error(ErrorKind::Usage, "there is no such RunJobOptions::Existing");
}

}  // namespace

class Engine::Impl {
 public:
  explicit Impl(EngineOptions& options)
      : log_(serialized(std::move(options.log))), components_(options.components) {
    global_.program = program_beside(library_file());
    global_.threads = options.threads;
    global_.asset_cache_mib = options.asset_cache_mib;
    global_.plugin_dirs = std::move(options.plugin_dirs);
    global_.assets_root = std::move(options.assets_root);
  }

  const Log& log() const { return log_; }

  JobServices services_for(const Value& job) const {
    return make_job_services(global_, job, log_, components_);
  }

  DatasetReaders& readers() {
    if (!readers_) {
      services_ = services_for(Value());
      readers_.emplace(*services_.registry, *services_.host);
    }
    return *readers_;
  }

  RunSummary run(JobAssembly& assembly, HostServices& host, const RunJobOptions& options) const {
    RunOptions run;
    run.encodes_in_order = options.encodes_in_order;
    run.stop = options.stop;
    run.queue_bytes =
        default_queue_bytes(host.thread_count(), available_memory(), memory_of(assembly));
    if (options.progress) {
      run.progress = [&](const RunProgress& progress) {
        options.progress({progress.done, progress.total, progress.resumed});
      };
    }
    if (!options.keeps_files) return run_in_memory(assembly, host, run);
    const OutputFolders folders = output_folders(assembly.job);
    check_folders_are_free(folders);
    LocalFileSystem file_system;
    OutputStore::Options store_options;
    store_options.existing = policy_of(options.existing);
    store_options.warn = [this](const std::string& text) { log_(LogLevel::Warning, text); };
    OutputStore store(file_system, folders, assembly.plan.capture_count(), store_options);
    return Pipeline(assembly.job, assembly.plan, assembly.components, host, store, run)
        .run(assembly.dataset, assembly.dataset_json);
  }

 private:
  GlobalOptions global_;
  Log log_;
  void (*components_)(Registrar&);
  JobServices services_;  ///< Of readers.
  std::optional<DatasetReaders> readers_;
};

Engine::Engine(std::uint64_t sdk_headers, std::uint64_t engine_headers, EngineOptions& options) {
  // Before anything of the caller's is touched.
  if (sdk_headers != DIORAMA_HEADERS_DIGEST || engine_headers != DIORAMA_ENGINE_DIGEST) {
    throw Error(ErrorKind::Plugin, library_file().string() +
                                       ": the program was compiled with headers of another "
                                       "version than " +
                                       program_version() + " of this library; build it again");
  }
  impl_ = std::make_unique<Impl>(options);
}

Engine::~Engine() = default;

std::string Engine::version() { return program_version(); }

Value Engine::load_job(const fs::path& file, const JobChanges& changes) const {
  JobOptions options = options_of(changes);
  options.job = file;
  return diorama::load_job(options, impl_->log());
}

Value Engine::parse_job(std::string_view text, const JobChanges& changes,
                        std::string_view name) const {
  return native_job(parse_yaml(std::string(text), std::string(name)), options_of(changes),
                    impl_->log());
}

Value Engine::check_job(const Value& job) {
  const JobServices services = impl_->services_for(job);
  return diorama::check_job(job, *services.registry, *services.host);
}

RunJobResult Engine::run_job(const Value& job, const RunJobOptions& options) {
  const JobServices services = impl_->services_for(job);
  if (options.stop) services.host->stop_on(*options.stop);
  RunJobResult result;
  try {
    JobAssembly assembly = assemble_job(job, *services.registry, *services.host,
                                        services.assets_root, program_version(), AssembleFor::Run);
    if (options.keeps_files) result.dataset = output_folders(assembly.job).records_path();
    const RunSummary summary = impl_->run(assembly, *services.host, options);
    result.captures = summary.captures;
    result.resumed = summary.resumed;
    result.is_finished = summary.is_finished;
  } catch (const Interrupted&) {
    result.is_stopped = true;
  } catch (const Stopped&) {
    result.is_stopped = true;
  } catch (const Busy& busy) {
    throw Error(ErrorKind::Output, busy.what());
  }
  return result;
}

std::vector<DatasetPlace> Engine::find_datasets(const fs::path& folder) {
  std::vector<DatasetPlace> places;
  for (FoundDataset& found : diorama::find_datasets(folder, impl_->readers())) {
    places.push_back({std::move(found.folder), std::move(found.reader)});
  }
  return places;
}

std::unique_ptr<const StoredDataset> Engine::open_dataset(const fs::path& folder,
                                                          const std::string& reader) {
  const FoundDataset found = find_dataset(folder, impl_->readers(), reader);
  return impl_->readers().open(found.folder, found.reader, DatasetReaders::LostCaptures::Throw);
}

}  // namespace diorama
