// SPDX-License-Identifier: Apache-2.0
#include "framework/view/dataset_view.h"

#include <algorithm>
#include <charconv>
#include <exception>
#include <nlohmann/json.hpp>
#include <utility>

#include "diorama/error.h"
#include "framework/config/json_text.h"
#include "framework/datasets/dataset_difference.h"
#include "framework/datasets/dataset_origin.h"
#include "framework/datasets/dataset_stats.h"
#include "framework/datasets/pixel_boxes.h"
#include "framework/lint/lint_dataset.h"
#include "framework/output/dataset_status.h"
#include "framework/view/capture_json.h"
#include "framework/view/page.h"
#include "framework/view/pictures.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;
using OrderedJson = nlohmann::ordered_json;

constexpr const char* kJson = "application/json";
/// How often a run that goes on is looked at.
constexpr std::chrono::seconds kFollowTime{3};

HttpAnswer answer_of(std::string type, std::string body) {
  return {200, std::move(type), std::make_shared<const std::string>(std::move(body))};
}

std::string json_text(const OrderedJson& json) {
  return json.dump(-1, ' ', false, OrderedJson::error_handler_t::replace);
}

HttpAnswer json_answer(const OrderedJson& json, int status = 200) {
  HttpAnswer answer = answer_of(kJson, json_text(json));
  answer.status = status;
  return answer;
}

HttpAnswer not_there() {
  HttpAnswer answer = answer_of("text/plain; charset=utf-8", "nothing here\n");
  answer.status = 404;
  return answer;
}

/// No picture of ids can show the masks that overlap.
HttpAnswer look_elsewhere() {
  HttpAnswer answer = answer_of("image/png", "");
  answer.status = 204;
  return answer;
}

/// A part of an index, which is JSON of an object. Those of different openings do not fit together.
HttpAnswer part_answer(std::string part, int generation) {
  return answer_of(kJson, part.insert(1, R"("generation":)" + std::to_string(generation) + ","));
}

/// "7", not "+7", "07" or "7.0".
std::optional<std::size_t> whole_number(std::string_view word) {
  std::size_t value = 0;
  const char* const end = word.data() + word.size();
  const auto [rest, failed] = std::from_chars(word.data(), end, value);
  const bool is_plain = word.size() == 1 || !word.starts_with('0');
  if (failed != std::errc() || rest != end || !is_plain) return std::nullopt;
  return value;
}

OrderedJson skeletons_json(const StoredInfo& info) {
  OrderedJson json = OrderedJson::object();
  for (const auto& [name, skeleton] : info.skeletons) {
    json[name] = {{"names", skeleton.names}, {"lines", skeleton.lines}};
  }
  return json;
}

/// The first that is wrong with the dataset as a whole. What is wrong with a capture is told with
/// it.
OrderedJson faults_json(const ReadLog& log) {
  constexpr std::size_t kMost = 3;
  OrderedJson json = OrderedJson::array();
  for (const Finding& finding : log.findings) {
    if (json.size() == kMost) break;
    json.push_back(finding.file + ": " + lint_finding(finding).message);
  }
  return json;
}

/// Some captures of a dataset, evenly spread.
class PartOfDataset final : public StoredDataset {
 public:
  PartOfDataset(std::shared_ptr<const StoredDataset> whole, std::size_t most)
      : whole_(std::move(whole)), info_(whole_->info()) {
    const std::vector<int> all = std::move(info_.captures);
    info_.captures.clear();
    for (std::size_t i = 0; i < most; ++i) {
      places_.push_back(i * all.size() / most);
      info_.captures.push_back(all[places_.back()]);
    }
  }

  const StoredInfo& info() const override { return info_; }
  const ReadLog& log() const override { return whole_->log(); }
  StoredCapture read(std::size_t i, const NameSet& wanted) const override {
    return whole_->read(places_[i], wanted);
  }

 private:
  std::shared_ptr<const StoredDataset> whole_;
  StoredInfo info_;
  std::vector<std::size_t> places_;
};

