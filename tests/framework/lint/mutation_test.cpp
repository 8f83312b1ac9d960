// SPDX-License-Identifier: Apache-2.0
// Changes each kind of value in each kind of file of every format, one at a time, and counts what
// lint finds. What nothing else in the dataset contradicts is listed with its reason.
#include <fnmatch.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <iostream>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <regex>
#include <span>
#include <string>
#include <vector>

#include "diorama/error.h"
#include "framework/datasets/frame_copy.h"
#include "framework/lint/dataset_on_disk.h"
#include "framework/lint/encoding_host.h"
#include "framework/lint/every_format.h"
#include "plugins/writer_support/sample_dataset.h"
#include "support/catch.h"

using namespace diorama;
using test::DatasetOnDisk;
using Json = nlohmann::ordered_json;

namespace {

/// A file's new content; nothing: the file goes.
struct Mutant {
  std::string file;
  std::string what;
  std::optional<std::string> content;
};

/// Numbers in names and paths are of one kind: "rgb_#.png".
std::string kind_of(const std::string& text) {
  static const std::regex kNumbers("[0-9]+");
  return std::regex_replace(text, kNumbers, "#");
}

/// Changes of text-like values: what a number or a word may turn into.
std::vector<std::pair<std::string, std::string>> changed_words(const std::string& word) {
  char* end = nullptr;
  const double number = std::strtod(word.c_str(), &end);
  if (word.empty() || *end != '\0') return {{"another word", word + "x"}};
  std::vector<std::pair<std::string, std::string>> changes;
  const auto as_text = [&](double value) {
    const bool is_whole = word.find_first_of(".eE") == std::string::npos;
    char text[40];
    std::snprintf(text, sizeof text, is_whole ? "%.0f" : "%.6f", value);
    return std::string(text);
  };
  changes.emplace_back("larger", as_text(number * 1.3 + 1.0));
  if (number != 0.0) changes.emplace_back("negated", as_text(-number));
  return changes;
}

// JSON -----------------------------------------------------------------------------------------

using Pointer = Json::json_pointer;

void collect_leaves(const Json& node, const Pointer& at, const std::string& kind,
                    std::map<std::string, std::vector<Pointer>>& leaves,
                    std::map<std::string, std::vector<Pointer>>& lists) {
  if (node.is_array()) {
    const bool is_of_objects = !node.empty() && node[0].is_structured();
    if (is_of_objects && node.size() > 1) lists[kind].push_back(at);
    for (std::size_t i = 0; i < node.size(); ++i) {
      // Places in short lists differ (x, y, width), entries of tables do not.
      const bool is_table = is_of_objects || node.size() > 16;
      collect_leaves(node[i], at / i, kind + (is_table ? "/*" : "/" + std::to_string(i)), leaves,
                     lists);
    }
  } else if (node.is_object()) {
    const bool is_table = node.size() > 1 && std::isdigit(node.begin().key()[0]);
    for (const auto& [key, value] : node.items()) {
      collect_leaves(value, at / key, kind + "/" + (is_table ? "*" : key), leaves, lists);
    }
  } else {
    leaves[kind].push_back(at);
  }
}

std::string dumped(const Json& json) {
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

/// Rounding that nobody could see: 2e-17 negated.
bool is_next_to(const Json& a, const Json& b) {
  return a.is_number() && b.is_number() && std::abs(a.get<double>() - b.get<double>()) < 1e-9;
}

void mutate_json(const std::string& file, const Json& json, std::vector<Mutant>& mutants) {
  std::map<std::string, std::vector<Pointer>> leaves, lists;
  collect_leaves(json, Pointer(), "", leaves, lists);
  for (const auto& [kind, places] : leaves) {
    const Pointer& place = places[places.size() / 2];
    const Json& old = json.at(place);
    const auto add = [&](const std::string& what, Json value) {
      if (value == old || is_next_to(value, old)) return;
      Json changed = json;
      changed[place] = std::move(value);
      mutants.push_back({file, kind + ": " + what, dumped(changed)});
    };
    if (old.is_boolean()) {
      add("inverted", !old.get<bool>());
    } else if (old.is_number_integer()) {
      add("larger", old.get<std::int64_t>() * 13 / 10 + 1);
      add("negated", -old.get<std::int64_t>());
    } else if (old.is_number()) {
      add("larger", old.get<double>() * 1.3 + 1.0);
      add("negated", -old.get<double>());
    } else if (old.is_string()) {
      add("another word", old.get<std::string>() + "x");
      for (const Pointer& other : places) {
        if (json.at(other) == old) continue;
        add("the word of another", json.at(other));
        break;
      }
    }
  }
  for (const auto& [kind, places] : lists) {
    const Pointer& place = places[places.size() / 2];
    const std::size_t middle = json.at(place).size() / 2;
    Json less = json;
    less[place].erase(middle);
    mutants.push_back({file, kind + ": an entry is gone", dumped(less)});
    Json more = json;
    more[place].push_back(json.at(place)[middle]);
    mutants.push_back({file, kind + ": an entry comes twice", dumped(more)});
  }
}

// Text and XML ---------------------------------------------------------------------------------

std::vector<std::string> pieces(const std::string& text, char cut) {
  std::vector<std::string> list;
  std::string piece;
  for (const char c : text) {
    if (c != cut) {
      piece += c;
    } else {
      list.push_back(std::move(piece));
      piece.clear();
    }
  }
  if (!piece.empty()) list.push_back(piece);
  return list;
}

std::string put_together(const std::vector<std::string>& list, char cut, bool ends) {
  std::string text;
  for (std::size_t i = 0; i < list.size(); ++i)
    text += (i > 0 ? std::string(1, cut) : "") + list[i];
  return ends ? text + cut : text;
}

void mutate_lines(const std::string& file, const std::string& text, std::vector<Mutant>& mutants) {
  const std::vector<std::string> lines = pieces(text, '\n');
  if (lines.empty()) return;
  const std::size_t middle = lines.size() / 2;
  const auto add = [&](const std::string& what, std::vector<std::string> changed) {
    mutants.push_back({file, what, put_together(changed, '\n', true)});
  };
  auto less = lines;
  less.erase(less.begin() + long(middle));
  add("a line is gone", less);
  auto more = lines;
  more.push_back(lines[middle]);
  add("a line comes twice", more);
  const std::vector<std::string> words = pieces(lines[middle], ' ');
  for (std::size_t i = 0; i < std::min<std::size_t>(words.size(), 40); ++i) {
    for (const auto& [what, word] : changed_words(words[i])) {
      auto changed = words;
      changed[i] = word;
      auto all = lines;
      all[middle] = put_together(changed, ' ', false);
      add("column " + std::to_string(i) + ": " + what, all);
    }
  }
}

void mutate_xml(const std::string& file, const std::string& text, std::vector<Mutant>& mutants) {
  static const std::regex kLeaf("<([a-z_A-Z]+)>([^<>]*)</");
  std::map<std::string, std::vector<std::smatch>> leaves;
  for (std::sregex_iterator it(text.begin(), text.end(), kLeaf), end; it != end; ++it) {
    leaves[(*it)[1]].push_back(*it);
  }
  for (const auto& [name, places] : leaves) {
    const std::smatch& place = places[places.size() / 2];
    for (const auto& [what, word] : changed_words(place[2])) {
      std::string changed = text;
      changed.replace(std::size_t(place.position(2)), std::size_t(place.length(2)), word);
      mutants.push_back({file, name + ": " + what, changed});
    }
  }
  const std::size_t from = text.find("<object>");
  const std::size_t to = text.find("</object>");
  if (from == std::string::npos || to == std::string::npos) return;
  const std::string object = text.substr(from, to + 9 - from);
  mutants.push_back({file, "an object is gone", text.substr(0, from) + text.substr(to + 9)});
  mutants.push_back(
      {file, "an object comes twice", text.substr(0, to + 9) + object + text.substr(to + 9)});
}

// Arrays and pictures --------------------------------------------------------------------------

void mutate_array(const std::string& file, const std::string& text, std::vector<Mutant>& mutants) {
  std::uint16_t length = 0;
  std::memcpy(&length, text.data() + 8, sizeof length);
  const std::string header = text.substr(10, length);
  const std::size_t data = 10u + length;
  if (data >= text.size()) return;
  const auto add = [&](const std::string& what, const std::function<void(std::string&)>& change) {
    std::string changed = text;
    change(changed);
    if (changed != text) mutants.push_back({file, what, changed});
  };
  std::smatch found;
  static const std::regex kPlain("'descr': '([<|][a-z][0-9])'");
  static const std::regex kField(
      R"(\('([A-Za-z_0-9]+)', '([<|][a-z][0-9])'(?:, \(([0-9, ]+)\))?\))");
  if (std::regex_search(header, found, kPlain)) {
    if (found[1] != "<f4") return;
    const std::size_t count = (text.size() - data) / 4;
    const auto each = [&](const std::function<float(float)>& change) {
      return [=](std::string& bytes) {
        for (std::size_t i = 0; i < count; ++i) {
          float value = 0.0f;
          std::memcpy(&value, bytes.data() + data + 4 * i, 4);
          value = change(value);
          std::memcpy(bytes.data() + data + 4 * i, &value, 4);
        }
      };
    };
    add("all values a tenth larger", each([](float v) { return v * 1.1f; }));
    add("all values negated", each([](float v) { return -v; }));
    add("one value is none", [&](std::string& bytes) {
      const float none = std::numeric_limits<float>::quiet_NaN();
      std::memcpy(bytes.data() + data + 4 * (count / 2), &none, 4);
    });
    return;
  }
  struct Field {
    std::string name;
    std::string type;
    std::size_t offset;
    std::size_t count;
  };
  std::vector<Field> fields;
  std::size_t size = 0;
  for (std::sregex_iterator it(header.begin(), header.end(), kField), end; it != end; ++it) {
    std::size_t numbers = 1;
    for (const std::string& n : pieces((*it)[3].str(), ',')) {
      if (!n.empty() && n != " ") numbers *= std::stoul(n);
    }
    fields.push_back({(*it)[1], (*it)[2], size, numbers});
    size += numbers * std::size_t((*it)[2].str()[2] - '0');
  }
  if (size == 0) return;
  const std::size_t record = (text.size() - data) / size / 2;
  for (const Field& field : fields) {
    const std::size_t width = std::size_t(field.type[2] - '0');
    for (std::size_t i = 0; i < field.count; ++i) {
      const std::size_t at = data + record * size + field.offset + i * width;
      const std::string name =
          field.name + (field.count > 1 ? "[" + std::to_string(i) + "]" : std::string());
      if (field.type == "<f4") {
        add(name + " larger", [&](std::string& bytes) {
          float value = 0.0f;
          std::memcpy(&value, bytes.data() + at, 4);
          value = value * 1.3f + 0.5f;
          std::memcpy(bytes.data() + at, &value, 4);
        });
      } else {
        add(name + " larger", [&](std::string& bytes) { bytes[at] = char(bytes[at] + 3); });
      }
    }
  }
}

/// The file of the same kind that another capture or camera has, in place of this one.
void exchange(const DatasetOnDisk& dataset, const std::string& file,
              const std::vector<std::string>& files, std::vector<Mutant>& mutants) {
  const std::string content = dataset.read(file);
  for (const std::string& other : files) {
    if (other == file || kind_of(other) != kind_of(file)) continue;
    const std::string theirs = dataset.read(other);
    if (theirs == content) continue;
    mutants.push_back({file, "has the content of " + other, theirs});
    return;
  }
}

void mutate_picture(const std::string& file, const std::string& text,
                    std::vector<Mutant>& mutants) {
  const test::EncodingHost host;
  const auto texture =
      host.decode_texture(std::as_bytes(std::span(text.data(), text.size())), file);
  if (!texture || file.ends_with(".exr")) return;
  const int bits = texture->floats.empty() ? 8 : 16;
  const std::size_t pixel = std::size_t(texture->channels) * std::size_t(bits / 8);
  std::vector<std::uint8_t> samples = texture->bytes;
  for (const float value : texture->floats) {
    const auto sample = std::uint16_t(std::lround(value * 65535.0f));
    const auto* bytes = reinterpret_cast<const std::uint8_t*>(&sample);
    samples.insert(samples.end(), bytes, bytes + 2);
  }
  // A block in the middle becomes what the corner is.
  const int w = texture->width;
  const int h = texture->height;
  for (int y = h / 2 - 4; y < h / 2 + 4; ++y) {
    for (int x = w / 2 - 4; x < w / 2 + 4; ++x) {
      std::memcpy(samples.data() + (std::size_t(y) * std::size_t(w) + std::size_t(x)) * pixel,
                  samples.data(), pixel);
    }
  }
  const auto bytes =
      host.encode_image({samples.data(), w, h, texture->channels, bits}, ImageFormat::Png);
  mutants.push_back({file, "a block has the corner's value",
                     std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size())});
}

// ----------------------------------------------------------------------------------------------

std::vector<std::string> files_of(const DatasetOnDisk& dataset) {
  std::vector<std::string> files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(dataset.folder())) {
    if (entry.is_regular_file()) {
      files.push_back(entry.path().lexically_relative(dataset.folder()).generic_string());
    }
  }
  std::ranges::sort(files);
  return files;
}

