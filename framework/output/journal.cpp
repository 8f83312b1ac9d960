// SPDX-License-Identifier: Apache-2.0
#include "framework/output/journal.h"

#include <xxhash.h>

#include <algorithm>
#include <charconv>
#include <climits>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "diorama/error.h"

#include "framework/config/json_text.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;
using OrderedJson = nlohmann::ordered_json;

constexpr int kFormat = 1;
constexpr std::string_view kIndexEnding = ".index";
constexpr std::string_view kEntriesEnding = ".entries";

std::string hex(std::uint64_t value, int digits) {
  char text[24];
  std::snprintf(text, sizeof text, "%0*llx", digits, static_cast<unsigned long long>(value));
  return text;
}

std::string to_text(const XXH128_hash_t& hash) {
  return hex(hash.high64, 16) + hex(hash.low64, 16);
}

std::string checksum(std::string_view line) { return hex(XXH32(line.data(), line.size(), 0), 8); }

std::optional<std::uint64_t> number_in(std::string_view text) {
  std::uint64_t value = 0;
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (code != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

std::optional<int> entry_in(std::string_view text) {
  if (text == "begin") return kBeginEntry;
  if (text == "finish") return kFinishEntry;
  const auto number = number_in(text);
  if (!number || text.size() < 6 || *number > std::uint64_t(INT32_MAX)) return std::nullopt;
  return int(*number);
}

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  while (!line.empty()) {
    const std::size_t end = std::min(line.find(' '), line.size());
    words.push_back(line.substr(0, end));
    line.remove_prefix(std::min(end + 1, line.size()));
  }
  return words;
}

std::string to_text(const JournalledFiles& content) {
  OrderedJson json;
  json["files"] = OrderedJson::array();
  for (const JournalledFile& file : content.files) {
    json["files"].push_back({file.path, file.size, file.digest});
  }
  json["records"] = OrderedJson::object();
  for (const auto& [writer, line] : content.records) json["records"][writer] = line;
  return json.dump(-1, ' ', false, OrderedJson::error_handler_t::replace) + "\n";
}

/// Nothing but what to_text() writes; std::nullopt otherwise.
std::optional<JournalledFiles> from_text(std::string_view text) {
  const OrderedJson json = parse_json_or_nothing<OrderedJson>(text);
  if (!json.is_object() || !json.contains("files") || !json["files"].is_array()) return {};
  JournalledFiles content;
  for (const OrderedJson& file : json["files"]) {
    const bool is_well_typed = file.is_array() && file.size() == 3 && file[0].is_string() &&
                               file[1].is_number_unsigned() && file[2].is_string();
    if (!is_well_typed) return {};
    content.files.push_back(
        {file[0].get<std::string>(), file[1].get<std::uint64_t>(), file[2].get<std::string>()});
    if (!is_plain_relative(content.files.back().path)) return {};
  }
  if (!json.contains("records") || !json["records"].is_object()) return {};
  for (const auto& [writer, line] : json["records"].items()) {
    if (!line.is_string()) return {};
    content.records.emplace_back(writer, line.get<std::string>());
  }
  return content;
}

}  // namespace

std::string entry_name(int entry) {
  if (entry == kBeginEntry) return "begin";
  if (entry == kFinishEntry) return "finish";
  char digits[16];
  std::snprintf(digits, sizeof digits, "%06d", entry);
  return digits;
}

std::string digest_of(std::span<const std::byte> bytes) {
  return to_text(XXH3_128bits(bytes.data(), bytes.size()));
}

std::string digest_of(std::string_view text) { return digest_of(std::as_bytes(std::span(text))); }

struct Digest::State {
  XXH3_state_t* hash = XXH3_createState();
  State() { XXH3_128bits_reset(hash); }
  ~State() { XXH3_freeState(hash); }
  State(const State&) = delete;
  State& operator=(const State&) = delete;
};

Digest::Digest() : state_(std::make_unique<State>()) {}
Digest::~Digest() = default;

void Digest::add(std::span<const std::byte> bytes) {
  XXH3_128bits_update(state_->hash, bytes.data(), bytes.size());
}

std::string Digest::text() const { return to_text(XXH3_128bits_digest(state_->hash)); }

std::string digest_of(FileSystem& file_system, const fs::path& file) {
  constexpr std::uint64_t kPiece = std::uint64_t(1) << 20;
  Digest digest;
  for (std::uint64_t at = 0;; at += kPiece) {
    const std::string piece = file_system.read_part(file, at, kPiece);
    digest.add(std::as_bytes(std::span(piece)));
    if (piece.size() < kPiece) return digest.text();
  }
}

