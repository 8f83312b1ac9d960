// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/output_store.h"

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "diorama/error.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr const char* kStageFolder = ".diorama-stage";
constexpr const char* kDatasetFile = "dataset.json";
constexpr const char* kBegin = "begin";
constexpr const char* kFinish = "finish";

bool is_plain_relative(std::string_view path) {
  if (path.empty() || path.front() == '/' || path.back() == '/') return false;
  if (path.find('\\') != std::string_view::npos || path.find('\0') != std::string_view::npos) {
    return false;
  }
  const fs::path parsed(path);
  return std::none_of(parsed.begin(), parsed.end(),
                      [](const fs::path& part) { return part == ".." || part == "."; });
}

bool is_capture_entry(const std::string& entry) {
  return entry.size() >= 6 && entry.size() < 10 &&
         std::all_of(entry.begin(), entry.end(), [](char c) { return c >= '0' && c <= '9'; });
}

std::string begin_stage(int shard) { return kBegin + std::to_string(shard); }
std::string finish_stage(int shard) { return kFinish + std::to_string(shard); }

std::span<const std::byte> bytes_of(const std::string& text) {
  return std::as_bytes(std::span(text));
}

std::string keys_that_differ(const std::string& before, const std::string& now) {
  const Json old_json = Json::parse(before, nullptr, false);
  const Json new_json = Json::parse(now, nullptr, false);
  std::string keys;
  for (const auto& [key, value] : new_json.items()) {
    const bool is_same = old_json.is_object() && old_json.contains(key) && old_json[key] == value;
    if (!is_same) keys += (keys.empty() ? "" : ", ") + key;
  }
  return keys.empty() ? "format" : keys;
}

}  // namespace

Stage::~Stage() = default;

CollectedFiles::CollectedFiles(Transaction& transaction, std::size_t folder, std::string writer)
    : transaction_(transaction), folder_(folder), writer_(std::move(writer)) {}

void CollectedFiles::check(std::string_view path) const {
  if (is_plain_relative(path)) return;
  throw Error(ErrorKind::Plugin, "writer '" + writer_ +
                                     "': expected a relative path without `..`, found \"" +
                                     std::string(path) + "\"");
}

/// Puts bytes at the end of a file; when it has become large, all of it goes to the stage.
void CollectedFiles::put(std::size_t number, std::span<const std::byte> bytes) {
  StagedFile& file = transaction_.files[number];
  if (transaction_.stage && file.bytes.size() + bytes.size() >= kKeptBytes) {
    for (const auto part : {std::span<const std::byte>(file.bytes), bytes}) {
      if (!part.empty()) transaction_.stage->put(number, file, part);
    }
    file.bytes = {};
    return;
  }
  file.bytes.insert(file.bytes.end(), bytes.begin(), bytes.end());
}

void CollectedFiles::add(std::string_view path, std::vector<std::byte> bytes) {
  check(path);
  transaction_.files.push_back({folder_, std::string(path), {}});
  if (transaction_.stage && bytes.size() >= kKeptBytes) {
    put(transaction_.files.size() - 1, bytes);
  } else {
    transaction_.files.back().bytes = std::move(bytes);
  }
}

