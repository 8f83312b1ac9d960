// SPDX-License-Identifier: Apache-2.0
#include "framework/datasets/dataset_stats.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "diorama/rng.h"
#include "framework/datasets/pixel_counts.h"
#include "framework/lint/dataset_on_disk.h"
#include "framework/lint/every_format.h"
#include "plugins/writer_support/sample_dataset.h"
#include "support/catch.h"
#include "writer_coco/coco_writer.h"

using namespace diorama;

namespace {

DatasetStats stats_of(const test::DatasetOnDisk& disk, test::EncodingHost& host) {
  DatasetReaders readers = test::every_reader(host);
  const FoundDataset found = find_dataset(disk.folder(), readers);
  return dataset_stats(*readers.open(found.folder, found.reader), host);
}

}  // namespace

TEST_CASE("A histogram counts what lies beyond at its ends", "[stats]") {
  Histogram values(0.0, 1.0, 4);
  for (const double value : {-3.0, 0.1, 0.3, 1.0, 7.0, std::nan("")}) values.add(value);
  CHECK(values.counts() == std::vector<std::int64_t>{2, 1, 0, 2});
  CHECK(values.total() == 5);
  CHECK(values.least() == -3.0);
  CHECK(values.most() == 7.0);
  CHECK(values.mean() == Approx(5.4 / 5.0));
}

TEST_CASE("Pixels are counted alike whatever their number", "[stats]") {
  Rng rng(3);
  for (const int size : {1, 3, 4, 7, 512, 1030, 5000}) {
    std::vector<Rgba8> pixels;
    std::vector<float> values;
    std::uint64_t sum = 0;
    std::size_t burnt = 0;
    std::size_t below = 0;
    for (int i = 0; i < size; ++i) {
      const auto shade = [&] { return std::uint8_t(248 + rng.bits() % 8); };
      pixels.push_back({shade(), shade(), shade(), shade()});
      const Rgba8& p = pixels.back();
      sum += std::uint64_t(p[0]) + p[1] + p[2];
      burnt += std::size_t(p[0] >= 254 && p[1] >= 254 && p[2] >= 254);
      values.push_back(i % 5 == 0 ? std::nanf("") : float(rng.uniform()));
      below += std::size_t(values.back() < 0.15f);
    }
    const ColorCounts counts = color_counts(pixels);
    CHECK(counts.sum == sum);
    CHECK(counts.burnt == burnt);
    CHECK(counts.is_uniform == (size == 1));
    CHECK(count_below(values, 0.15f) == below);
    std::ranges::fill(pixels, Rgba8{255, 255, 255, 0});
    CHECK(color_counts(pixels).is_uniform);
    CHECK(color_counts(pixels).sum == 765 * std::uint64_t(size));
    for (const std::size_t at : {std::size_t(0), pixels.size() - 1}) {
      pixels[at][3] = 1;
      CHECK(color_counts(pixels).is_uniform == (size == 1));
      pixels[at][3] = 0;
    }
  }
}

TEST_CASE("What is counted is what was written", "[stats]") {
  test::EncodingHost host;
  const test::DatasetOnDisk disk(test::write_sample<BasicWriter>(test::everything(), host));
  const DatasetStats stats = stats_of(disk, host);
  CHECK(stats.captures == 3);
  CHECK(stats.pictures == 6);
  CHECK(stats.pictures_by_camera ==
        std::map<std::string, std::int64_t>{{"cam_0", 3}, {"cam_1", 3}});
  CHECK(stats.pictures_by_size ==
        std::map<std::string, std::int64_t>{{"54 x 48", 3}, {"72 x 48", 3}});
  CHECK(stats.findings == 0);
  std::int64_t mugs = 0;
  double distance = 0.0;
  for (const Capture& capture : test::sample_captures()) {
    for (const Frame& frame : capture.frames) {
      const Instance& mug = test::instance_at(frame, "/Assets/mug");
      if (!mug.tight_box) continue;
      ++mugs;
      distance +=
          (mug.world_from_node * mug.bounds_node.centre() - frame.world_from_camera.translation())
              .norm();
    }
  }
  const ClassStats& own = stats.classes.at("mug");
  REQUIRE(mugs > 0);
  CHECK(own.objects == mugs);
  CHECK(own.distance_m.mean() == Approx(distance / double(mugs)).epsilon(1e-4));
  std::int64_t seen = 0;
  for (const auto& row : own.views) {
    for (const std::int64_t count : row) seen += count;
  }
  CHECK(seen == mugs);
  CHECK(own.visible.total() == mugs);
  // The sample's motion grows with the pixel.
  CHECK(stats.suspicious.at("moving").count == 6);
  CHECK(stats.suspicious.at("moving").names.front() == "capture 0, cam_0");
}

TEST_CASE("What a format does not hold is not counted", "[stats]") {
  test::EncodingHost host;
  const test::DatasetOnDisk disk(test::write_sample<CocoWriter>({}, host));
  const DatasetStats stats = stats_of(disk, host);
  CHECK(stats.pictures_by_split.at("train") + stats.pictures_by_split.at("val") == 6);
  CHECK(stats.classes.at("ball").distance_m.total() == 0);
  CHECK(stats.classes.at("ball").objects > 0);
  const auto json = nlohmann::json::parse(stats_json(stats));
  CHECK(json.at("classes").at("ball").at("distance_m").is_null());
  CHECK(json.at("classes").at("ball").at("views").is_null());
  CHECK(json.at("pictures") == 6);
  const std::string text = stats_text(stats);
  CHECK(text.find("COCO: 3 captures, 6 pictures\n") == 0);
  CHECK(text.find("where in the picture") != std::string::npos);
}

TEST_CASE("Black, burnt and empty pictures are named", "[stats]") {
  test::EncodingHost host;
  const test::DatasetOnDisk disk(test::write_sample<BasicWriter>(test::everything(), host));
  for (const auto& [file, shade] : {std::pair{"rp_cam_0/rgb/rgb_0001.png", std::uint8_t(0)},
                                    std::pair{"rp_cam_0/rgb/rgb_0002.png", std::uint8_t(255)}}) {
    const std::vector<std::uint8_t> samples(72 * 48 * 3, shade);
    const auto bytes = host.encode_image({samples.data(), 72, 48, 3, 8}, ImageFormat::Png);
    disk.write(file, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  }
  const DatasetStats stats = stats_of(disk, host);
  CHECK(stats.suspicious.at("black").names == std::vector<std::string>{"capture 1, cam_0"});
  CHECK(stats.suspicious.at("burnt").names == std::vector<std::string>{"capture 2, cam_0"});
}

TEST_CASE("The page of statistics holds what the tables hold and needs nothing else", "[stats]") {
  test::EncodingHost host;
  const test::DatasetOnDisk disk(test::write_sample<BasicWriter>(test::everything(), host));
  DatasetStats stats = stats_of(disk, host);
  stats.classes["<script>"] = stats.classes.at("mug");
  const std::string page = stats_html(stats, "a & b");
  CHECK(page.starts_with("<!DOCTYPE html>"));
  CHECK(page.find("<h1>a &amp; b</h1>") != std::string::npos);
  CHECK(page.find("BasicWriter: 3 captures, 6 pictures") != std::string::npos);
  CHECK(page.find("<td>mug</td>") != std::string::npos);
  CHECK(page.find("<li>capture 0, cam_0</li>") != std::string::npos);
  CHECK(page.find("<script>") == std::string::npos);
  CHECK(page.find("http") == std::string::npos);
  CHECK(page.find("src=") == std::string::npos);
}