bool is_picture(const std::string& file) {
  return file.ends_with(".png") || file.ends_with(".jpg");
}

std::vector<Mutant> mutants_of(const DatasetOnDisk& dataset) {
  const std::vector<std::string> files = files_of(dataset);
  std::map<std::string, std::vector<std::string>> kinds;
  for (const std::string& file : files) kinds[kind_of(file)].push_back(file);
  std::vector<Mutant> mutants;
  for (const auto& [kind, same] : kinds) {
    const std::string& file = same[same.size() / 2];
    const std::string text = dataset.read(file);
    mutants.push_back({file, "is gone", std::nullopt});
    if (same.size() > 1) {
      mutants.push_back({same.back(), "the last is gone", std::nullopt});
      exchange(dataset, file, same, mutants);
    }
    const Json json = Json::parse(text, nullptr, false);
    if (json.is_structured()) {
      mutate_json(file, json, mutants);
    } else if (file.ends_with(".xml")) {
      mutate_xml(file, text, mutants);
    } else if (file.ends_with(".npy")) {
      mutate_array(file, text, mutants);
    } else if (is_picture(file)) {
      mutate_picture(file, text, mutants);
    } else if (file.ends_with(".txt") || file.ends_with(".yaml") || file.ends_with(".jsonl")) {
      mutate_lines(file, text, mutants);
    }
  }
  return mutants;
}