/// This one or the one above; formats may have a page dataset.json of their own.
fs::path folder_of_run(const fs::path& folder) {
  fs::path plain = fs::absolute(folder).lexically_normal();
  if (!plain.has_filename()) plain = plain.parent_path();
  return run_of(plain).value_or(plain);
}

/// JSON that the page has asked for, or why there is none: files may change while they are read,
/// and that is no reason to end.
template <class Make>
std::shared_ptr<const std::string> made_or_fault(Make&& make) {
  try {
    return std::make_shared<const std::string>(make());
  } catch (const Stopped&) {
    throw;
  } catch (const Error& error) {
    return std::make_shared<const std::string>(json_text({{"fault", error.what()}}));
  }
}

std::optional<DatasetStatus> status_of_run(const fs::path& folder) {
  try {
    if (page_of_run(folder).empty()) return std::nullopt;
    LocalFileSystem file_system;
    return read_status(file_system, folder_of_run(folder), false);
  } catch (const Error&) {
    return std::nullopt;  // a run of others, or files that come and go
  }
}

}  // namespace

struct DatasetView::Opened {
  std::string name;
  fs::path folder;
  bool is_other = false;  ///< Of the folder that is compared with.
  std::shared_ptr<const StoredDataset> whole;
  std::shared_ptr<const StoredDataset> shown;
  CaptureIndex index;
  bool is_looked_up = false;               ///< Whether the index was looked for among kept ones.
  std::optional<IndexCache::Key> key;      ///< When it was made; nothing: it is not kept.
  std::optional<std::size_t> kept_bright;  ///< Captures with brightness in the index kept.
  std::atomic<bool> wants_stats{false};
  std::mutex mutex;
  std::shared_ptr<const std::string> stats;  ///< JSON; null until they were counted.
  // Of a run that goes on, on the main thread: what was read stays true of captures that were there
  // at an earlier look. Others may have come while they were read.
  std::vector<int> whole_captures;  ///< Ascending.
  std::map<int, CaptureIndex::Entry> read_entries;
  std::map<int, std::vector<std::int32_t>> read_brightness;

  bool is_whole(int capture) const { return std::ranges::binary_search(whole_captures, capture); }
  /// What was read of the same folder before it was opened anew.
  void take_over(Opened& before) {
    const StoredInfo& info = shown->info();
    const StoredInfo& old = before.shown->info();
    if (info.camera_names != old.camera_names || info.holds != old.holds) return;
    whole_captures = old.captures;
    read_entries = std::move(before.read_entries);
    read_brightness = std::move(before.read_brightness);
  }
};

DatasetView::DatasetView(Options options, DatasetReaders& readers, Host& host)
    : options_(std::move(options)), readers_(readers), host_(host), indexes_(options_.cache) {
  if (!options_.reader.empty()) readers_.make(options_.reader);
  // Before they are opened, which takes long: what comes meanwhile is seen at the next look.
  if (const auto status = status_of_run(options_.folder)) {
    done_ = status->done;
    is_finished_ = status->is_finished;
  }
  Opening opening = open();
  datasets_ = std::move(opening.datasets);
  faults_ = std::move(opening.faults);
}

DatasetView::~DatasetView() {
  for (const auto& opened : *datasets_) keep_index(*opened);
}

