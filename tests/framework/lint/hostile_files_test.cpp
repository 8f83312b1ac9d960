// SPDX-License-Identifier: Apache-2.0
// Datasets of strangers: files that lie about their sizes, lead elsewhere or never end.
#include <sys/stat.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <sstream>
#include <string>

#include "diorama/error.h"
#include "framework/images/image_codecs.h"
#include "framework/lint/dataset_on_disk.h"
#include "framework/lint/encoding_host.h"
#include "framework/lint/every_format.h"
#include "plugins/writer_support/sample_dataset.h"
#include "reader_support/npy_array.h"
#include "support/catch.h"
#include "writer_webdataset/tar_walk.h"

using namespace diorama;
using test::DatasetOnDisk;

namespace {

std::string npy(const std::string& descr, const std::string& shape, const std::string& data) {
  std::string header =
      "{'descr': " + descr + ", 'fortran_order': False, 'shape': (" + shape + "), }";
  header.resize(118, ' ');
  return std::string("\x93NUMPY\x01\x00", 8) + char(header.size()) + '\0' + header + data;
}

DatasetOnDisk sample(const std::string& name) {
  std::vector<const Capture*> captures;
  for (const Capture& capture : test::sample_captures()) captures.push_back(&capture);
  const auto formats = test::every_format();
  const auto format = std::ranges::find(formats, name, &test::SampleFormat::name);
  REQUIRE(format != formats.end());
  test::EncodingHost host;
  return DatasetOnDisk(
      format->write(host, test::sample_dataset(test::SampleScene(8, 6)), captures));
}

bool finds(const LintReport& report, const std::string& file, const std::string& message) {
  return std::ranges::any_of(report.findings, [&](const LintFinding& finding) {
    return finding.file.find(file) != std::string::npos &&
           finding.message.find(message) != std::string::npos;
  });
}

}  // namespace

TEST_CASE("an array that claims more than its file holds is refused", "[lint]") {
  CHECK(parse_array(npy("'<f4'", "2, 1", "12345678")).count() == 2);
  CHECK(parse_array(npy("'<f4'", "0, 3", "")).count() == 0);
  // The products wrap around to 0, to 8 and to 4.
  for (const char* shape : {"4294967296, 4294967296", "4611686018427387906,",
                            "2, 4611686018427387905", "9223372036854775808, 2"}) {
    INFO(shape);
    CHECK_THROWS_AS(parse_array(npy("'<f4'", shape, "12345678")), std::runtime_error);
    CHECK_THROWS_AS(parse_array(npy("'<f4'", shape, "")), std::runtime_error);
  }
  for (const char* descr : {"'f'", "'<f0'", "'<f99999999999999999999'", "'<", "'|'", "''",
                            "[('a', '<u18446744073709551615', (4, 4))]"}) {
    INFO(descr);
    CHECK_THROWS_AS(parse_array(npy(descr, "99999999,", "")), std::runtime_error);
  }
  for (const char* shape : {"99999999999999999999,", "-1,", "x", "1.5,"}) {
    INFO(shape);
    CHECK_THROWS_AS(parse_array(npy("'<f4'", shape, "")), std::runtime_error);
  }
}

TEST_CASE("the tenth thousand of frames is counted like the first", "[lint]") {
  const std::vector<std::uint8_t> grey(4, 9);
  const auto png = encode_image({grey.data(), 2, 2, 1, 8}, ImageFormat::Png);
  test::MemoryFiles files;
  const std::string page = "{\"name\": \"BasicWriter\"}";
  const auto* text = reinterpret_cast<const std::byte*>(page.data());
  files.files["metadata.txt"] = {text, text + page.size()};
  for (int i = 0; i <= 10'001; ++i) {
    const std::string digits = std::to_string(i);
    files.files["rgb_" + std::string(digits.size() < 4 ? 4 - digits.size() : 0, '0') + digits +
                ".png"] = png;
  }
  const DatasetOnDisk dataset(files);
  const LintReport report = dataset.lint();
  INFO(lint_text(report, 5));
  CHECK(report.findings.empty());
  dataset.remove("rgb_10000.png");
  CHECK(finds(dataset.lint(), ".", "there are 10001 frames"));
}

