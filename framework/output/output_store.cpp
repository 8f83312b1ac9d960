// SPDX-License-Identifier: Apache-2.0
#include "framework/output/output_store.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "diorama/error.h"

#include "framework/config/json_text.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;
using OrderedJson = nlohmann::ordered_json;

constexpr int kCommitsPerCheckpoint = 64;
constexpr int kVisitsPerClaimFolder = 256;

std::span<const std::byte> bytes_of(const std::string& text) {
  return std::as_bytes(std::span(text));
}

std::string keys_that_differ(const std::string& before, const std::string& now) {
  const OrderedJson old_json = parse_json_or_nothing<OrderedJson>(before);
  const OrderedJson new_json = parse_json_or_nothing<OrderedJson>(now);
  std::string keys;
  for (const auto& [key, value] : new_json.items()) {
    const bool is_same = old_json.is_object() && old_json.contains(key) && old_json[key] == value;
    if (!is_same) keys += (keys.empty() ? "" : ", ") + key;
  }
  return keys.empty() ? "format" : keys;
}

/// "out/." without what does not count.
fs::path joined(const fs::path& base, const std::string& below) {
  const fs::path place = (base / below).lexically_normal();
  return place.has_filename() ? place : place.parent_path();
}

OutputFolders normal(OutputFolders folders) {
  folders.base = joined(folders.base, ".");
  return folders;
}

std::string below(const std::string& folder, const std::string& path) {
  return folder == "." ? path : folder + "/" + path;
}

bool is_below(const std::string& folder, const std::string& path) {
  return folder == "." || path.starts_with(folder + "/");
}

/// What "shard-3-of-16" shares its work with.
std::string split_of(const std::string& role) {
  const std::size_t of = role.rfind("-of-");
  return of == std::string::npos ? role : role.substr(of);
}

std::string role_text(const std::string& role) {
  if (role == "auto") return "with '--shard auto'";
  if (role == "overwrite") return "replacing the dataset";
  if (role == "shard-1-of-1") return "as the only worker";
  std::string text = role;
  std::replace(text.begin(), text.end(), '-', ' ');
  return "as " + text;
}

/// Below the folder of kept things.
std::string kept_name(std::size_t writer, int capture) {
  return std::to_string(writer) + "/" + entry_name(capture);
}

std::string visit_folder(int visit) {
  char name[32];
  std::snprintf(name, sizeof name, "visits-%05d", visit / kVisitsPerClaimFolder);
  return name;
}

std::string visit_task(int visit) { return visit_folder(visit) + "/" + std::to_string(visit); }

}  // namespace

const std::string& OutputFolders::folder(std::size_t index) const {
  return index == kRecordsFolder ? records : writers[index].folder;
}

std::string OutputFolders::name(std::size_t index) const {
  return index == kRecordsFolder ? std::string() : writers[index].name;
}

fs::path OutputFolders::records_path() const { return joined(base, records); }

CollectedFiles::CollectedFiles(Transaction& transaction, std::size_t folder, std::string writer)
    : transaction_(transaction), folder_(folder), writer_(std::move(writer)) {}

void CollectedFiles::check_path(std::string_view path) const {
  if (is_plain_relative(path)) return;
  throw Error(ErrorKind::Plugin, "writer '" + writer_ +
                                     "': expected a relative path without '..', found '" +
                                     std::string(path) + "'");
}

void CollectedFiles::stage_if_large(std::size_t number) {
  StagedFile& file = transaction_.files[number];
  if (transaction_.stage && file.bytes.size() >= kKeptBytes) transaction_.stage->put(number, file);
}

void CollectedFiles::add(std::string_view path, std::vector<std::byte> bytes) {
  check_path(path);
  transaction_.files.push_back({folder_, std::string(path), std::move(bytes)});
  stage_if_large(transaction_.files.size() - 1);
}

void CollectedFiles::append(std::string_view path, std::span<const std::byte> bytes) {
  auto found = growing_.find(path);
  if (found == growing_.end()) {
    add(path, {});
    found = growing_.emplace(path, transaction_.files.size() - 1).first;
    transaction_.growing.push_back(found->second);
  }
  grow(found->second, bytes);
}

void CollectedFiles::grow(std::size_t number, std::span<const std::byte> bytes) {
  std::vector<std::byte>& file = transaction_.files[number].bytes;
  const std::size_t before = file.size();
  file.insert(file.end(), bytes.begin(), bytes.end());
  stage_if_large(number);
  transaction_.growing_bytes += file.size() - before;
  // Many small ones fill the memory, too: this writer's, and what those before it left.
  if (!transaction_.stage || transaction_.growing_bytes < kKeptGrowingBytes) return;
  for (const std::size_t each : transaction_.growing) {
    StagedFile& growing = transaction_.files[each];
    if (!growing.bytes.empty()) transaction_.stage->put(each, growing);
  }
  transaction_.growing_bytes = 0;
}