void DatasetView::open_below(const fs::path& folder, bool is_other, Datasets& all,
                             std::vector<std::string>& faults) {
  const std::ptrdiff_t before = std::ssize(all);
  const auto status = status_of_run(folder);
  const bool goes_on = status && !status->is_finished;
  // Formats may have nothing to read before a run's end; the others show how it goes.
  std::exception_ptr first_fault;
  const auto forgive = [&](const Error& error) {
    if (dynamic_cast<const Stopped*>(&error) || error.kind() == ErrorKind::Usage) throw;
    if (goes_on) return host_.log(LogLevel::Debug, error.what());
    if (!first_fault) first_fault = std::current_exception();
    faults.emplace_back(error.what());
  };
  std::vector<FoundDataset> found;
  try {
    found = find_datasets(folder, readers_, options_.reader);
  } catch (const Error& error) {
    forgive(error);
  }
  const auto add = [&](const fs::path& place, std::shared_ptr<const StoredDataset> whole) {
    auto dataset = std::make_shared<Opened>();
    dataset->folder = place;
    dataset->is_other = is_other;
    dataset->name = place.filename().empty() ? place.parent_path().filename().string()
                                             : place.filename().string();
    dataset->whole = std::move(whole);
    dataset->shown = dataset->whole;
    const std::size_t count = dataset->whole->info().captures.size();
    if (options_.most_captures && *options_.most_captures < count) {
      dataset->shown =
          std::make_shared<const PartOfDataset>(dataset->whole, *options_.most_captures);
    }
    all.push_back(std::move(dataset));
  };
  for (const FoundDataset& each : found) {
    try {
      add(each.folder, readers_.open(each.folder, each.reader));
    } catch (const Error& error) {
      forgive(error);
    }
  }
  const auto is_shown = [&](const fs::path& place) {
    return std::any_of(all.begin() + before, all.end(), [&](const auto& opened) {
      return opened->folder == place && !opened->whole->info().captures.empty();
    });
  };
  if (goes_on && status->done > 0 && options_.unfinished) {
    const bool is_whole_run = options_.reader.empty() && run_of(folder) == folder;
    std::vector<fs::path> places = is_whole_run ? folders_of_run(folder) : std::vector{folder};
    std::erase_if(places, [&](const fs::path& place) {
      return is_shown(place) || unreadable_.contains(place);
    });
    std::map<fs::path, fs::path> stand_ins;
    try {
      stand_ins = options_.unfinished(*status, places);
    } catch (const Stopped&) {
      throw;
    } catch (const Error& error) {
      host_.log(LogLevel::Debug, error.what());  // also a job that cannot be assembled here
    }
    for (const auto& [place, made] : stand_ins) {
      try {
        const std::string reader =
            options_.reader.empty() ? readers_.recognise(made) : options_.reader;
        if (reader.empty()) {
          unreadable_.insert(place);
          continue;
        }
        auto whole = readers_.open(made, reader);
        all.erase(std::remove_if(all.begin() + before, all.end(),
                                 [&](const auto& opened) { return opened->folder == place; }),
                  all.end());
        add(place, std::move(whole));
      } catch (const Error& error) {
        forgive(error);
      }
    }
  }
  if (std::ssize(all) == before && first_fault) std::rethrow_exception(first_fault);
  if (std::ssize(all) == before && !goes_on) find_dataset(folder, readers_, options_.reader);
  // Those that hold most come first: what the page shows unless asked.
  std::stable_sort(all.begin() + before, all.end(), [](const auto& a, const auto& b) {
    const auto rank = [](const StoredInfo& info) {
      return std::pair(info.holds.contains(kColor.name), info.holds.size());
    };
    return rank(a->whole->info()) > rank(b->whole->info());
  });
}

DatasetView::Opening DatasetView::open() {
  auto opened = std::make_shared<Datasets>();
  Opening opening;
  open_below(options_.folder, false, *opened, opening.faults);
  if (!options_.other.empty()) open_below(options_.other, true, *opened, opening.faults);
  for (const std::string& fault : opening.faults) host_.log(LogLevel::Warning, fault);
  opening.datasets = std::move(opened);
  return opening;
}

std::shared_ptr<const DatasetView::Datasets> DatasetView::datasets() const {
  const std::lock_guard lock(mutex_);
  return datasets_;
}

std::vector<DatasetView::Shown> DatasetView::shown() const {
  std::vector<Shown> all;
  for (const auto& opened : *datasets()) {
    const StoredInfo& info = opened->shown->info();
    all.push_back({info.captures, info.camera_names, info.holds});
  }
  return all;
}

/// What is still being written has no index that stays.
bool DatasetView::look_up_index(Opened& opened) {
  if (opened.is_looked_up) return false;
  opened.is_looked_up = true;
  if (!is_finished_ || opened.shown != opened.whole) return true;
  const StoredInfo& info = opened.shown->info();
  opened.key = indexes_.key_of(opened.folder, info);
  if (opened.key && indexes_.find(*opened.key, info.captures.size(), opened.index)) {
    opened.kept_bright = opened.index.brightness_size();
  }
  return true;
}

