// SPDX-License-Identifier: Apache-2.0
#include <diorama/writer.h>

#include <map>
#include <span>

#include "plugin_under_test.h"

namespace {

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
  frame.instances.push_back(instance("/Assets/cup", "cup, \"red\"", 45));
  frame.instances.push_back(instance("/Assets/pea", "pea", 6));
  frame.instances.push_back(instance("/Assets/pot", "pot", 60));

  Files files;
  writer->write(capture, files);
  check(files.texts.empty() && files.records.size() == 1, "a capture is one record");
  check(files.records[0].find('\n') == std::string::npos, "a record is one line");

  writer->finish(
      [&](const diorama::RecordVisitor& visit) {
        visit(7, files.records[0]);
        visit(8, "next\t");
      },
      files);
  check(files.texts["boxes.csv"] ==
            "picture,phase,object,label,x_min,y_min,x_max,y_max,visibility,truncation\n"
            "cam_1/000007.png,dropped,/Assets/cup,\"cup, \"\"red\"\"\",2,3,12,9,0.750,0.250\n"
            "cam_1/000007.png,dropped,/Assets/pot,pot,2,3,12,9,1.000,0.250\n"
            "next\n",
        "the table holds the rows of all captures");
}