void CollectedFiles::append_kept(std::string_view path, int capture) {
  if (!transaction_.read_kept) {
    throw Error(ErrorKind::Plugin,
                "writer '" + writer_ + "': only finish() gets what captures keep");
  }
  transaction_.read_kept(folder_, capture,
                         [&](std::span<const std::byte> bytes) { append(path, bytes); });
}

void CollectedFiles::keep(std::span<const std::byte> bytes) {
  if (!kept_) {
    transaction_.files.push_back({folder_, {}, {}});
    transaction_.files.back().is_kept = true;
    kept_ = transaction_.files.size() - 1;
    transaction_.growing.push_back(*kept_);
  }
  grow(*kept_, bytes);
}

void CollectedFiles::record(std::string_view line) {
  if (line.find('\n') != std::string_view::npos) {
    throw Error(ErrorKind::Plugin, "writer '" + writer_ + "': a record may not hold a line break");
  }
  for (const auto& [folder, text] : transaction_.records) {
    if (folder == folder_) {
      throw Error(ErrorKind::Plugin, "writer '" + writer_ + "': a capture has one record only");
    }
  }
  transaction_.records.emplace_back(folder_, std::string(line));
}

Stage::~Stage() = default;

class OutputStore::DiskStage final : public Stage {
 public:
  DiskStage(OutputStore& store, int entry) : store_(store), entry_(entry) {}
  ~DiskStage() override {
    try {
      for (const std::size_t number : used_) {
        store_.file_system_.remove_file(store_.staged(store_.options_.self.name, entry_, number));
      }
    } catch (const std::exception&) {
      // Who joins next clears what is left.
    }
  }
  void put(std::size_t number, StagedFile& file) override {
    used_.insert(number);
    try {
      store_.put_staged(store_.staged(store_.options_.self.name, entry_, number), file);
    } catch (const Error&) {
      // Who took over also took the stage away: that is the reason then.
      store_.check_membership();
      throw;
    }
  }
  void release() override { used_.clear(); }

 private:
  OutputStore& store_;
  int entry_;
  std::set<std::size_t> used_;
};

OutputStore::OutputStore(FileSystem& file_system, OutputFolders folders, int capture_count,
                         Options options)
    : file_system_(file_system),
      folders_(normal(std::move(folders))),
      capture_count_(capture_count),
      options_(std::move(options)),
      workers_(file_system, diorama_folder(), options_.self, options_.lease_timeout),
      journals_(file_system, diorama_folder() / "journal", capture_count),
      writer_(file_system, diorama_folder() / "journal", options_.self.name, folders_.records) {}

OutputStore::~OutputStore() {
  try {
    leave();
  } catch (const std::exception&) {
    // What is left behind is settled by the next worker.
  }
}

fs::path OutputStore::stage(const std::string& worker) const {
  return diorama_folder() / "stage" / worker;
}

fs::path OutputStore::staged(const std::string& worker, int entry, std::size_t file) const {
  return stage(worker) / (entry_name(entry) + "-" + std::to_string(file));
}

void OutputStore::read_kept(std::size_t writer, int capture, const BytesVisitor& visit) {
  constexpr std::uint64_t kPiece = std::uint64_t(1) << 20;
  const fs::path file = kept_folder() / kept_name(writer, capture);
  const auto status = file_system_.status(file);
  if (!status || status->kind != FileStatus::Kind::File) {
    // Who took over and finished took it away: that is the reason then.
    check_membership();
    throw Error(ErrorKind::Output,
                file.string() + ": is missing; 'diorama run --resume --verify' makes it anew");
  }
  for (std::uint64_t at = 0; at < status->size;) {
    const std::string piece = file_system_.read_part(file, at, std::min(kPiece, status->size - at));
    if (piece.empty()) throw Error(ErrorKind::Output, file.string() + ": has become shorter");
    visit(bytes_of(piece));
    at += piece.size();
  }
}

/// The finish files survive a power cut: from then on what captures kept may go.
bool OutputStore::has_durable_end() const {
  const auto is_open = [](const auto& worker) {
    const WorkerIndex& index = worker.second;
    return index.settled_bytes < index.bytes_read &&
           (index.committed.contains(kFinishEntry) ||
            std::ranges::find(index.published_since, kFinishEntry, &EntryPlace::entry) !=
                index.published_since.end());
  };
  return journals_.is_published(kFinishEntry) && std::ranges::none_of(journals_.workers(), is_open);
}

