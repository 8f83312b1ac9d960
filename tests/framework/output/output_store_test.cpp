// SPDX-License-Identifier: Apache-2.0
#include "framework/output/output_store.h"

#include <sys/stat.h>
#include <unistd.h>

#include <climits>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <map>
#include <sstream>
#include <stop_token>
#include <thread>

#include "diorama/error.h"
#include "framework/output/memory_file_system.h"
#include "framework/output/workers.h"
#include "simulated_disk.h"
#include "support/catch.h"

using namespace diorama;
using namespace diorama::test;
namespace fs = std::filesystem;

namespace {

using Existing = OutputStore::Existing;

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

std::vector<std::byte> bytes_of(const std::string& text) {
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

/// What a machine takes to come back: its workers' leases may be torn, but are old by then.
constexpr double kRestartSeconds = 300;

const std::string kDataset = R"({"seed": 4, "job": "a"})";

/// One of its files waits in the stage, in two pieces.
Transaction capture_files(OutputStore& store, int capture) {
  Transaction transaction = store.capture_transaction(capture);
  CollectedFiles first(transaction, 0, "one");
  first.add_text("rgb_" + std::to_string(capture) + ".png", "colour " + std::to_string(capture));
  const std::string depth = "depth/" + std::to_string(capture) + ".npy";
  first.append_text(depth, std::string(300, char('a' + capture % 26)));
  transaction.stage->put(1, transaction.files[1]);
  first.append_text(depth, "end");
  first.record("line " + std::to_string(capture));
  first.keep(bytes_of("kept by "));
  transaction.stage->put(2, transaction.files[2]);
  first.keep(bytes_of(std::to_string(capture) + "\n"));
  CollectedFiles second(transaction, 1, "two");
  second.add_text("boxes/deep/" + std::to_string(capture) + ".json", "{}");
  return transaction;
}

void commit(OutputStore& store, int capture) {
  Transaction transaction = capture_files(store, capture);
  store.commit_capture(capture, transaction);
}

OutputFolders folders_in(const fs::path& root) {
  return {root, "out", {{"one", "out/one"}, {"two", "elsewhere"}}};
}

/// One process that works on a dataset.
struct Job {
  int captures = 3;
  Existing existing = Existing::Refuse;
  int shard = 0;
  int shards = 1;
  bool takes_visits = false;
  bool verifies_all = false;
  std::string dataset = kDataset;
  std::string name = "w1";
  std::string machine = "machine";
  int lease_timeout_s = 120;
};

OutputStore::Options options_of(const Job& job) {
  OutputStore::Options options;
  options.existing = job.existing;
  options.shard = job.shard;
  options.shards = job.shards;
  options.takes_visits = job.takes_visits;
  options.verifies_all = job.verifies_all;
  options.lease_timeout = std::chrono::seconds(job.lease_timeout_s);
  options.self = {job.name, "host-of-" + job.name, job.machine, 4711};
  options.beats = false;
  return options;
}

void finish(OutputStore& store, const std::function<void()>& begin) {
  store.refresh();
  if (!store.is_complete() || store.is_finished()) return;
  begin();
  if (!store.claim_finish()) return;
  Transaction files = store.finish_transaction();
  CollectedFiles last(files, 0, "one");
  store.read_records(0, [&](int capture, std::string_view line) {
    last.append_text("all.txt", std::to_string(capture) + "=" + std::string(line) + ";");
    last.append_kept(capture % 2 == 0 ? "shared/even.txt" : "shared/odd.txt", capture);
  });
  store.commit_finish(files);
}

/// What a run does with its store; visits are of two captures. Returns whether it saw the dataset
/// finished.
bool run(FileSystem& file_system, const fs::path& root, const Job& job) {
  OutputStore store(file_system, folders_in(root), job.captures, options_of(job));
  store.join(job.dataset);
  bool has_begun = false;
  const auto begin = [&] {
    if (std::exchange(has_begun, true)) return;
    store.open();
    Transaction classes;
    classes.files.push_back({0, "classes.txt", bytes_of("mug")});
    store.commit_begin(classes);
  };
  const auto make_visit = [&](int visit) {
    for (int i = 2 * visit; i < std::min(job.captures, 2 * visit + 2); ++i) {
      if (store.is_done(i)) continue;
      begin();
      commit(store, i);
    }
  };
  const int visits = (job.captures + 1) / 2;
  if (job.takes_visits) {
    const auto needs_work = [&](int visit) {
      return !store.is_done(2 * visit) ||
             (2 * visit + 1 < job.captures && !store.is_done(2 * visit + 1));
    };
    while (const auto visit = store.claim_visit(visits, needs_work)) make_visit(*visit);
  } else {
    for (int visit = job.shard; visit < visits; visit += job.shards) make_visit(visit);
  }
  finish(store, begin);
  store.refresh();
  const bool is_finished = store.is_finished();
  store.close();
  return is_finished;
}

using Files = std::map<std::string, std::string>;

/// Without what workers keep for themselves.
Files dataset_files(Files files) {
  std::erase_if(files,
                [](const auto& file) { return file.first.find(".diorama/") != std::string::npos; });
  return files;
}

Files tree(const fs::path& root) {
  Files files;
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

Files expected_files(int captures) {
  SimulatedDisk disk(1);
  SimulatedProcess process(disk);
  Job job;
  job.captures = captures;
  run(process, "/data", job);
  return dataset_files(disk.tree("/data"));
}

int visible_files_of(const Files& files, int capture) {
  const std::string number = std::to_string(capture);
  return int(files.contains("out/one/rgb_" + number + ".png")) +
         int(files.contains("out/one/depth/" + number + ".npy")) +
         int(files.contains("elsewhere/boxes/deep/" + number + ".json"));
}

/// Captures that any journal committed, by its own words.
std::set<int> committed(const Files& files) {
  std::set<int> captures;
  for (const auto& [name, text] : files) {
    if (!name.ends_with(".index")) continue;
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) {
      if (line.starts_with("c 0")) captures.insert(std::stoi(line.substr(2, 6)));
    }
  }
  return captures;
}

Job resuming(std::string name, int captures = 3) {
  Job job;
  job.captures = captures;
  job.existing = Existing::Resume;
  job.name = std::move(name);
  return job;
}

/// The text of what the action throws; empty when it throws no such thing.
template <class Exception, class Action>
std::string thrown(Action action) {
  try {
    action();
  } catch (const Exception& exception) {
    return exception.what();
  }
  return {};
}

int steps_of_a_run(const Job& job) {
  SimulatedDisk disk(1);
  SimulatedProcess process(disk);
  run(process, "/data", job);
  return process.steps();
}

}  // namespace

TEST_CASE("A whole run leaves its files, its journal and nothing else", "[store]") {
  const TemporaryFolder folder;
  LocalFileSystem local;
  CHECK(run(local, folder.path(), {}));
  const auto files = tree(folder.path());
  CHECK(files.size() == 1 + 1 + 3 * 3 + 3 + 2);
  CHECK(files.at("out/dataset.json") == kDataset);
  CHECK(files.at("out/one/rgb_2.png") == "colour 2");
  CHECK(files.at("out/one/all.txt") == "0=line 0;1=line 1;2=line 2;");
  CHECK(files.at("out/one/shared/even.txt") == "kept by 0\nkept by 2\n");
  CHECK(files.at("out/one/shared/odd.txt") == "kept by 1\n");
  CHECK(files.contains("out/.diorama/journal/w1.index"));
  for (const char* name : {"stage", "workers", "claims", "kept"}) {
    CHECK_FALSE(fs::exists(folder.path() / "out/.diorama" / name));
  }
  // The simulated disk does the same.
  CHECK(dataset_files(files) == expected_files(3));
}

TEST_CASE("Wherever a run is killed, whole captures are left and a resumed run completes them",
          "[store]") {
  const Files expected = expected_files(3);
  const int steps = steps_of_a_run({});
  REQUIRE(steps > 100);
  for (int at = 1; at <= steps; ++at) {
    for (const bool is_fault : {false, true}) {
      CAPTURE(at, is_fault);
      SimulatedDisk disk(std::uint64_t(at) * 2 + is_fault);
      {
        SimulatedProcess process(disk);
        is_fault ? process.fail_at(at) : process.kill_at(at);
        try {
          run(process, "/data", {});
          // A fault in clearing up is passed over.
          CHECK(is_fault);
        } catch (const Killed&) {
          CHECK_FALSE(is_fault);
        } catch (const Error& error) {
          CHECK_THAT(error.what(), ContainsSubstring("No space left on device"));
        }
      }
      const Files left = disk.tree("/data");
      for (int capture = 0; capture < 3; ++capture) {
        if (!committed(left).contains(capture)) CHECK(visible_files_of(left, capture) == 0);
      }
      SimulatedProcess second(disk);
      CHECK(run(second, "/data", resuming("w2")));
      CHECK(dataset_files(disk.tree("/data")) == expected);
    }
  }
}

TEST_CASE("A power cut at any step loses no capture that the journal calls done", "[store]") {
  const Files expected = expected_files(5);
  Job job;
  job.captures = 5;
  const int steps = steps_of_a_run(job);
  for (int at = 1; at <= steps; ++at) {
    for (std::uint64_t seed = 1; seed <= 6; ++seed) {
      CAPTURE(at, seed);
      SimulatedDisk disk(seed * 1000 + std::uint64_t(at));
      {
        SimulatedProcess process(disk);
        process.kill_at(at);
        try {
          run(process, "/data", job);
        } catch (const Killed&) {
        }
      }
      disk.cut_power();
      disk.wait(kRestartSeconds);
      SimulatedProcess second(disk);
      const Job again = resuming("w2", 5);
      CHECK(run(second, "/data", again));
      CHECK(dataset_files(disk.tree("/data")) == expected);
    }
  }
}

TEST_CASE("What was there when a run ended survives a power cut as it is", "[store]") {
  const Files expected = expected_files(70);
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SimulatedDisk disk(seed);
    {
      SimulatedProcess process(disk);
      Job job;
      job.captures = 70;
      CHECK(run(process, "/data", job));
    }
    disk.cut_power();
    CHECK(dataset_files(disk.tree("/data")) == expected);
  }
}

