// SPDX-License-Identifier: Apache-2.0
#include "framework/view/unfinished_writers.h"

#include <algorithm>
#include <fstream>
#include <new>
#include <string>
#include <system_error>
#include <utility>

#include "diorama/error.h"
#include "diorama/writer.h"
#include "framework/jobs/assemble.h"
#include "framework/jobs/assemble_job.h"
#include "framework/jobs/job_file.h"
#include "framework/output/journal.h"
#include "framework/output/output_store.h"
#include "framework/plugins/plugin_call.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

/// The files of a writer's end, in a folder that otherwise links to what is there.
class FilesOverLinks final : public DatasetFiles {
 public:
  FilesOverLinks(fs::path here, const std::atomic<bool>& stop)
      : here_(std::move(here)), stop_(stop) {}

  void link(const fs::path& there) { link_all(there, here_); }

  void add(std::string_view path, std::vector<std::byte> bytes) override { put(path, bytes); }
  void append(std::string_view path, std::span<const std::byte> bytes) override {
    put(path, bytes);
  }
  void append_kept(std::string_view, int) override {
    refuse("its files are put together at the end of the run");
  }
  void close() {
    if (!file_.is_open()) return;
    file_.close();
    if (!file_) throw Error(ErrorKind::Output, last_ + ": cannot be written");
  }
  /// Why it will be no other way at the next look; empty: nothing is known of that.
  const std::string& refused() const { return refused_; }

 private:
  [[noreturn]] void refuse(const std::string& why) {
    refused_ = why;
    throw Error(ErrorKind::Output, why);
  }

  void link_all(const fs::path& from, const fs::path& to) {
    fs::create_directories(to);
    for (const fs::directory_entry& entry : fs::directory_iterator(from)) {
      if (stop_) throw Stopped();
      const fs::path name = entry.path().filename();
      if (name.string().starts_with('.')) continue;
      if (++links_ > UnfinishedWriters::kMostLinks) {
        refuse("has too many files beside its tables");
      }
      fs::create_symlink(entry.path(), to / name);
    }
  }

  /// Folders on the way become folders of their own.
  void begin(const std::string& path) {
    if (!is_plain_relative(path)) {
      throw Error(ErrorKind::Plugin, path + ": is no path below the folder");
    }
    fs::path at = here_;
    for (const fs::path& part : fs::path(path).parent_path()) {
      at /= part;
      if (!fs::is_symlink(at)) {
        fs::create_directories(at);
        continue;
      }
      const fs::path there = fs::read_symlink(at);
      fs::remove(at);
      link_all(there, at);
    }
    fs::remove(here_ / path);
  }

  /// One file is open at a time: formats have lists by the thousand.
  void put(std::string_view path, std::span<const std::byte> bytes) {
    if (stop_) throw Stopped();
    if (path != last_ || !file_.is_open()) {
      close();
      last_ = path;
      if (begun_.insert(last_).second) begin(last_);
      file_ = std::ofstream(here_ / last_, std::ios::binary | std::ios::app);
      if (!file_) throw Error(ErrorKind::Output, last_ + ": cannot be written");
    }
    file_.write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
  }

  fs::path here_;
  const std::atomic<bool>& stop_;
  std::size_t links_ = 0;
  std::set<std::string> begun_;
  std::string last_;
  std::ofstream file_;
  std::string refused_;
};

/// Place of the writer that writes into the folder; nothing when there is none.
std::optional<std::size_t> writer_in(const OutputFolders& places, const fs::path& folder) {
  for (std::size_t i = 0; i < places.writers.size(); ++i) {
    std::error_code ignored;
    if (fs::equivalent(places.base / places.folder(i), folder, ignored)) return i;
  }
  return std::nullopt;
}

}  // namespace

UnfinishedWriters::UnfinishedWriters(GlobalOptions options, const std::atomic<bool>& stop, Log log)
    : options_(std::move(options)), stop_(stop), log_(std::move(log)) {}