/// The finished dataset has it in files of its own.
void OutputStore::remove_kept() {
  const fs::path folder = kept_folder();
  for (const std::string& writer : file_system_.list(folder)) {
    const auto status = file_system_.status(folder / writer);
    if (!status || status->kind != FileStatus::Kind::Folder) continue;
    for (const std::string& capture : file_system_.list(folder / writer)) {
      file_system_.remove_file(folder / writer / capture);
    }
    file_system_.remove_if_empty(folder / writer);
  }
  file_system_.remove_if_empty(folder);
}

std::string OutputStore::role() const {
  if (options_.existing == Existing::Overwrite) return "overwrite";
  if (options_.takes_visits) return "auto";
  return "shard-" + std::to_string(options_.shard + 1) + "-of-" + std::to_string(options_.shards);
}

void OutputStore::say(const std::string& text) const {
  if (options_.warn) options_.warn(text);
}

// Joining and leaving.

/// A stranger's dataset could lead our files and removals elsewhere.
void OutputStore::refuse_links() const {
  const fs::path top = diorama_folder();
  for (const fs::path& folder :
       {top, top / "journal", top / "workers", top / "claims", top / "stage", kept_folder()}) {
    const auto status = file_system_.status(folder);
    if (status && status->kind != FileStatus::Kind::Folder) {
      throw Error(ErrorKind::Output,
                  folder.string() + ": expected a folder, found a " +
                      (status->kind == FileStatus::Kind::Link ? "link" : "file"));
    }
  }
}

void OutputStore::check_same_dataset() const {
  const std::string before = file_system_.read(dataset_file());
  if (before == dataset_json_) return;
  throw Error(ErrorKind::Output, dataset_file().string() +
                                     ": belongs to another job or version (differs in: " +
                                     keys_that_differ(before, dataset_json_) +
                                     "); resume with the same job, choose another --output or use "
                                     "--overwrite");
}

void OutputStore::check_folder() {
  refuse_links();
  const bool is_there = file_system_.exists(dataset_file());
  journals_.refresh();
  if (options_.existing == Existing::Refuse && is_there) {
    throw Error(ErrorKind::Output,
                folders_.records_path().string() + ": already holds a dataset with " +
                    std::to_string(journals_.published_captures()) +
                    " captures; go on with it by --resume, replace it by --overwrite, or choose "
                    "another --output");
  }
  if (options_.existing == Existing::Refuse && !journals_.workers().empty()) {
    throw Error(ErrorKind::Output,
                folders_.records_path().string() +
                    ": the removal of a dataset was interrupted here; --resume and --overwrite "
                    "complete it, or choose another --output");
  }
  if (options_.existing == Existing::Resume && is_there) check_same_dataset();
  for (const auto& writer : folders_.writers)
    require_writable(file_system_, joined(folders_.base, writer.folder), options_.self.name);
}

/// Living workers whose part overlaps with this one's.
void OutputStore::refuse_rivals() {
  const std::string own = role();
  for (const Workers::Lease& lease : workers_.others()) {
    const bool is_exclusive = own == "overwrite" || lease.role == "overwrite";
    if (!is_exclusive && split_of(lease.role) == split_of(own)) continue;
    if (!workers_.is_alive(lease)) continue;
    throw Busy(folders_.records_path().string() + ": another process works on this dataset " +
               role_text(lease.role) + " (" + workers_.describe(lease) +
               "); wait for it or stop it first");
  }
  if (options_.takes_visits) return;
  if (const auto owner = workers_.claim(own)) {
    throw Busy(folders_.records_path().string() + ": another process works on this dataset " +
               role_text(own) + ", too (" + workers_.describe(*owner) +
               "); wait for it or stop it first");
  }
}

void OutputStore::join(const std::string& dataset_json) {
  dataset_json_ = dataset_json;
  check_folder();
  has_joined_ = true;
  try {
    created_ = file_system_.make_folders(diorama_folder());
    for (const fs::path& folder : created_) unsynced_folders_.insert(folder.parent_path());
    workers_.join(role());
    refuse_rivals();
    start_heart();
    replaces_ = options_.existing == Existing::Overwrite;
    if (!replaces_) settle_dead_workers();
    journals_.refresh();
    if (options_.verifies_all && !replaces_) verify_all();
  } catch (...) {
    try {
      leave();
    } catch (const Error&) {
      // The first failure is the one to report.
    }
    throw;
  }
}

void OutputStore::start_heart() {
  if (!options_.beats) return;
  heart_ = std::thread([this] {
    const auto pause = std::max<std::chrono::milliseconds>(options_.lease_timeout / 8,
                                                           std::chrono::milliseconds(100));
    std::unique_lock lock(heart_mutex_);
    while (!heart_stops_.wait_for(lock, pause, [&] { return stops_beating_; })) {
      try {
        if (!workers_.beat()) is_lost_ = true;
      } catch (const Error&) {
        // The disk is away: so is this worker, until it comes back.
      }
    }
  });
}

