// SPDX-License-Identifier: Apache-2.0
#include "writer_webdataset/webdataset_writer.h"

#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <span>

#include "plugins/writer_support/sample_dataset.h"
#include "support/catch.h"
#include "writer_webdataset/tar_archive.h"

using namespace diorama;
using test::MemoryFiles;

TEST_CASE("tar reads the archive", "[writers]") {
  MemoryFiles files;
  TarArchive archive(files, "t.tar");
  archive.add("a.txt", "hello");
  const std::string half(350, 'x');
  const auto bytes_of_half = std::as_bytes(std::span(half));
  const std::span<const std::byte> parts[] = {bytes_of_half, bytes_of_half};
  archive.add("folder/b.bin", parts);
  archive.end();
  const auto folder = std::filesystem::temp_directory_path() / "diorama_tar_test";
  std::filesystem::create_directories(folder);
  const auto& bytes = files.bytes("t.tar");
  CHECK(bytes.size() % 512 == 0);
  std::ofstream(folder / "t.tar", std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
  const std::string command = "cd '" + folder.string() +
                              "' && tar -xf t.tar && test \"$(cat a.txt)\" = hello && "
                              "test \"$(wc -c < folder/b.bin)\" = 700";
  CHECK(std::system(command.c_str()) == 0);
  std::filesystem::remove_all(folder);
}

TEST_CASE("names that tar cannot hold are refused", "[writers]") {
  MemoryFiles files;
  TarArchive archive(files, "t.tar");
  CHECK_THROWS_WITH(archive.add(std::string(101, 'n'), "x"), ContainsSubstring("cannot hold"));
}

TEST_CASE("a shard holds one capture's samples", "[writers]") {
  test::FakeHost host;
  const MemoryFiles files = test::write_sample<WebDatasetWriter>({}, host);
  const std::string shard = files.text("shards/000001.tar");
  for (const char* name : {"000001_cam_0.png", "000001_cam_0.json", "000001_cam_0.instances.png",
                           "000001_cam_0.depth.npy", "000001_cam_1.json"}) {
    CHECK(shard.find(std::string(name) + '\0') != std::string::npos);
  }
  const std::size_t header = shard.find(std::string("000001_cam_1.json") + '\0');
  const std::size_t size = std::stoull(shard.substr(header + 124, 11), nullptr, 8);
  const Json json = Json::parse(shard.substr(header + 512, size));
  const Frame& frame = test::sample_captures()[1].frames[1];
  for (const Json& object : json.at("objects")) {
    const Instance& instance = test::instance_at(frame, object.at("node"));
    CHECK(object.at("box")[2] == instance.tight_box->x_max);
    CHECK(object.at("world_from_node")[1][3].get<double>() ==
          instance.world_from_node.translation().y());
  }
  CHECK(files.text(test::split_of(files, 1) + ".txt").find("shards/000001.tar\n") !=
        std::string::npos);
}

TEST_CASE("channels of other plugins are members of their names", "[writers]") {
  test::FakeHost host;
  WebDatasetWriter::Params params;
  params.channels.names = {"disparity"};
  WebDatasetWriter writer(params, host);
  CHECK(writer.needs().contains("disparity"));
  const test::SampleScene sample(24, 16, 1);
  Capture capture = test::ray_cast_capture(sample, 0);
  Image<float> disparity(24, 16, 0.5f);
  disparity.at(3, 2) = 7.25f;
  capture.frames[0].set(Channel<float>{"disparity"}, disparity);
  const MemoryFiles files = test::write_dataset(writer, test::sample_dataset(sample), {&capture});
  const std::string shard = files.text("shards/000000.tar");
  const std::size_t header = shard.find(std::string("000000_cam_0.disparity.npy") + '\0');
  REQUIRE(header != std::string::npos);
  const std::size_t size = std::stoull(shard.substr(header + 124, 11), nullptr, 8);
  const std::string npy = shard.substr(header + 512, size);
  CHECK(npy.find("'descr': '<f4', 'fortran_order': False, 'shape': (16, 24), }") !=
        std::string::npos);
  float value = 0.0f;
  std::memcpy(&value, &npy[npy.size() - 4 * (24 * 16 - (2 * 24 + 3))], 4);
  CHECK(value == 7.25f);
  WebDatasetWriter::Params taken;
  taken.channels.names = {"depth"};
  CHECK_THROWS_WITH(WebDatasetWriter(taken, host), ContainsSubstring("channels: 'depth'"));
}
