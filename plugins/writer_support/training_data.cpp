// SPDX-License-Identifier: Apache-2.0
#include "writer_support/training_data.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "diorama/rng.h"
#include "writer_support/clips_json.h"
#include "writer_support/image_files.h"
#include "writer_support/replicator.h"

namespace diorama {
namespace {

/// The `wanted` units with the lowest draws, which are never all in memory: jobs may have hundreds
/// of millions. Counts them by their first bits, then sorts only those among which the last one is.
std::vector<bool> choose_units(int count, long wanted, const Rng& stream) {
  constexpr int kBits = 16;
  const auto draw = [&](int unit) { return stream.fork(std::uint64_t(unit)).bits(); };
  std::vector<int> sizes(std::size_t(1) << kBits);
  for (int unit = 0; unit < count; ++unit) ++sizes[draw(unit) >> (64 - kBits)];
  std::uint64_t last = 0;
  long rest = wanted;
  while (sizes[last] < rest) rest -= sizes[last++];

  std::vector<bool> is_chosen(std::size_t(count), false);
  std::vector<std::pair<std::uint64_t, int>> order;
  for (int unit = 0; unit < count; ++unit) {
    const std::uint64_t bits = draw(unit);
    const std::uint64_t first = bits >> (64 - kBits);
    if (first < last) is_chosen[std::size_t(unit)] = true;
    if (first == last) order.emplace_back(bits, unit);
  }
  std::ranges::sort(order);
  for (long i = 0; i < rest; ++i) is_chosen[std::size_t(order[std::size_t(i)].second)] = true;
  return is_chosen;
}

/// Exactly the asked share, as far as whole captures allow; both sides get one at least.
std::vector<bool> choose_validation(int count, double share, std::uint64_t seed) {
  if (share <= 0.0 || count < 2) return std::vector<bool>(std::size_t(std::max(count, 0)), false);
  const auto wanted = std::clamp(std::lround(share * count), 1L, long(count) - 1);
  return choose_units(count, wanted, Rng(seed).fork("training and validation"));
}

/// Frames of a clip, which show nearly the same, stay together.
std::vector<bool> choose_validation(const DatasetInfo& dataset, double share) {
  const auto begins_unit = [&](int capture) {
    const auto clip = clip_frame(dataset.clips, capture);
    return !clip || clip->frame == 0;
  };
  int units = 0;
  for (int i = 0; i < dataset.capture_count; ++i) units += begins_unit(i) ? 1 : 0;
  const std::vector<bool> is_val_unit = choose_validation(units, share, dataset.seed);
  std::vector<bool> is_val;
  is_val.reserve(std::size_t(std::max(dataset.capture_count, 0)));
  int unit = -1;
  for (int i = 0; i < dataset.capture_count; ++i) {
    unit += begins_unit(i) ? 1 : 0;
    is_val.push_back(is_val_unit[std::size_t(unit)]);
  }
  return is_val;
}

std::vector<bool> as_flags(int count, const std::vector<int>& captures) {
  std::vector<bool> flags(std::size_t(std::max(count, 0)), false);
  for (const int capture : captures) flags.at(std::size_t(capture)) = true;
  return flags;
}

std::map<std::uint32_t, std::int64_t> count_visible(const Image<std::uint32_t>& ids) {
  std::map<std::uint32_t, std::int64_t> counts;
  std::uint32_t run_id = 0;
  std::int64_t run = 0;
  for (const std::uint32_t id : ids.pixels()) {
    if (id != run_id) {
      counts[run_id] += run;
      run_id = id;
      run = 0;
    }
    ++run;
  }
  counts[run_id] += run;
  return counts;
}

Json assets_json(const DatasetInfo& dataset) {
  Json list = Json::array();
  for (const DatasetAsset& asset : dataset.assets) {
    Json files = Json::array();
    for (const auto& [name, hash] : asset.files) {
      files.push_back({{"file", name}, {"sha256", hash}});
    }
    list.push_back({{"asset", asset.asset}, {"files", std::move(files)}});
  }
  return list;
}

}  // namespace

void TrainingParams::visit(ParamVisitor& v) {
  v.param("val_share", val_share,
          {"Share of the captures that is kept for validation.", "", 0.0, 1.0});
  v.param("classes", classes,
          {"Class list in order; empty: every label of the job's objects, sorted."});
  v.param("taxonomy", taxonomy, {"Which of an object's labels is its class."});
  v.param("min_visible_px", min_visible_px,
          {"Objects with fewer visible pixels are left out.", "px", 1.0});
  v.choice("image_format", image_format, kTrainingImageFormats, {"Format of the pictures."});
}

void TrainingParams::visit_masks(ParamVisitor& v) {
  v.param("masks", masks,
          {"What the pixels of objects tell. Without: boxes alone, whose pixels min_visible_px "
           "counts."});
}

void TrainingData::begin(const DatasetInfo& dataset) {
  classes_ = params_.classes.empty() ? dataset.classes : params_.classes;
  if (classes_.empty()) {
    std::set<std::string> names;
    for (const Labels& labels : dataset.labels) {
      if (const auto label = choice_.of(labels)) names.insert(*label);
    }
    classes_.assign(names.begin(), names.end());
  }
  is_val_ = dataset.validation ? as_flags(dataset.capture_count, *dataset.validation)
                               : choose_validation(dataset, params_.val_share);
  padding_ = grown_padding(6, dataset.capture_count);
  camera_count_ = int(dataset.camera_names.size());
}

int TrainingData::class_of(const Labels& labels) const {
  const auto label = choice_.of(labels);
  if (!label) return -1;
  auto found = std::ranges::find(classes_, *label);
  if (found == classes_.end() && !other_.empty()) found = std::ranges::find(classes_, other_);
  return found == classes_.end() ? -1 : int(found - classes_.begin());
}

std::vector<int> TrainingData::classes_of(const std::vector<Labels>& labels) const {
  std::set<int> found;
  for (const Labels& each : labels) {
    if (const int index = class_of(each); index >= 0) found.insert(index);
  }
  return {found.begin(), found.end()};
}

std::vector<std::string> TrainingData::splits() const {
  std::vector<std::string> names{"train"};
  if (std::ranges::find(is_val_, true) != is_val_.end()) names.emplace_back("val");
  return names;
}

std::string TrainingData::image_stem(const Capture& capture, const Frame& frame) const {
  return padded(capture.index, padding_) + "_" + frame.camera_name;
}

std::vector<std::byte> TrainingData::image_file(const Host& host, const Frame& frame) const {
  const auto& color = frame.get(kColor);
  return params_.image_format == "jpg" ? jpeg_file(host, color) : rgb_png_file(host, color);
}

std::vector<TrainingObject> TrainingData::objects(const Frame& frame) const {
  std::map<std::uint32_t, std::int64_t> counts;
  if (params_.masks) counts = count_visible(frame.get(kInstanceId));
  const auto pixels_of = [&](const Instance& instance) {
    if (!params_.masks) {
      return std::int64_t(instance.tight_box->width()) * instance.tight_box->height();
    }
    const auto count = counts.find(instance.id);
    return count == counts.end() ? 0 : count->second;
  };
  std::vector<TrainingObject> result;
  for (const Instance& instance : frame.instances) {
    if (!instance.tight_box) continue;
    const std::int64_t pixels = pixels_of(instance);
    if (pixels == 0 || pixels < params_.min_visible_px) continue;
    const int class_index = class_of(instance.labels);
    if (class_index >= 0) result.push_back({&instance, class_index, pixels});
  }
  return result;
}

void TrainingData::add_dataset_page(const std::string& format, Json more,
                                    const DatasetInfo& dataset, DatasetFiles& files) const {
  Json page = Json::object();
  page["format"] = format;
  page["program"] = "diorama " + dataset.program_version;
  page["seed"] = dataset.seed;
  page["captures"] = dataset.capture_count;
  page["cameras"] = dataset.camera_names;
  page["classes"] = classes_;
  page["split"] = Json::object();
  if (!dataset.clips.empty()) page["clips"] = clips_json(dataset.clips);
  page["conventions"] = {
      {"units", "metres, radians"},
      {"world_axes", "right-handed, z up"},
      {"camera_axes", "x right, y up, looking along -z"},
      {"pixels", "(0, 0) is the top left corner, the first pixel's centre is (0.5, 0.5)"},
      {"boxes", "x_max and y_max are one past the last pixel"},
      {"rotations", "matrices; there are no quaternions"},
      {"depth", "none"},
      {"class_order", std::ranges::is_sorted(classes_) ? "sorted" : "as given"}};
  if (!params_.masks) page["conventions"]["masks"] = "none; boxes are all that is known of pixels";
  for (auto& [key, value] : more.items()) page["conventions"][key] = value;
  page["plugins"] = Json::object();
  for (const auto& [name, version] : dataset.plugin_versions) page["plugins"][name] = version;
  page["assets"] = assets_json(dataset);
  page["job"] = dataset.resolved_job;
  add_page(python_json(page, 2) + "\n", files);
}

/// The lists of captures are the only part that grows with the dataset, so they are never in memory
/// as a whole.
void TrainingData::add_page(const std::string& page, DatasetFiles& files) const {
  constexpr const char* kFile = "dataset.json";
  constexpr std::size_t kPart = std::size_t(1) << 16;
  // No text holds a line break, so this is nothing but the key.
  const std::string key = "\n  \"split\": {";
  const std::size_t lists = page.find(key) + key.size();
  std::string text = page.substr(0, lists);
  const char* before_name = "\n";
  for (const std::string& name : splits()) {
    text += before_name + std::string("    \"") + name + "\": [";
    const char* before = "\n";
    for (int i = 0; i < capture_count(); ++i) {
      if (split(i) != name) continue;
      text += before + std::string("      ") + std::to_string(i);
      before = ",\n";
      if (text.size() < kPart) continue;
      files.append_text(kFile, text);
      text.clear();
    }
    text += *before == ',' ? "\n    ]" : "]";
    before_name = ",\n";
  }
  files.append_text(kFile, text + "\n  " + page.substr(lists));
}

}  // namespace diorama