void OutputStore::leave() {
  if (!std::exchange(has_joined_, false)) return;
  if (heart_.joinable()) {
    {
      const std::lock_guard lock(heart_mutex_);
      stops_beating_ = true;
    }
    heart_stops_.notify_all();
    heart_.join();
  }
  // What is staged for good stays for who comes next.
  if (next_times_ != std::chrono::steady_clock::time_point{}) {
    try {
      file_system_.remove_file(stage(options_.self.name) / kTimesFile);
    } catch (const Error&) {
      // Nothing depends on it.
    }
  }
  file_system_.remove_if_empty(stage(options_.self.name));
  file_system_.remove_if_empty(diorama_folder() / "stage");
  if (is_finished() && has_durable_end() && !is_lost_) remove_kept();
  if (is_finished()) workers_.sweep();
  workers_.leave();
  if (writer_.has_lines() || has_opened_) return;
  for (auto folder = created_.rbegin(); folder != created_.rend(); ++folder) {
    file_system_.remove_if_empty(*folder);
  }
}

void OutputStore::close() {
  checkpoint();
  leave();
}

void OutputStore::open() {
  if (std::exchange(has_opened_, true)) return;
  if (replaces_) remove_dataset();
  replaces_ = false;
  const auto created = file_system_.make_folders(stage(options_.self.name));
  for (const fs::path& folder : created) unsynced_folders_.insert(folder.parent_path());
  const fs::path draft = stage(options_.self.name) / "dataset";
  file_system_.write(draft, bytes_of(dataset_json_));
  file_system_.sync(draft);
  if (!file_system_.move_new(draft, dataset_file())) {
    file_system_.remove_file(draft);
    check_same_dataset();
  }
  // From here on names in these folders count.
  for (const fs::path& folder : std::exchange(unsynced_folders_, {})) {
    file_system_.sync_folder(folder);
  }
  file_system_.sync_folder(folders_.records_path());
}

// What is there.

bool OutputStore::is_done(int capture) const {
  return !replaces_ && journals_.is_published(capture);
}

int OutputStore::done_count() const { return replaces_ ? 0 : journals_.published_captures(); }

bool OutputStore::is_finished() const {
  return !replaces_ && is_complete() && journals_.is_published(kBeginEntry) &&
         journals_.is_published(kFinishEntry);
}

void OutputStore::refresh() { journals_.refresh(); }

void OutputStore::tell_times(const std::map<std::string, double>& seconds) {
  const auto now = std::chrono::steady_clock::now();
  if (!has_opened_ || now < next_times_) return;
  next_times_ = now + std::chrono::seconds(2);
  try {
    file_system_.write(stage(options_.self.name) / kTimesFile,
                       bytes_of(nlohmann::json(seconds).dump()));
  } catch (const Error&) {
    // Nothing depends on it; what does will say it better.
  }
}

OutputStore::FileState OutputStore::state_of(const fs::path& path, const JournalledFile& file) {
  const auto status = file_system_.status(path);
  if (!status) return FileState::Missing;
  if (status->kind != FileStatus::Kind::File || status->size != file.size) return FileState::Wrong;
  return digest_of(file_system_, path) == file.digest ? FileState::Right : FileState::Wrong;
}

// Dead workers: what they committed is completed, the rest is taken away.

void OutputStore::settle_dead_workers() {
  if (!file_system_.exists(dataset_file())) {
    journals_.refresh();
    if (journals_.workers().empty()) return;
    // Without dataset.json the journals are the rest of a dataset whose removal was cut short.
    if (const auto owner = workers_.claim("removal")) {
      throw Busy(folders_.records_path().string() + ": another process removes a dataset here (" +
                 workers_.describe(*owner) + ")");
    }
    if (!file_system_.exists(dataset_file())) {
      say(dataset_file().string() + ": is missing, so what the journals beside it name (" +
          std::to_string(journals_.published_captures()) +
          " captures) is the rest of an interrupted removal: it is removed and made anew");
      remove_dataset();
    }
    workers_.release("removal");
    return;
  }
  std::set<std::string> alive{options_.self.name};
  std::set<std::string> dead;  // as far as can be seen: settle() looks again
  for (const Workers::Lease& lease : workers_.others()) {
    (workers_.is_alive(lease) ? alive : dead).insert(lease.worker);
  }
  journals_.refresh();
  for (const auto& [worker, index] : journals_.workers()) {
    if (index.has_unsettled() && index.settled_bytes < index.bytes_read) dead.insert(worker);
  }
  for (const std::string& worker : file_system_.list(diorama_folder() / "stage")) {
    if (is_plain_name(worker)) dead.insert(worker);
  }
  for (const std::string& worker : dead) {
    if (alive.contains(worker)) continue;
    const auto index = journals_.workers().find(worker);
    settle(worker, index == journals_.workers().end() ? WorkerIndex() : index->second);
  }
}

