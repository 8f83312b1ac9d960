// SPDX-License-Identifier: @LICENCE@
// One CSV file per picture: its size, and the box of every labelled object that can be seen in it.
// The writer makes such datasets, the reader gives them back to lint, stats, convert and the like.
#include <diorama/plugin.h>
#include <diorama/reader.h>
#include <diorama/writer.h>

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <fstream>
#include <map>
#include <set>
#include <string>

namespace {

namespace fs = std::filesystem;

// RFC 4180: quotes are doubled inside quotes.
std::string quoted(const std::string& label) {
  if (label.find_first_of(",\"\r\n") == std::string::npos) return label;
  std::string text = "\"";
  for (const char c : label) text += c == '"' ? std::string("\"\"") : std::string(1, c);
  return text + "\"";
}

std::vector<std::string> fields_of(const std::string& line) {
  std::vector<std::string> fields(1);
  bool is_quoted = false;
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (line[i] == '"' && is_quoted && i + 1 < line.size() && line[i + 1] == '"') {
      fields.back() += line[i++];
    } else if (line[i] == '"') {
      is_quoted = !is_quoted;
    } else if (line[i] == ',' && !is_quoted) {
      fields.emplace_back();
    } else if (line[i] != '\r') {
      fields.back() += line[i];
    }
  }
  return fields;
}

class @CLASS@Writer final : public diorama::Writer {
 public:
  // Defaults are the field initialisers. visit() is the one list from which the program reads and
  // checks a job, describes the plugin and makes the JSON Schema.
  struct Params {
    std::string taxonomy = "class";
    void visit(diorama::ParamVisitor& v) {
      v.param("taxonomy", taxonomy, {"Which of an object's labels to write."});
    }
  };
  @CLASS@Writer(Params params, diorama::Host&) : params_(std::move(params)) {}

  // Only what is asked for here is computed.
  diorama::NameSet needs() const override { return {"instance_id", "instances"}; }

  // Runs on several threads at once, hence const; names follow from the capture's index alone.
  void write(const diorama::Capture& capture, diorama::CaptureFiles& files) const override {
    for (const diorama::Frame& frame : capture.frames) {
      char number[16];
      std::snprintf(number, sizeof number, "%06d", capture.index);
      files.add_text(frame.camera_name + "/" + number + ".boxes.csv", table(frame));
    }
  }

 private:
  std::string table(const diorama::Frame& frame) const {
    std::string text = "picture," + std::to_string(frame.camera.width) + "," +
                       std::to_string(frame.camera.height) + "\n";
    for (const diorama::Instance& instance : frame.instances) {
      const auto label = instance.labels.find(params_.taxonomy);
      if (label == instance.labels.end() || !instance.tight_box) continue;
      const diorama::PixelBox& box = *instance.tight_box;
      text += quoted(label->second) + "," + std::to_string(box.x_min) + "," +
              std::to_string(box.y_min) + "," + std::to_string(box.x_max) + "," +
              std::to_string(box.y_max) + "\n";
    }
    return text;
  }

  Params params_;
};

// A folder of such files. Only their names are kept; read() opens those of one capture.
class @CLASS@Dataset final : public diorama::StoredDataset {
 public:
  explicit @CLASS@Dataset(fs::path folder) : folder_(std::move(folder)) {
    std::set<int> captures;
    for (const auto& camera : fs::directory_iterator(folder_)) {
      if (!camera.is_directory()) continue;
      for (const auto& file : fs::directory_iterator(camera.path())) {
        if (const int capture = number_of(file.path().filename().string()); capture >= 0) {
          captures.insert(capture);
          cameras_.insert(camera.path().filename().string());
        }
      }
    }
    if (captures.empty()) {
      throw diorama::Error(diorama::ErrorKind::Asset, folder_.string() + ": holds no boxes");
    }
    info_.format = "@NAME@";
    // Nobody looks at what is not named here.
    info_.holds = {std::string(diorama::kHoldsInstances), std::string(diorama::kHoldsLabels),
                   std::string(diorama::kHoldsTightBoxes)};
    info_.camera_names.assign(cameras_.begin(), cameras_.end());
    info_.captures.assign(captures.begin(), captures.end());
  }

  const diorama::StoredInfo& info() const override { return info_; }
  const diorama::ReadLog& log() const override { return log_; }

