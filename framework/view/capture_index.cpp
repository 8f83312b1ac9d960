// SPDX-License-Identifier: Apache-2.0
#include "framework/view/capture_index.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <span>

#include "framework/datasets/dataset_stats.h"

namespace diorama {
namespace {

using Json = nlohmann::json;

std::int32_t whole(double value, double least, double most) {
  if (!std::isfinite(value)) return CaptureIndex::kUnknown;
  return std::int32_t(std::lround(std::clamp(value, least, most)));
}

/// Whole numbers faster than a tree of JSON would write them.
template <class Numbers>
void add_column(std::string& text, const char* key, const Numbers& numbers, std::size_t from,
                std::size_t to) {
  text += text.back() == '{' ? "'" : ",'";
  text += key;
  text += "':[";
  for (std::size_t i = from; i < to; ++i) {
    if (i != from) text += ',';
    text += std::to_string(numbers[i]);
  }
  text += ']';
}

/// How many each has, of where they begin.
std::vector<std::size_t> counts(const std::vector<std::size_t>& firsts, std::size_t from,
                                std::size_t to) {
  std::vector<std::size_t> made;
  for (std::size_t i = from; i < to; ++i) made.push_back(firsts[i + 1] - firsts[i]);
  return made;
}

/// Elements behind their number.
template <class Elements>
void put(std::string& bytes, const Elements& elements) {
  const std::uint64_t count = elements.size();
  bytes.append(reinterpret_cast<const char*>(&count), sizeof count);
  bytes.append(reinterpret_cast<const char*>(elements.data()), count * sizeof(elements[0]));
}

/// False when there are not as many as it says.
template <class Elements>
bool take(std::string_view& bytes, Elements& elements) {
  std::uint64_t count = 0;
  if (bytes.size() < sizeof count) return false;
  std::memcpy(&count, bytes.data(), sizeof count);
  bytes.remove_prefix(sizeof count);
  if (count > bytes.size() / sizeof(elements[0])) return false;
  elements.resize(count);
  if (count > 0) std::memcpy(elements.data(), bytes.data(), count * sizeof(elements[0]));
  bytes.remove_prefix(count * sizeof(elements[0]));
  return true;
}

/// Begins of parts of something that has so many elements, and its end.
bool are_begins(const std::vector<std::size_t>& firsts, std::size_t count) {
  return !firsts.empty() && firsts.front() == 0 && firsts.back() == count &&
         std::ranges::is_sorted(firsts);
}

CaptureIndex::Object object_of(const StoredInfo& info, const Frame& frame,
                               const Instance& instance) {
  const auto holds = [&](std::string_view name) { return info.holds.contains(name); };
  CaptureIndex::Object object;
  object.name = class_of(instance);
  const PixelBox& box = *instance.tight_box;
  const double pixels =
      double(std::max(frame.camera.width, 1)) * double(std::max(frame.camera.height, 1));
  object.box_side = whole(1000.0 * std::sqrt(double(box.width()) * box.height() / pixels), 0, 1000);
  if (instance.visibility && holds(kHoldsOcclusion)) {
    if (const auto occlusion = instance.visibility->occlusion()) {
      object.visible = whole(100.0 * (1.0 - *occlusion), 0, 100);
    }
  }
  if (instance.visibility && holds(kHoldsTruncation)) {
    object.truncation = whole(100.0 * instance.visibility->truncation(), 0, 100);
  }
  if (const auto seen = seen_from(info, frame, instance)) {
    object.distance = whole(100.0 * seen->distance_m, 0, 1e8);
    object.elevation = whole(seen->elevation * 180.0 / kPi, -90, 90);
    object.azimuth = whole(seen->azimuth * 180.0 / kPi, -180, 180);
  }
  return object;
}

}  // namespace

NameSet CaptureIndex::wanted(const StoredInfo& info) {
  NameSet names;
  for (const std::string_view name :
       {kHoldsLabels, kHoldsTightBoxes, kHoldsPoses, kHoldsBounds, kHoldsBoxes3d, kHoldsOcclusion,
        kHoldsTruncation, kHoldsCamera, kHoldsCameraPose, std::string_view("visibility")}) {
    if (info.holds.contains(name)) names.emplace(name);
  }
  // Boxes may follow from pixels alone. Where they stand in tables, the list of objects is not
  // asked for: formats that have it in pictures would decode one of each capture.
  if (!names.contains(kHoldsTightBoxes)) {
    for (const std::string_view name : {kInstanceId.name, kHoldsInstances}) names.emplace(name);
  }
  return names;
}

CaptureIndex::Entry CaptureIndex::entry_of(const StoredInfo& info, const StoredCapture& stored) {
  Entry entry;
  entry.visit = stored.capture.visit;
  entry.phase = stored.capture.phase;
  entry.environment = stored.capture.environment;
  entry.split = stored.split;
  entry.findings = std::int32_t(stored.log.findings.size());
  if (stored.capture.clip) entry.clip = stored.capture.clip->clip;
  for (const Frame& frame : stored.capture.frames) {
    Picture picture;
    const auto name = std::ranges::find(info.camera_names, frame.camera_name);
    picture.camera = std::int32_t(name - info.camera_names.begin());
    picture.width = frame.camera.width;
    picture.height = frame.camera.height;
    for (const Instance& instance : frame.instances) {
      if (!instance.tight_box || instance.tight_box->is_empty()) continue;
      picture.objects.push_back(object_of(info, frame, instance));
    }
    entry.pictures.push_back(std::move(picture));
  }
  return entry;
}

std::int32_t CaptureIndex::Names::number(const std::string& name) {
  const auto [at, is_new] = numbers_.emplace(name, std::int32_t(list_.size()));
  if (is_new) list_.push_back(name);
  return at->second;
}

void CaptureIndex::add(const Entry& entry) {
  const std::lock_guard lock(mutex_);
  phase_.push_back(phases_.number(entry.phase));
  environment_.push_back(environments_.number(entry.environment));
  split_.push_back(splits_.number(entry.split));
  findings_.push_back(entry.findings);
  clip_.push_back(entry.clip);
  for (const Picture& picture : entry.pictures) {
    camera_.push_back(picture.camera);
    width_.push_back(picture.width);
    height_.push_back(picture.height);
    for (const Object& object : picture.objects) {
      class_.push_back(classes_.number(object.name));
      visible_.push_back(object.visible);
      truncation_.push_back(object.truncation);
      box_side_.push_back(object.box_side);
      distance_.push_back(object.distance);
      elevation_.push_back(object.elevation);
      azimuth_.push_back(object.azimuth);
    }
    first_object_.push_back(class_.size());
  }
  first_picture_.push_back(camera_.size());
  visit_.push_back(entry.visit);
}

void CaptureIndex::add_brightness(const std::vector<std::int32_t>& pictures) {
  const std::lock_guard lock(mutex_);
  // Of a capture whose pictures could not be read there are fewer.
  const std::size_t place = first_bright_.size() - 1;
  const std::size_t count = first_picture_.at(place + 1) - first_picture_[place];
  for (std::size_t i = 0; i < count; ++i) {
    brightness_.push_back(i < pictures.size() ? pictures[i] : kUnknown);
  }
  first_bright_.push_back(brightness_.size());
}

std::size_t CaptureIndex::brightness_size() const {
  const std::lock_guard lock(mutex_);
  return first_bright_.size() - 1;
}

std::size_t CaptureIndex::size() const {
  const std::lock_guard lock(mutex_);
  return visit_.size();
}

std::string CaptureIndex::json(std::size_t from, std::size_t most) const {
  const std::lock_guard lock(mutex_);
  from = std::min(from, visit_.size());
  const std::size_t to = std::min(from + most, visit_.size());
  const std::size_t pictures = first_picture_[from];
  const std::size_t pictures_end = first_picture_[to];
  const std::size_t objects = first_object_[pictures];
  const std::size_t objects_end = first_object_[pictures_end];

  std::string text = "{";
  add_column(text, "visit", visit_, from, to);
  add_column(text, "phase", phase_, from, to);
  add_column(text, "environment", environment_, from, to);
  add_column(text, "split", split_, from, to);
  add_column(text, "findings", findings_, from, to);
  add_column(text, "clip", clip_, from, to);
  add_column(text, "pictures", counts(first_picture_, from, to), 0, to - from);
  add_column(text, "camera", camera_, pictures, pictures_end);
  add_column(text, "width", width_, pictures, pictures_end);
  add_column(text, "height", height_, pictures, pictures_end);
  add_column(text, "objects", counts(first_object_, pictures, pictures_end), 0,
             pictures_end - pictures);
  add_column(text, "class", class_, objects, objects_end);
  add_column(text, "visible", visible_, objects, objects_end);
  add_column(text, "truncation", truncation_, objects, objects_end);
  add_column(text, "box_side", box_side_, objects, objects_end);
  add_column(text, "distance", distance_, objects, objects_end);
  add_column(text, "elevation", elevation_, objects, objects_end);
  add_column(text, "azimuth", azimuth_, objects, objects_end);
  std::ranges::replace(text, '\'', '"');
  const Json names{{"classes", classes_.list()},
                   {"phases", phases_.list()},
                   {"environments", environments_.list()},
                   {"splits", splits_.list()}};
  return "{\"from\":" + std::to_string(from) + ",\"columns\":" + text +
         "},\"names\":" + names.dump(-1, ' ', false, Json::error_handler_t::replace) + "}";
}

std::string CaptureIndex::brightness_json(std::size_t from, std::size_t most) const {
  const std::lock_guard lock(mutex_);
  const std::size_t count = first_bright_.size() - 1;
  from = std::min(from, count);
  const std::size_t to = std::min(from + most, count);
  std::string text = "{";
  add_column(text, "brightness", brightness_, first_bright_[from], first_bright_[to]);
  std::ranges::replace(text, '\'', '"');
  return text + ",\"from\":" + std::to_string(from) + ",\"captures\":" + std::to_string(to - from) +
         "}";
}

bool CaptureIndex::Names::has(const Column& numbers) const {
  return std::ranges::all_of(numbers, [this](std::int32_t number) {
    return number >= 0 && std::size_t(number) < list_.size();
  });
}

template <class Self, class Act>
void CaptureIndex::each_names(Self& self, Act&& act) {
  for (auto* names : {&self.classes_, &self.phases_, &self.environments_, &self.splits_}) {
    act(*names);
  }
}

template <class Self, class Act>
void CaptureIndex::each_column(Self& self, Act&& act) {
  for (auto* column :
       {&self.visit_, &self.phase_, &self.environment_, &self.split_, &self.findings_, &self.clip_,
        &self.camera_, &self.width_, &self.height_, &self.brightness_, &self.class_, &self.visible_,
        &self.truncation_, &self.box_side_, &self.distance_, &self.elevation_, &self.azimuth_}) {
    act(*column);
  }
  for (auto* firsts : {&self.first_picture_, &self.first_object_, &self.first_bright_}) {
    act(*firsts);
  }
}

std::string CaptureIndex::bytes() const {
  const std::lock_guard lock(mutex_);
  std::string bytes;
  each_names(*this, [&](const Names& names) {
    bytes += std::to_string(names.list().size()) + "\n";
    for (const std::string& name : names.list()) put(bytes, name);
  });
  each_column(*this, [&](const auto& column) { put(bytes, column); });
  return bytes;
}

bool CaptureIndex::take_bytes(std::string_view bytes, std::size_t captures) {
  const std::lock_guard lock(mutex_);
  bool is_whole = true;
  each_names(*this, [&](Names& names) {
    std::string count;
    while (is_whole && !bytes.empty() && bytes.front() != '\n' && count.size() < 9) {
      count += bytes.front();
      bytes.remove_prefix(1);
    }
    is_whole = is_whole && bytes.starts_with('\n') && !count.empty() &&
               count.find_first_not_of("0123456789") == count.npos;
    if (!is_whole) return;
    bytes.remove_prefix(1);
    const int most = std::stoi(count);
    std::string name;
    for (int i = 0; i < most && is_whole; ++i) {
      is_whole = take(bytes, name) && names.number(name) == i;
    }
  });
  each_column(*this, [&](auto& column) { is_whole = is_whole && take(bytes, column); });
  if (is_whole && bytes.empty() && fits_together(captures)) return true;
  each_names(*this, [](Names& names) { names = {}; });
  each_column(*this, [](auto& column) { column.clear(); });
  for (auto* firsts : {&first_picture_, &first_object_, &first_bright_}) firsts->assign(1, 0);
  return false;
}

bool CaptureIndex::fits_together(std::size_t captures) const {
  const auto have = [](std::size_t count, std::initializer_list<const Column*> columns) {
    return std::ranges::all_of(columns,
                               [count](const Column* column) { return column->size() == count; });
  };
  return have(captures, {&visit_, &phase_, &environment_, &split_, &findings_, &clip_}) &&
         first_picture_.size() == captures + 1 && are_begins(first_picture_, camera_.size()) &&
         have(camera_.size(), {&width_, &height_}) && first_object_.size() == camera_.size() + 1 &&
         are_begins(first_object_, class_.size()) &&
         have(class_.size(),
              {&visible_, &truncation_, &box_side_, &distance_, &elevation_, &azimuth_}) &&
         first_bright_.size() <= captures + 1 && are_begins(first_bright_, brightness_.size()) &&
         std::ranges::equal(first_bright_, std::span(first_picture_).first(first_bright_.size())) &&
         classes_.has(class_) && phases_.has(phase_) && environments_.has(environment_) &&
         splits_.has(split_);
}

}  // namespace diorama