void OutputStore::settle(const std::string& worker, const WorkerIndex& index) {
  // A worker has a lease before it has anything else; it may have joined since leases were listed.
  for (const Workers::Lease& lease : workers_.others()) {
    if (lease.worker == worker && workers_.is_alive(lease)) return;
  }
  if (workers_.claim("settle-" + worker)) return;
  // First: should it come back, it finds that it is out.
  for (const Workers::Lease& lease : workers_.others()) {
    if (lease.worker == worker) workers_.remove(lease);
  }
  if (index.settled_bytes < index.bytes_read) {
    for (const EntryPlace& place : index.unsettled()) settle_entry(worker, place);
    checkpoint();
    writer_.settled(worker, index.bytes_read);
  }
  remove_stage(worker);
  workers_.release("settle-" + worker);
}

/// Moves what is staged to its place; false when files are missing.
bool OutputStore::settle_entry(const std::string& worker, const EntryPlace& place) {
  const auto content = journals_.files_of(worker, place);
  // Torn: the power went before it counted.
  if (!content) {
    if (place.is_published) take_back(worker, place, "its journal entry is torn", {});
    return false;
  }
  std::vector<JournalledFile> damaged;
  std::string reason;
  for (std::size_t i = 0; i < content->files.size(); ++i) {
    const JournalledFile& file = content->files[i];
    const fs::path target = folders_.base / file.path;
    check_no_links(target.parent_path());
    const fs::path source = staged(worker, place.entry, i);
    FileState state = state_of(target, file);
    const bool is_staged = state_of(source, file) == FileState::Right;
    if (state == FileState::Missing && is_staged) {
      move_to_place(source, target, file);
    }
    sync_later(target.parent_path());
    // Another worker may have moved it meanwhile.
    if (state != FileState::Right) state = state_of(target, file);
    if (state == FileState::Right) continue;
    const bool may_be_gone = is_kept_path(folders_.records, file.path) && has_durable_end();
    if (state == FileState::Missing && may_be_gone) continue;
    reason = file.path + (state == FileState::Missing ? " is missing" : " is not what was written");
    // Beside its staged twin a file is somebody else's.
    if (state == FileState::Wrong && !is_staged) damaged.push_back(file);
  }
  if (!reason.empty()) {
    take_back(worker, place, reason, damaged);
    return false;
  }
  if (!place.is_published) writer_.published_for(worker, place.entry);
  return true;
}

void OutputStore::take_back(const std::string& worker, const EntryPlace& place,
                            const std::string& reason, const std::vector<JournalledFile>& damaged) {
  writer_.void_entry(worker, place.entry);
  for (const JournalledFile& file : damaged) {
    if (may_remove(file)) file_system_.remove_file(folders_.base / file.path);
  }
  if (place.is_published) {
    say((place.entry < 0 ? entry_name(place.entry) : "capture " + std::to_string(place.entry)) +
        ": " + reason + "; it is made anew");
  }
}

/// The end first: what captures kept for it has to be there only when it has to be made anew.
void OutputStore::verify_all() {
  verify([](int entry) { return entry == kFinishEntry; });
  verify([](int entry) { return entry != kFinishEntry; });
}

void OutputStore::verify(const std::function<bool(int)>& is_wanted) {
  // Whoever is dead stays so: a worker's name is never used again.
  std::string looked_at;
  bool lives = false;
  journals_.visit_entries([&](const std::string& worker, const EntryPlace& place) {
    if (!is_wanted(place.entry)) return;
    if (std::exchange(looked_at, worker) != worker) {
      const auto others = workers_.others();
      lives = std::any_of(others.begin(), others.end(), [&](const Workers::Lease& lease) {
        return lease.worker == worker && workers_.is_alive(lease);
      });
    }
    if (place.is_published && !lives) settle_entry(worker, place);
  });
  journals_.refresh();
}

void OutputStore::remove_stage(const std::string& worker) {
  const fs::path folder = stage(worker);
  const auto status = file_system_.status(folder);
  if (!status || status->kind != FileStatus::Kind::Folder) return;
  for (const std::string& name : file_system_.list(folder)) {
    const auto file = file_system_.status(folder / name);
    if (is_plain_name(name) && file && file->kind == FileStatus::Kind::File) {
      file_system_.remove_file(folder / name);
    }
  }
  file_system_.remove_if_empty(folder);
}