  // Runs on several threads at once.
  diorama::StoredCapture read(std::size_t i, const diorama::NameSet&) const override {
    diorama::StoredCapture stored;
    stored.capture.index = info_.captures.at(i);
    char number[16];
    std::snprintf(number, sizeof number, "%06d", stored.capture.index);
    for (const std::string& camera : info_.camera_names) {
      const std::string file = camera + "/" + number + ".boxes.csv";
      if (auto frame = read_frame(file, camera, stored)) {
        stored.capture.frames.push_back(std::move(*frame));
        stored.files.push_back({{std::string(diorama::kHoldsInstances), file}});
      }
    }
    return stored;
  }

 private:
  static int number_of(const std::string& name) {
    int number = -1;
    const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), number);
    return error == std::errc() && std::string(end) == ".boxes.csv" ? number : -1;
  }

  static bool read_numbers(const std::vector<std::string>& fields, int* numbers) {
    for (std::size_t i = 1; i < fields.size(); ++i) {
      const char* last = fields[i].data() + fields[i].size();
      const auto [end, error] = std::from_chars(fields[i].data(), last, numbers[i - 1]);
      if (error != std::errc() || end != last) return false;
    }
    return true;
  }

  // What is wrong with a file is a finding; the frame comes without it.
  std::optional<diorama::Frame> read_frame(const std::string& file, const std::string& camera,
                                           diorama::StoredCapture& stored) const {
    const auto check = [&](bool holds, const std::string& rule, const std::string& found,
                           const std::string& expected) {
      stored.log.check(holds, {rule, file, stored.capture.index, camera, "", found, expected});
      return holds;
    };
    std::ifstream in(folder_ / file);
    ++stored.log.files;
    if (!check(in.is_open(), "nothing is missing", "the file is not there", "")) return {};
    std::optional<diorama::Frame> frame;
    for (std::string line; std::getline(in, line);) {
      const std::vector<std::string> fields = fields_of(line);
      int numbers[4] = {};
      const bool is_good = fields.size() == (frame ? 5u : 3u) && read_numbers(fields, numbers);
      if (!check(is_good, "every file can be read", "the line " + line,
                 frame ? "label,x_min,y_min,x_max,y_max" : "picture,width,height")) {
        continue;
      }
      if (!frame) {
        frame.emplace();
        frame->camera_name = camera;
        frame->camera.width = std::max(numbers[0], 1);
        frame->camera.height = std::max(numbers[1], 1);
        continue;
      }
      diorama::Instance instance;
      instance.id = std::uint32_t(frame->instances.size() + 1);
      instance.node_path = "object " + std::to_string(instance.id);
      instance.labels = {{"class", fields[0]}};
      instance.tight_box = diorama::PixelBox{numbers[0], numbers[1], numbers[2], numbers[3]};
      frame->instances.push_back(std::move(instance));
    }
    check(frame.has_value(), "every file can be read", "no size of the picture",
          "picture,width,height");
    return frame;
  }

  fs::path folder_;
  std::set<std::string> cameras_;
  diorama::StoredInfo info_;
  diorama::ReadLog log_;
};

class @CLASS@Reader final : public diorama::Reader {
 public:
  struct Params {
    void visit(diorama::ParamVisitor&) {}
  };
  @CLASS@Reader(Params, diorama::Host&) {}

  std::vector<std::string> patterns() const override { return {"*/*.boxes.csv"}; }

  // The ending is ours alone.
  diorama::Recognition recognise(const fs::path& folder) const override {
    std::error_code ignored;
    for (const auto& camera : fs::directory_iterator(folder, ignored)) {
      for (const auto& file : fs::directory_iterator(camera.path(), ignored)) {
        if (file.path().string().ends_with(".boxes.csv")) return diorama::Recognition::ByName;
      }
    }
    return diorama::Recognition::No;
  }

  std::unique_ptr<const diorama::StoredDataset> open(const fs::path& folder) const override {
    return std::make_unique<@CLASS@Dataset>(folder);
  }
};

}  // namespace

DIORAMA_PLUGIN("@NAME@", "0.1.0", "@LICENCE@") {
  DIORAMA_ADD(@CLASS@Writer, "@NAME@", "Writes the boxes of each picture as CSV.");
  DIORAMA_ADD_READER(@CLASS@Reader, "@NAME@_reader", "Reads boxes of pictures from CSV.",
                     "*/*.boxes.csv");
}
