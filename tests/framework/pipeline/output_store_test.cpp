// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/output_store.h"

#include <unistd.h>

#include <fstream>
#include <map>
#include <sstream>

#include "diorama/error.h"
#include "support/catch.h"

using namespace diorama;
namespace fs = std::filesystem;

namespace {

class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string pattern = (fs::temp_directory_path() / "diorama-store-XXXXXX").string();
    path_ = ::mkdtemp(pattern.data());
  }
  ~TemporaryFolder() { fs::remove_all(path_); }
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

/// Fails at one change of the disk: that one only, or that and everything after it, as if the
/// process had been killed there.
class FaultyFileSystem final : public FileSystem {
 public:
  enum class Fault { One, AllFromThere };
  FaultyFileSystem(int at, Fault fault) : at_(at), fault_(fault) {}
  int changes() const { return changes_; }

  void make_folders(const fs::path& folder) override {
    count();
    local_.make_folders(folder);
  }
  void write(const fs::path& file, std::span<const std::byte> bytes) override {
    // A full disk leaves the part of a file that fitted.
    if (changes_ + 1 == at_) local_.write(file, bytes.first(bytes.size() / 2));
    count();
    local_.write(file, bytes);
  }
  void append(const fs::path& file, std::span<const std::byte> bytes) override {
    if (changes_ + 1 == at_) local_.append(file, bytes.first(bytes.size() / 2));
    count();
    local_.append(file, bytes);
  }
  void rename(const fs::path& from, const fs::path& to) override {
    count();
    local_.rename(from, to);
  }
  void remove(const fs::path& path) override {
    count();
    local_.remove(path);
  }
  void remove_if_empty(const fs::path& folder) override {
    count();
    local_.remove_if_empty(folder);
  }
  bool exists(const fs::path& path) override { return local_.exists(path); }
  std::string read(const fs::path& file) override { return local_.read(file); }
  std::vector<std::string> list(const fs::path& folder) override { return local_.list(folder); }

 private:
  void count() {
    ++changes_;
    const bool fails = fault_ == Fault::One ? changes_ == at_ : changes_ >= at_;
    if (fails) throw Error(ErrorKind::Output, "injected: No space left on device");
  }
  LocalFileSystem local_;
  int at_;
  Fault fault_;
  int changes_ = 0;
};