void CollectedFiles::append(std::string_view path, std::span<const std::byte> bytes) {
  auto found = growing_.find(path);
  if (found == growing_.end()) {
    add(path, {});
    found = growing_.emplace(path, transaction_.files.size() - 1).first;
  }
  const std::size_t before = transaction_.files[found->second].bytes.size();
  put(found->second, bytes);
  kept_ += transaction_.files[found->second].bytes.size() - before;
  if (!transaction_.stage || kept_ < kKeptGrowingBytes) return;
  for (const auto& [growing_path, number] : growing_) {
    StagedFile& file = transaction_.files[number];
    if (file.bytes.empty()) continue;
    transaction_.stage->put(number, file, file.bytes);
    file.bytes = {};
  }
  kept_ = 0;
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

class OutputStore::DiskStage final : public Stage {
 public:
  DiskStage(OutputStore& store, std::string name) : store_(store), name_(std::move(name)) {}
  ~DiskStage() override {
    try {
      store_.clear_stage(name_, used_);
    } catch (const Error&) {
      // The next open() clears what is left.
    }
  }
  void put(std::size_t number, StagedFile& file, std::span<const std::byte> bytes) override {
    const fs::path folder = store_.stage(file.folder, name_);
    if (used_.insert(file.folder).second) store_.file_system_.make_folders(folder);
    store_.write_staged(folder / std::to_string(number), file.is_begun, bytes);
    file.is_begun = true;
  }
  void release() override { used_.clear(); }

 private:
  OutputStore& store_;
  std::string name_;
  std::set<std::size_t> used_;
};

OutputStore::OutputStore(FileSystem& file_system, OutputFolders folders, int capture_count)
    : file_system_(file_system), folders_(std::move(folders)), capture_count_(capture_count) {}

fs::path OutputStore::journal() const { return folders_.records / ".diorama" / "journal"; }

fs::path OutputStore::journal_file(const std::string& entry) const {
  return journal() / (entry + ".json");
}

fs::path OutputStore::folder(std::size_t index) const {
  return index == kRecordsFolder ? folders_.records : folders_.writers[index].folder;
}

fs::path OutputStore::stage(std::size_t index, const std::string& name) const {
  const std::string part = index == kRecordsFolder ? "records" : std::to_string(index);
  return folder(index) / kStageFolder / (name + "-" + part);
}

std::string OutputStore::capture_entry(int capture) const {
  char digits[16];
  std::snprintf(digits, sizeof digits, "%06d", capture);
  return digits;
}

void OutputStore::probe(const fs::path& target) {
  fs::path existing = fs::absolute(target).lexically_normal();
  while (!file_system_.exists(existing) && existing.has_relative_path()) {
    existing = existing.parent_path();
  }
  if (existing.filename().empty() && existing.has_parent_path()) existing = existing.parent_path();
  const fs::path trial = existing / ".diorama-write-test";
  file_system_.make_folders(trial);
  file_system_.remove(trial);
}

void OutputStore::check_same_dataset(const std::string& dataset_json) const {
  const fs::path file = folders_.records / kDatasetFile;
  if (!file_system_.exists(file)) return;
  const std::string before = file_system_.read(file);
  if (before == dataset_json) return;
  throw Error(ErrorKind::Output, file.string() +
                                     ": belongs to another job or version (differs in: " +
                                     keys_that_differ(before, dataset_json) +
                                     "); resume with the same job, choose another --output or use "
                                     "--overwrite");
}

void OutputStore::check(const std::string& dataset_json, Existing existing) {
  read_journal();
  if (existing == Existing::Refuse && file_system_.exists(folders_.records / kDatasetFile)) {
    throw Error(ErrorKind::Output,
                folders_.records.string() + ": already holds a dataset with " +
                    std::to_string(done_.size()) +
                    " captures; go on with it by --resume, replace it by --overwrite, or choose "
                    "another --output");
  }
  if (existing == Existing::Resume) check_same_dataset(dataset_json);
  probe(folders_.records);
  for (const auto& writer : folders_.writers) probe(writer.folder);
}

void OutputStore::read_journal() {
  done_.clear();
  is_finished_ = false;
  for (const std::string& name : file_system_.list(journal())) {
    if (!name.ends_with(".json")) continue;
    const std::string entry = name.substr(0, name.size() - 5);
    if (entry == kFinish) is_finished_ = true;
    if (is_capture_entry(entry)) done_.insert(std::stoi(entry));
  }
}

std::vector<std::pair<std::size_t, std::string>> OutputStore::journalled_files(
    const std::string& entry) const {
  std::vector<std::pair<std::size_t, std::string>> files;
  const Json json = Json::parse(file_system_.read(journal_file(entry)), nullptr, false);
  if (!json.is_object() || !json.contains("files")) {
    throw Error(ErrorKind::Output,
                journal_file(entry).string() +
                    ": damaged journal entry; remove it to make the capture anew");
  }
  for (const Json& file : json["files"]) {
    const std::string writer = file.at(0);
    std::size_t index = kRecordsFolder;
    for (std::size_t i = 0; i < folders_.writers.size(); ++i) {
      if (folders_.writers[i].name == writer) index = i;
    }
    if (index == kRecordsFolder && !writer.empty()) continue;
    files.emplace_back(index, file.at(1));
  }
  return files;
}

void OutputStore::remove_entries(bool captures_only) {
  for (const std::string& name : file_system_.list(journal())) {
    if (!name.ends_with(".json")) continue;
    const std::string entry = name.substr(0, name.size() - 5);
    if (captures_only && !is_capture_entry(entry)) continue;
    for (const auto& [index, path] : journalled_files(entry)) {
      file_system_.remove(folder(index) / path);
    }
    file_system_.remove(journal_file(entry));
  }
  done_.clear();
  is_finished_ = false;
}

void OutputStore::remove_old_dataset() {
  // dataset.json goes first: from then on the folder holds no dataset that could be resumed.
  file_system_.remove(folders_.records / kDatasetFile);
  remove_entries(false);
  for (const auto& writer : folders_.writers) file_system_.remove(writer.folder / kStageFolder);
  file_system_.remove(folders_.records / kStageFolder);
}

void OutputStore::open(Existing existing, const std::set<int>& own) {
  // Without dataset.json the journal is the rest of a dataset whose removal was cut short. A shard
  // that starts at the same time has no captures before it has written dataset.json.
  const bool is_orphan = !file_system_.exists(folders_.records / kDatasetFile);
  if (existing != Existing::Resume) {
    remove_old_dataset();
  } else if (is_orphan) {
    remove_entries(true);
  }
  file_system_.make_folders(journal());
  std::set<std::size_t> all{kRecordsFolder};
  for (std::size_t i = 0; i < folders_.writers.size(); ++i) all.insert(i);
  for (const int capture : own) {
    const std::string entry = capture_entry(capture);
    const bool is_staged = std::any_of(all.begin(), all.end(), [&](std::size_t index) {
      return file_system_.exists(stage(index, entry));
    });
    if (!is_staged) continue;
    if (is_done(capture)) publish(entry, journalled_files(entry));
    clear_stage(entry, all);
  }
}

std::set<std::size_t> OutputStore::used_folders(const Transaction& transaction) const {
  std::set<std::size_t> used;
  for (const StagedFile& file : transaction.files) used.insert(file.folder);
  return used;
}

void OutputStore::clear_stage(const std::string& stage_name, const std::set<std::size_t>& used) {
  for (const std::size_t index : used) {
    const fs::path place = stage(index, stage_name);
    if (file_system_.exists(place)) file_system_.remove(place);
  }
}

void OutputStore::write_stage(const std::string& stage_name, const Transaction& transaction) {
  for (const std::size_t index : used_folders(transaction)) {
    file_system_.make_folders(stage(index, stage_name));
  }
  for (std::size_t i = 0; i < transaction.files.size(); ++i) {
    const StagedFile& file = transaction.files[i];
    if (file.is_begun && file.bytes.empty()) continue;
    write_staged(stage(file.folder, stage_name) / std::to_string(i), file.is_begun, file.bytes);
  }
}

void OutputStore::write_staged(const fs::path& place, bool is_begun,
                               std::span<const std::byte> bytes) {
  if (is_begun) {
    file_system_.append(place, bytes);
  } else {
    file_system_.write(place, bytes);
  }
  bytes_written_ += bytes.size();
}

void OutputStore::publish(const std::string& stage_name,
                          const std::vector<std::pair<std::size_t, std::string>>& files) {
  for (std::size_t i = 0; i < files.size(); ++i) {
    const auto& [index, path] = files[i];
    const fs::path staged = stage(index, stage_name) / std::to_string(i);
    // Absent when an earlier attempt has moved it already.
    if (!file_system_.exists(staged)) continue;
    const fs::path target = folder(index) / path;
    file_system_.make_folders(target.parent_path());
    file_system_.rename(staged, target);
  }
}

void OutputStore::commit(const std::string& entry, const std::string& stage_name,
                         const Transaction& transaction) {
  Json json;
  json["files"] = Json::array();
  std::vector<std::pair<std::size_t, std::string>> files;
  std::set<fs::path> places;
  for (const StagedFile& file : transaction.files) {
    if (!places.insert((folder(file.folder) / file.path).lexically_normal()).second) {
      throw Error(ErrorKind::Config, (folder(file.folder) / file.path).string() +
                                         ": two files of one capture have this name; give the "
                                         "writers different `output_dir`s");
    }
    const bool is_record = file.folder == kRecordsFolder;
    json["files"].push_back({is_record ? "" : folders_.writers[file.folder].name, file.path});
    files.emplace_back(file.folder, file.path);
  }
  json["records"] = Json::object();
  for (const auto& [writer, line] : transaction.records) {
    json["records"][folders_.writers[writer].name] = line;
  }
  const std::set<std::size_t> used = used_folders(transaction);
  const fs::path draft = journal() / (stage_name + ".part");
  try {
    write_stage(stage_name, transaction);
    file_system_.write(draft, bytes_of(json.dump(-1, ' ', false, Json::error_handler_t::replace)));
    file_system_.rename(draft, journal_file(entry));
  } catch (...) {
    try {
      clear_stage(stage_name, used);
      file_system_.remove(draft);
    } catch (const Error&) {
      // The first failure is the one to report; the next open() clears what is left.
    }
    throw;
  }
  if (transaction.stage) transaction.stage->release();
  publish(stage_name, files);
  clear_stage(stage_name, used);
}

Transaction OutputStore::begin_transaction(int shard) {
  return {std::make_unique<DiskStage>(*this, begin_stage(shard)), {}, {}};
}

Transaction OutputStore::capture_transaction(int capture) {
  return {std::make_unique<DiskStage>(*this, capture_entry(capture)), {}, {}};
}

Transaction OutputStore::finish_transaction(int shard) {
  return {std::make_unique<DiskStage>(*this, finish_stage(shard)), {}, {}};
}

void OutputStore::commit_capture(int capture, const Transaction& transaction) {
  const std::string entry = capture_entry(capture);
  commit(entry, entry, transaction);
}

void OutputStore::commit_begin(const Transaction& transaction, int shard) {
  commit(kBegin, begin_stage(shard), transaction);
}

void OutputStore::commit_finish(const Transaction& transaction, int shard) {
  commit(kFinish, finish_stage(shard), transaction);
  is_finished_ = true;
}

void OutputStore::refresh() { read_journal(); }

void OutputStore::read_records(std::size_t writer, const RecordVisitor& visit) const {
  const std::string& name = folders_.writers[writer].name;
  for (const int capture : done_) {
    const fs::path file = journal_file(capture_entry(capture));
    const Json json = Json::parse(file_system_.read(file), nullptr, false);
    if (!json.is_object() || !json.contains("records")) {
      throw Error(ErrorKind::Output,
                  file.string() + ": damaged journal entry; remove it to make the capture anew");
    }
    const auto record = json["records"].find(name);
    if (record != json["records"].end()) visit(capture, record->get_ref<const std::string&>());
  }
}

void OutputStore::close() {
  for (const auto& writer : folders_.writers) {
    file_system_.remove_if_empty(writer.folder / kStageFolder);
  }
  file_system_.remove_if_empty(folders_.records / kStageFolder);
}

}  // namespace diorama