bool is_plain_relative(std::string_view path) {
  if (path.empty() || path.size() >= PATH_MAX) return false;
  if (path.front() == '/' || path.back() == '/') return false;
  if (path.find('\\') != std::string_view::npos || path.find('\0') != std::string_view::npos) {
    return false;
  }
  const fs::path parsed(path);
  return std::none_of(parsed.begin(), parsed.end(),
                      [](const fs::path& part) { return part == ".." || part == "."; });
}

bool is_kept_path(const std::string& records, std::string_view path) {
  const std::string folder = (records == "." ? "" : records + "/") + kKeptFolder + "/";
  return path.starts_with(folder);
}

bool is_plain_name(std::string_view name) {
  if (name.empty() || name.size() > 200 || name.front() == '.') return false;
  return std::all_of(name.begin(), name.end(), [](char c) {
    return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '.' ||
           c == '_' || c == '-';
  });
}

std::string journal_line(std::string line) { return line + " *" + checksum(line) + "\n"; }

JournalWriter::JournalWriter(FileSystem& file_system, fs::path folder, std::string worker,
                             std::string records)
    : file_system_(file_system),
      folder_(std::move(folder)),
      worker_(std::move(worker)),
      records_(std::move(records)) {}

/// With the mutex held.
void JournalWriter::start() {
  if (index_) return;
  const auto open = [&](std::string_view ending) {
    const fs::path file = folder_ / (worker_ + std::string(ending));
    return in_folder(file_system_, folder_, [&] { return file_system_.append_to(file); });
  };
  entries_ = open(kEntriesEnding);
  index_ = open(kIndexEnding);
  const OrderedJson header{{"format", kFormat}, {"records", records_}};
  add_line("h " +
           add_entry(header.dump(-1, ' ', false, OrderedJson::error_handler_t::replace) + "\n"));
  file_system_.sync_folder(folder_);
  file_system_.sync_folder(folder_.parent_path());
}

/// Its place, as an index says it.
std::string JournalWriter::add_entry(const std::string& text) {
  const std::uint64_t offset = entries_bytes_;
  append(*entries_, text);
  entries_bytes_ += text.size();
  return std::to_string(offset) + " " + std::to_string(text.size()) + " " + digest_of(text);
}

void JournalWriter::add_line(std::string line) { append(*index_, journal_line(std::move(line))); }

/// Nothing is written after a failure: what follows a torn line would be lost with it. Each thread
/// that tries says why the first one failed, as any of them may be the one that is heard.
template <class Write>
void JournalWriter::attempt(Write write) {
  if (!failure_.empty()) {
    throw Error(ErrorKind::Output,
                (folder_ / worker_).string() +
                    ": the journal takes no more since writing it failed: " + failure_);
  }
  failure_ = "it was broken off";
  try {
    write();
  } catch (const Error& error) {
    failure_ = error.what();
    throw;
  }
  failure_.clear();
}

void JournalWriter::append(AppendFile& file, const std::string& text) {
  attempt([&] { file.append(std::as_bytes(std::span(text))); });
}

void JournalWriter::sync(AppendFile& file) {
  attempt([&] { file.sync(); });
}

void JournalWriter::commit(int entry, const JournalledFiles& files) {
  const std::string text = to_text(files);
  const std::lock_guard lock(mutex_);
  start();
  const std::string place = add_entry(text);
  sync(*entries_);
  add_line("c " + entry_name(entry) + " " + place);
  sync(*index_);
}

void JournalWriter::published(int entry) {
  const std::lock_guard lock(mutex_);
  add_line("d " + entry_name(entry));
}

void JournalWriter::published_for(const std::string& worker, int entry) {
  const std::lock_guard lock(mutex_);
  start();
  add_line("p " + worker + " " + entry_name(entry));
}

void JournalWriter::void_entry(const std::string& worker, int entry) {
  const std::lock_guard lock(mutex_);
  start();
  add_line("v " + worker + " " + entry_name(entry));
  sync(*index_);
}

void JournalWriter::settled(const std::string& worker, std::uint64_t bytes) {
  const std::lock_guard lock(mutex_);
  start();
  add_line("r " + worker + " " + std::to_string(bytes));
  sync(*index_);
}

