// SPDX-License-Identifier: Apache-2.0
#include "writer_webdataset/webdataset_writer.h"

#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "plugins/writer_support/sample_dataset.h"
#include "support/catch.h"
#include "writer_webdataset/gzip_stream.h"
#include "writer_webdataset/tar_archive.h"

using namespace diorama;
using test::MemoryFiles;

TEST_CASE("tar reads the archive", "[writers]") {
  MemoryFiles files;
  TarArchive archive([&](std::span<const std::byte> part) { files.append("t.tar", part); });
  archive.add("a.txt", "hello");
  const std::string half(350, 'x');
  const auto bytes_of_half = std::as_bytes(std::span(half));
  const std::span<const std::byte> parts[] = {bytes_of_half, bytes_of_half};
  archive.add("folder/b.bin", parts);
  archive.end();
  const auto folder = std::filesystem::temp_directory_path() / "diorama_tar_test";
  std::filesystem::create_directories(folder);
  const auto& bytes = files.bytes("t.tar");
  CHECK(archive.bytes() == bytes.size());
  CHECK(bytes.size() % 512 == 0);
  std::ofstream(folder / "t.tar", std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
  const std::string command = "cd '" + folder.string() +
                              "' && tar -xf t.tar && test \"$(cat a.txt)\" = hello && "
                              "test \"$(wc -c < folder/b.bin)\" = 700";
  CHECK(std::system(command.c_str()) == 0);
  std::filesystem::remove_all(folder);
}

TEST_CASE("what gzip packed is read from any place", "[readers]") {
  const auto folder = std::filesystem::temp_directory_path() / "diorama_gzip_test";
  std::filesystem::create_directories(folder);
  std::string text;  // Packs to a half.
  std::uint32_t state = 1;
  while (text.size() < 3'000'000) {
    state = state * 1664525 + 1013904223;
    text += char('a' + (state >> 28));
  }
  for (const auto& [name, begin] : {std::pair("a", 0), std::pair("b", 2'000'000)}) {
    std::ofstream(folder / name, std::ios::binary) << text.substr(begin, begin ? -1 : 2'000'000);
  }
  // Members with and without a name in front, the last one with zeros behind.
  const std::string command = "cd '" + folder.string() +
                              "' && gzip -9 -c a > t.gz && gzip -n < b >> t.gz && "
                              "head -c 100 /dev/zero >> t.gz";
  REQUIRE(std::system(command.c_str()) == 0);
  const auto open = [&] { return std::ifstream(folder / "t.gz", std::ios::binary); };
  GzipPlaces places(100'000);
  {
    GzipStream stream(open(), places);
    stream.ignore(std::numeric_limits<std::streamsize>::max());
    CHECK(stream.seen() == text.size());
  }
  CHECK(places.count() > 10);
  CHECK(places.count() <= 30);
  const std::size_t starts[] = {0, 2'999'990, 1'999'995, 150'000, 149'999, 2'000'000, 700'001, 5};
  for (const std::uint64_t spacing : {100'000, 800'000, 100'000'000}) {
    places.thin(spacing);
    GzipStream stream(open(), places);
    for (const std::size_t start : starts) {
      std::string part(std::min<std::size_t>(200'000, text.size() - start), ' ');
      stream.seekg(std::streamoff(start));
      stream.read(part.data(), std::streamsize(part.size()));
      CHECK(stream.good());
      CHECK(part == text.substr(start, part.size()));
    }
    stream.seekg(std::streamoff(text.size() + 1));
    CHECK(stream.fail());
  }
  CHECK(places.count() == 0);
  std::filesystem::remove_all(folder);
}

TEST_CASE("few places are kept of content of any length", "[readers]") {
  GzipPlaces places(1);
  for (std::uint64_t at = 1; at < 100'000; ++at) {
    if (places.is_wanted(at)) places.add({at, at, 0, {}});
  }
  CHECK(places.count() <= GzipPlaces::kMost);
  CHECK(places.count() > GzipPlaces::kMost / 4);
  CHECK(places.before(0) == nullptr);
  REQUIRE(places.before(50'000));
  CHECK(places.before(50'000)->at <= 50'000);
  CHECK(places.before(50'000)->at > 49'000);
}

TEST_CASE("names that tar cannot hold are refused", "[writers]") {
  TarArchive archive([](std::span<const std::byte>) {});
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

namespace {

/// Six captures, of which 1 and 4 are for validation.
DatasetInfo six_captures(const test::SampleScene& sample) {
  DatasetInfo dataset = test::sample_dataset(sample);
  dataset.capture_count = 6;
  dataset.validation = std::vector<int>{1, 4};
  return dataset;
}

std::vector<Capture> captures_of(const test::SampleScene& sample) {
  std::vector<Capture> captures;
  for (int i = 0; i < 6; ++i) {
    captures.push_back(test::ray_cast_capture(sample, 0));
    captures.back().index = i;
  }
  return captures;
}

MemoryFiles write_captures(const WebDatasetWriter::Params& params, std::vector<int> order) {
  static const test::SampleScene sample(24, 16, 1);
  static const std::vector<Capture> captures = captures_of(sample);
  std::vector<const Capture*> given;
  for (const int i : order) given.push_back(&captures[std::size_t(i)]);
  test::FakeHost host;
  WebDatasetWriter writer(params, host);
  return test::write_dataset(writer, six_captures(sample), given);
}

std::string end_of_tar() { return std::string(1024, '\0'); }

std::string without_end(const std::string& tar) { return tar.substr(0, tar.size() - 1024); }

}  // namespace

TEST_CASE("Shards of a chosen number of captures are those of single captures put together",
          "[writers]") {
  WebDatasetWriter::Params params;
  const MemoryFiles single = write_captures(params, {0, 1, 2, 3, 4, 5});
  params.shard_captures = 3;
  const MemoryFiles filled = write_captures(params, {0, 1, 2, 3, 4, 5});
  const auto part = [&](int capture) {
    return without_end(single.text("shards/00000" + std::to_string(capture) + ".tar"));
  };
  CHECK(filled.paths() == std::set<std::string>{"dataset.json", "shards/train-000000.tar",
                                                "shards/train-000001.tar", "shards/val-000000.tar",
                                                "train.txt", "val.txt"});
  CHECK(filled.text("shards/train-000000.tar") == part(0) + part(2) + part(3) + end_of_tar());
  CHECK(filled.text("shards/train-000001.tar") == part(5) + end_of_tar());
  CHECK(filled.text("shards/val-000000.tar") == part(1) + part(4) + end_of_tar());
  CHECK(filled.text("train.txt") == "shards/train-000000.tar\nshards/train-000001.tar\n");
  CHECK(filled.text("val.txt") == "shards/val-000000.tar\n");
  CHECK(write_captures(params, {5, 3, 1, 0, 4, 2}).files == filled.files);
  CHECK(filled.text("dataset.json") == single.text("dataset.json"));
}

TEST_CASE("Shards of a chosen size hold what fits, and what fits in none alone", "[writers]") {
  WebDatasetWriter::Params params;
  const MemoryFiles single = write_captures(params, {0, 1, 2, 3, 4, 5});
  const auto size = double(single.bytes("shards/000000.tar").size() - 1024);
  // Captures of one scene differ in their numbers alone: all are of one size.
  params.shard_size_mb = (2.0 * size + 1024.0) / 1e6;
  const MemoryFiles two = write_captures(params, {0, 1, 2, 3, 4, 5});
  CHECK(two.bytes("shards/train-000000.tar").size() == std::size_t(2.0 * size) + 1024);
  CHECK(two.bytes("shards/train-000001.tar").size() == std::size_t(2.0 * size) + 1024);
  params.shard_size_mb = (2.0 * size + 1023.0) / 1e6;
  const MemoryFiles one = write_captures(params, {0, 1, 2, 3, 4, 5});
  CHECK(one.text("shards/train-000003.tar") == single.text("shards/000005.tar"));
  CHECK(one.text("val.txt") == "shards/val-000000.tar\nshards/val-000001.tar\n");
  params.shard_size_mb = 1e-6;
  CHECK(write_captures(params, {0, 1, 2, 3, 4, 5}).files == one.files);
  params.shard_size_mb = 1e9;
  CHECK(write_captures(params, {0, 1, 2, 3, 4, 5}).paths().contains("shards/val-000000.tar"));
}

TEST_CASE("A part without captures has a list without shards", "[writers]") {
  WebDatasetWriter::Params params;
  params.shard_captures = 2;
  params.training.val_share = 0.0;
  test::FakeHost host;
  const MemoryFiles files = test::write_sample<WebDatasetWriter>(params, host);
  CHECK(files.text("val.txt").empty());
  CHECK_FALSE(files.text("train.txt").empty());
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