/// Nothing happens while it is not whole, and when nothing has come to it since.
void DatasetView::keep_index(Opened& opened) const {
  const StoredInfo& info = opened.shown->info();
  const std::size_t bright = opened.index.brightness_size();
  if (!opened.key || opened.index.size() < info.captures.size() || opened.kept_bright == bright) {
    return;
  }
  opened.kept_bright = bright;
  // What was changed meanwhile was read half old and half new.
  if (indexes_.key_of(opened.folder, info) == opened.key) indexes_.keep(*opened.key, opened.index);
}

bool DatasetView::index_some(Opened& opened) {
  if (look_up_index(opened)) return true;
  const StoredDataset& data = *opened.shown;
  const std::size_t first = opened.index.size();
  const std::size_t count = data.info().captures.size();
  if (first >= count) return false;
  const std::size_t at_once = 32 * std::size_t(std::max(host_.thread_count(), 1));
  std::vector<CaptureIndex::Entry> entries(std::min(at_once, count - first));
  const NameSet wanted = CaptureIndex::wanted(data.info());
  host_.parallel_for(entries.size(), [&](std::size_t i) {
    const auto known = opened.read_entries.find(data.info().captures[first + i]);
    if (known != opened.read_entries.end()) {
      entries[i] = known->second;
      return;
    }
    StoredCapture stored = data.read(first + i, wanted);
    for (Frame& frame : stored.capture.frames) complete_boxes(frame);
    entries[i] = CaptureIndex::entry_of(data.info(), stored);
  });
  for (std::size_t i = 0; i < entries.size(); ++i) {
    const CaptureIndex::Entry& entry = entries[i];
    const int capture = data.info().captures[first + i];
    opened.index.add(entry);
    // What could not be read may well be the next time.
    if (entry.pictures.empty()) opened.key.reset();
    if (!entry.pictures.empty() && entry.findings == 0 && opened.is_whole(capture)) {
      opened.read_entries.emplace(capture, entry);
    }
  }
  if (opened.index.size() == count) keep_index(opened);
  return true;
}

/// Pictures have to be decoded for it: when all else is there.
bool DatasetView::brighten_some(Opened& opened) {
  const StoredDataset& data = *opened.shown;
  const std::size_t first = opened.index.brightness_size();
  const std::size_t count = data.info().captures.size();
  const NameSet wanted{std::string(kColor.name)};
  if (first >= count || !data.info().holds.contains(kColor.name)) return false;
  const std::size_t at_once = 8 * std::size_t(std::max(host_.thread_count(), 1));
  std::vector<std::vector<std::int32_t>> found(std::min(at_once, count - first));
  host_.parallel_for(found.size(), [&](std::size_t i) {
    const auto known = opened.read_brightness.find(data.info().captures[first + i]);
    if (known != opened.read_brightness.end()) {
      found[i] = known->second;
      return;
    }
    const StoredCapture stored = data.read(first + i, wanted);
    for (const Frame& frame : stored.capture.frames) {
      found[i].push_back(frame.has(kColor.name)
                             ? std::int32_t(std::lround(100.0 * mean_brightness(frame.get(kColor))))
                             : CaptureIndex::kUnknown);
    }
  });
  for (std::size_t i = 0; i < found.size(); ++i) {
    const int capture = data.info().captures[first + i];
    opened.index.add_brightness(found[i]);
    if (opened.is_whole(capture)) opened.read_brightness.emplace(capture, found[i]);
  }
  if (opened.index.brightness_size() == count) keep_index(opened);
  return true;
}

bool DatasetView::make_stats(Opened& opened) {
  if (!opened.wants_stats.exchange(false)) return false;
  auto text = made_or_fault([&] { return stats_json(dataset_stats(*opened.whole, host_)); });
  const std::lock_guard lock(opened.mutex);
  opened.stats = std::move(text);
  return true;
}