TEST_CASE("A resumed run may be cut as well", "[store]") {
  const Files expected = expected_files(4);
  SimulatedDisk disk(3);
  // Every attempt gets a little further.
  for (int at = 3; at < 300; at += 3) {
    SimulatedProcess process(disk);
    process.kill_at(at);
    try {
      run(process, "/data", resuming("w" + std::to_string(at), 4));
    } catch (const Killed&) {
    }
    if (at % 2 == 0) disk.cut_power();
    disk.wait(kRestartSeconds);
  }
  SimulatedProcess last(disk);
  CHECK(run(last, "/data", resuming("last", 4)));
  CHECK(dataset_files(disk.tree("/data")) == expected);
}

TEST_CASE("Workers that start, double, die and come back lose nothing and fail for no reason",
          "[store]") {
  constexpr int kCaptures = 14;
  const Files expected = expected_files(kCaptures);
  int finished = 0;
  int killed = 0;
  int busy = 0;
  // More of them by night: tests/nightly.sh.
  const char* const wanted = std::getenv("DIORAMA_STORE_SEEDS");
  const std::uint64_t seeds = wanted ? std::strtoull(wanted, nullptr, 10) : 60;
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    CAPTURE(seed);
    SimulatedDisk disk(seed);
    std::mt19937_64 random(seed * 77);
    disk.set_step_time(seed % 2 == 0 ? 0.002 : 0.120);
    const bool takes_visits = seed % 3 == 0;
    std::mutex mutex;
    std::vector<std::string> faults;
    int names = 0;
    for (int round = 0; round < 3; ++round) {
      std::vector<std::function<void()>> processes;
      // Two of the five have the same shard; the last round is the doubled one, and nobody dies.
      for (int i = 0; i < 5; ++i) {
        Job job = resuming("w" + std::to_string(names++), kCaptures);
        job.shard = i % 4;
        job.shards = 4;
        job.takes_visits = takes_visits;
        // Some share a machine, and where they do not, only silence tells that a worker is gone.
        job.machine = seed % 5 == 0 ? job.name : "machine";
        job.lease_timeout_s = 30;
        const int kill_at = round < 2 && random() % 3 != 0 ? int(random() % 400) + 1 : 0;
        processes.push_back([&, job, kill_at] {
          SimulatedProcess process(disk);
          process.set_locks(seed % 5 != 0);
          process.kill_at(kill_at);
          try {
            const bool is_finished = run(process, "/data", job);
            const std::lock_guard lock(mutex);
            finished += is_finished;
            if (is_finished && dataset_files(disk.tree("/data")) != expected) {
              faults.push_back(job.name + " called a dataset finished that is not");
            }
          } catch (const Killed&) {
            const std::lock_guard lock(mutex);
            ++killed;
          } catch (const Busy&) {
            const std::lock_guard lock(mutex);
            ++busy;
          } catch (const std::exception& error) {
            const std::lock_guard lock(mutex);
            faults.push_back(job.name + ": " + error.what());
          }
        });
      }
      disk.run(processes);
      disk.wait(3600);
    }
    CHECK(faults == std::vector<std::string>());
    // Shards whose owners all died or were busy are made by one more start of each.
    for (int shard = 0; shard < 4; ++shard) {
      SimulatedProcess process(disk);
      Job job = resuming("last" + std::to_string(shard), kCaptures);
      job.shard = shard;
      job.shards = 4;
      job.takes_visits = takes_visits;
      run(process, "/data", job);
    }
    CHECK(dataset_files(disk.tree("/data")) == expected);
    const Files left = disk.tree("/data/out/.diorama");
    for (const auto& [name, text] : left) CHECK(name.starts_with("journal/"));
  }
  CHECK(finished > 20);
  CHECK(killed > 60);
  CHECK(busy > 20);
}