std::vector<std::byte> bytes_of(const std::string& text) {
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

constexpr int kCaptures = 3;
const std::string kDataset = R"({"seed": 4, "job": "a"})";

/// The one below depth/ is too large to wait in memory.
Transaction capture_files(OutputStore& store, int capture) {
  Transaction transaction = store.capture_transaction(capture);
  CollectedFiles first(transaction, 0, "one");
  first.add_text("rgb_" + std::to_string(capture) + ".png", "colour " + std::to_string(capture));
  for (const std::size_t size : {CollectedFiles::kKeptBytes, std::size_t(3000)}) {
    first.append_text("depth/" + std::to_string(capture) + ".npy",
                      std::string(size, char('a' + capture)));
  }
  first.record("line " + std::to_string(capture));
  CollectedFiles second(transaction, 1, "two");
  second.add_text("boxes/deep/" + std::to_string(capture) + ".json", "{}");
  return transaction;
}

OutputFolders folders_in(const fs::path& root) {
  return {root / "out", {{"one", root / "out" / "one"}, {"two", root / "elsewhere"}}};
}

/// What a run does with its store.
void run(FileSystem& file_system, const fs::path& root, OutputStore::Existing existing) {
  OutputStore store(file_system, folders_in(root), kCaptures);
  store.check(kDataset, existing);
  std::set<int> own;
  for (int i = 0; i < kCaptures; ++i) own.insert(i);
  store.open(existing, own);
  Transaction begin;
  begin.files.push_back({kRecordsFolder, "dataset.json", bytes_of(kDataset)});
  begin.files.push_back({0, "classes.txt", bytes_of("mug")});
  store.commit_begin(begin, 0);
  for (int i = 0; i < kCaptures; ++i) {
    if (!store.is_done(i)) store.commit_capture(i, capture_files(store, i));
  }
  store.refresh();
  Transaction finish = store.finish_transaction(0);
  CollectedFiles last(finish, 0, "one");
  store.read_records(0, [&](int capture, std::string_view line) {
    last.append_text("all.txt", std::to_string(capture) + "=" + std::string(line) + ";");
  });
  store.commit_finish(finish, 0);
  store.close();
}

/// Every file below the folder with its content; folders without files do not count.
std::map<std::string, std::string> tree(const fs::path& root) {
  std::map<std::string, std::string> files;
  if (!fs::exists(root)) return files;
  for (const auto& entry : fs::recursive_directory_iterator(root)) {
    if (!entry.is_regular_file()) continue;
    std::ifstream stream(entry.path(), std::ios::binary);
    std::ostringstream text;
    text << stream.rdbuf();
    files[entry.path().lexically_relative(root).string()] = text.str();
  }
  return files;
}

int visible_files_of(const fs::path& root, int capture) {
  const std::string number = std::to_string(capture);
  return int(fs::exists(root / "out/one" / ("rgb_" + number + ".png"))) +
         int(fs::exists(root / "out/one/depth" / (number + ".npy"))) +
         int(fs::exists(root / "elsewhere/boxes/deep" / (number + ".json")));
}

bool is_journalled(const fs::path& root, int capture) {
  return fs::exists(root / "out/.diorama/journal" / ("00000" + std::to_string(capture) + ".json"));
}

}  // namespace

TEST_CASE("A whole run leaves its files, the journal and nothing else", "[store]") {
  const TemporaryFolder folder;
  LocalFileSystem local;
  run(local, folder.path(), OutputStore::Existing::Refuse);
  const auto files = tree(folder.path());
  CHECK(files.size() == 1 + 1 + 3 * 3 + 1 + 5);
  CHECK(files.at("out/dataset.json") == kDataset);
  CHECK(files.at("out/one/rgb_2.png") == "colour 2");
  CHECK(files.at("out/one/all.txt") == "0=line 0;1=line 1;2=line 2;");
  CHECK(files.contains("out/.diorama/journal/000001.json"));
  CHECK_FALSE(fs::exists(folder.path() / "out/one/.diorama-stage"));
  CHECK_FALSE(fs::exists(folder.path() / "elsewhere/.diorama-stage"));
}

TEST_CASE("Wherever a run is cut, whole captures are left and a resumed run completes them",
          "[store]") {
  const TemporaryFolder whole;
  LocalFileSystem local;
  run(local, whole.path(), OutputStore::Existing::Refuse);
  const auto expected = tree(whole.path());
  FaultyFileSystem counting(0, FaultyFileSystem::Fault::One);
  {
    const TemporaryFolder folder;
    run(counting, folder.path(), OutputStore::Existing::Refuse);
  }
  REQUIRE(counting.changes() > 40);
  for (const auto fault : {FaultyFileSystem::Fault::One, FaultyFileSystem::Fault::AllFromThere}) {
    for (int at = 1; at <= counting.changes(); ++at) {
      CAPTURE(at, fault == FaultyFileSystem::Fault::One);
      const TemporaryFolder folder;
      FaultyFileSystem faulty(at, fault);
      CHECK_THROWS_WITH(run(faulty, folder.path(), OutputStore::Existing::Refuse),
                        ContainsSubstring("No space left on device"));
      for (int capture = 0; capture < kCaptures; ++capture) {
        if (!is_journalled(folder.path(), capture)) {
          CHECK(visible_files_of(folder.path(), capture) == 0);
        }
      }
      run(local, folder.path(), OutputStore::Existing::Resume);
      CHECK(tree(folder.path()) == expected);
    }
  }
}