bool DatasetView::make_findings() {
  if (!wants_findings_) return false;
  auto text = made_or_fault(
      [&] { return lint_json(lint_datasets(options_.folder, readers_, host_, options_.reader)); });
  const std::lock_guard lock(mutex_);
  findings_ = std::move(text);
  wants_findings_ = false;
  return true;
}

bool DatasetView::make_comparison() {
  Pair asked;
  std::shared_ptr<const Datasets> all;
  {
    const std::lock_guard lock(mutex_);
    const auto open =
        std::ranges::find_if(comparisons_, [](const auto& each) { return each.second == nullptr; });
    if (open == comparisons_.end()) return false;
    asked = open->first;
    all = datasets_;
    if (std::max(asked.first, asked.second) >= all->size()) {  // of a run that has changed since
      comparisons_.erase(open);
      return true;
    }
  }
  const Opened& a = *all->at(asked.first);
  const Opened& b = *all->at(asked.second);
  auto text = made_or_fault([&] {
    const DatasetDifference difference =
        dataset_difference({a.folder, *a.whole}, {b.folder, *b.whole}, options_.tolerance, host_);
    return json_text({{"pages", difference.pages},
                      {"contents", difference.contents},
                      {"captures", difference.captures},
                      {"differing", difference.differing}});
  });
  const std::lock_guard lock(mutex_);
  if (all == datasets_) comparisons_[asked] = std::move(text);
  return true;
}

bool DatasetView::follow_run() {
  const auto now = std::chrono::steady_clock::now();
  if (is_finished_ || now < next_look_) return false;
  const auto status = status_of_run(options_.folder);
  if (status && (status->done != done_ || status->is_finished)) {
    try {
      Opening fresh = open();
      const bool is_other_edition = status->is_finished || status->done < done_;
      if (!is_other_edition) {
        for (const auto& opened : *fresh.datasets) {
          for (const auto& old : *datasets_) {
            if (old->folder == opened->folder && old->is_other == opened->is_other) {
              opened->take_over(*old);
            }
          }
        }
      }
      const std::lock_guard lock(mutex_);
      datasets_ = std::move(fresh.datasets);
      faults_ = std::move(fresh.faults);
      ++generation_;
      edition_ += is_other_edition ? 1 : 0;
      findings_ = nullptr;
      comparisons_.clear();
      done_ = status->done;
      is_finished_ = status->is_finished;
    } catch (const Error& error) {
      // A file that is just being replaced: the next look will see it.
      host_.log(LogLevel::Debug, error.what());
    }
  }
  // Large datasets take long to open; that is no reason to do nothing else.
  const auto later = std::chrono::steady_clock::now();
  next_look_ =
      later + std::max<std::chrono::steady_clock::duration>(kFollowTime, 10 * (later - now));
  return false;
}

bool DatasetView::work() {
  follow_run();
  const auto all = datasets();
  for (const auto& opened : *all) {
    if (make_stats(*opened)) return true;
  }
  if (make_findings() || make_comparison()) return true;
  const std::size_t asked = asked_;
  if (asked < all->size() && index_some(*all->at(asked))) return true;
  if (std::ranges::any_of(*all, [&](const auto& opened) { return index_some(*opened); })) {
    return true;
  }
  return std::ranges::any_of(*all, [&](const auto& opened) { return brighten_some(*opened); });
}

HttpAnswer DatasetView::state() const {
  OrderedJson json;
  fs::path folder = fs::absolute(options_.folder).lexically_normal();
  json["folder"] = folder.string();
  {
    const std::lock_guard lock(mutex_);
    json["generation"] = generation_;
    json["edition"] = edition_;
    json["is_finished"] = is_finished_;
    json["is_linted"] = findings_ != nullptr;
    json["faults"] = faults_;
  }
  json["datasets"] = OrderedJson::array();
  for (const auto& opened : *datasets()) {
    const StoredInfo& info = opened->shown->info();
    json["datasets"].push_back({{"name", opened->name},
                                {"folder", opened->folder.string()},
                                {"is_other", opened->is_other},
                                {"format", info.format},
                                {"captures", info.captures.size()},
                                {"all_captures", opened->whole->info().captures.size()},
                                {"indexed", opened->index.size()}});
  }
  return json_answer(json);
}