// Removing a dataset: what its journals name, and nothing else.

/// In the folders of this job by its name; elsewhere below the output folder, where a journal may
/// name anything, only what is known to the byte.
bool OutputStore::may_remove(const JournalledFile& file) {
  const fs::path path = folders_.base / file.path;
  check_no_links(path.parent_path());
  const auto status = file_system_.status(path);
  if (!status || status->kind != FileStatus::Kind::File) return false;
  const bool is_own =
      (folders_.records != "." && is_below(folders_.records, file.path)) ||
      std::any_of(folders_.writers.begin(), folders_.writers.end(), [&](const auto& writer) {
        return writer.folder != "." && is_below(writer.folder, file.path);
      });
  return is_own || state_of(path, file) == FileState::Right;
}

/// Of a folder that the old dataset did not have: what lies there is somebody else's.
void OutputStore::refuse_content(const fs::path& folder) const {
  const auto status = file_system_.status(folder);
  if (!status || status->kind != FileStatus::Kind::Folder) return;
  for (const std::string& name : file_system_.list(folder)) {
    if (name.starts_with('.')) continue;
    throw Error(ErrorKind::Output, folder.string() + ": holds '" + name +
                                       "', which is not of the dataset that is replaced; move it "
                                       "away or choose another folder");
  }
}

void OutputStore::remove_dataset() {
  Journals old(file_system_, diorama_folder() / "journal", capture_count_);
  old.refresh();
  std::set<std::string> workers;
  for (const auto& [worker, index] : old.workers()) workers.insert(worker);
  // All of it is read before anything goes: a bad journal is an error, not half a removal.
  std::vector<bool> is_known(folders_.writers.size(), false);
  old.visit_entries([&](const std::string& worker, const EntryPlace& place) {
    const auto content = old.files_of(worker, place);
    if (!content) return;
    for (const JournalledFile& file : content->files) {
      check_no_links((folders_.base / file.path).parent_path());
      for (std::size_t i = 0; i < is_known.size(); ++i) {
        if (is_below(folders_.writers[i].folder, file.path)) is_known[i] = true;
      }
    }
  });
  for (std::size_t i = 0; i < is_known.size(); ++i) {
    if (!is_known[i]) refuse_content(joined(folders_.base, folders_.writers[i].folder));
  }
  // dataset.json goes first: from then on the folder holds no dataset that could be resumed.
  file_system_.remove_file(dataset_file());
  file_system_.sync_folder(folders_.records_path());
  std::set<fs::path> emptied;
  old.visit_entries([&](const std::string& worker, const EntryPlace& place) {
    const auto content = old.files_of(worker, place);
    if (!content) return;
    for (const JournalledFile& file : content->files) {
      if (!may_remove(file)) continue;
      const fs::path path = folders_.base / file.path;
      file_system_.remove_file(path);
      for (fs::path above = path.parent_path();
           above != folders_.base && emptied.insert(above).second; above = above.parent_path()) {
      }
    }
  });
  for (auto folder = emptied.rbegin(); folder != emptied.rend(); ++folder) {
    if (*folder != folders_.records_path()) file_system_.remove_if_empty(*folder);
  }
  // The journals go last: a power cut must not bring back files that nothing names.
  for (const fs::path& folder : emptied) file_system_.sync_folder(folder);
  file_system_.sync_folder(folders_.base);
  {
    const std::lock_guard lock(folders_mutex_);
    known_folders_.clear();
  }
  for (const std::string& name : file_system_.list(diorama_folder() / "claims")) {
    if (name.starts_with("visits-") && is_plain_name(name)) workers_.remove_claims(name);
  }
  for (const std::string& worker : file_system_.list(diorama_folder() / "stage")) {
    if (worker != options_.self.name && is_plain_name(worker)) remove_stage(worker);
  }
  for (const Workers::Lease& lease : workers_.others()) {
    if (!workers_.is_alive(lease)) workers_.remove(lease);
  }
  for (const std::string& worker : workers) {
    file_system_.remove_file(old.index_file(worker));
    file_system_.remove_file(old.entries_file(worker));
  }
  file_system_.sync_folder(diorama_folder() / "journal");
  journals_.forget();
}

// Committing.

void OutputStore::check_no_links(const fs::path& folder) {
  const std::lock_guard lock(folders_mutex_);
  for (fs::path place = folder; place != folders_.base && !known_folders_.contains(place);
       place = place.parent_path()) {
    const auto status = file_system_.status(place);
    if (status && status->kind != FileStatus::Kind::Folder) {
      throw Error(ErrorKind::Output, place.string() +
                                         ": expected a folder, found a link or a file; a dataset "
                                         "lies in one folder, without links");
    }
    if (place == place.parent_path() || place.empty()) return;
  }
}

