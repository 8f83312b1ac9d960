// SPDX-License-Identifier: Apache-2.0
// write_sample_datasets FOLDER: the sample scene in every format, one folder each, and below clips/
// as a clip. What Python's readers make of it is checked by read_back.py.
#include <filesystem>
#include <fstream>
#include <iostream>

#include "framework/lint/encoding_host.h"
#include "framework/lint/every_format.h"
#include "plugins/writer_support/sample_dataset.h"
#ifdef DIORAMA_HAS_VIDEO
#include "writer_video/video_writer.h"
#endif

using namespace diorama;

namespace {

void save(const test::MemoryFiles& files, const std::filesystem::path& folder) {
  for (const auto& [path, bytes] : files.files) {
    std::filesystem::create_directories((folder / path).parent_path());
    std::ofstream out(folder / path, std::ios::binary);
    out.write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
    if (!out) throw std::runtime_error((folder / path).string() + ": cannot be written");
  }
}

void write_all(const std::filesystem::path& folder) {
  std::vector<const Capture*> captures;
  for (const Capture& capture : test::sample_captures()) captures.push_back(&capture);
  const DatasetInfo dataset = test::sample_dataset(test::SampleScene(8, 6));
  test::EncodingHost host;
  for (const test::SampleFormat& format : test::every_format()) {
    save(format.write(host, dataset, captures), folder / format.name);
  }
}

void write_clips(const std::filesystem::path& folder) {
  const test::SampleClip clip = test::sample_clip();
  test::EncodingHost host;
  for (const test::SampleFormat& format : test::formats_of_clips()) {
    save(format.write(host, clip.dataset, clip.captures()), folder / format.name);
  }
#ifdef DIORAMA_HAS_VIDEO
  VideoWriter writer({}, host);
  save(test::write_dataset(writer, clip.dataset, clip.captures()), folder / "video");
#endif
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::cerr << "write_sample_datasets FOLDER\n";
    return 2;
  }
  try {
    write_all(argv[1]);
    write_clips(std::filesystem::path(argv[1]) / "clips");
    return 0;
  } catch (const std::exception& error) {
    std::cerr << error.what() << "\n";
    return 1;
  }
}