void JournalWriter::checkpoint() {
  const std::lock_guard lock(mutex_);
  if (!index_) return;
  add_line("s");
  sync(*index_);
}

bool JournalWriter::has_lines() const {
  const std::lock_guard lock(mutex_);
  return index_ != nullptr;
}

/// A line whose checksum holds.
struct Journals::Line {
  char kind = 0;
  std::string worker;
  int entry = 0;
  EntryPlace place;
  std::uint64_t bytes = 0;
};

Journals::Journals(FileSystem& file_system, fs::path folder, int capture_count)
    : file_system_(file_system),
      folder_(std::move(folder)),
      capture_count_(capture_count),
      published_(std::size_t(std::max(capture_count, 0))) {}

fs::path Journals::index_file(const std::string& worker) const {
  return folder_ / (worker + std::string(kIndexEnding));
}

fs::path Journals::entries_file(const std::string& worker) const {
  return folder_ / (worker + std::string(kEntriesEnding));
}

std::vector<std::string> Journals::worker_names() const {
  std::vector<std::string> names;
  for (const std::string& name : file_system_.list(folder_)) {
    if (name.ends_with(".json")) {
      throw Error(ErrorKind::Output, folder_.string() +
                                         ": a journal of an earlier version; finish this dataset "
                                         "with that version or choose another --output");
    }
    if (!name.ends_with(kIndexEnding)) continue;
    const std::string worker = name.substr(0, name.size() - kIndexEnding.size());
    if (is_plain_name(worker)) names.push_back(worker);
  }
  return names;
}

bool Journals::is_published(int entry) const {
  if (entry == kBeginEntry) return has_begun_;
  if (entry == kFinishEntry) return has_finished_;
  return entry < capture_count_ && published_[std::size_t(entry)];
}

std::vector<EntryPlace> WorkerIndex::unsettled() const {
  std::vector<EntryPlace> places = published_since;
  for (const auto& [entry, place] : committed) places.push_back(place);
  std::ranges::stable_sort(places, {}, &EntryPlace::offset);
  return places;
}

/// False, and nothing happens, when no line of its worker says what it holds: who looks for damage
/// would never see it.
bool Journals::set_published(const std::string& worker, int entry, WorkerIndex& index) {
  const auto [first, last] = index.committed.equal_range(entry);
  if (first == last) return false;
  for (auto at = first; at != last; ++at) {
    at->second.is_published = true;
    index.published_since.push_back(std::move(at->second));
  }
  index.committed.erase(first, last);
  if (voids_.contains({worker, entry})) return true;
  if (entry == kBeginEntry) has_begun_ = true;
  if (entry == kFinishEntry) has_finished_ = true;
  if (entry < 0 || entry >= capture_count_) return true;
  ++index.published;
  if (published_[std::size_t(entry)]) return true;
  published_[std::size_t(entry)] = true;
  ++published_captures_;
  return true;
}

namespace {

/// Of digest_of(), as numbers.
std::optional<std::array<std::uint64_t, 2>> digits_of(std::string_view digest) {
  std::array<std::uint64_t, 2> halves{};
  if (digest.size() != 32) return std::nullopt;
  for (std::size_t i = 0; i < 2; ++i) {
    const char* begin = digest.data() + 16 * i;
    const auto [end, code] = std::from_chars(begin, begin + 16, halves[i], 16);
    if (code != std::errc() || end != begin + 16) return std::nullopt;
  }
  return halves;
}

std::optional<EntryPlace> place_in(const std::vector<std::string_view>& words, std::size_t first) {
  if (words.size() != first + 3) return std::nullopt;
  const auto offset = number_in(words[first]);
  const auto length = number_in(words[first + 1]);
  const auto digest = digits_of(words[first + 2]);
  // A transaction of a million files is the most that anyone writes.
  if (!offset || !length || !digest || *length > (std::uint64_t(1) << 30)) return std::nullopt;
  EntryPlace place;
  place.offset = *offset;
  place.length = std::uint32_t(*length);
  place.digest = *digest;
  return place;
}

/// The line without its checksum; empty when that does not hold.
std::string_view checked(std::string_view line) {
  if (line.size() < 11 || line[line.size() - 9] != '*' || line[line.size() - 10] != ' ') return {};
  const std::string_view text = line.substr(0, line.size() - 10);
  return checksum(text) == line.substr(line.size() - 8) ? text : std::string_view();
}

/// Those whose checksums hold, without these, from `offset` on, in little memory; moves `offset`
/// behind what was read.
void read_lines(FileSystem& file_system, const fs::path& file, std::uint64_t& offset,
                const std::function<void(std::string_view)>& visit) {
  constexpr std::uint64_t kBlock = std::uint64_t(1) << 18;
  for (;;) {
    const std::string block = file_system.read_part(file, offset, kBlock);
    // A line without its end is on its way, or torn.
    const std::size_t end = block.rfind('\n');
    if (end == std::string::npos) return;
    std::string_view rest = std::string_view(block).substr(0, end + 1);
    while (!rest.empty()) {
      const std::size_t length = rest.find('\n');
      const std::string_view text = checked(rest.substr(0, length));
      rest.remove_prefix(length + 1);
      if (!text.empty()) visit(text);
    }
    offset += end + 1;
    if (block.size() < kBlock) return;
  }
}

}  // namespace