/// What nothing else in a dataset of this format contradicts.
struct Free {
  const char* format;  ///< Patterns of file names.
  const char* file;
  const char* what;
  const char* reason;
};

constexpr Free kFree[] = {
    {"*", "dataset.json", "/seed*", "any number is a seed"},
    {"*", "dataset.json", "/program*", "the program's name"},
    {"*", "dataset.json", "/plugins*", "versions of plugins"},
    {"*", "dataset.json", "/job*", "a text"},
    {"*", "dataset.json", "/assets*", "names of files that are not part of the dataset"},
    {"*", "dataset.json", "/conventions*", "sentences"},
    {"*", "dataset.json", "/format: another word", "another format's reader is asked"},
    {"*", "dataset.json", "is gone", "then the dataset may be anybody's"},
    {"[bp]*", "metadata.txt", "is gone", "then the dataset may be anybody's"},
    {"*", "metadata.txt", "/replicator_global_seed*", "any number is a seed"},
    {"*", "metadata.txt", "/version*", "a version"},
    {"boxes", "*.png", "a block*", "a picture for people"},
    // Pictures show what no label says.
    {"basic*", "*rgb*.png", "a block*", "a picture"},
    {"*", "images/*", "a block*", "a picture"},
    {"kitti", "training/image_2/*", "a block*", "a picture"},
    {"voc", "JPEGImages/*", "a block*", "a picture"},
    {"pose*", "*[0-9].png", "a block*", "a picture"},
    {"pose*", "*_overlay.png", "a block*", "a picture for people"},
    {"bop*", "*/rgb*", "a block*", "a picture"},
    {"imagefolder", "*.png", "a block*", "a picture"},
    {"pose", "*.json", "*/meters_per_scene_unit: larger", "all lengths are scene units"},
    {"pose*", "*.json", "/objects: an entry is gone", "nothing says how many objects there are"},
    {"hdf5", "val/*", "has the content of*", "a file names neither its capture nor its camera"},
    {"basic*", "*camera_params*", "/cameraFisheye*", "says nothing of a pinhole"},
    {"basic*", "*camera_params*", "/cameraFStop*", "pictures are not looked at for blur"},
    {"basic*", "*camera_params*", "/cameraFocusDistance*", "pictures are not looked at for blur"},
    {"basic*", "*camera_params*", "/metersPerSceneUnit: larger", "all lengths are scene units"},
    {"basic*", "*motion_vectors*", "all values a tenth larger", "stands nowhere else"},
    {"basic*", "*motion_vectors*", "all values negated", "stands nowhere else"},
    {"basic*", "*occlusion_0*", "instanceId*", "a number that only tells rows apart"},
    {"basic*", "*occlusion_0*", "semanticId*", "a number that only tells rows apart"},
    {"basic*", "*bounding_box_2d_loose*", "y_max larger",
     "of the hidden part nothing else is said"},
    {"basic*", "*instance_id_segmentation_mapping*", "*: another word", "names of surfaces"},
    {"coco*", "annotations/instances*", "/annotations/[*]/id: negated", "any number is an id"},
    {"coco*", "annotations/*", "/info/*", "sentences"},
    {"coco*", "annotations/instances*", "/images/[*]/intrinsics*", "there is no third dimension"},
    {"coco*", "annotations/instances*", "/images/[*]/world_from_camera/[*]/3*",
     "there is no third dimension"},
    {"yolo*", "labels/*", "a line is gone", "nothing says how many objects there are"},
    {"yolo*", "labels/*", "has the content*", "labels stand in one file alone"},
    {"yolo_pose", "labels/*", "column *[0-9]: larger", "of a corner only what is in sight is said"},
    {"kitti", "dataset.json", "/cameras/*", "the format has no names of cameras"},
    {"kitti", "training/label_2/*", "a line is gone", "nothing says how many objects there are"},
    {"kitti", "training/label_2/*", "column 2: larger", "levels of occlusion stand nowhere else"},
    {"kitti", "training/depth_2/*", "a block*", "no object stands there"},
    {"voc", "Annotations/*", "folder*", "a name that nobody uses"},
    {"voc", "Annotations/*", "pose*", "a word for people"},
    {"voc", "Annotations/*", "truncated: larger", "objects may have parts apart"},
};

