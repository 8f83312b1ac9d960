// SPDX-License-Identifier: @LICENCE@
#include <diorama/reader.h>
#include <diorama/writer.h>

#include <filesystem>
#include <fstream>
#include <span>

#include "plugin_under_test.h"

namespace {

namespace fs = std::filesystem;

// Puts a writer's files into a folder.
class Files final : public diorama::CaptureFiles {
 public:
  explicit Files(fs::path folder) : folder_(std::move(folder)) {}
  void add(std::string_view path, std::vector<std::byte> bytes) override { append(path, bytes); }
  void append(std::string_view path, std::span<const std::byte> bytes) override {
    fs::create_directories((folder_ / path).parent_path());
    std::ofstream out(folder_ / path, std::ios::binary | std::ios::app);
    out.write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
  }
  // Content of files that captures share: not used here.
  void keep(std::span<const std::byte>) override {}
  void append_kept(std::string_view, int) override {}
  void record(std::string_view) override {}

 private:
  fs::path folder_;
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
  const auto writer = plugin.make<diorama::Writer>(diorama::Value::make_map());
  const auto reader = plugin.make<diorama::Reader>(diorama::Value::make_map());
  const fs::path folder = fs::temp_directory_path() / "@NAME@_test";
  fs::remove_all(folder);

  diorama::Capture capture;
  capture.index = 7;
  diorama::Frame& frame = capture.frames.emplace_back();
  frame.camera_name = "cam_1";
  frame.camera.width = 32;
  frame.camera.height = 20;
  frame.instances.push_back(instance("cup, \"red\"", {2, 3, 12, 9}));
  frame.instances.push_back(diorama::Instance());
  Files files(folder);
  writer->write(capture, files);

  // What was written comes back.
  check(reader->recognise(folder) == diorama::Recognition::ByName, "the folder is known");
  const auto dataset = reader->open(folder);
  check(dataset->info().captures == std::vector<int>{7}, "the capture is there");
  const diorama::StoredCapture stored = dataset->read(0, dataset->info().holds);
  check(stored.log.findings.empty(), "nothing is wrong with it");
  const diorama::Frame& read = stored.capture.frames.at(0);
  check(read.camera_name == "cam_1" && read.camera.width == 32, "camera and size");
  check(read.instances.size() == 1, "labelled objects that can be seen");
  check(read.instances.at(0).labels == frame.instances[0].labels, "labels");
  check(*read.instances.at(0).tight_box == *frame.instances[0].tight_box, "boxes");

  // A damaged file is a finding, no error.
  std::ofstream(folder / "cam_1/000007.boxes.csv", std::ios::app) << "cup,1,2\n";
  check(dataset->read(0, dataset->info().holds).log.findings.size() == 1, "damage is found");
  fs::remove_all(folder);
}
