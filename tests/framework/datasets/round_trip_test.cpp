// SPDX-License-Identifier: Apache-2.0
// What our writers write comes back as it was, as far as the format holds it.
#include <algorithm>
#include <thread>

#include "framework/datasets/frame_difference.h"
#include "framework/lint/dataset_on_disk.h"
#include "framework/lint/every_format.h"
#include "plugins/writer_support/sample_dataset.h"
#include "support/catch.h"
#include "writer_pose/pose_writer.h"

using namespace diorama;

namespace {

std::vector<const Capture*> samples() {
  std::vector<const Capture*> captures;
  for (const Capture& capture : test::sample_captures()) captures.push_back(&capture);
  return captures;
}

std::string text_of(const std::vector<Finding>& findings) {
  std::string text;
  for (const Finding& finding : findings) {
    text +=
        finding.check + ": " + finding.file + ": " + finding.object + " " + finding.found + "\n";
  }
  return text;
}

}  // namespace

TEST_CASE("Every format that has a reader comes back", "[readers]") {
  test::EncodingHost host;
  DatasetReaders readers = test::every_reader(host);
  int formats = 0;
  for (const test::SampleFormat& format : test::every_format()) {
    const test::DatasetOnDisk disk(
        format.write(host, test::sample_dataset(test::SampleScene(8, 6)), samples()));
    const std::string type = readers.recognise(disk.folder());
    if (type.empty()) continue;
    ++formats;
    INFO(format.name << " by " << type);
    const auto dataset = readers.open(disk.folder(), type);
    const StoredInfo& info = dataset->info();
    INFO(text_of(dataset->log().findings));
    CHECK(dataset->log().findings.empty());
    REQUIRE(info.captures == std::vector<int>{0, 1, 2});
    CHECK(info.camera_names == std::vector<std::string>{"cam_0", "cam_1"});
    // Backwards: no order is needed.
    for (std::size_t i = info.captures.size(); i-- > 0;) {
      const StoredCapture stored = dataset->read(i, info.holds);
      INFO(text_of(stored.log.findings));
      CHECK(stored.log.findings.empty());
      CHECK(stored.log.checks > 0);
      REQUIRE(stored.capture.frames.size() == 2);
      for (std::size_t k = 0; k < 2; ++k) {
        const Frame& written = test::sample_captures()[i].frames[k];
        const Frame& read = stored.capture.frames[k];
        CHECK(frame_differences(info, written, read) == std::vector<std::string>{});
        CHECK(read.camera_name == written.camera_name);
        CHECK(read.instances.empty() != dataset->info().holds.contains(kHoldsInstances));
        for (const std::string& channel : read.channels()) CHECK(info.holds.contains(channel));
      }
    }
  }
  CHECK(formats == 20);
}

TEST_CASE("Cameras that take turns in one folder are told by metadata or the run's page",
          "[readers]") {
  test::EncodingHost host;
  test::MemoryFiles run;
  for (const auto& [path, bytes] : test::write_sample<PoseWriter>({}, host).files) {
    run.files["poses/" + path] = bytes;
  }
  const test::DatasetOnDisk disk(run);
  DatasetReaders readers = test::every_reader(host);
  const auto open = [&] { return readers.open(disk.folder() / "poses", "PoseReader"); };
  CHECK(open()->info().camera_names == std::vector<std::string>{"cam_0", "cam_1"});
  CHECK(open()->info().captures == std::vector<int>{0, 1, 2});
  // As the reference writes it.
  disk.write("poses/metadata.txt", R"({"name": "PoseWriter", "version": "0.2.0"})");
  CHECK(open()->info().camera_names == std::vector<std::string>{"camera"});
  CHECK(open()->info().captures.size() == 6);
  // A capture that nothing shows has no files.
  disk.write("dataset.json", R"({"writers": [], "cameras": ["cam_0", "cam_1"], "captures": 4})");
  const auto dataset = open();
  CHECK(dataset->info().camera_names == std::vector<std::string>{"cam_0", "cam_1"});
  REQUIRE(dataset->info().captures == std::vector<int>{0, 1, 2, 3});
  const StoredCapture stored = dataset->read(2, dataset->info().holds);
  REQUIRE(stored.capture.frames.size() == 2);
  CHECK(frame_differences(dataset->info(), test::sample_captures()[2].frames[1],
                          stored.capture.frames[1]) == std::vector<std::string>{});
  CHECK(dataset->read(3, dataset->info().holds).capture.frames.empty());
}

TEST_CASE("A frame that differs is told", "[readers]") {
  test::EncodingHost host;
  DatasetReaders readers = test::every_reader(host);
  const test::DatasetOnDisk disk(test::write_sample<BasicWriter>(test::everything(), host));
  const auto dataset = readers.open(disk.folder(), "BasicReader");
  const Frame& other = test::sample_captures()[1].frames[0];
  const StoredCapture stored = dataset->read(0, dataset->info().holds);
  const auto differences = frame_differences(dataset->info(), other, stored.capture.frames[0]);
  const auto tells = [&](const std::string& what) {
    return std::ranges::any_of(
        differences, [&](const std::string& line) { return line.find(what) != std::string::npos; });
  };
  CHECK(tells("/Assets/crate: its pose"));
  CHECK(tells("color in "));
  CHECK(tells("distance_to_camera in "));
  CHECK_FALSE(tells("/Assets/ball: its pose"));
}

TEST_CASE("Only what is wanted is read", "[readers]") {
  test::EncodingHost host;
  DatasetReaders readers = test::every_reader(host);
  const test::DatasetOnDisk disk(test::write_sample<BasicWriter>(test::everything(), host));
  const auto dataset = readers.open(disk.folder(), "BasicReader");
  const StoredCapture stored = dataset->read(0, {"distance_to_camera"});
  CHECK(stored.capture.frames[0].channels() == NameSet{"distance_to_camera"});
  CHECK(stored.capture.frames[0].camera.width == 72);
  CHECK(stored.log.files < dataset->read(0, dataset->info().holds).log.files / 3);
}

TEST_CASE("Several threads may read one dataset", "[readers]") {
  test::EncodingHost host;
  DatasetReaders readers = test::every_reader(host);
  for (const test::SampleFormat& format : test::every_format()) {
    const test::DatasetOnDisk disk(
        format.write(host, test::sample_dataset(test::SampleScene(8, 6)), samples()));
    const std::string type = readers.recognise(disk.folder());
    if (type.empty()) continue;
    const auto dataset = readers.open(disk.folder(), type);
    std::vector<std::size_t> findings(6, 1);
    std::vector<std::thread> threads;
    for (std::size_t t = 0; t < findings.size(); ++t) {
      threads.emplace_back([&, t] {
        findings[t] = dataset->read(t % 3, dataset->info().holds).log.findings.size();
      });
    }
    for (std::thread& thread : threads) thread.join();
    CHECK(findings == std::vector<std::size_t>(6, 0));
  }
}