HttpAnswer DatasetView::run_answer() {
  OrderedJson json = OrderedJson::object();
  OrderedJson page;
  try {
    page = parse_json_or_nothing<OrderedJson>(page_of_run(options_.folder));
  } catch (const Error& error) {
    host_.log(LogLevel::Debug, error.what());  // it was readable when the view began
  }
  if (page.is_object()) {
    json["folder"] = folder_of_run(options_.folder).string();
    for (const char* key : {"seed", "version", "job", "plugins"}) {
      if (page.contains(key)) json[key] = page.at(key);
    }
  }
  if (const auto status = status_of_run(options_.folder)) {
    json["captures"] = status->captures;
    json["done"] = status->done;
    json["is_finished"] = status->is_finished;
    json["workers"] = OrderedJson::array();
    for (const DatasetStatus::Worker& worker : status->workers) {
      json["workers"].push_back({{"name", worker.name},
                                 {"role", worker.role},
                                 {"description", worker.description},
                                 {"is_alive", worker.is_alive},
                                 {"memory_bytes", worker.memory_bytes},
                                 {"captures", worker.captures}});
    }
    const std::lock_guard lock(records_mutex_);
    if (!records_) records_.emplace(folder_of_run(options_.folder));
    try {
      records_->refresh(*status, page.is_object() && page.contains("views"));
    } catch (const Error& error) {
      // What was read until then is true all the same.
      host_.log(LogLevel::Debug, error.what());
    }
    json.update(records_->json());
  }
  return json_answer(json);
}

HttpAnswer DatasetView::lint_answer() {
  const std::lock_guard lock(mutex_);
  if (findings_) return {200, kJson, findings_};
  wants_findings_ = true;
  return json_answer({{"state", "running"}}, 202);
}

HttpAnswer DatasetView::compare_answer(const Datasets& all, std::size_t first, Words words) {
  const auto second = words.empty() ? std::nullopt : whole_number(words[0]);
  if (!second || *second >= all.size() || words.size() > 2) return not_there();
  if (words.size() == 2) {
    const auto number = whole_number(words[1]);
    if (!number || *number > std::size_t(INT32_MAX)) return not_there();
    return json_answer(capture_difference(*all[first]->whole, *all[*second]->whole, int(*number),
                                          options_.tolerance));
  }
  const std::lock_guard lock(mutex_);
  const auto& made = comparisons_[{first, *second}];
  if (made) return {200, kJson, made};
  return json_answer({{"state", "running"}}, 202);
}

HttpAnswer DatasetView::capture_answer(const Opened& opened, Words words) {
  const StoredDataset& data = *opened.shown;
  const StoredInfo& info = data.info();
  const auto number = whole_number(words[0]);
  if (!number || *number > std::size_t(INT32_MAX)) return not_there();
  const auto at = std::ranges::lower_bound(info.captures, int(*number));
  if (at == info.captures.end() || *at != int(*number)) return not_there();
  const auto read = [&](const NameSet& wanted) {
    return data.read(std::size_t(at - info.captures.begin()), wanted);
  };
  if (words.size() == 1) {
    StoredCapture stored = read(wanted_for_labels(info));
    for (Frame& frame : stored.capture.frames) complete_boxes(frame);
    return answer_of(kJson, capture_json(info, stored));
  }
  if (words.size() != 3) return not_there();
  const auto place = whole_number(words[1]);
  const auto kind = picture_kind(words[2]);
  const bool is_amodal = words[2] == "amodal";
  const bool is_masks = words[2] == "masks";
  if (!place || (!kind && !is_amodal && !is_masks)) return not_there();
  const StoredCapture stored =
      read(kind        ? channels_of(*kind)
           : is_amodal ? NameSet{"amodal_mask", "visibility", std::string(kHoldsInstances)}
                       : channels_of(PictureKind::Ids));
  if (*place >= stored.capture.frames.size()) return not_there();
  const Frame& frame = stored.capture.frames[*place];
  if (is_amodal) return answer_of(kJson, amodal_json(frame));
  const bool has_masks = *place < stored.masks.size() && !stored.masks[*place].empty();
  if (is_masks) return has_masks ? answer_of(kJson, masks_json(stored.masks[*place])) : not_there();
  auto picture = make_picture(frame, *kind, host_);
  if (picture) return answer_of(std::move(picture->type), std::move(picture->bytes));
  return has_masks ? look_elsewhere() : not_there();
}