/// Who reads in the last one goes on.
fs::path UnfinishedWriters::next_folder(const fs::path& folder) {
  if (!scratch_) scratch_.emplace("unfinished");
  std::vector<fs::path>& all = folders_[folder];
  while (all.size() > 1) {
    std::error_code ignored;
    fs::remove_all(all.front().parent_path(), ignored);
    all.erase(all.begin());
  }
  // Datasets are called by the names of their folders.
  all.push_back(scratch_->path() / std::to_string(made_++) / folder.filename());
  return all.back();
}

void UnfinishedWriters::give_up(const fs::path& folder, const std::string& why) {
  if (!given_up_.insert(folder).second) return;
  log_(LogLevel::Info, folder.string() + ": is shown at the end of the run: " + why);
}

std::optional<fs::path> UnfinishedWriters::finished(JobAssembly& assembly,
                                                    const OutputFolders& places, std::size_t place,
                                                    OutputStore& store, const fs::path& folder) {
  const fs::path here = next_folder(folder);
  FilesOverLinks files(here, stop_);
  const auto visit_all = [&](const RecordVisitor& visit) {
    store.read_records(place, [&](int capture, std::string_view line) {
      if (stop_) throw Stopped();
      visit(capture, line);
    });
  };
  try {
    files.link(fs::absolute(folder));
    Writer& writer = *assembly.components.writers[place];
    call_component("writer '" + places.name(place) + "'", [&] {
      writer.begin(assembly.dataset, files);
      writer.finish(visit_all, files);
    });
    files.close();
    return here;
  } catch (const Stopped&) {
    throw;
  } catch (const Error& error) {
    if (files.refused().empty()) {
      log_(LogLevel::Debug, error.what());
    } else {
      give_up(folder, files.refused());
    }
  } catch (const fs::filesystem_error& error) {
    log_(LogLevel::Debug, error.what());
  }
  return std::nullopt;
}

UnfinishedWriters::Folders UnfinishedWriters::folders_for(const DatasetStatus& status,
                                                          std::span<const fs::path> folders) {
  Folders made;
  if (std::ranges::none_of(status.workers, &DatasetStatus::Worker::is_alive)) return made;
  // What the assembly of a run's job has to say, the run has said.
  const Log quiet = [this](LogLevel, std::string_view text) { log_(LogLevel::Debug, text); };
  const Value value = job_of(status, status.base);
  Diagnostics diagnostics;
  const Job job = read_job(value, diagnostics);
  diagnostics.raise();
  const OutputFolders places = output_folders(job);
  std::vector<std::pair<fs::path, std::size_t>> due;
  for (const fs::path& folder : folders) {
    if (given_up_.contains(folder)) continue;
    const std::optional<std::size_t> place = writer_in(places, folder);
    if (!place) {
      given_up_.insert(folder);
    } else if (job.total_captures > kMostCaptures) {
      give_up(folder, "it has more than " + std::to_string(kMostCaptures) + " captures");
    } else {
      due.emplace_back(folder, *place);
    }
  }
  if (due.empty()) return made;
  try {
    const JobServices services = make_job_services(options_, value, quiet);
    services.host->stop_on(stop_);
    JobAssembly assembly =
        assemble_job(value, *services.registry, *services.host, services.assets_root,
                     program_version(), AssembleFor::Tables, 1);
    LocalFileSystem file_system;
    OutputStore store(file_system, places, assembly.plan.capture_count(), {});
    store.refresh();
    for (const auto& [folder, place] : due) {
      if (stop_) throw Stopped();
      if (auto here = finished(assembly, places, place, store, folder)) {
        made[folder] = std::move(*here);
      }
    }
  } catch (const std::bad_alloc&) {
    for (const auto& each : due) give_up(each.first, "it needs too much memory");
  }
  return made;
}

}  // namespace diorama