bool is_free(const std::string& format, const Mutant& mutant) {
  return std::ranges::any_of(kFree, [&](const Free& free) {
    return fnmatch(free.format, format.c_str(), 0) == 0 &&
           fnmatch(free.file, mutant.file.c_str(), 0) == 0 &&
           fnmatch(free.what, mutant.what.c_str(), 0) == 0;
  });
}

bool is_found(const DatasetOnDisk& dataset) {
  test::EncodingHost host;
  DatasetReaders readers = test::every_reader(host);
  try {
    // A folder that is none any more may hold others.
    return std::ranges::any_of(lint_datasets(dataset.folder(), readers, host),
                               [](const LintReport& report) { return !report.findings.empty(); });
  } catch (const Error&) {
    return true;
  }
}

struct Score {
  int found = 0;
  int all = 0;
  std::string missed;
};

/// All of them take two minutes; a third finds what makes lint blind. The nightly script asks for
/// all.
bool takes_all_mutants() { return std::getenv("DIORAMA_ALL_MUTANTS") != nullptr; }

Score score_of(const test::SampleFormat& format, const DatasetOnDisk& dataset) {
  Score score;
  int number = 0;
  for (const Mutant& mutant : mutants_of(dataset)) {
    if (is_free(format.name, mutant)) continue;
    if (!takes_all_mutants() && number++ % 3 != 0) continue;
    const std::string before = dataset.read(mutant.file);
    if (mutant.content == before) continue;
    if (mutant.content) {
      dataset.write(mutant.file, *mutant.content);
    } else {
      dataset.remove(mutant.file);
    }
    ++score.all;
    if (is_found(dataset)) {
      ++score.found;
    } else {
      score.missed += "  " + format.name + " " + mutant.file + ": " + mutant.what + "\n";
    }
    dataset.write(mutant.file, before);
  }
  return score;
}

}  // namespace

TEST_CASE("lint finds seeded faults of every kind", "[lint][mutation]") {
  std::vector<const Capture*> captures;
  for (const Capture& capture : test::sample_captures()) captures.push_back(&capture);
  test::EncodingHost host;
  int found = 0;
  int all = 0;
  std::string missed;
  for (const test::SampleFormat& format : test::every_format()) {
    const DatasetOnDisk dataset(
        format.write(host, test::sample_dataset(test::SampleScene(8, 6)), captures));
    REQUIRE_FALSE(is_found(dataset));
    const Score score = score_of(format, dataset);
    INFO(format.name << ": " << score.found << " of " << score.all << "\n" << score.missed);
    std::cout << format.name << ": " << score.found << " of " << score.all << "\n"
              << (std::getenv("DIORAMA_MUTANTS") ? score.missed : "");
    found += score.found;
    all += score.all;
    missed += score.missed;
    CHECK(score.found * 100 >= score.all * 95);
  }
  INFO(found << " of " << all << " found\n" << missed);
  CHECK(all > (takes_all_mutants() ? 2900 : 950));
  CHECK(found * 1000 >= all * 996);
}