void Journals::take(const std::string& worker, WorkerIndex& index, const Line& line) {
  switch (line.kind) {
    case 'h':
      index.header = line.place;
      break;
    case 'c':
      index.committed.emplace(line.place.entry, line.place);
      break;
    case 'd':
      set_published(worker, line.entry, index);
      break;
    case 's':
      // What is still on its way to its place is not covered.
      index.published_since.clear();
      break;
    case 'p':
      published_for_.emplace(line.worker, line.entry);
      break;
    case 'v':
      has_new_voids_ |= voids_.emplace(line.worker, line.entry).second;
      break;
    case 'r':
      workers_[line.worker].settled_bytes =
          std::max(workers_[line.worker].settled_bytes, line.bytes);
      break;
    default:
      break;
  }
}

/// Without its checksum; empty when it is no line of an index.
std::optional<Journals::Line> Journals::parse(std::string_view text) {
  const auto words = words_of(text);
  Line line;
  if (words.front().size() != 1) return {};
  line.kind = words.front().front();
  std::optional<int> entry;
  switch (line.kind) {
    case 's':
      return words.size() == 1 ? std::optional(line) : std::nullopt;
    case 'h':
    case 'c': {
      if (line.kind == 'c') entry = words.size() > 1 ? entry_in(words[1]) : std::nullopt;
      const auto place = place_in(words, line.kind == 'h' ? 1 : 2);
      if (!place || (line.kind == 'c' && !entry)) return {};
      line.place = *place;
      line.place.entry = entry.value_or(0);
      return line;
    }
    case 'd':
      if (words.size() != 2 || !(entry = entry_in(words[1]))) return {};
      line.entry = *entry;
      return line;
    case 'p':
    case 'v':
      if (words.size() != 3 || !is_plain_name(words[1])) return {};
      if (!(entry = entry_in(words[2]))) return {};
      line.worker = words[1];
      line.entry = *entry;
      return line;
    case 'r': {
      const auto bytes = words.size() == 3 ? number_in(words[2]) : std::nullopt;
      if (!bytes || !is_plain_name(words[1])) return {};
      line.worker = words[1];
      line.bytes = *bytes;
      return line;
    }
    default:
      return {};
  }
}

void Journals::read_worker(const std::string& worker) {
  WorkerIndex& index = workers_[worker];
  const fs::path file = index_file(worker);
  read_lines(file_system_, file, index.bytes_read, [&](std::string_view text) {
    const auto line = parse(text);
    if (!line) {
      throw Error(ErrorKind::Output, file.string() + ": no journal of this version: expected " +
                                         "lines such as 'd 000017', found '" +
                                         std::string(text.substr(0, 80)) + "'");
    }
    take(worker, index, *line);
  });
}

void Journals::read_workers() {
  for (const std::string& worker : worker_names()) read_worker(worker);
  // Lines about other workers' entries: they stand in indexes that may be read before those. What
  // is not known yet may come with the next reading.
  std::erase_if(published_for_, [this](const auto& of) {
    const auto index = workers_.find(of.first);
    return index != workers_.end() && set_published(of.first, of.second, index->second);
  });
}

void Journals::refresh() {
  read_workers();
  if (!std::exchange(has_new_voids_, false)) return;
  // What a void takes back was counted before: count all anew, with the voids known.
  EntriesOfWorkers voids = std::move(voids_);
  forget();
  voids_ = std::move(voids);
  read_workers();
  has_new_voids_ = false;
}

void Journals::forget() {
  workers_.clear();
  voids_.clear();
  published_for_.clear();
  published_.assign(published_.size(), false);
  published_captures_ = 0;
  has_begun_ = has_finished_ = false;
}