TEST_CASE("A resumed run may be cut as well", "[store]") {
  const TemporaryFolder whole;
  LocalFileSystem local;
  run(local, whole.path(), OutputStore::Existing::Refuse);
  const auto expected = tree(whole.path());
  const TemporaryFolder folder;
  // Every attempt gets a little further.
  for (int at = 3; at < 200; at += 3) {
    FaultyFileSystem faulty(at, FaultyFileSystem::Fault::AllFromThere);
    try {
      run(faulty, folder.path(), OutputStore::Existing::Resume);
    } catch (const Error&) {
    }
  }
  run(local, folder.path(), OutputStore::Existing::Resume);
  CHECK(tree(folder.path()) == expected);
}

TEST_CASE("Overwriting removes all files of the old dataset, others stay", "[store]") {
  const TemporaryFolder folder;
  LocalFileSystem local;
  run(local, folder.path(), OutputStore::Existing::Refuse);
  const auto expected = tree(folder.path());
  // A longer old dataset, and a file that belongs to somebody else.
  {
    OutputStore store(local, folders_in(folder.path()), 9);
    store.check(kDataset, OutputStore::Existing::Resume);
    store.open(OutputStore::Existing::Resume, {8});
    store.commit_capture(8, capture_files(store, 8));
  }
  std::ofstream(folder.path() / "out/one/notes.txt") << "mine";
  CHECK(visible_files_of(folder.path(), 8) == 3);
  run(local, folder.path(), OutputStore::Existing::Overwrite);
  auto now = tree(folder.path());
  CHECK(now.erase("out/one/notes.txt") == 1);
  CHECK(now == expected);
}

TEST_CASE("An overwriting run that is cut never resurrects old captures", "[store]") {
  const TemporaryFolder whole;
  LocalFileSystem local;
  run(local, whole.path(), OutputStore::Existing::Refuse);
  const auto expected = tree(whole.path());
  for (int at = 1; at < 80; ++at) {
    CAPTURE(at);
    const TemporaryFolder folder;
    run(local, folder.path(), OutputStore::Existing::Refuse);
    FaultyFileSystem faulty(at, FaultyFileSystem::Fault::AllFromThere);
    try {
      run(faulty, folder.path(), OutputStore::Existing::Overwrite);
    } catch (const Error&) {
    }
    run(local, folder.path(), OutputStore::Existing::Resume);
    CHECK(tree(folder.path()) == expected);
  }
}

TEST_CASE("An existing dataset is refused, and a different one is not resumed", "[store]") {
  const TemporaryFolder folder;
  LocalFileSystem local;
  run(local, folder.path(), OutputStore::Existing::Refuse);
  const auto before = tree(folder.path());
  OutputStore store(local, folders_in(folder.path()), kCaptures);
  CHECK_THROWS_WITH(store.check(kDataset, OutputStore::Existing::Refuse),
                    ContainsSubstring("already holds a dataset with 3 captures") &&
                        ContainsSubstring("--resume") && ContainsSubstring("--overwrite"));
  CHECK_THROWS_WITH(
      store.check(R"({"seed": 5, "job": "a"})", OutputStore::Existing::Resume),
      ContainsSubstring("dataset.json: belongs to another job or version (differs in: seed)"));
  CHECK(tree(folder.path()) == before);
}

TEST_CASE("An output that cannot be written is found before anything is done", "[store]") {
  const TemporaryFolder folder;
  std::ofstream(folder.path() / "file") << "no folder";
  LocalFileSystem local;
  OutputFolders folders = folders_in(folder.path());
  folders.writers[1].folder = folder.path() / "file" / "below";
  OutputStore store(local, folders, kCaptures);
  CHECK_THROWS_WITH(store.check(kDataset, OutputStore::Existing::Refuse),
                    ContainsSubstring((folder.path() / "file").string()));
  CHECK(tree(folder.path()).size() == 1);
  CHECK_FALSE(fs::exists(folder.path() / "out"));

  OutputStore fine(local, folders_in(folder.path()), kCaptures);
  fine.check(kDataset, OutputStore::Existing::Refuse);
  CHECK_FALSE(fs::exists(folder.path() / "out"));
}