/// Its names, and at the first time those of the folders above: who made them may have died before
/// it synced them.
void OutputStore::sync_later(const fs::path& folder) {
  const std::lock_guard lock(folders_mutex_);
  unsynced_folders_.insert(folder);
  if (known_folders_.contains(folder)) return;
  for (fs::path above = folder; above != folders_.base && above.has_relative_path();) {
    above = above.parent_path();
    unsynced_folders_.insert(above);
  }
}

void OutputStore::make_target_folder(const fs::path& folder) {
  check_no_links(folder);
  sync_later(folder);
  {
    const std::lock_guard lock(folders_mutex_);
    if (known_folders_.contains(folder)) return;
  }
  file_system_.make_folders(folder);
  constexpr std::size_t kMostKnown = 256;  // Clips have folders of their own, without end.
  const std::lock_guard lock(folders_mutex_);
  if (known_folders_.size() >= kMostKnown) known_folders_.clear();
  known_folders_.insert(folder);
}

/// Who finishes the dataset removes folders of what is kept, whoever is still at work.
bool OutputStore::move_to_place(const fs::path& source, const fs::path& target,
                                const JournalledFile& file) {
  make_target_folder(target.parent_path());
  const auto move = [&] { return file_system_.move_new(source, target); };
  if (!is_kept_path(folders_.records, file.path)) return move();
  return in_folder(file_system_, target.parent_path(), move);
}

JournalledFiles OutputStore::journalled(int entry, const Transaction& transaction) const {
  JournalledFiles content;
  std::set<std::string> places;
  for (const StagedFile& file : transaction.files) {
    const std::string path =
        file.is_kept ? below(folders_.records, kKeptFolder) + "/" + kept_name(file.folder, entry)
                     : below(folders_.folder(file.folder), file.path);
    if (!places.insert(path).second) {
      throw Error(ErrorKind::Config, (folders_.base / path).string() +
                                         ": two files of one capture have this name; give the "
                                         "writers different 'output_dir's");
    }
    content.files.push_back({path, file.staged_size, file.staged ? file.staged->text() : ""});
  }
  for (const auto& [writer, line] : transaction.records) {
    content.records.emplace_back(folders_.name(writer), line);
  }
  return content;
}

void OutputStore::put_staged(const fs::path& place, StagedFile& file) {
  if (!file.staged) {
    file_system_.write(place, file.bytes);
    file.staged = std::make_shared<Digest>();
  } else if (!file.bytes.empty()) {
    file_system_.append_to(place)->append(file.bytes);
  }
  file.staged->add(file.bytes);
  file.staged_size += file.bytes.size();
  bytes_written_ += file.bytes.size();
  file.bytes = std::vector<std::byte>();  // {} would keep the memory
}

void OutputStore::write_stage(int entry, Transaction& transaction) {
  const std::string& self = options_.self.name;
  for (std::size_t i = 0; i < transaction.files.size(); ++i) {
    StagedFile& file = transaction.files[i];
    if (!file.staged || !file.bytes.empty()) put_staged(staged(self, entry, i), file);
  }
  // Once all are on their way: the first sync takes the others along.
  for (std::size_t i = 0; i < transaction.files.size(); ++i) {
    file_system_.sync(staged(self, entry, i));
  }
  file_system_.sync_folder(stage(self));
}

void OutputStore::clear_stage(int entry, std::size_t files) {
  for (std::size_t i = 0; i < files; ++i) {
    file_system_.remove_file(staged(options_.self.name, entry, i));
  }
}

void OutputStore::publish(int entry, const JournalledFiles& content) {
  std::vector<fs::path> moved;
  for (std::size_t i = 0; i < content.files.size(); ++i) {
    const JournalledFile& file = content.files[i];
    const fs::path target = folders_.base / file.path;
    const fs::path source = staged(options_.self.name, entry, i);
    if (move_to_place(source, target, file)) {
      moved.push_back(target);
      continue;
    }
    if (state_of(target, file) == FileState::Right) {
      file_system_.remove_file(source);
      continue;
    }
    // Somebody else's file: this capture will not be, and leaves none of its own.
    writer_.void_entry(options_.self.name, entry);
    for (const fs::path& path : moved) file_system_.remove_file(path);
    clear_stage(entry, content.files.size());
    throw Error(
        ErrorKind::Output,
        target.string() + ": exists with another content than " + entry_name(entry) +
            " has. When another capture wrote it, a writer names files of two captures alike; "
            "when it is not of this dataset, move it away or choose another --output");
  }
}

