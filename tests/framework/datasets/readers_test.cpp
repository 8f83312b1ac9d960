// SPDX-License-Identifier: Apache-2.0
// Which reader takes which folder.
#include "framework/datasets/dataset_readers.h"

#include <memory>

#include "diorama/error.h"
#include "framework/lint/encoding_host.h"
#include "framework/lint/every_format.h"
#include "support/catch.h"
#include "support/temporary_folder.h"

using namespace diorama;

namespace {

/// Says the same of every folder.
class OpinionatedReader final : public Reader {
 public:
  explicit OpinionatedReader(Recognition opinion) : opinion_(opinion) {}
  std::vector<std::string> patterns() const override { return {"mark.txt"}; }
  Recognition recognise(const std::filesystem::path&) const override { return opinion_; }
  std::unique_ptr<const StoredDataset> open(const std::filesystem::path&) const override {
    return nullptr;
  }

 private:
  Recognition opinion_;
};

DatasetReaders::Entry entry(const char* type, Recognition opinion, int* made = nullptr) {
  return {type, {"mark.txt"}, [opinion, made] {
            if (made) ++*made;
            return std::make_unique<OpinionatedReader>(opinion);
          }};
}

}  // namespace

TEST_CASE("Patterns fit files part by part", "[readers]") {
  const test::TemporaryFolder folder;
  folder.write("annotations/instances_train.json", "{}");
  folder.write("labels/train/000000.txt", "");
  folder.write(".hidden/a.json", "");
  CHECK(has_file_like(folder.path(""), "annotations/*.json"));
  CHECK(has_file_like(folder.path(""), "*/*.json"));
  CHECK(has_file_like(folder.path(""), "labels/*/*.txt"));
  CHECK(has_file_like(folder.path(""), "annotations/instances_train.json"));
  CHECK_FALSE(has_file_like(folder.path(""), "*.json"));
  CHECK_FALSE(has_file_like(folder.path(""), "labels/*.txt"));
  CHECK_FALSE(has_file_like(folder.path(""), "*/a.json"));
  CHECK_FALSE(has_file_like(folder.path("absent"), "*"));
}

TEST_CASE("The surer reader takes a folder, equally sure ones are a question", "[readers]") {
  const test::TemporaryFolder folder;
  folder.write("mark.txt", "");
  DatasetReaders sure({entry("a", Recognition::ByFiles), entry("b", Recognition::ByName),
                       entry("c", Recognition::No)});
  CHECK(sure.recognise(folder.path("")) == "b");
  DatasetReaders torn({entry("a", Recognition::ByFiles), entry("b", Recognition::ByFiles)});
  CHECK_THROWS_WITH(torn.recognise(folder.path("")),
                    ContainsSubstring("looks like a dataset of a, b; say which with --reader"));
  CHECK(find_datasets(folder.path(""), torn, "a").at(0).reader == "a");
}

TEST_CASE("A reader is made for a folder with one of its files only", "[readers]") {
  const test::TemporaryFolder folder;
  folder.write("other.txt", "");
  int made = 0;
  DatasetReaders readers({entry("a", Recognition::ByName, &made)});
  CHECK(readers.recognise(folder.path("")).empty());
  CHECK(made == 0);
  folder.write("mark.txt", "");
  CHECK(readers.recognise(folder.path("")) == "a");
  CHECK(made == 1);
}

TEST_CASE("Datasets of a run are found; nothing outside of it", "[readers]") {
  const test::TemporaryFolder folder;
  folder.write("run/coco/mark.txt", "");
  folder.write("run/deep/er/mark.txt", "");
  folder.write("elsewhere/mark.txt", "");
  folder.write(
      "run/dataset.json",
      R"({"writers": [{"folder": "deep/er"}, {"folder": "../elsewhere"}, {"folder": 3}]})");
  DatasetReaders readers({entry("a", Recognition::ByFiles)});
  const auto found = find_datasets(folder.path("run"), readers);
  REQUIRE(found.size() == 2);
  CHECK(found[0].folder == folder.path("run/coco"));
  CHECK(found[1].folder == folder.path("run/deep/er"));
  CHECK_THROWS_WITH(find_dataset(folder.path("run"), readers),
                    ContainsSubstring("holds several datasets, name one: "));
  CHECK_THROWS_WITH(find_dataset(folder.path("absent"), readers),
                    ContainsSubstring("not a folder"));
  CHECK_THROWS_WITH(readers.open(folder.path("run"), "b"), ContainsSubstring("unknown reader 'b'"));
}

TEST_CASE("An empty folder is no dataset", "[readers]") {
  const test::TemporaryFolder folder;
  test::EncodingHost host;
  DatasetReaders readers = test::every_reader(host);
  CHECK_THROWS_WITH(find_dataset(folder.path(""), readers),
                    ContainsSubstring("holds no dataset that a reader knows"));
  for (const std::string& type : readers.types()) {
    CHECK_THROWS_WITH(readers.open(folder.path(""), type), ContainsSubstring(folder.path("")));
  }
}
