// SPDX-License-Identifier: Apache-2.0
// What writers and the output store keep in memory while a dataset grows.
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include "framework/output/output_store.h"
#include "plugins/writer_support/fake_host.h"
#include "plugins/writer_support/sample_capture.h"
#include "support/catch.h"
#include "writer_bop/bop_writer.h"
#include "writer_coco/coco_writer.h"
#include "writer_hdf5/hdf5_writer.h"
#include "writer_imagefolder/image_folder_writer.h"
#include "writer_voc/voc_writer.h"
#include "writer_webdataset/webdataset_writer.h"

using namespace diorama;
namespace fs = std::filesystem;

namespace {

/// The same capture over and over, written as a run does.
void write_dataset(Writer& writer, Capture& capture, DatasetInfo dataset, int captures,
                   const fs::path& folder) {
  dataset.capture_count = captures;
  LocalFileSystem disk;
  OutputStore store(disk, {folder, ".", {{"writer", "writer"}}}, captures, {});
  store.join("{}");
  store.open();
  Transaction begin = store.begin_transaction();
  CollectedFiles first(begin, 0, "writer");
  writer.begin(dataset, first);
  store.commit_begin(begin);
  for (capture.index = 0; capture.index < captures; ++capture.index) {
    Transaction transaction = store.capture_transaction(capture.index);
    CollectedFiles files(transaction, 0, "writer");
    writer.write(capture, files);
    store.commit_capture(capture.index, transaction);
  }
  store.refresh();
  Transaction finish = store.finish_transaction();
  CollectedFiles last(finish, 0, "writer");
  writer.finish([&store](const RecordVisitor& visit) { store.read_records(0, visit); }, last);
  store.commit_finish(finish);
}

/// The most memory, in KiB, of a process that writes so many captures like `capture`.
template <class W>
long peak_kib(int captures, const test::SampleScene& sample, Capture& capture,
              const typename W::Params& params = {}) {
  std::string folder = (fs::temp_directory_path() / "diorama-memory-XXXXXX").string();
  REQUIRE(::mkdtemp(folder.data()) != nullptr);
  const pid_t child = ::fork();
  if (child == 0) {
    int status = 1;
    try {
      test::FakeHost host;
      W writer(params, host);
      write_dataset(writer, capture, test::sample_dataset(sample), captures, folder);
      status = 0;
    } catch (const std::exception&) {
    }
    ::_exit(status);
  }
  int status = -1;
  rusage usage{};
  REQUIRE(::wait4(child, &status, 0, &usage) == child);
  fs::remove_all(folder);
  REQUIRE(status == 0);
  return usage.ru_maxrss;
}

template <class W>
long peak_kib(int captures, const typename W::Params& params) {
  static const test::SampleScene sample(24, 16, 1);
  static Capture capture = test::ray_cast_capture(sample, 0);
  return peak_kib<W>(captures, sample, capture, params);
}

/// A frame as large as cameras are, with surfaces that are neither flat nor noise.
Capture large_capture(const test::SampleScene& sample, int size) {
  Capture capture = test::ray_cast_capture(sample, 0);
  Frame& frame = capture.frames.at(0);
  const auto ids = frame.get(kInstanceId).pixels();
  Image<Rgba8> color(size, size, {0, 0, 0, 255});
  Image<float> depth(size, size, 0.0f);
  Image<Vec3f> normals(size, size, Vec3f::Zero());
  Image<std::uint32_t> instances(size, size, 0);
  for (int y = 0; y < size; ++y) {
    for (int x = 0; x < size; ++x) {
      const auto grain = std::uint8_t((x * 7 + y * 13) % 5);
      color.at(x, y) = {std::uint8_t(x / 9 + grain), std::uint8_t(y / 11), grain, 255};
      depth.at(x, y) = 1.0f + 0.001f * float(x / 4) + 0.002f * float(y / 4);
      normals.at(x, y) =
          Vec3f(0.1f * float(x / 64 % 9), 0.05f * float(y / 64 % 9), 1.0f).normalized();
      instances.at(x, y) = ids[std::size_t(x / 256 + y / 256 * 8) % ids.size()];
    }
  }
  frame.camera.width = frame.camera.height = size;
  frame.set(kColor, std::move(color));
  frame.set(kDistanceToImagePlane, std::move(depth));
  frame.set(kNormals, std::move(normals));
  frame.set(kInstanceId, std::move(instances));
  return capture;
}

/// What may grow: the buffers of files that grow, and the store's list of captures.
template <class W>
void check_flat(const char* name, const typename W::Params& params = {}) {
  constexpr long kBound = long(CollectedFiles::kKeptGrowingBytes >> 10) + 1024;
  const long few = peak_kib<W>(100, params);
  const long many = peak_kib<W>(1200, params);
  INFO(name << ": " << few << " KiB for 100 captures, " << many << " KiB for 1200");
  CHECK(many - few < kBound);
}

}  // namespace

TEST_CASE("a writer's memory does not grow with the number of captures", "[writers][slow]") {
  check_flat<BopWriter>("BopWriter");
  check_flat<CocoWriter>("CocoWriter");
  check_flat<ImageFolderWriter>("ImageFolderWriter");
  check_flat<VocWriter>("VocWriter");
  WebDatasetWriter::Params shards;
  shards.shard_captures = 500;
  check_flat<WebDatasetWriter>("WebDatasetWriter", shards);
}

TEST_CASE("an HDF5 file of a large camera needs little beside its frame", "[writers][slow]") {
  const test::SampleScene sample(24, 16, 1);
  Capture capture = large_capture(sample, 2048);
  // The frame is there in both processes; nothing is written in the first one.
  const long without = peak_kib<Hdf5Writer>(0, sample, capture);
  const long with = peak_kib<Hdf5Writer>(1, sample, capture);
  INFO(without << " KiB with the frame alone, " << with << " KiB with a file of it");
  CHECK(with - without < 32 * 1024);
}