TEST_CASE("Two jobs that start into one new folder do not both succeed", "[store]") {
  int both_refused = 0;
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    CAPTURE(seed);
    SimulatedDisk disk(seed);
    std::mutex mutex;
    int succeeded = 0;
    std::vector<std::function<void()>> processes;
    for (const int i : {0, 1}) {
      processes.push_back([&, i] {
        Job job;
        // Two whole runs, or shards of the same split of different jobs.
        job.existing = seed % 2 == 0 ? Existing::Refuse : Existing::Resume;
        job.shard = seed % 2 == 0 ? 0 : i;
        job.shards = seed % 2 == 0 ? 1 : 2;
        job.dataset = i == 0 ? kDataset : R"({"seed": 5, "job": "a"})";
        job.name = "w" + std::to_string(i);
        SimulatedProcess process(disk);
        try {
          run(process, "/data", job);
          const std::lock_guard lock(mutex);
          ++succeeded;
        } catch (const Busy&) {
        } catch (const Error& error) {
          const std::string text = error.what();
          CHECK((text.find("belongs to another job") != std::string::npos ||
                 text.find("already holds a dataset") != std::string::npos));
        }
      });
    }
    disk.run(processes);
    CHECK(succeeded <= 1);
    both_refused += succeeded == 0;
  }
  CHECK(both_refused < 40);
}

TEST_CASE("A dataset in memory has the files of one on a disk, and is held by one process",
          "[store]") {
  MemoryFileSystem memory;
  OutputStore holder(memory, folders_in("/data"), 8, options_of(resuming("w1", 8)));
  holder.join(kDataset);
  holder.open();
  commit(holder, 0);
  CHECK_THROWS_AS(run(memory, "/data", resuming("w2", 8)), Busy);
  holder.close();
  CHECK(run(memory, "/data", resuming("w3", 8)));
  Files files;
  const std::function<void(const fs::path&)> collect = [&](const fs::path& folder) {
    for (const std::string& name : memory.list(folder)) {
      const fs::path path = folder / name;
      if (memory.status(path)->kind == FileStatus::Kind::Folder) {
        collect(path);
      } else {
        files[path.lexically_relative("/data").string()] = memory.read(path);
      }
    }
  };
  collect("/data");
  CHECK(dataset_files(files) == expected_files(8));
  CHECK_THROWS_AS(memory.read("/data/nothing"), NotThere);
  CHECK_THROWS_AS(memory.write("/nowhere/file", {}), NotThere);
}

TEST_CASE("A living worker keeps its part; the message names it", "[store]") {
  SimulatedDisk disk(1);
  SimulatedProcess first(disk);
  OutputStore holder(first, folders_in("/data"), 8, options_of(resuming("w1", 8)));
  holder.join(kDataset);
  holder.open();
  commit(holder, 0);

  SimulatedProcess second(disk);
  disk.wait(40);
  CHECK(thrown<Busy>([&] { run(second, "/data", resuming("w2", 8)); }) ==
        "/data/out: another process works on this dataset as the only worker, too (host "
        "host-of-w1, process 4711, last sign of life 40 s ago); wait for it or stop it first");
  Job shard = resuming("w3", 8);
  shard.shards = 3;
  shard.shard = 1;
  CHECK_THAT(thrown<Busy>([&] { run(second, "/data", shard); }),
             ContainsSubstring("works on this dataset as the only worker (host host-of-w1, process "
                               "4711"));
  Job overwriting = resuming("w4", 8);
  overwriting.existing = Existing::Overwrite;
  CHECK_THROWS_AS(run(second, "/data", overwriting), Busy);
  // Nothing of it was touched.
  commit(holder, 1);
  holder.close();
  CHECK(run(second, "/data", resuming("w5", 8)));
  CHECK(dataset_files(disk.tree("/data")) == expected_files(8));
}

namespace {

/// Others go on before it locks its first file.
class SlowToLock final : public SimulatedProcess {
 public:
  SlowToLock(SimulatedDisk& disk, std::function<void()> meanwhile)
      : SimulatedProcess(disk), meanwhile_(std::move(meanwhile)) {}
  std::unique_ptr<FileLock> lock(const fs::path& file) override {
    if (const auto meanwhile = std::exchange(meanwhile_, nullptr)) meanwhile();
    return SimulatedProcess::lock(file);
  }

 private:
  std::function<void()> meanwhile_;
};

Job shard_of(std::string name, int shard, int shards, int captures) {
  Job job = resuming(std::move(name), captures);
  job.shard = shard;
  job.shards = shards;
  return job;
}

}  // namespace

TEST_CASE("A worker that others overtake while it joins is not taken for dead", "[store]") {
  for (const bool is_finished : {false, true}) {
    CAPTURE(is_finished);
    SimulatedDisk disk(1);
    SimulatedProcess before(disk);
    // Who leaves a finished dataset sweeps what looks like the rest of dead workers.
    if (is_finished) REQUIRE(run(before, "/data", resuming("w0", 8)));
    SimulatedProcess second(disk);
    SlowToLock first(disk, [&] { run(second, "/data", shard_of("w2", 1, 2, 8)); });
    CHECK(run(first, "/data", shard_of("w1", 0, 2, 8)));
    const Files left = disk.tree("/data");
    CHECK(dataset_files(left) == expected_files(8));
    for (const auto& [name, text] : disk.tree("/data/out/.diorama")) {
      CHECK(name.starts_with("journal/"));
    }
  }
}

TEST_CASE("Without locks the workers of one machine do not take each other for dead", "[store]") {
  constexpr int kShards = 4;
  SimulatedDisk disk(1);
  std::vector<std::unique_ptr<SimulatedProcess>> processes;
  std::vector<std::unique_ptr<OutputStore>> stores;
  for (int shard = 0; shard < kShards; ++shard) {
    processes.push_back(std::make_unique<SimulatedProcess>(disk));
    processes.back()->set_locks(false);
    const Job job = shard_of("w" + std::to_string(shard), shard, kShards, kShards);
    stores.push_back(std::make_unique<OutputStore>(*processes.back(), folders_in("/data"), kShards,
                                                   options_of(job)));
    stores.back()->join(kDataset);
    stores.back()->open();
  }
  for (int shard = 0; shard < kShards; ++shard) commit(*stores[std::size_t(shard)], shard);
  // A silent one is dead, after a while.
  processes.push_back(std::make_unique<SimulatedProcess>(disk));
  processes.back()->set_locks(false);
  const Job again = shard_of("again", 0, kShards, kShards);
  CHECK_THROWS_AS(run(*processes.back(), "/data", again), Busy);
  disk.wait(kRestartSeconds);
  CHECK(run(*processes.back(), "/data", again));
  CHECK(dataset_files(disk.tree("/data")) == expected_files(kShards));
}