TEST_CASE("wrong numbers and types in a dataset are findings", "[lint]") {
  const DatasetOnDisk basic = sample("basic");
  basic.write("rp_cam_0/rgb/rgb_99999999999999999999999.png", "x");
  CHECK_FALSE(basic.lint().findings.empty());
  const DatasetOnDisk other = sample("basic");
  const std::string map =
      "rp_cam_0/instance_id_segmentation/instance_id_segmentation_mapping_0000.json";
  for (const char* text : {"{\"99999999999999999999\": \"/a\"}", "{\"-1\": 3}", "[]", "7", "null",
                           "{\"(1, 2\": \"/a\"}"}) {
    INFO(text);
    other.write(map, text);
    CHECK_FALSE(other.lint().findings.empty());
  }
  other.write(map, std::string(100'000, '[') + std::string(100'000, ']'));
  CHECK(finds(other.lint(), map, "nests deeper than 100 levels"));
  const DatasetOnDisk pictures = sample("boxes");
  pictures.write("rp_cam_0/no.png", "x");
  CHECK(finds(pictures.lint(), "no.png", "is no picture of a capture"));
}

TEST_CASE("names in a dataset neither lead out of it nor to what never ends", "[lint]") {
  const DatasetOnDisk coco = sample("coco");
  const std::string page = "annotations/instances_train.json";
  const std::string text = coco.read(page);
  const std::size_t at = text.find("\"file_name\": \"") + 14;
  REQUIRE(at > 14);
  const std::string name = text.substr(at, text.find('"', at) - at);
  for (const std::string file : {"/etc/hostname", "../../../../../../etc/hostname", "pipe"}) {
    if (file == "pipe") REQUIRE(mkfifo((coco.folder() / "pipe").c_str(), 0600) == 0);
    std::string changed = text;
    changed.replace(at, name.size(), file);
    coco.write(page, changed);
    CHECK_FALSE(coco.lint().findings.empty());
  }
}

TEST_CASE("files that become pipes while a dataset is open are not waited for", "[lint]") {
  for (const test::SampleFormat& format : test::every_format()) {
    INFO(format.name);
    const DatasetOnDisk disk = sample(format.name);
    test::EncodingHost host;
    DatasetReaders readers = test::every_reader(host);
    const std::string reader = readers.recognise(disk.folder());
    if (reader.empty()) continue;
    const auto dataset = readers.open(disk.folder(), reader);
    std::vector<std::filesystem::path> files;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(disk.folder())) {
      if (entry.is_regular_file()) files.push_back(entry.path());
    }
    for (const std::filesystem::path& file : files) {
      std::filesystem::remove(file);
      REQUIRE(mkfifo(file.c_str(), 0600) == 0);
    }
    for (std::size_t i = 0; i < dataset->info().captures.size(); ++i) {
      const auto stored = dataset->read(i, dataset->info().holds);
      // The third party's reader has read its only table when the dataset was opened.
      CHECK((format.name == std::string_view("boxes") || !stored.log.findings.empty()));
    }
  }
}

TEST_CASE("a page without an end is a finding", "[lint]") {
  const DatasetOnDisk basic = sample("basic");
  basic.write("dataset.json", "{}");
  const auto page = basic.folder() / "dataset.json";
  std::filesystem::resize_file(page, std::uintmax_t(20) << 30);  // a hole
  CHECK(finds(basic.lint(), "dataset.json", "it has 21474836480 bytes, more than"));
  basic.remove("dataset.json");
  std::filesystem::create_symlink("/dev/zero", page);
  CHECK(finds(basic.lint(), "dataset.json", "it is no regular file"));
}

TEST_CASE("a long element of a label file is read without recursion", "[lint]") {
  const DatasetOnDisk voc = sample("voc");
  std::string file;
  for (const auto& entry : std::filesystem::directory_iterator(voc.folder() / "Annotations")) {
    file = "Annotations/" + entry.path().filename().string();
  }
  REQUIRE_FALSE(file.empty());
  voc.replace(file, "<width>", "<width>" + std::string(1'000'000, '1'));
  CHECK_FALSE(voc.lint().findings.empty());
}

TEST_CASE("archives say where they are damaged", "[lint]") {
  std::string tar(3 * 512, '\0');
  tar.replace(0, 5, "a.txt");
  tar.replace(124, 11, "77777777777");
  std::size_t sum = 8 * ' ';
  for (int i = 0; i < 512; ++i) sum += static_cast<unsigned char>(tar[std::size_t(i)]);
  char digits[8];
  std::snprintf(digits, sizeof digits, "%06zo", sum);
  tar.replace(148, 7, digits, 7);
  const auto walk = [](const std::string& bytes) {
    std::istringstream in(bytes);
    TarWalk archive(in, bytes.size());
    while (archive.next()) {
    }
  };
  CHECK_THROWS_WITH(walk(tar), "a.txt is cut short");
  tar[148] = '9';
  CHECK_THROWS_WITH(walk(tar), "the header at byte 0 is damaged");
  CHECK_THROWS_WITH(walk("x"), "the end of the archive is missing");
}