namespace {

/// A run: each format in a folder of its own, and the page of the run.
DatasetOnDisk run_on_disk(const std::vector<std::string>& formats) {
  std::vector<const Capture*> captures;
  for (const Capture& capture : test::sample_captures()) captures.push_back(&capture);
  test::EncodingHost host;
  test::MemoryFiles all;
  for (const test::SampleFormat& format : test::every_format()) {
    if (std::ranges::find(formats, format.name) == formats.end()) continue;
    const auto files = format.write(host, test::sample_dataset(test::SampleScene(8, 6)), captures);
    for (const auto& [path, bytes] : files.files) all.files[format.name + "/" + path] = bytes;
  }
  Json writers = Json::array();
  for (const std::string& name : formats) writers.push_back({{"name", name}, {"folder", name}});
  const std::string page = Json{
      {"captures", captures.size()},
      {"cameras", {"cam_0", "cam_1"}},
      {"seed", test::sample_dataset(test::SampleScene(8, 6)).seed},
      {"writers", writers}}.dump();
  const auto bytes = std::as_bytes(std::span(page));
  all.files["dataset.json"] = {bytes.begin(), bytes.end()};
  return DatasetOnDisk(all);
}

/// What one folder cannot contradict and the others of its run do.
constexpr Free kToldByOthers[] = {
    {"*", "*/images/*", "a block*", ""},
    {"*", "voc/JPEGImages/*", "a block*", ""},
    {"*", "kitti/training/image_2/*", "a block*", ""},
    {"*", "kitti/training/depth_2/*", "a block*", ""},
    {"*", "bop/*/rgb/*", "a block*", ""},
    {"*", "imagefolder/*.png", "a block*", ""},
    {"*", "pose/*[0-9].png", "a block*", ""},
    {"*", "hdf5/val/*", "has the content of*", ""},
    {"*", "yolo_detect/labels/*", "a line is gone", ""},
    {"*", "yolo_detect/labels/*", "has the content of*", ""},
    {"*", "kitti/training/label_2/*", "a line is gone", ""},
    {"*", "dataset.json", "/captures: *", ""},
    {"*", "dataset.json", "/cameras/*", ""},
};

}  // namespace

TEST_CASE("lint finds what one writer's folder says against another's of the run",
          "[lint][mutation]") {
  const DatasetOnDisk run = run_on_disk({"basic", "coco", "yolo_detect", "kitti", "voc", "bop",
                                         "webdataset", "hdf5", "imagefolder", "pose"});
  REQUIRE_FALSE(is_found(run));
  int found = 0;
  int all = 0;
  std::string missed;
  for (const Mutant& mutant : mutants_of(run)) {
    const bool counts = std::ranges::any_of(kToldByOthers, [&](const Free& told) {
      return fnmatch(told.file, mutant.file.c_str(), 0) == 0 &&
             fnmatch(told.what, mutant.what.c_str(), 0) == 0;
    });
    if (!counts || !mutant.content) continue;
    const std::string before = run.read(mutant.file);
    run.write(mutant.file, *mutant.content);
    ++all;
    if (is_found(run)) {
      ++found;
    } else {
      missed += "  " + mutant.file + ": " + mutant.what + "\n";
    }
    run.write(mutant.file, before);
  }
  INFO(found << " of " << all << " found\n" << missed);
  std::cout << "between writers: " << found << " of " << all << "\n";
  CHECK(all >= 16);
  // A drawing's block is lost in the noise of a JPEG file; a writer may leave objects out.
  CHECK(found >= all - 2);
}

