// SPDX-License-Identifier: Apache-2.0
#include "writer_support/training_data.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <set>
#include <string>

#include "diorama/abi.h"
#include "diorama/rng.h"
#include "memory_files.h"
#include "support/catch.h"

using namespace diorama;

namespace {

TrainingData split_of(int captures, double share) {
  TrainingParams params;
  params.val_share = share;
  TrainingData data(params);
  DatasetInfo dataset;
  dataset.capture_count = captures;
  dataset.seed = 3;
  data.begin(dataset);
  return data;
}

/// Counts what it is given.
class CountedFiles final : public DatasetFiles {
 public:
  void add(std::string_view, std::vector<std::byte> bytes) override { take(bytes.size()); }
  void append(std::string_view, std::span<const std::byte> bytes) override { take(bytes.size()); }
  void append_kept(std::string_view, int) override {}

  std::size_t size = 0;
  std::size_t largest = 0;

 private:
  void take(std::size_t bytes) {
    size += bytes;
    largest = std::max(largest, bytes);
  }
};

/// Of this process, in kB.
long status_kb(const std::string& key) {
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;) {
    long value = 0;
    if (word == key + ":" && status >> value) return value;
  }
  return 0;
}

}  // namespace

TEST_CASE("the captures with the lowest draws are for validation", "[training]") {
  for (const int captures : {2, 3, 10, 1000, 200'000}) {
    for (const double share : {0.0001, 0.2, 0.5, 1.0}) {
      const TrainingData data = split_of(captures, share);
      const Rng stream = Rng(3).fork("training and validation");
      std::set<std::pair<std::uint64_t, int>> order;
      for (int i = 0; i < captures; ++i) {
        order.emplace(stream.fork(std::uint64_t(i)).bits(), i);
      }
      const long wanted = std::clamp(std::lround(share * captures), 1L, long(captures) - 1);
      long place = 0;
      int wrong = 0;
      for (const auto& [draw, capture] : order) {
        wrong += (std::string(data.split(capture)) == "val") == (place++ < wanted) ? 0 : 1;
      }
      INFO(captures << " captures, share " << share);
      CHECK(wrong == 0);
    }
  }
}

TEST_CASE("the page of a dataset is one text, however it is written", "[training]") {
  test::MemoryFiles files;
  DatasetInfo dataset;
  dataset.capture_count = 20'000;
  dataset.camera_names = {"cam_0"};
  dataset.classes = {"\n  \"split\": {"};  // does not pass for the key
  TrainingData data((TrainingParams()));
  data.begin(dataset);
  data.add_dataset_page("Test", Json::object(), dataset, files);
  const std::string text = files.text("dataset.json");
  const Json page = Json::parse(text);
  CHECK(text == python_json(page, 2) + "\n");
  std::set<int> seen;
  for (const auto& [name, captures] : page.at("split").items()) {
    for (const Json& capture : captures) {
      if (data.split(capture.get<int>()) != name) FAIL("capture " << capture);
      seen.insert(capture.get<int>());
    }
  }
  CHECK(seen.size() == 20'000);
}

TEST_CASE("a job of millions of captures is split in little memory", "[training]") {
#if DIORAMA_DETAIL_ADDRESS_SANITIZER || DIORAMA_DETAIL_THREAD_SANITIZER
  WARN("sanitizers need memory of their own: not measured");
#else
  constexpr int kCaptures = 2'000'000;
  std::ofstream("/proc/self/clear_refs") << "5";  // forgets the peak
  const long before = status_kb("VmRSS");
  const TrainingData data = split_of(kCaptures, 0.2);
  CountedFiles files;
  DatasetInfo dataset;
  dataset.capture_count = kCaptures;
  data.add_dataset_page("Test", Json::object(), dataset, files);
  CHECK(files.size > std::size_t(kCaptures) * 12);
  CHECK(files.largest < std::size_t(1) << 17);
  CHECK(status_kb("VmHWM") - before < 8 * 1024);
#endif
}
