// SPDX-License-Identifier: @LICENCE@
#include <diorama/writer.h>

#include <map>
#include <span>

#include "plugin_under_test.h"

namespace {

class Files final : public diorama::CaptureFiles {
 public:
  std::map<std::string, std::string> texts;
  void add(std::string_view path, std::vector<std::byte> bytes) override {
    texts[std::string(path)].assign(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  }
  void append(std::string_view path, std::span<const std::byte> bytes) override {
    texts[std::string(path)].append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  }
  // Content of files that captures share: not used here.
  void keep(std::span<const std::byte>) override {}
  void append_kept(std::string_view, int) override {}
  void record(std::string_view) override {}
};

diorama::Instance instance(const char* label, diorama::PixelBox box) {
  diorama::Instance made;
  made.labels = {{"class", label}};
  made.tight_box = box;
  return made;
}

}  // namespace

int main(int, char** argv) {
  PluginUnderTest plugin(argv[1]);
  diorama::Value params = diorama::Value::make_map();
  params.set("min_pixels", diorama::Value::integer(3));
  const auto writer = plugin.make<diorama::Writer>(params);

  diorama::Capture capture;
  capture.index = 7;
  diorama::Frame& frame = capture.frames.emplace_back();
  frame.camera_name = "cam_1";
  frame.instances.push_back(instance("cup, red", {2, 3, 12, 9}));
  frame.instances.push_back(instance("pea", {0, 0, 2, 2}));
  frame.instances.push_back(diorama::Instance());

  Files files;
  writer->write(capture, files);
  check(files.texts.size() == 1, "one file per camera");
  check(files.texts["cam_1/000007.csv"] ==
            "label,x_min,y_min,x_max,y_max\n\"cup, red\",2,3,12,9\n",
        "labelled, large enough boxes are written");
}