TEST_CASE("normals are held against another writer's, also if the one that holds most has none",
          "[lint][mutation]") {
  const DatasetOnDisk run = run_on_disk({"bop"});
  std::vector<const Capture*> captures;
  for (const Capture& capture : test::sample_captures()) captures.push_back(&capture);
  BasicWriter::Params params;
  params.rgb = params.normals = true;
  test::EncodingHost host;
  BasicWriter writer(params, host);
  const auto files =
      test::write_dataset(writer, test::sample_dataset(test::SampleScene(8, 6)), captures);
  std::vector<std::string> normals;
  for (const auto& [path, bytes] : files.files) {
    for (const std::string& file : {"one/" + path, "two/" + path}) {
      std::filesystem::create_directories((run.folder() / file).parent_path());
      run.write(file, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
    }
    if (path.find("/normals_") != std::string::npos) normals.push_back("one/" + path);
  }
  REQUIRE_FALSE(is_found(run));
  REQUIRE(normals.size() > 1);
  REQUIRE(run.read(normals.front()) != run.read(normals.at(1)));
  run.write(normals.front(), run.read(normals.at(1)));
  CHECK(is_found(run));
}

TEST_CASE("3-D boxes are held against those of another writer of the run", "[lint][mutation]") {
  const DatasetOnDisk run = run_on_disk({"basic", "kitti"});
  REQUIRE_FALSE(is_found(run));
  const std::string file = "kitti/training/label_2/000004.txt";
  const std::vector<std::string> lines = pieces(run.read(file), '\n');
  using Words = std::vector<std::string>;
  const auto add = [](std::string& word, double more) {
    word = std::to_string(std::stod(word) + more);
  };
  const std::vector<std::pair<std::string, std::function<void(Words&)>>> faults = {
      {"alpha", [&](Words& words) { add(words[3], 0.05); }},
      {"occlusion", [](Words& words) { words[2] = "7"; }},
      {"class", [](Words& words) { words[0] = "unheard_of"; }},
      {"both angles",
       [&](Words& words) {
         add(words[3], 0.1);
         add(words[14], 0.1);
       }},
      {"width and length", [](Words& words) { std::swap(words[9], words[10]); }},
      {"three centimetres in depth", [&](Words& words) { add(words[13], 0.03); }},
      {"a box that begins too low", [&](Words& words) { add(words[5], 1.0); }},
      {"height", [&](Words& words) { add(words[8], 1.0); }},
      {"width", [&](Words& words) { add(words[9], 1.0); }},
      {"length", [&](Words& words) { add(words[10], 1.0); }}};
  const auto line = std::ranges::find_if(lines, [](const std::string& each) {
    const Words words = pieces(each, ' ');
    return std::abs(std::stod(words[9]) - std::stod(words[10])) > 0.02;
  });
  REQUIRE(line != lines.end());
  for (const auto& [what, spoil] : faults) {
    Words words = pieces(*line, ' ');
    spoil(words);
    auto changed = lines;
    changed[std::size_t(line - lines.begin())] = put_together(words, ' ', false);
    run.write(file, put_together(changed, '\n', true));
    INFO(*line << ": " << what);
    CHECK(is_found(run));
  }
}

TEST_CASE("hidden shares are held against those of another writer of the run", "[lint][mutation]") {
  const DatasetOnDisk run = run_on_disk({"basic", "imagefolder"});
  REQUIRE_FALSE(is_found(run));
  const std::string file = "imagefolder/train/metadata.jsonl";
  std::string text = run.read(file);
  const std::string key = "\"visible_share\": [";
  const std::size_t at = text.find(key);
  REQUIRE(at != std::string::npos);
  const std::size_t begin = at + key.size();
  text.replace(begin, text.find_first_of(",]", begin) - begin, "0.123");
  run.write(file, text);
  CHECK(is_found(run));
}

TEST_CASE("a model's diameter is that of its vertices", "[lint][mutation]") {
  const DatasetOnDisk run = run_on_disk({"bop"});
  REQUIRE_FALSE(is_found(run));
  const std::string file = "bop/models/models_info.json";
  auto page = nlohmann::json::parse(run.read(file));
  nlohmann::json& model = page.begin().value();
  // Still no less than its longest side.
  model["diameter"] = 0.5 * (model["diameter"].get<double>() + model["size_x"].get<double>());
  run.write(file, page.dump());
  CHECK(is_found(run));
}

namespace {

/// The sample's captures as the frames of one clip, by all writers of clips, or one of them.
DatasetOnDisk clip_on_disk(const std::string& only = {}) {
  const test::SampleClip sample = test::sample_clip();
  const int count = int(sample.frames.size());
  test::EncodingHost host;
  test::MemoryFiles all;
  for (const test::SampleFormat& format : test::formats_of_clips()) {
    if (!only.empty() && format.name != only) continue;
    const auto files = format.write(host, sample.dataset, sample.captures());
    for (const auto& [path, bytes] : files.files) all.files[format.name + "/" + path] = bytes;
  }
  const Json clip{{"clip", 0}, {"first_capture", 0}, {"frame_count", count}, {"fps", 10.0}};
  const std::string page = Json{
      {"captures", count},
      {"cameras", sample.dataset.camera_names},
      {"clips",
       Json::array({clip})}}.dump();
  const auto bytes = std::as_bytes(std::span(page));
  all.files["dataset.json"] = {bytes.begin(), bytes.end()};
  return DatasetOnDisk(all);
}

std::string file_like(const DatasetOnDisk& dataset, const std::string& pattern) {
  for (const std::string& file : files_of(dataset)) {
    if (fnmatch(pattern.c_str(), file.c_str(), 0) == 0) return file;
  }
  FAIL("no file like " << pattern);
  return {};
}

struct TextFault {
  const char* what;
  const char* file;  ///< A pattern.
  std::function<std::string(const std::string&)> spoil;
};

void check_all_found(const DatasetOnDisk& run, const std::vector<TextFault>& faults) {
  REQUIRE_FALSE(is_found(run));
  for (const TextFault& fault : faults) {
    INFO(fault.what);
    const std::string file = file_like(run, fault.file);
    const std::string before = run.read(file);
    const std::string spoiled = fault.spoil(before);
    REQUIRE(spoiled != before);
    run.write(file, spoiled);
    CHECK(is_found(run));
    run.write(file, before);
  }
}

/// Changes one field of the last line.
std::function<std::string(const std::string&)> last_line(
    char cut, const std::function<void(std::vector<std::string>&)>& change) {
  return [=](const std::string& text) {
    std::vector<std::string> lines = pieces(text, '\n');
    std::vector<std::string> words = pieces(lines.back(), cut);
    change(words);
    lines.back() = put_together(words, cut, false);
    return put_together(lines, '\n', true);
  };
}

std::function<std::string(const std::string&)> json(const std::function<void(Json&)>& change) {
  return [=](const std::string& text) {
    Json page = Json::parse(text);
    change(page);
    return page.dump();
  };
}

}  // namespace

TEST_CASE("a track is of one class, also where nothing else says which", "[lint][mutation]") {
  using Words = std::vector<std::string>;
  const auto other_class = [](Words& words) { words[7] = words[7] == "1" ? "2" : "1"; };
  check_all_found(clip_on_disk("mot"), {{"the class of a track of MOT", "mot/*/gt/gt.txt",
                                         last_line(',', other_class)}});
}

TEST_CASE("tracks, videos and clips of a run are held against each other", "[lint][mutation]") {
  using Words = std::vector<std::string>;
  const auto video = [](const char* list) {
    return [list](Json& page) -> Json& { return page["annotations"][0][list]; };
  };
  check_all_found(
      clip_on_disk(),
      {{"a track of MOT ends as another", "mot/*/gt/gt.txt",
        last_line(',', [](Words& words) { words[1] = "77"; })},
       {"visibility of MOT", "mot/*/gt/gt.txt",
        last_line(',', [](Words& words) { words[8] = "0.123"; })},
       {"frames per second of MOT", "mot/*/seqinfo.ini",
        [](const std::string& text) {
          return std::regex_replace(text, std::regex("frameRate=10"), "frameRate=20");
        }},
       {"a track of KITTI ends as another", "kitti/training/label_02/*.txt",
        last_line(' ', [](Words& words) { words[1] = "77"; })},
       {"a track of COCO is of two nodes", "coco/annotations/instances_*.json",
        json([](Json& page) { page["annotations"].back()["track_id"] = 77; })},
       {"the frame of a picture of COCO", "coco/annotations/instances_*.json",
        json([](Json& page) { page["images"][1]["frame_index"] = 7; })},
       {"a frame of a video is empty", "coco/youtube_vis/*.json", json([](Json& page) {
          for (const char* list : {"bboxes", "areas", "segmentations"}) {
            page["annotations"][0][list][1] = nullptr;
          }
        })},
       {"an area in a video", "coco/youtube_vis/*.json",
        json([&](Json& page) { video("areas")(page)[1] = 3; })},
       {"a mask in a video", "coco/youtube_vis/*.json", json([&](Json& page) {
          video("segmentations")(page)[1] = video("segmentations")(page)[0];
        })},
       {"the length of a video", "coco/youtube_vis/*.json",
        json([](Json& page) { page["videos"][0]["length"] = 2; })},
       {"the order of pictures in a video", "coco/youtube_vis/*.json", json([](Json& page) {
          std::swap(page["videos"][0]["file_names"][0], page["videos"][0]["file_names"][1]);
        })},
       {"a track of a video is gone", "coco/youtube_vis/*.json",
        json([](Json& page) { page["annotations"].erase(0); })},
       {"the time of a file of PoseWriter", "pose/*2.json",
        json([](Json& page) { page["time_s"] = 0.5 * page["time_s"].get<double>(); })},
       {"frames per second of the run", "dataset.json",
        json([](Json& page) { page["clips"][0]["fps"] = 20.0; })}});
}

TEST_CASE("times of PoseWriter grow evenly with the frames, and are the same for all cameras",
          "[lint][mutation]") {
  const DatasetOnDisk run = clip_on_disk("pose");
  run.remove("dataset.json");
  const auto with = [](const char* key, const Json& value) {
    return json([=](Json& page) { page[key] = value; });
  };
  const char* last = "pose/*5.json";
  check_all_found(
      run, {{"a time that is not that of other cameras", "pose/*2.json", with("time_s", 0.2)},
            {"a time that is no multiple of the frame's", last, with("time_s", 0.25)},
            {"a time before the clip", last, with("time_s", -0.1)},
            {"no time", last, with("time_s", nullptr)},
            {"a frame beyond the next one", last, with("frame_index", 5)},
            {"a clip that begins with a later frame", last, with("clip", 1)}});
}

TEST_CASE("levels, areas and keypoints are held against shares of other writers",
          "[lint][mutation]") {
  using Words = std::vector<std::string>;
  const auto changed_flag = [](const char* flag) {
    return [=](const std::string& text) {
      const std::string open = "<" + std::string(flag) + ">";
      std::string changed = text;
      char& value = changed[changed.rfind(open) + open.size()];
      value = value == '0' ? '1' : '0';
      return changed;
    };
  };
  const auto other_level = [](Words& words) { words[2] = words[2] == "0" ? "2" : "0"; };
  check_all_found(
      run_on_disk({"basic", "coco", "kitti", "voc", "imagefolder", "pose", "yolo_pose"}),
      {{"KITTI's occluded", "kitti/training/label_2/*4.txt", last_line(' ', other_level)},
       {"KITTI's truncated", "kitti/training/label_2/*4.txt",
        last_line(' ', [](Words& words) { words[1] = words[1] == "0.00" ? "0.50" : "0.00"; })},
       {"the seed of the run", "dataset.json", json([](Json& page) { page["seed"] = 12345; })},
       {"the folder of a writer", "dataset.json",
        json([](Json& page) { page["writers"][1]["folder"] = "elsewhere"; })},
       {"the share of KITTI's truncated", "kitti/training/label_2/*4.txt",
        last_line(' ',
                  [](Words& words) { words[1] = std::to_string(std::stod(words[1]) + 0.02); })},
       {"VOC's truncated", "voc/Annotations/*.xml", changed_flag("truncated")},
       {"VOC's occluded", "voc/Annotations/*.xml", changed_flag("occluded")},
       {"the area of an image folder", "imagefolder/train/metadata.jsonl",
        [](const std::string& text) {
          const std::size_t end = text.find('\n');
          Json row = Json::parse(text.substr(0, end));
          Json& area = row["objects"]["area"][0];
          area = area.get<int>() - 1;
          return row.dump() + text.substr(end);
        }},
       {"the order of YOLO's keypoints", "yolo_pose/labels/*.txt",
        last_line(' ',
                  [](Words& words) {
                    Words turned(words.begin(), words.begin() + 5);
                    for (std::size_t at = words.size(); at > 5; at -= 3) {
                      turned.insert(turned.end(), words.begin() + long(at - 3),
                                    words.begin() + long(at));
                    }
                    words = turned;
                  })},
       {"an object of PoseWriter is gone", "pose/*0.json",
        json([](Json& page) { page["objects"].erase(page["objects"].size() - 1); })}});
}

TEST_CASE("splits and counts of YOLO's page, floats of VOC and clips that are none",
          "[lint][mutation]") {
  check_all_found(run_on_disk({"basic", "yolo_detect", "voc", "coco"}),
                  {{"pictures for validation are those for training", "yolo_detect/data.yaml",
                    [](const std::string& text) {
                      return std::regex_replace(text, std::regex("images/val"), "images/train");
                    }},
                   {"a number of classes", "yolo_detect/data.yaml",
                    [](const std::string& text) { return text + "nc: 17\n"; }},
                   {"a part of a pixel", "voc/Annotations/*.xml",
                    [](const std::string& text) {
                      return std::regex_replace(text, std::regex("</xmax>"), ".5</xmax>",
                                                std::regex_constants::format_first_only);
                    }},
                   {"a clip of a picture that is in none", "coco/annotations/instances_*.json",
                    json([](Json& page) { page["images"][0]["clip"] = 0; })},
                   {"a video of a picture that is in none", "coco/annotations/instances_*.json",
                    json([](Json& page) { page["images"][0]["video_id"] = 1; })}});
}

TEST_CASE("symmetries leave models what they are, as near as the page says", "[lint][mutation]") {
  const DatasetOnDisk run = run_on_disk({"bop"});
  const std::string file = "bop/models/models_info.json";
  const std::string before = run.read(file);
  const auto with = [&](const char* key, const Json& value) {
    Json table = Json::parse(before);
    for (auto& [id, model] : table.items()) model[key] = value;
    run.write(file, table.dump());
  };
  REQUIRE_FALSE(is_found(run));
  const Json none = Json::array();
  // A mirror, a turn by less than a quarter, a shift and an axis beside the middle.
  const Json mirror{{-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}};
  const Json shift{{1, 0, 0, 40, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}};
  for (const Json& map : {mirror, shift}) {
    with("symmetries_discrete", Json::array({map}));
    CHECK(is_found(run));
  }
  with("symmetries_continuous", Json::array({{{"axis", {0, 0, 1}}, {"offset", {70, 0, 0}}}}));
  CHECK(is_found(run));
  with("symmetries_continuous", Json::array({{{"axis", {0, 0, 2}}, {"offset", {0, 0, 0}}}}));
  CHECK(is_found(run));
  with("symmetries_continuous", none);
  CHECK_FALSE(is_found(run));
}

TEST_CASE("classes are sorted where the page says so", "[lint][mutation]") {
  const DatasetOnDisk run = run_on_disk({"kitti"});
  const std::string file = "kitti/dataset.json";
  const Json before = Json::parse(run.read(file));
  REQUIRE(before.at("conventions").at("class_order") == "sorted");
  const auto is_found_with = [&](const Json& order, bool is_turned) {
    Json page = before;
    page["conventions"]["class_order"] = order;
    if (is_turned) std::ranges::reverse(page["classes"]);
    run.write(file, page.dump());
    return is_found(run);
  };
  CHECK_FALSE(is_found_with("sorted", false));
  CHECK(is_found_with("sorted", true));
  CHECK_FALSE(is_found_with("as given", true));
  CHECK_FALSE(is_found_with(7, true));
}

TEST_CASE("normals are held against those of another writer of the run", "[lint][mutation]") {
  const test::SampleClip sample = test::sample_clip();
  std::vector<Capture> turned;
  for (const Capture& capture : sample.frames) {
    Capture& copy = turned.emplace_back();
    copy.index = capture.index;
    copy.clip = capture.clip;
    for (const Frame& frame : capture.frames) {
      Frame& own = copy.frames.emplace_back(copy_of(frame));
      Image<Vec3f> normals = frame.get(kNormals);
      for (int y = 0; y < normals.height(); ++y) std::ranges::reverse(normals.row(y));
      own.set(kNormals, std::move(normals));
    }
  }
  std::vector<const Capture*> captures;
  for (const Capture& capture : turned) captures.push_back(&capture);
  test::EncodingHost host;
  for (const bool is_turned : {false, true}) {
    test::MemoryFiles all;
    for (const test::SampleFormat& format : test::every_format()) {
      const bool is_hdf5 = format.name == "hdf5";
      if (!is_hdf5 && format.name != "basic") continue;
      const auto files =
          format.write(host, sample.dataset, is_hdf5 && is_turned ? captures : sample.captures());
      for (const auto& [path, bytes] : files.files) all.files[format.name + "/" + path] = bytes;
    }
    CHECK(is_found(DatasetOnDisk(all)) == is_turned);
  }
}
