// SPDX-License-Identifier: Apache-2.0
#include "framework/view/unfinished_writers.h"

#include <fstream>
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
  FilesOverLinks(const fs::path& there, fs::path here) : here_(std::move(here)) {
    link_all(there, here_);
  }

  void add(std::string_view path, std::vector<std::byte> bytes) override { put(path, bytes); }
  void append(std::string_view path, std::span<const std::byte> bytes) override {
    put(path, bytes);
  }
  void append_kept(std::string_view path, int) override {
    throw Error(ErrorKind::Output, std::string(path) + ": is put together at the end of the run");
  }
  void close() {
    for (auto& [path, file] : files_) {
      file.close();
      if (!file) throw Error(ErrorKind::Output, path + ": cannot be written");
    }
  }

 private:
  static void link_all(const fs::path& from, const fs::path& to) {
    fs::create_directories(to);
    for (const fs::directory_entry& entry : fs::directory_iterator(from)) {
      const fs::path name = entry.path().filename();
      if (!name.string().starts_with('.')) fs::create_symlink(entry.path(), to / name);
    }
  }

  /// Folders on the way become folders of their own.
  void put(std::string_view path, std::span<const std::byte> bytes) {
    const auto [file, is_new] = files_.try_emplace(std::string(path));
    if (is_new) {
      if (!is_plain_relative(path)) {
        throw Error(ErrorKind::Plugin, std::string(path) + ": is no path below the folder");
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
      file->second.open(here_ / path, std::ios::binary);
    }
    file->second.write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
  }

  fs::path here_;
  std::map<std::string, std::ofstream, std::less<>> files_;
};

/// Place of the writer that writes into the folder; nothing when there is none.
std::optional<std::size_t> writer_in(const Value& job, const fs::path& folder) {
  Complaints complaints;
  const OutputFolders folders = output_folders(read_job(job, complaints));
  for (std::size_t i = 0; i < folders.writers.size(); ++i) {
    std::error_code ignored;
    if (fs::equivalent(folders.base / folders.folder(i), folder, ignored)) return i;
  }
  return std::nullopt;
}

}  // namespace

UnfinishedWriters::UnfinishedWriters(GlobalOptions options, Log log)
    : options_(std::move(options)), log_(std::move(log)) {}

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

std::optional<fs::path> UnfinishedWriters::folder_for(const DatasetStatus& status,
                                                      const fs::path& folder) {
  const Value job = job_of(status, status.base);
  const std::optional<std::size_t> place = writer_in(job, folder);
  if (!place) return std::nullopt;
  const JobServices services = make_job_services(options_, job, log_);
  JobAssembly assembly = assemble_job(job, *services.registry, *services.host, services.assets_root,
                                      program_version(), AssembleFor::Trial, 1);
  const OutputFolders folders = output_folders(assembly.job);
  LocalFileSystem file_system;
  OutputStore store(file_system, folders, assembly.plan.capture_count(), {});
  store.refresh();
  const fs::path here = next_folder(folder);
  try {
    FilesOverLinks files(fs::absolute(folder), here);
    Writer& writer = *assembly.components.writers[*place];
    call_component("writer '" + folders.name(*place) + "'", [&] {
      writer.begin(assembly.dataset, files);
      writer.finish([&](const RecordVisitor& visit) { store.read_records(*place, visit); }, files);
    });
    files.close();
  } catch (const fs::filesystem_error& error) {
    throw Error(ErrorKind::Output, error.what());
  }
  return here;
}

}  // namespace diorama