void OutputStore::check_membership() {
  if (!is_lost_ && workers_.is_member()) return;
  if (!file_system_.exists(dataset_file())) {
    throw Error(ErrorKind::Output, folders_.records_path().string() +
                                       ": the dataset is gone; it was removed or moved while this "
                                       "process worked on it");
  }
  throw Busy(folders_.records_path().string() +
             ": other processes took this one for dead and go on with its part; it was cut off for "
             "more than " +
             std::to_string(options_.lease_timeout.count()) + " s");
}

void OutputStore::commit(int entry, Transaction& transaction) {
  JournalledFiles content;
  try {
    write_stage(entry, transaction);
    content = journalled(entry, transaction);
    check_membership();
    writer_.commit(entry, content);
  } catch (...) {
    try {
      clear_stage(entry, transaction.files.size());
    } catch (const Error&) {
      // The first failure is the one to report; who joins next clears what is left.
    }
    // Who took over also took the stage away: that is the reason then.
    check_membership();
    throw;
  }
  if (transaction.stage) transaction.stage->release();
  {
    const std::shared_lock lock(publishing_);
    publish(entry, content);
    writer_.published(entry);
  }
  if (++commits_since_checkpoint_ >= kCommitsPerCheckpoint) checkpoint();
}

void OutputStore::checkpoint() {
  const std::unique_lock lock(publishing_);
  commits_since_checkpoint_ = 0;
  std::set<fs::path> unsynced;
  {
    const std::lock_guard folders_lock(folders_mutex_);
    unsynced.swap(unsynced_folders_);
  }
  for (const fs::path& folder : unsynced) file_system_.sync_folder(folder);
  writer_.checkpoint();
}

Transaction OutputStore::begin_transaction() {
  return {.stage = std::make_unique<DiskStage>(*this, kBeginEntry)};
}

Transaction OutputStore::capture_transaction(int capture) {
  return {.stage = std::make_unique<DiskStage>(*this, capture)};
}

Transaction OutputStore::finish_transaction() {
  Transaction transaction{.stage = std::make_unique<DiskStage>(*this, kFinishEntry)};
  transaction.read_kept = [this](std::size_t writer, int capture, const BytesVisitor& visit) {
    read_kept(writer, capture, visit);
  };
  return transaction;
}

void OutputStore::commit_capture(int capture, Transaction& transaction) {
  commit(capture, transaction);
}

void OutputStore::commit_begin(Transaction& transaction) {
  if (!journals_.is_published(kBeginEntry)) commit(kBeginEntry, transaction);
}

bool OutputStore::claim_finish() {
  if (workers_.claim("finish")) return false;
  journals_.refresh();
  return !is_finished();
}

void OutputStore::commit_finish(Transaction& transaction) {
  commit(kFinishEntry, transaction);
  checkpoint();
  journals_.refresh();
}

std::optional<int> OutputStore::claim_visit(int visit_count,
                                            const std::function<bool(int)>& needs_work) {
  const auto claim = [&](int visit) { return !workers_.claim(visit_task(visit)); };
  std::vector<int> taken;  // by others, dead or alive
  for (int first = 0; first < visit_count; first += kVisitsPerClaimFolder) {
    const int end = std::min(visit_count, first + kVisitsPerClaimFolder);
    std::vector<int> wanted;
    for (int visit = first; visit < end; ++visit) {
      if (needs_work(visit)) wanted.push_back(visit);
    }
    if (wanted.empty()) continue;
    const std::set<std::string> tasks = workers_.claims_in(visit_folder(first));
    std::vector<int> free;
    for (const int visit : wanted) {
      if (!tasks.contains(visit_task(visit)))
        free.push_back(visit);
      else if (!workers_.has_claimed(visit_task(visit)))
        taken.push_back(visit);
    }
    // Workers that start together look for different ones.
    const std::size_t start = free.empty() ? 0 : std::hash<std::string>()(options_.self.name);
    for (std::size_t i = 0; i < free.size(); ++i) {
      const int visit = free[(start + i) % free.size()];
      if (claim(visit)) return visit;
      taken.push_back(visit);
    }
  }
  // Nothing is free; what dead workers left is.
  journals_.refresh();
  for (const int visit : taken) {
    if (needs_work(visit) && claim(visit)) return visit;
  }
  return std::nullopt;
}

void OutputStore::read_records(std::size_t writer, const RecordVisitor& visit) const {
  const std::string name = folders_.name(writer);
  journals_.visit_captures([&](const std::string& worker, const EntryPlace& place) {
    const auto content = journals_.files_of(worker, place);
    if (!content) return false;
    for (const auto& [who, line] : content->records) {
      if (who == name) visit(place.entry, line);
    }
    return true;
  });
}

}  // namespace diorama
