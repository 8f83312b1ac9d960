// SPDX-License-Identifier: Apache-2.0
#include <diorama/reader.h>
#include <diorama/writer.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <span>

#include "plugin_under_test.h"

namespace {

namespace fs = std::filesystem;

class Files final : public diorama::CaptureFiles {
 public:
  std::map<std::string, std::string> texts;
  std::vector<std::string> records;
  void add(std::string_view path, std::vector<std::byte> bytes) override {
    texts[std::string(path)].assign(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  }
  void append(std::string_view path, std::span<const std::byte> bytes) override {
    texts[std::string(path)].append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  }
  // Content of files that captures share: not used here.
  void keep(std::span<const std::byte>) override {}
  void append_kept(std::string_view, int) override {}
  void record(std::string_view line) override { records.emplace_back(line); }
};

diorama::Instance instance(const char* path, const char* label, std::int64_t visible_pixels) {
  diorama::Instance made;
  made.node_path = path;
  made.labels = {{"class", label}};
  made.tight_box = diorama::PixelBox{2, 3, 12, 9};
  made.visibility.emplace();
  made.visibility->visible_pixels = visible_pixels;
  made.visibility->amodal_pixels = 60;
  made.visibility->outside_pixels = 20;
  return made;
}

// What was written comes back; what others broke is found.
void read_back(PluginUnderTest& plugin, const std::string& table) {
  const fs::path folder = fs::temp_directory_path() / "csv_boxes_test";
  fs::remove_all(folder);
  fs::create_directories(folder);
  const auto reader = plugin.make<diorama::Reader>();
  std::ofstream(folder / "boxes.csv") << "x,y\n1,2\n";
  check(reader->recognise(folder) == diorama::Recognition::No, "another table of that name");
  std::ofstream(folder / "boxes.csv", std::ios::trunc) << table;
  check(reader->recognise(folder) == diorama::Recognition::ByName, "its own table");

  const auto dataset = reader->open(folder);
  check(dataset->log().findings.empty(), "every row is whole");
  check(dataset->info().captures == std::vector<int>{7}, "the capture is there");
  const diorama::StoredCapture stored = dataset->read(0, dataset->info().holds);
  check(stored.log.findings.empty(), "and agrees with itself");
  check(stored.capture.phase == "dropped", "the phase comes back");
  const diorama::Frame& frame = stored.capture.frames.at(0);
  check(frame.camera_name == "cam_1", "the camera comes back");
  check(frame.camera.width == 64 && frame.camera.height == 48, "the size comes back");
  check(frame.instances.size() == 2, "each row is an object");
  const diorama::Instance& cup = frame.instances.at(0);
  check(cup.node_path == "/Assets/cup" && cup.labels.at("class") == "cup, \"red\"", "texts");
  check(*cup.tight_box == diorama::PixelBox{2, 3, 12, 9}, "the box comes back");
  check(cup.visibility->occlusion() == 0.25 && cup.visibility->truncation() == 0.25, "shares");

  std::ofstream(folder / "boxes.csv", std::ios::app)
      << "../../x/000001.png,64,48,p,o,l,1,2,3,4,1,0\n"
      << "cam_1/000007.png,64,48,p,o,l,1,2,3,4,nan,0\n"
      << "cam_1/000007.png,64,48,dropped,/Assets/cup,cup,1,2,3,4,1,0";
  const auto damaged = reader->open(folder);
  check(damaged->log().findings.size() == 2, "rows that cannot be read are found");
  check(damaged->read(0, {}).log.findings.size() == 1, "an object that comes twice is found");
  fs::remove_all(folder);
}

}  // namespace

int main(int, char** argv) {
  PluginUnderTest plugin(argv[1]);
  diorama::Value params = diorama::Value::make_map();
  params.set("pictures", diorama::Value::boolean(false));
  params.set("min_visibility", diorama::Value::number(0.2));
  const auto writer = plugin.make<diorama::Writer>(params);
  check(!writer->needs().contains("color"), "without pictures no colour is rendered");

  diorama::Capture capture;
  capture.index = 7;
  capture.phase = "dropped";
  diorama::Frame& frame = capture.frames.emplace_back();
  frame.camera_name = "cam_1";
  frame.camera.width = 64;
  frame.camera.height = 48;
  frame.instances.push_back(instance("/Assets/cup", "cup, \"red\"", 45));
  frame.instances.push_back(instance("/Assets/pea", "pea", 6));
  frame.instances.push_back(instance("/Assets/pot", "pot", 60));

  Files files;
  writer->write(capture, files);
  check(files.texts.empty() && files.records.size() == 1, "a capture is one record");
  check(files.records[0].find('\n') == std::string::npos, "a record is one line");

  writer->finish([&](const diorama::RecordVisitor& visit) { visit(7, files.records[0]); }, files);
  const std::string& table = files.texts["boxes.csv"];
  check(table ==
            "picture,width,height,phase,object,label,x_min,y_min,x_max,y_max,visibility,"
            "truncation\n"
            "cam_1/000007.png,64,48,dropped,/Assets/cup,\"cup, \"\"red\"\"\",2,3,12,9,0.750,0.250\n"
            "cam_1/000007.png,64,48,dropped,/Assets/pot,pot,2,3,12,9,1.000,0.250\n",
        "the table holds the rows of all captures");
  read_back(plugin, table);
}
