// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "diorama/config.h"
#include "diorama/engine_digest.h"
#include "diorama/headers_digest.h"
#include "diorama/host.h"
#include "diorama/plugin.h"
#include "diorama/reader.h"

/// The whole of libdiorama: datasets and jobs for programs of others. All else comes from the SDK:
/// captures are those that writers get, values those of job files.
namespace diorama {

struct EngineOptions {
  /// Gets what there is to say, from any thread, never two at once; without one nothing is said.
  std::function<void(LogLevel, std::string_view)> log;
  std::vector<std::filesystem::path> plugin_dirs;  ///< Looked at first.
  std::optional<std::filesystem::path> assets_root;
  int threads = 0;  ///< 0: as many as the machine offers.
  int asset_cache_mib = 1024;
  /// Components of the caller's own, beside those of plugins: writers that hand captures on,
  /// randomizers, loaders. As in a plugin: `add<MyWriter>(registrar, "my_writer", "Does this.")`.
  void (*components)(Registrar&) = nullptr;
};

/// What is changed in a job after it was read.
struct JobChanges {
  std::vector<std::string> sets;  ///< "renderer.samples=16", in order.
  std::optional<std::uint64_t> seed;
  std::optional<std::string> output;  ///< Folder.
};

struct JobProgress {
  int done = 0;     ///< Captures, with `resumed`.
  int total = 0;    ///< Of the job.
  int resumed = 0;  ///< Were there before.
};

struct RunJobOptions {
  enum class Existing : std::uint8_t { Refuse, Resume, Overwrite };

  Existing existing = Existing::Refuse;  ///< When the dataset is there.
  /// False: no file is written. What writers do with captures is what is left.
  bool keeps_files = true;
  /// Writers get captures in their order. If not, later visits are encoded meanwhile.
  bool encodes_in_order = false;
  const std::atomic<bool>* stop = nullptr;  ///< True asks the run to end soon.
  /// Called by the thread that runs the job.
  std::function<void(const JobProgress&)> progress;
};

struct RunJobResult {
  std::filesystem::path dataset;  ///< The folder of dataset.json; empty when nothing was kept.
  int captures = 0;               ///< Made by this run.
  int resumed = 0;                ///< Were there before.
  bool is_finished = false;       ///< The dataset is complete.
  bool is_stopped = false;        ///< Ended by RunJobOptions::stop; Existing::Resume goes on.
};

/// A folder that a reader knows.
struct DatasetPlace {
  std::filesystem::path folder;
  std::string reader;  ///< Type.
};

/// Plugins, and what they are used for. Used by one thread, the one that made it; any number of
/// engines may be there. Plugins are looked for as by the program, DIORAMA_PLUGIN_PATH and the
/// user's own folder included; they stay loaded until the process ends, and one that ends the
/// process ends the caller. All functions throw Error; what it says is for people, Error::kind()
/// for programs.
class DIORAMA_SDK_API Engine {
 public:
  /// Throws Error(Plugin) when the caller was compiled with headers of another libdiorama.
  explicit Engine(EngineOptions options = {})
      : Engine(DIORAMA_HEADERS_DIGEST, DIORAMA_ENGINE_DIGEST, options) {}
  ~Engine();
  Engine(const Engine&) = delete;
  Engine& operator=(const Engine&) = delete;

  /// Of the program and the library: "0.1.0".
  static std::string version();

  /// The job of a file, of Diorama's own form or of the Replicator dialect.
  Value load_job(const std::filesystem::path& file, const JobChanges& changes = {}) const;
  /// The same of text; `name` stands for the file in messages.
  Value parse_job(std::string_view text, const JobChanges& changes = {},
                  std::string_view name = "job") const;
  /// The job with every default. All diagnostics come in one Error(Config); assets need not be
  /// there.
  Value check_job(const Value& job);
  /// Makes all captures of a job that load_job() or parse_job() gave.
  RunJobResult run_job(const Value& job, const RunJobOptions& options = {});

  /// The folder itself, or those of a run: every one that some reader knows.
  std::vector<DatasetPlace> find_datasets(const std::filesystem::path& folder);
  /// The one dataset of a folder, or of a run with one writer. `reader`, when given, is taken
  /// whatever the folder looks like. The engine must outlive it; any threads may read it.
  std::unique_ptr<const StoredDataset> open_dataset(const std::filesystem::path& folder,
                                                    const std::string& reader = {});

 private:
  /// Of the SDK's headers and of this one, as the caller was compiled: types cross as they are.
  Engine(std::uint64_t sdk_headers, std::uint64_t engine_headers, EngineOptions& options);

  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace diorama