/// Read anew, by number; of one that comes again the last.
std::vector<EntryPlace> Journals::entries_of(const std::string& worker) const {
  std::vector<EntryPlace> places;
  std::uint64_t offset = 0;
  read_lines(file_system_, index_file(worker), offset, [&](std::string_view text) {
    const auto words = words_of(text);
    if (words.size() != 5 || words.front() != "c") return;
    const auto entry = entry_in(words[1]);
    auto place = place_in(words, 2);
    if (!entry || !place) return;
    place->entry = *entry;
    // One worker alone has nearly all: a list that doubles would take as much again.
    if (places.size() == places.capacity()) {
      places.reserve(places.size() + std::size_t(published_captures_) + 64);
    }
    places.push_back(*place);
  });
  std::ranges::sort(places, [](const EntryPlace& a, const EntryPlace& b) {
    return std::pair(a.entry, b.offset) < std::pair(b.entry, a.offset);
  });
  // Not by ranges: clang 14, which builds the fuzzers, does not know what they return.
  const auto are_same = [](const EntryPlace& a, const EntryPlace& b) { return a.entry == b.entry; };
  places.erase(std::unique(places.begin(), places.end(), are_same), places.end());
  std::erase_if(places, [&](const EntryPlace& place) {
    return voids_.contains({worker, place.entry});
  });
  for (EntryPlace& place : places) {
    place.is_published = place.entry >= capture_count_ || is_published(place.entry);
  }
  return places;
}

void Journals::visit_entries(
    const std::function<void(const std::string&, const EntryPlace&)>& visit) const {
  for (const std::string& worker : worker_names()) {
    for (const EntryPlace& place : entries_of(worker)) visit(worker, place);
  }
}

void Journals::visit_captures(
    const std::function<bool(const std::string&, const EntryPlace&)>& visit) const {
  struct Reading {
    std::string worker;
    std::vector<EntryPlace> places;
    std::size_t at = 0;
  };
  std::vector<Reading> readings;
  for (const std::string& worker : worker_names()) {
    if (workers_.contains(worker)) readings.push_back({worker, entries_of(worker)});
  }
  std::set<std::pair<int, std::size_t>> next;  // captures and places in `readings`
  const auto find_next = [&](std::size_t i) {
    Reading& reading = readings[i];
    for (; reading.at < reading.places.size(); ++reading.at) {
      const EntryPlace& place = reading.places[reading.at];
      if (place.entry < 0 || place.entry >= capture_count_ || !place.is_published) continue;
      next.emplace(place.entry, i);
      return;
    }
  };
  for (std::size_t i = 0; i < readings.size(); ++i) find_next(i);
  std::optional<int> taken;
  while (!next.empty()) {
    const auto [capture, i] = *next.begin();
    next.erase(next.begin());
    Reading& reading = readings[i];
    if (taken != capture && visit(reading.worker, reading.places[reading.at])) taken = capture;
    ++reading.at;
    find_next(i);
  }
}

std::optional<JournalledFiles> Journals::files_of(const std::string& worker,
                                                  const EntryPlace& place) const {
  const fs::path file = entries_file(worker);
  const std::string text = file_system_.read_part(file, place.offset, place.length);
  if (text.size() != place.length || digits_of(digest_of(text)) != place.digest) {
    return std::nullopt;
  }
  auto content = from_text(text);
  if (!content) {
    throw Error(ErrorKind::Output, file.string() + ": byte " + std::to_string(place.offset) +
                                       ": expected the files of " + entry_name(place.entry) +
                                       " with relative paths, sizes and digests, found '" +
                                       text.substr(0, std::min<std::size_t>(text.find('\n'), 80)) +
                                       "'");
  }
  return content;
}

std::optional<std::string> Journals::records_folder() const {
  for (const auto& [worker, index] : workers_) {
    if (index.header.length == 0) continue;
    const std::string text =
        file_system_.read_part(entries_file(worker), index.header.offset, index.header.length);
    if (digits_of(digest_of(text)) != index.header.digest) continue;
    const OrderedJson json = parse_json_or_nothing<OrderedJson>(text);
    if (!json.is_object() || !json.contains("records") || !json["records"].is_string()) continue;
    std::string records = json["records"].get<std::string>();
    if (records == "." || is_plain_relative(records)) return records;
  }
  return std::nullopt;
}

}  // namespace diorama