TEST_CASE("A stranger's lease says who it is on one line", "[store]") {
  SimulatedDisk disk(1);
  SimulatedProcess process(disk);
  process.make_folders("/data/workers");
  disk.put("/data/workers/auto~x",
           R"({"host": "n07\u001b[2J\nworker y", "process": 7, "machine": "m"})");
  Workers workers(process, "/data", this_worker(), std::chrono::seconds(120));
  REQUIRE(workers.others().size() == 1);
  const std::string who = workers.describe(workers.others().front());
  INFO(who);
  CHECK(who.starts_with("host n07\\x1B[2J\\x0Aworker y, process 7"));
}

TEST_CASE("A file that others remove between two looks is gone, and no failure", "[store]") {
  const TemporaryFolder folder;
  const fs::path lease = folder.path() / "lease";
  LocalFileSystem local;
  {
    // Both outcomes are right at any moment; how often each is met is the scheduler's affair.
    const std::jthread other([&](const std::stop_token& stop) {
      LocalFileSystem its_own;
      while (!stop.stop_requested()) {
        its_own.write(lease, bytes_of("who"));
        its_own.remove_file(lease);
      }
    });
    for (int i = 0; i < 30000; ++i) {
      const std::string text = local.read_part(lease, 0, 100);
      if (!text.empty() && text != "who") FAIL("read \"" << text << "\"");
      if (local.is_locked(lease)) FAIL("nobody locks it");
    }
  }
  CHECK(local.read_part(lease, 0, 100).empty());
  local.write(lease, bytes_of("who"));
  CHECK(local.read_part(lease, 0, 100) == "who");
}

TEST_CASE("A worker that was cut off for too long stops when it comes back", "[store]") {
  SimulatedDisk disk(1);
  SimulatedProcess first(disk);
  first.set_locks(false);
  OutputStore cut_off(first, folders_in("/data"), 8, options_of(resuming("w1", 8)));
  cut_off.join(kDataset);
  cut_off.open();
  commit(cut_off, 0);
  SimulatedProcess second(disk);
  second.set_locks(false);
  Job other = resuming("w2", 8);
  other.machine = "another machine";
  disk.wait(100);
  CHECK_THROWS_AS(run(second, "/data", other), Busy);
  disk.wait(100);
  CHECK(run(second, "/data", other));
  CHECK_THAT(thrown<Busy>([&] { commit(cut_off, 1); }),
             ContainsSubstring("other processes took this one for dead"));
  CHECK(dataset_files(disk.tree("/data")) == expected_files(8));
}

TEST_CASE("A dataset that is moved away while it is made is one message, and goes on elsewhere",
          "[store]") {
  const TemporaryFolder folder;
  LocalFileSystem local;
  const fs::path before = folder.path() / "before";
  const fs::path after = folder.path() / "after";
  {
    OutputStore store(local, folders_in(before), 3, options_of({}));
    store.join(kDataset);
    store.open();
    commit(store, 0);
    fs::rename(before, after);
    CHECK(thrown<Error>([&] { commit(store, 1); }) ==
          (before / "out").string() +
              ": the dataset is gone; it was removed or moved while this process worked on it");
  }
  CHECK_FALSE(fs::exists(before));
  CHECK(run(local, after, resuming("w2")));
  CHECK(dataset_files(tree(after)) == expected_files(3));
}

TEST_CASE("Overwriting removes all files of the old dataset, others stay", "[store]") {
  const TemporaryFolder folder;
  LocalFileSystem local;
  Job longer;
  longer.captures = 9;
  run(local, folder.path(), longer);
  std::ofstream(folder.path() / "out/one/notes.txt") << "mine";
  Job job = resuming("w2");
  job.existing = Existing::Overwrite;
  CHECK(run(local, folder.path(), job));
  auto now = dataset_files(tree(folder.path()));
  CHECK(now.erase("out/one/notes.txt") == 1);
  CHECK(now == expected_files(3));
}

TEST_CASE("Overwriting with a job of other writers leaves nothing of the old ones", "[store]") {
  SimulatedDisk disk(1);
  SimulatedProcess process(disk);
  run(process, "/data", {});
  disk.put("/data/new/rgb_0.png", "a picture of mine");
  disk.put("/data/elsewhere/mine.txt", "mine, too");
  disk.put("/data/out/one/new_0.png", "and mine");
  Job job = resuming("w2", 1);
  job.existing = Existing::Overwrite;
  const Files before = dataset_files(disk.tree("/data"));
  {
    // Found before anything is removed.
    OutputStore store(process, {"/data", "out", {{"one", "new"}}}, 1, options_of(job));
    store.join(kDataset);
    CHECK(thrown<Error>([&] { store.open(); }) ==
          "/data/new: holds 'rgb_0.png', which is not of the dataset that is replaced; move it "
          "away or choose another folder");
  }
  CHECK(dataset_files(disk.tree("/data")) == before);
  {
    OutputStore store(process, {"/data", "out", {{"one", "out/one"}}}, 1, options_of(job));
    store.join(kDataset);
    store.open();
    Transaction capture;
    capture.files.push_back({0, "new_0.png", bytes_of("colour 0")});
    CHECK_THROWS_WITH(store.commit_capture(0, capture),
                      ContainsSubstring("/data/out/one/new_0.png: exists with another content than "
                                        "000000 has") &&
                          ContainsSubstring("move it away"));
  }
  CHECK(dataset_files(disk.tree("/data")) == Files{{"out/dataset.json", kDataset},
                                                   {"new/rgb_0.png", "a picture of mine"},
                                                   {"out/one/new_0.png", "and mine"},
                                                   {"elsewhere/mine.txt", "mine, too"}});
}

TEST_CASE("An overwriting run that is cut never resurrects old captures", "[store]") {
  // The old dataset has other contents under the same names.
  const Files expected = expected_files(3);
  const std::string old_dataset = R"({"seed": 1})";
  const auto make_old = [&](SimulatedDisk& disk) {
    SimulatedProcess process(disk);
    OutputStore store(process, folders_in("/data"), 3, options_of({}));
    store.join(old_dataset);
    store.open();
    for (int i = 0; i < 3; ++i) {
      Transaction capture;
      capture.files.push_back({0, "rgb_" + std::to_string(i) + ".png", bytes_of("old")});
      store.commit_capture(i, capture);
    }
    Transaction end;
    end.files.push_back({0, "all.txt", bytes_of("old")});
    store.refresh();
    REQUIRE(store.claim_finish());
    store.commit_finish(end);
    store.close();
  };
  Job job = resuming("w2");
  job.existing = Existing::Overwrite;
  int steps = 0;
  {
    SimulatedDisk disk(1);
    make_old(disk);
    SimulatedProcess process(disk);
    run(process, "/data", job);
    steps = process.steps();
    CHECK(dataset_files(disk.tree("/data")) == expected);
  }
  for (int at = 1; at <= steps; ++at) {
    for (const bool loses_power : {false, true}) {
      CAPTURE(at, loses_power);
      SimulatedDisk disk(std::uint64_t(at) * 2 + loses_power);
      make_old(disk);
      {
        SimulatedProcess process(disk);
        process.kill_at(at);
        try {
          run(process, "/data", job);
        } catch (const Killed&) {
        }
      }
      if (loses_power) disk.cut_power();
      disk.wait(kRestartSeconds);
      SimulatedProcess second(disk);
      bool is_finished = false;
      const std::string refusal =
          thrown<Error>([&] { is_finished = run(second, "/data", resuming("w3")); });
      if (refusal.empty()) {
        CHECK(is_finished);
        CHECK(dataset_files(disk.tree("/data")) == expected);
      } else {
        // Where the removal had not begun, it is still the old dataset, whole.
        CHECK_THAT(refusal, ContainsSubstring("belongs to another job"));
        CHECK(disk.tree("/data").at("out/dataset.json") == old_dataset);
        CHECK(disk.tree("/data").at("out/one/all.txt") == "old");
      }
    }
  }
}

TEST_CASE("An existing dataset is refused, and a different one is not resumed", "[store]") {
  const TemporaryFolder folder;
  LocalFileSystem local;
  run(local, folder.path(), {});
  const auto before = tree(folder.path());
  Job again;
  again.name = "w2";
  CHECK_THROWS_WITH(run(local, folder.path(), again),
                    ContainsSubstring("already holds a dataset with 3 captures") &&
                        ContainsSubstring("--resume") && ContainsSubstring("--overwrite"));
  Job other = resuming("w3");
  other.dataset = R"({"seed": 5, "job": "a"})";
  CHECK_THROWS_WITH(
      run(local, folder.path(), other),
      ContainsSubstring("dataset.json: belongs to another job or version (differs in: seed)"));
  CHECK(tree(folder.path()) == before);
  CHECK(run(local, folder.path(), resuming("w4")));
  CHECK(dataset_files(tree(folder.path())) == dataset_files(before));
}

TEST_CASE("An output that cannot be written is found before anything is done", "[store]") {
  const TemporaryFolder folder;
  std::ofstream(folder.path() / "file") << "no folder";
  LocalFileSystem local;
  OutputFolders folders = folders_in(folder.path());
  folders.writers[1].folder = "file/below";
  {
    OutputStore store(local, folders, 3, options_of({}));
    CHECK_THROWS_WITH(store.join(kDataset), "cannot create the folder " +
                                                (folder.path() / "file/below").string() +
                                                ": Not a directory");
  }
  CHECK(tree(folder.path()).size() == 1);
  CHECK_FALSE(fs::exists(folder.path() / "out"));
  {
    OutputStore fine(local, folders_in(folder.path()), 3, options_of({}));
    fine.join(kDataset);
  }
  // It ended before its first capture.
  CHECK_FALSE(fs::exists(folder.path() / "out"));
}

TEST_CASE("What is missing or damaged is made anew when all is verified", "[store]") {
  const Files expected = expected_files(6);
  SimulatedDisk disk(1);
  SimulatedProcess process(disk);
  Job job;
  job.captures = 6;
  run(process, "/data", job);
  disk.erase("/data/out/one/rgb_1.png");
  disk.put("/data/out/one/depth/4.npy", "short");
  CHECK(run(process, "/data", resuming("w2", 6)));
  CHECK(dataset_files(disk.tree("/data")) != expected);
  Job verifying = resuming("w3", 6);
  verifying.verifies_all = true;
  std::vector<std::string> said;
  {
    auto options = options_of(verifying);
    options.warn = [&](const std::string& text) { said.push_back(text); };
    OutputStore store(process, folders_in("/data"), 6, options);
    store.join(kDataset);
    CHECK_FALSE(store.is_done(1));
    CHECK_FALSE(store.is_done(4));
    CHECK(store.done_count() == 4);
    CHECK_FALSE(store.is_finished());
  }
  CHECK(said == std::vector<std::string>{
                    "capture 1: out/one/rgb_1.png is missing; it is made anew",
                    "capture 4: out/one/depth/4.npy is not what was written; it is made anew"});
  verifying.name = "w4";
  CHECK(run(process, "/data", verifying));
  CHECK(disk.tree("/data/out/.diorama/kept").empty());
  CHECK(dataset_files(disk.tree("/data")) == expected);
}

TEST_CASE("What was written before the first capture is made anew, too", "[store]") {
  SimulatedDisk disk(1);
  SimulatedProcess process(disk);
  run(process, "/data", {});
  disk.erase("/data/out/one/classes.txt");
  Job verifying = resuming("w2");
  verifying.verifies_all = true;
  std::vector<std::string> said;
  {
    auto options = options_of(verifying);
    options.warn = [&](const std::string& text) { said.push_back(text); };
    OutputStore store(process, folders_in("/data"), 3, options);
    store.join(kDataset);
    CHECK(store.done_count() == 3);
    CHECK_FALSE(store.is_finished());
  }
  CHECK(said == std::vector<std::string>{"begin: out/one/classes.txt is missing; it is made anew"});
  // What is known to be missing is made without a second look.
  CHECK(run(process, "/data", resuming("w3")));
  CHECK(dataset_files(disk.tree("/data")) == expected_files(3));
}

TEST_CASE("A dataset without its description is not made anew in silence", "[store]") {
  SimulatedDisk disk(1);
  SimulatedProcess process(disk);
  run(process, "/data", {});
  disk.erase("/data/out/dataset.json");
  std::vector<std::string> said;
  auto options = options_of(resuming("w2"));
  options.warn = [&](const std::string& text) { said.push_back(text); };
  OutputStore store(process, folders_in("/data"), 3, options);
  store.join(kDataset);
  REQUIRE(said.size() == 1);
  CHECK_THAT(said[0], ContainsSubstring("/data/out/dataset.json: is missing") &&
                          ContainsSubstring("3 captures") && ContainsSubstring("made anew"));
}

TEST_CASE("What captures kept is made anew with the files that it went into", "[store]") {
  const Files expected = expected_files(3);
  SimulatedDisk disk(1);
  SimulatedProcess process(disk);
  run(process, "/data", {});
  disk.put("/data/out/one/shared/odd.txt", "damaged");
  Job verifying = resuming("w2");
  verifying.verifies_all = true;
  std::vector<std::string> said;
  {
    auto options = options_of(verifying);
    options.warn = [&](const std::string& text) { said.push_back(text); };
    OutputStore store(process, folders_in("/data"), 3, options);
    store.join(kDataset);
    CHECK(store.done_count() == 0);
  }
  CHECK(said == std::vector<std::string>{
                    "finish: out/one/shared/odd.txt is not what was written; it is made anew",
                    "capture 0: out/.diorama/kept/0/000000 is missing; it is made anew",
                    "capture 1: out/.diorama/kept/0/000001 is missing; it is made anew",
                    "capture 2: out/.diorama/kept/0/000002 is missing; it is made anew"});
  verifying.name = "w3";
  CHECK(run(process, "/data", verifying));
  CHECK(dataset_files(disk.tree("/data")) == expected);
}

TEST_CASE("Without what captures kept the dataset's end is one message", "[store]") {
  SimulatedDisk disk(1);
  SimulatedProcess process(disk);
  OutputStore store(process, folders_in("/data"), 2, options_of({}));
  store.join(kDataset);
  store.open();
  for (int capture : {0, 1}) commit(store, capture);
  CHECK(disk.tree("/data").at("out/.diorama/kept/0/000001") == "kept by 1\n");
  disk.erase("/data/out/.diorama/kept/0/000001");
  store.refresh();
  REQUIRE(store.claim_finish());
  Transaction end = store.finish_transaction();
  CollectedFiles files(end, 0, "one");
  files.append_kept("shared.txt", 0);
  CHECK_THROWS_WITH(files.append_kept("shared.txt", 1),
                    "/data/out/.diorama/kept/0/000001: is missing; 'diorama run --resume --verify' "
                    "makes it anew");
  Transaction capture = store.capture_transaction(0);
  CHECK_THROWS_WITH(CollectedFiles(capture, 0, "one").append_kept("shared.txt", 0),
                    "writer 'one': only finish() gets what captures keep");
}

namespace {

/// A stranger's journal: lines with right checksums, whatever they say.
void forge_journal(const fs::path& root, const std::string& entry_json,
                   const std::string& more_lines = "") {
  LocalFileSystem local;
  JournalWriter writer(local, root / "out/.diorama/journal", "stranger", "out");
  writer.commit(0, {});
  writer.published(0);
  const fs::path entries = root / "out/.diorama/journal/stranger.entries";
  const fs::path index = root / "out/.diorama/journal/stranger.index";
  const auto offset = fs::file_size(entries);
  const std::string text = entry_json + "\n";
  std::ofstream(entries, std::ios::app) << text;
  std::string line = "c 000001 " + std::to_string(offset) + " " + std::to_string(text.size()) +
                     " " + digest_of(text);
  std::ofstream(index, std::ios::app)
      << journal_line(line) << journal_line("d 000001") << more_lines;
  std::ofstream(root / "out/dataset.json") << kDataset;
}

}  // namespace

TEST_CASE("A stranger's journal removes and writes nothing outside of the dataset", "[store]") {
  const TemporaryFolder folder;
  const fs::path root = folder.path() / "data";
  const auto put = [&](const char* name, const char* text) {
    fs::create_directories((folder.path() / name).parent_path());
    std::ofstream(folder.path() / name) << text;
  };
  put("victim/a.txt", "precious");
  put("data/src/main.c", "int main;");
  put("data/out/one/rgb_7.png", "of the user");
  LocalFileSystem local;
  const std::string too_long =
      R"({"files":[[")" + std::string(PATH_MAX, 'a') + R"(",8,"0"]],"records":{}})";
  for (const char* entry :
       {R"({"files":[["../victim/a.txt",8,"0"]],"records":{}})",
        R"({"files":[["/etc/passwd",8,"0"]],"records":{}})",
        R"({"files":[["a/../../victim",8,"0"]],"records":{}})",
        R"({"files":[[7,8,"0"]],"records":{}})", R"({"files":[["a",-8,"0"]],"records":{}})",
        R"({"files":[["a","b","0"]],"records":{}})", R"({"files":{"a":1},"records":{}})",
        R"({"files":[["a",8]],"records":{}})", too_long.c_str(), R"({"files":[],"records":[]})",
        R"({"files":[],"records":{"one":7}})", R"({"files":"../victim"})", "[]", "null", "{"}) {
    CAPTURE(entry);
    fs::remove_all(root / "out/.diorama");
    forge_journal(root, entry);
    const auto before = tree(folder.path());
    for (const Existing existing : {Existing::Resume, Existing::Overwrite}) {
      Job job = resuming("w2");
      job.existing = existing;
      job.verifies_all = existing == Existing::Resume;
      CHECK_THROWS_WITH(run(local, root, job),
                        ContainsSubstring("stranger.entries: byte ") &&
                            ContainsSubstring("expected the files of 000001"));
      CHECK(tree(folder.path()) == before);
    }
  }
  // Names that are well formed: in foreign folders only what is known to the byte is removed.
  fs::remove_all(root / "out/.diorama");
  forge_journal(root, R"({"files":[["src/main.c",9,"00"],["victim",1,"00"]],"records":{}})");
  Job job = resuming("w3");
  job.existing = Existing::Overwrite;
  const auto before = tree(folder.path());
  CHECK_THROWS_WITH(run(local, root, job), ContainsSubstring("holds 'rgb_7.png', which is not of"));
  CHECK(tree(folder.path()) == before);
  fs::remove(root / "out/one/rgb_7.png");
  CHECK(run(local, root, job));
  CHECK(tree(folder.path()).at("data/src/main.c") == "int main;");
  CHECK(tree(folder.path()).at("victim/a.txt") == "precious");
}

TEST_CASE("A folder that is a link leads nobody out of the dataset", "[store]") {
  const TemporaryFolder folder;
  const fs::path root = folder.path() / "data";
  fs::create_directories(folder.path() / "victim");
  std::ofstream(folder.path() / "victim/rgb_1.png") << "precious";
  LocalFileSystem local;
  fs::create_directories(root / "out");
  fs::create_symlink(folder.path() / "victim", root / "out/one");
  forge_journal(root, R"({"files":[["out/one/rgb_1.png",8,"00"]],"records":{}})");
  for (const Existing existing : {Existing::Resume, Existing::Overwrite}) {
    Job job = resuming("w2");
    job.existing = existing;
    CHECK_THROWS_WITH(
        run(local, root, job),
        ContainsSubstring((root / "out/one").string() + ": expected a folder, found a link"));
    CHECK(tree(folder.path() / "victim") == Files{{"rgb_1.png", "precious"}});
  }
  fs::remove_all(root);
  fs::create_directories(root / "out");
  fs::create_symlink(folder.path() / "victim", root / "out/.diorama");
  CHECK_THROWS_WITH(run(local, root, {}), ContainsSubstring(".diorama: expected a folder"));
  CHECK(tree(folder.path() / "victim") == Files{{"rgb_1.png", "precious"}});
}

TEST_CASE("Bad journal lines are one message, torn ones do not count", "[store]") {
  const TemporaryFolder folder;
  LocalFileSystem local;
  Job job;
  run(local, folder.path(), job);
  const fs::path index = folder.path() / "out/.diorama/journal/w1.index";
  std::ofstream(index, std::ios::app) << "d 0000" << std::string(40, '\0') << "\nc 000002 5\n";
  CHECK(run(local, folder.path(), resuming("w2")));
  for (const char* line :
       {"d ../../x", "v ../w 000001", "r w1", "c 000002 1 2 3", "x", "d 999999999999",
        "c 000001 0 99999999999999 00000000000000000000000000000000"}) {
    CAPTURE(line);
    const auto before = fs::file_size(index);
    std::ofstream(index, std::ios::app) << journal_line(line);
    const auto files = dataset_files(tree(folder.path()));
    CHECK_THROWS_WITH(run(local, folder.path(), resuming("w3")),
                      ContainsSubstring("w1.index: no journal of this version"));
    CHECK(dataset_files(tree(folder.path())) == files);
    fs::resize_file(index, before);
  }
}

TEST_CASE("A capture counts when a line says what it holds", "[store]") {
  const TemporaryFolder folder;
  LocalFileSystem local;
  run(local, folder.path(), {});
  const fs::path journal = folder.path() / "out/.diorama/journal";
  // One damaged byte, and what its line would have shown to be missing.
  std::string text = local.read(journal / "w1.index");
  const std::size_t line = text.find("c 000002 ");
  REQUIRE(line != std::string::npos);
  text[line + 9] = text[line + 9] == '1' ? '2' : '1';
  local.write(journal / "w1.index", bytes_of(text));
  fs::remove(folder.path() / "out/one/rgb_2.png");
  CHECK(run(local, folder.path(), resuming("w2")));
  CHECK(dataset_files(tree(folder.path())) == expected_files(3));

  // Lines about others' entries may be read before the entries' own, or come before them.
  const fs::path other = folder.path() / "other";
  JournalWriter first(local, other, "a", "out");
  JournalWriter second(local, other, "b", "out");
  JournalWriter third(local, other, "c", "out");
  first.published_for("b", 1);
  first.published_for("c", 2);
  second.commit(1, {});
  third.checkpoint();
  std::ofstream(other / "d.index") << journal_line("d 000000");
  Journals journals(local, other, 3);
  journals.refresh();
  CHECK(journals.is_published(1));
  CHECK(journals.published_captures() == 1);
  third.commit(2, {});
  journals.refresh();
  CHECK(journals.is_published(2));
  CHECK(journals.published_captures() == 2);
}

TEST_CASE("Files without an end are one message or nothing", "[store]") {
  const TemporaryFolder folder;
  LocalFileSystem local;
  run(local, folder.path(), {});
  // Holes: as large as a stranger likes, in a few kilobytes.
  constexpr std::uintmax_t kHuge = std::uintmax_t(20) << 30;
  fs::resize_file(folder.path() / "out/.diorama/journal/w1.index", kHuge);
  fs::resize_file(folder.path() / "out/.diorama/journal/w1.entries", kHuge);
  Job verifying = resuming("w2");
  verifying.verifies_all = true;
  CHECK(run(local, folder.path(), verifying));
  const fs::path page = folder.path() / "out/dataset.json";
  fs::resize_file(page, kHuge);
  CHECK_THROWS_WITH(run(local, folder.path(), resuming("w3")),
                    "cannot read " + page.string() +
                        ": it has 21474836480 bytes, more than the "
                        "1073741824 that are read at once");
  fs::remove(page);
  fs::create_symlink("/dev/zero", page);
  CHECK_THROWS_WITH(run(local, folder.path(), resuming("w4")),
                    "cannot read " + page.string() + ": it is no regular file");
}

// Minutes, were a line to cost a look at all open ones.
TEST_CASE("A journal of any length, of any order, is read line by line", "[store]") {
  const TemporaryFolder folder;
  constexpr int kEntries = 300'000;
  const fs::path journal = folder.path() / "out/.diorama/journal";
  fs::create_directories(journal);
  const auto entry = [](int i) { return std::to_string(1'000'000 + i); };
  {
    std::ofstream index(journal / "w1.index");
    for (int i = 0; i < kEntries; ++i) {
      index << journal_line("c " + entry(i) + " " + std::to_string(10 * i) + " 9 " +
                            std::string(32, '0'));
    }
    for (int i = 0; i < kEntries; i += 2) {
      index << journal_line("d " + entry(i)) << journal_line("s");
    }
    index << journal_line("d " + entry(1));
  }
  LocalFileSystem local;
  Journals journals(local, journal, 2 * 1'000'000);
  journals.refresh();
  CHECK(journals.published_captures() == kEntries / 2 + 1);
  const WorkerIndex& index = journals.workers().at("w1");
  const auto unsettled = index.unsettled();
  REQUIRE(unsettled.size() == kEntries / 2);
  CHECK((unsettled[0].entry == 1'000'001 && unsettled[0].is_published));
  CHECK((unsettled[1].entry == 1'000'003 && !unsettled[1].is_published));
  CHECK(unsettled.back().entry == 1'000'000 + kEntries - 1);
}

TEST_CASE("What is appended to a file leaves the memory and comes out whole", "[store]") {
  const TemporaryFolder folder;
  LocalFileSystem local;
  OutputStore store(local, folders_in(folder.path()), 1, options_of({}));
  store.join(kDataset);
  store.open();
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

TEST_CASE("What writers append one after the other has one budget", "[store]") {
  const TemporaryFolder folder;
  LocalFileSystem local;
  OutputStore store(local, folders_in(folder.path()), 1, options_of({}));
  store.join(kDataset);
  store.open();
  Transaction transaction = store.capture_transaction(0);
  std::map<std::string, std::string> expected;
  for (int writer = 0; writer < 2; ++writer) {
    CollectedFiles files(transaction, std::size_t(writer), writer == 0 ? "one" : "two");
    for (int i = 0; i < 24; ++i) {
      const std::string name = std::to_string(i % 8) + ".txt";
      const std::string piece(40'000, char('a' + i));
      files.append_text(name, piece);
      expected[std::to_string(writer) + name] += piece;
      std::size_t kept = 0;
      for (const StagedFile& file : transaction.files) kept += file.bytes.size();
      CHECK(kept < CollectedFiles::kKeptGrowingBytes);
      CHECK(kept == transaction.growing_bytes);
    }
  }
  store.commit_capture(0, transaction);
  const std::map<std::string, std::string> found[] = {tree(folder.path() / "out/one"),
                                                      tree(folder.path() / "elsewhere")};
  for (const auto& [name, content] : expected) {
    CHECK(found[name[0] - '0'].at(name.substr(1)) == content);
  }
}

TEST_CASE("Records come by capture, of each the first whole one, in little memory", "[store]") {
  // 20,000 of them in a run are a megabyte.
  CHECK(sizeof(EntryPlace) <= 40);
  const TemporaryFolder folder;
  LocalFileSystem local;
  constexpr int kCaptures = 3;
  const auto commit = [&](const std::string& worker, std::vector<int> captures) {
    const Job job{.captures = kCaptures, .existing = Existing::Resume, .name = worker};
    OutputStore store(local, folders_in(folder.path()), kCaptures, options_of(job));
    store.join(kDataset);
    store.open();
    for (const int capture : captures) {
      Transaction transaction = store.capture_transaction(capture);
      CollectedFiles(transaction, 0, "one").record(worker + std::to_string(capture));
      store.commit_capture(capture, transaction);
    }
    store.close();
  };
  commit("b", {2, 0, 1});
  commit("a", {1, 0});
  // One byte of the record of capture 0 by "a" is damaged: the other worker's counts.
  const fs::path entries = folder.path() / "out/.diorama/journal/a.entries";
  std::string text = local.read(entries);
  text.at(text.rfind("a0")) = 'x';
  std::ofstream(entries, std::ios::binary) << text;
  OutputStore store(local, folders_in(folder.path()), kCaptures, options_of({}));
  store.refresh();
  std::vector<std::string> lines;
  store.read_records(0, [&](int capture, std::string_view line) {
    lines.push_back(std::to_string(capture) + " " + std::string(line));
  });
  CHECK(lines == std::vector<std::string>{"0 b0", "1 a1", "2 b2"});
}

TEST_CASE("What a stage holds goes when its transaction is not committed", "[store]") {
  const TemporaryFolder folder;
  LocalFileSystem local;
  OutputStore store(local, folders_in(folder.path()), 1, options_of({}));
  store.join(kDataset);
  store.open();
  const fs::path stage = folder.path() / "out/.diorama/stage/w1";
  {
    Transaction transaction = store.capture_transaction(0);
    CollectedFiles files(transaction, 0, "one");
    files.add("large.bin", std::vector<std::byte>(3'000'000, std::byte(7)));
    CHECK(tree(stage).size() == 1);
  }
  CHECK(tree(stage).empty());
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

TEST_CASE("Two files of one name in a capture are an error", "[store]") {
  SimulatedDisk disk(1);
  SimulatedProcess process(disk);
  OutputFolders folders = folders_in("/data");
  folders.writers[1].folder = folders.writers[0].folder;
  OutputStore store(process, folders, 1, options_of({}));
  store.join(kDataset);
  store.open();
  Transaction transaction;
  transaction.files.push_back({0, "a/x.png", bytes_of("1")});
  transaction.files.push_back({1, "a/x.png", bytes_of("2")});
  CHECK_THROWS_WITH(store.commit_capture(0, transaction),
                    ContainsSubstring("a/x.png: two files of one capture have this name"));
}

TEST_CASE("A capture costs few steps beside its own files, whatever the number of workers",
          "[store]") {
  SimulatedDisk disk(1);
  // As many workers before this one as a farm has, of one capture each.
  constexpr int kWorkers = 200;
  for (int i = 0; i < kWorkers; ++i) {
    SimulatedProcess process(disk);
    Job job = resuming("w" + std::to_string(i), 3000);
    job.shard = i;
    job.shards = kWorkers;
    OutputStore store(process, folders_in("/data"), 3000, options_of(job));
    if (i == 0) store.join(kDataset);
    if (i == 0) store.open();
    // The others' joins are what is measured below.
    JournalWriter writer(process, "/data/out/.diorama/journal", job.name, "out");
    writer.commit(i, {});
    writer.published(i);
    writer.checkpoint();
    if (i == 0) store.close();
  }
  SimulatedProcess process(disk);
  constexpr int kCaptures = kWorkers;  // as many as a farm gives each
  constexpr int kFiles = 40;
  OutputStore store(process, folders_in("/data"), 3000, options_of(resuming("this", 3000)));
  store.join(kDataset);
  store.open();
  for (int i = 0; i < kCaptures; ++i) {
    Transaction capture;
    for (int k = 0; k < kFiles; ++k) {
      capture.files.push_back(
          {0, "rp_cam_" + std::to_string(k) + "/x/" + std::to_string(i), bytes_of("x")});
    }
    store.commit_capture(1000 + i, capture);
  }
  store.refresh();
  store.close();
  const double own = 3.0 * kFiles;  // written, synced, moved
  const double per_capture = double(process.steps()) / kCaptures - own;
  INFO(per_capture << " steps per capture beside its files");
  CHECK(per_capture < 25);
}

namespace {

/// Shards after each other, each with as many captures as the others; what they cost of a file
/// system.
void check_costs(int shards, int of_each) {
  const int captures = shards * of_each;
  SimulatedDisk disk(1);
  disk.set_step_time(1e-6);  // leases of the first are not old when the last one joins
  std::int64_t steps = 0;
  int most_to_join = 0;
  const auto run_shard = [&](int shard) {
    SimulatedProcess process(disk);
    Job job = resuming("w" + std::to_string(shard), captures);
    job.shard = shard;
    job.shards = shards;
    OutputStore store(process, folders_in("/data"), captures, options_of(job));
    store.join(kDataset);
    store.open();
    Transaction nothing;
    store.commit_begin(nothing);
    most_to_join = std::max(most_to_join, process.steps());
    for (int i = 0; i < of_each; ++i) {
      const int capture = shard + i * shards;
      Transaction transaction;
      const std::string folder = std::to_string(shard);
      transaction.files.push_back({0, folder + "/" + std::to_string(capture), bytes_of("x")});
      store.commit_capture(capture, transaction);
    }
    finish(store, [] {});
    CHECK(store.is_finished() == (shard + 1 == shards));
    store.close();
    steps += process.steps();
  };
  for (int shard = 0; shard < shards; ++shard) run_shard(shard);
  constexpr double kOwn = 3;  // written, synced, moved
  const double per_capture = double(steps) / captures - kOwn;
  INFO(per_capture << " steps per capture beside its file, at most " << most_to_join
                   << " before a shard's first");
  CHECK(per_capture < 60);
  WARN(per_capture << " steps per capture beside its file; " << most_to_join
                   << " before the last shard's first");
}

}  // namespace

TEST_CASE("Captures of many shards cost few steps each", "[store]") { check_costs(30, 30); }

// By night (tests/nightly.sh): minutes, most of it for what each shard reads of those before it.
TEST_CASE("A million captures of a thousand shards cost few steps each", "[.large]") {
  check_costs(1000, 1000);
}