HttpAnswer DatasetView::dataset_answer(Opened& opened, int generation, Words words) {
  const StoredInfo& info = opened.shown->info();
  if (words[0] == "info" && words.size() == 1) {
    return json_answer({{"name", opened.name},
                        {"folder", opened.folder.string()},
                        {"format", info.format},
                        {"holds", info.holds},
                        {"cameras", info.camera_names},
                        {"classes", info.classes},
                        {"captures", info.captures},
                        {"skeletons", skeletons_json(info)},
                        {"faults", faults_json(opened.whole->log())},
                        {"fault_count", opened.whole->log().findings.size()}});
  }
  if (words[0] == "stats" && words.size() == 1) {
    const std::lock_guard lock(opened.mutex);
    if (opened.stats) return {200, kJson, opened.stats};
    opened.wants_stats = true;
    return json_answer({{"state", "running"}}, 202);
  }
  if (words[0] == "index" && words.size() == 2) {
    const auto from = whole_number(words[1]);
    return from ? part_answer(opened.index.json(*from, kIndexPart), generation) : not_there();
  }
  if (words[0] == "brightness" && words.size() == 2) {
    const auto from = whole_number(words[1]);
    return from ? part_answer(opened.index.brightness_json(*from, kIndexPart), generation)
                : not_there();
  }
  if (words[0] == "capture" && words.size() >= 2) return capture_answer(opened, words.subspan(1));
  return not_there();
}

HttpAnswer DatasetView::answer(std::string_view path) {
  if (path == "/") return answer_of("text/html; charset=utf-8", std::string(page_html()));
  if (path == "/view.js") {
    return answer_of("text/javascript; charset=utf-8", std::string(page_script()));
  }
  if (path == "/view.css") return answer_of("text/css; charset=utf-8", std::string(page_style()));
  if (path == "/icon.svg") return answer_of("image/svg+xml", std::string(page_icon()));
  std::vector<std::string_view> words;
  for (std::string_view rest = path; !rest.empty();) {
    rest.remove_prefix(1);
    words.push_back(rest.substr(0, rest.find('/')));
    rest.remove_prefix(words.back().size());
  }
  if (words.size() < 2 || words[0] != "api") return not_there();
  if (words.size() == 2 && words[1] == "state") return state();
  if (words.size() == 2 && words[1] == "run") return run_answer();
  if (words.size() == 2 && words[1] == "lint") return lint_answer();
  std::shared_ptr<const Datasets> all;
  int generation = 0;
  {
    const std::lock_guard lock(mutex_);
    all = datasets_;
    generation = generation_;
  }
  const auto number = whole_number(words[1]);
  if (words.size() < 3 || !number || *number >= all->size()) return not_there();
  Opened& opened = *all->at(*number);
  const Words rest = Words(words).subspan(2);
  if (rest[0] == "index") asked_ = *number;
  if (rest[0] == "compare") return compare_answer(*all, *number, rest.subspan(1));
  if (rest[0] != "capture") return dataset_answer(opened, generation, rest);

  // What captures hold stays the same for as long as a dataset is open.
  const std::string key = std::to_string(generation) + std::string(path);
  if (const auto known = cache_.find(key)) return *known;
  HttpAnswer made = dataset_answer(opened, generation, rest);
  if (made.status == 200) {
    cache_.add(key, std::make_shared<const HttpAnswer>(made), made.body->size() + key.size() + 256);
  }
  return made;
}

}  // namespace diorama