TEST_CASE("Files of writers stay inside their folders", "[store]") {
  Transaction transaction;
  CollectedFiles files(transaction, 0, "sly");
  for (const char* path : {"", "/etc/passwd", "../up.txt", "a/../../b", "a/", "./a", "a\\b"}) {
    CAPTURE(path);
    CHECK_THROWS_WITH(files.add_text(path, "x"),
                      ContainsSubstring("writer 'sly'") && ContainsSubstring(path));
  }
  files.add_text("a/b/c.txt", "x");
  CHECK(transaction.files.size() == 1);
  CHECK_THROWS_WITH(files.record("two\nlines"), ContainsSubstring("line break"));
}

TEST_CASE("What is appended to a file leaves the memory and comes out whole", "[store]") {
  const TemporaryFolder folder;
  LocalFileSystem local;
  OutputStore store(local, folders_in(folder.path()), 1);
  store.check(kDataset, OutputStore::Existing::Refuse);
  store.open(OutputStore::Existing::Refuse, {0});
  std::string odd, even;
  {
    Transaction transaction = store.capture_transaction(0);
    CollectedFiles files(transaction, 0, "one");
    files.append_text("empty.txt", "");
    for (int i = 0; i < 40; ++i) {
      const std::string piece(50'000 + std::size_t(i), char('a' + i % 26));
      files.append_text(i % 2 == 0 ? "even.txt" : "odd.txt", piece);
      (i % 2 == 0 ? even : odd) += piece;
      std::size_t kept = 0;
      for (const StagedFile& file : transaction.files) kept += file.bytes.size();
      CHECK(kept < 2 * CollectedFiles::kKeptBytes);
    }
    files.add("large.bin", std::vector<std::byte>(3'000'000, std::byte(7)));
    CHECK(transaction.files.back().bytes.empty());
    store.commit_capture(0, transaction);
  }
  const auto files = tree(folder.path() / "out/one");
  CHECK(files.size() == 4);
  CHECK(files.at("even.txt") == even);
  CHECK(files.at("odd.txt") == odd);
  CHECK(files.at("empty.txt").empty());
  CHECK(files.at("large.bin") == std::string(3'000'000, '\7'));
  CHECK(store.bytes_written() == odd.size() + even.size() + 3'000'000);
}

TEST_CASE("What a stage holds goes when its transaction is not committed", "[store]") {
  const TemporaryFolder folder;
  LocalFileSystem local;
  OutputStore store(local, folders_in(folder.path()), 1);
  store.check(kDataset, OutputStore::Existing::Refuse);
  store.open(OutputStore::Existing::Refuse, {0});
  {
    Transaction transaction = store.capture_transaction(0);
    CollectedFiles files(transaction, 0, "one");
    files.add("large.bin", std::vector<std::byte>(3'000'000, std::byte(7)));
    CHECK(tree(folder.path() / "out/one").size() == 1);
  }
  CHECK(tree(folder.path() / "out/one").empty());
}

TEST_CASE("Two files of one name in a capture are an error", "[store]") {
  const TemporaryFolder folder;
  LocalFileSystem local;
  OutputFolders folders = folders_in(folder.path());
  folders.writers[1].folder = folders.writers[0].folder;
  OutputStore store(local, folders, 1);
  store.check(kDataset, OutputStore::Existing::Refuse);
  store.open(OutputStore::Existing::Refuse, {0});
  Transaction transaction;
  transaction.files.push_back({0, "a/x.png", bytes_of("1")});
  transaction.files.push_back({1, "a/x.png", bytes_of("2")});
  CHECK_THROWS_WITH(store.commit_capture(0, transaction),
                    ContainsSubstring("a/x.png: two files of one capture have this name"));
}
