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
#include "writer_imagefolder/image_folder_writer.h"
#include "writer_voc/voc_writer.h"

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

/// The most memory, in KiB, of a process that writes so many captures.
template <class W>
long peak_kib(int captures) {
  static const test::SampleScene sample(24, 16, 1);
  static Capture capture = test::ray_cast_capture(sample, 0);
  std::string folder = (fs::temp_directory_path() / "diorama-memory-XXXXXX").string();
  REQUIRE(::mkdtemp(folder.data()) != nullptr);
  const pid_t child = ::fork();
  if (child == 0) {
    int status = 1;
    try {
      test::FakeHost host;
      W writer(typename W::Params(), host);
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

/// What may grow: the buffers of files that grow, and the store's list of captures.
template <class W>
void check_flat(const char* name) {
  constexpr long kBound = long(CollectedFiles::kKeptGrowingBytes >> 10) + 1024;
  const long few = peak_kib<W>(100);
  const long many = peak_kib<W>(1200);
  INFO(name << ": " << few << " KiB for 100 captures, " << many << " KiB for 1200");
  CHECK(many - few < kBound);
}

}  // namespace

TEST_CASE("a writer's memory does not grow with the number of captures", "[writers][slow]") {
  check_flat<BopWriter>("BopWriter");
  check_flat<CocoWriter>("CocoWriter");
  check_flat<ImageFolderWriter>("ImageFolderWriter");
  check_flat<VocWriter>("VocWriter");
}
