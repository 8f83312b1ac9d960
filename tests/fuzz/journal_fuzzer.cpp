// SPDX-License-Identifier: Apache-2.0
//
// A dataset whose journal others wrote. The first byte says how it is joined; each further line is
// one of a worker's index:
//   c ENTRY TEXT   an entry with this text; place and digest are put right
//   h TEXT         the same for the header
//   !LINE          as it is, without a checksum
//   LINE           with its checksum put right
// Refusing is fine; crashing, hanging and touching what belongs to no dataset are findings.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <map>
#include <string>
#include <string_view>

#include "diorama/error.h"
#include "framework/output/output_store.h"
#include "tests/framework/output/simulated_disk.h"

namespace {

using namespace diorama;

constexpr int kCaptures = 40;

class StrangersJournal {
 public:
  void add(std::string_view line) {
    if (line.starts_with("c ")) {
      const std::size_t end = std::min(line.find(' ', 2), line.size());
      add_entry(std::string(line.substr(0, end)), line.substr(std::min(end + 1, line.size())));
    } else if (line.starts_with("h ")) {
      add_entry("h", line.substr(2));
    } else if (line.starts_with("!")) {
      index_ += line.substr(1);
      index_ += '\n';
    } else {
      index_ += journal_line(std::string(line));
    }
  }
  void put_on(test::SimulatedDisk& disk) const {
    disk.put("/data/out/.diorama/journal/w.index", index_);
    disk.put("/data/out/.diorama/journal/w.entries", entries_);
  }

 private:
  void add_entry(const std::string& begin, std::string_view text) {
    const std::string entry = std::string(text) + "\n";
    const auto digest = digest_of(std::as_bytes(std::span(entry)));
    index_ += journal_line(begin + " " + std::to_string(entries_.size()) + " " +
                           std::to_string(entry.size()) + " " + digest);
    entries_ += entry;
  }
  std::string index_;
  std::string entries_;
};

void join(test::SimulatedDisk& disk, unsigned how) {
  test::SimulatedProcess process(disk);
  OutputStore::Options options;
  options.existing =
      (how & 1) != 0 ? OutputStore::Existing::Overwrite : OutputStore::Existing::Resume;
  options.verifies_all = (how & 2) != 0;
  options.takes_visits = (how & 4) != 0;
  options.self = {"me", "host", "machine", 1};
  options.beats = false;
  OutputFolders folders{"/data", "out", {{"one", "out/one"}, {"two", "elsewhere"}}};
  try {
    OutputStore store(process, folders, kCaptures, options);
    store.join("{}");
    store.open();
    Transaction capture = store.capture_transaction(1);
    CollectedFiles files(capture, 0, "one");
    files.add_text("new.txt", "new");
    if (!store.is_done(1)) store.commit_capture(1, capture);
    store.read_records(0, [](int, std::string_view) {});
    store.close();
  } catch (const Error&) {
    return;
  } catch (const Busy&) {
    return;
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  test::SimulatedDisk disk(1);
  // Without workers' leases the journal's writer is dead.
  disk.put("/data/out/dataset.json", "{}");
  disk.put("/data/out/one/rgb_0.png", "colour");
  disk.put("/data/notes/mine.txt", "mine");
  disk.put("/victim/deep/file", "precious");
  disk.put("/data/out/.diorama/stage/w/000001-0", "staged");
  StrangersJournal journal;
  std::string_view lines(reinterpret_cast<const char*>(data) + 1, size - 1);
  while (!lines.empty()) {
    const std::size_t end = std::min(lines.find('\n'), lines.size());
    journal.add(lines.substr(0, end));
    lines.remove_prefix(std::min(end + 1, lines.size()));
  }
  journal.put_on(disk);
  join(disk, data[0]);
  const std::map<std::string, std::string> victim{{"deep/file", "precious"}};
  const std::map<std::string, std::string> notes{{"mine.txt", "mine"}};
  if (disk.tree("/victim") != victim || disk.tree("/data/notes") != notes) std::abort();
  return 0;
}
