// SPDX-License-Identifier: Apache-2.0
#include "diorama/writer.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <filesystem>
#include <map>
#include <set>
#include <span>

#include "framework/conformance/fingerprint.h"
#include "framework/conformance/kinds.h"
#include "framework/conformance/run_together.h"
#include "framework/conformance/sample_scene.h"

namespace diorama::conformance {
namespace {

constexpr int kCaptures = 4;

/// Files in memory; complains about names that lead elsewhere and about names that come twice.
class MemoryFiles final : public CaptureFiles {
 public:
  explicit MemoryFiles(bool yields = false) : yields_(yields) {}
  std::map<std::string, std::vector<std::byte>> files;
  std::vector<std::string> records;
  std::vector<std::byte> kept;
  const std::vector<MemoryFiles>* ended = nullptr;  ///< Of finish(): all captures.

  void add(std::string_view path, std::vector<std::byte> bytes) override {
    give_way();
    check(path);
    require(files.emplace(path, std::move(bytes)).second,
            "writes '" + std::string(path) + "' twice");
  }
  void append(std::string_view path, std::span<const std::byte> bytes) override {
    check(path);
    const bool is_new = growing.emplace(path).second;
    require(!is_new || !files.contains(std::string(path)),
            "writes '" + std::string(path) + "' twice");
    std::vector<std::byte>& file = files[std::string(path)];
    file.insert(file.end(), bytes.begin(), bytes.end());
  }
  void append_kept(std::string_view path, int capture) override {
    require(ended != nullptr, "takes what captures keep before finish()");
    const bool is_there = capture >= 0 && std::size_t(capture) < ended->size() &&
                          !(*ended)[std::size_t(capture)].kept.empty();
    require(is_there, "takes what capture " + std::to_string(capture) + " has not kept");
    append(path, (*ended)[std::size_t(capture)].kept);
  }
  void keep(std::span<const std::byte> bytes) override {
    give_way();
    kept.insert(kept.end(), bytes.begin(), bytes.end());
  }
  void record(std::string_view line) override {
    give_way();
    require(line.find('\n') == line.npos, "a record holds a line break");
    records.emplace_back(line);
  }
  friend bool operator==(const MemoryFiles& a, const MemoryFiles& b) {
    return a.files == b.files && a.records == b.records && a.kept == b.kept;
  }

 private:
  static void check(std::string_view path) {
    const std::filesystem::path relative(path);
    const bool leaves = std::find(relative.begin(), relative.end(), "..") != relative.end();
    require(!path.empty() && relative.is_relative() && !leaves,
            "writes '" + std::string(path) + "', which lies outside of its folder");
  }
  std::set<std::string> growing;  ///< What was appended to.
  /// Lets other threads in, in the midst of writing.
  void give_way() const {
    if (yields_) std::this_thread::sleep_for(std::chrono::microseconds(50));
  }
  bool yields_;
};

/// All of a dataset; which capture has written a file counts.
struct Dataset {
  std::vector<MemoryFiles> captures;
  MemoryFiles whole;  ///< Of begin() and finish().
  friend bool operator==(const Dataset&, const Dataset&) = default;
};

void finish(Writer& writer, Dataset& dataset) {
  const RecordReader records = [&dataset](const RecordVisitor& visit) {
    for (std::size_t i = 0; i < dataset.captures.size(); ++i) {
      for (const std::string& line : dataset.captures[i].records) visit(int(i), line);
    }
  };
  dataset.whole.ended = &dataset.captures;
  writer.finish(records, dataset.whole);
  dataset.whole.ended = nullptr;
  MemoryFiles folder = dataset.whole;
  for (const MemoryFiles& capture : dataset.captures) {
    for (const auto& [path, bytes] : capture.files) folder.add(path, bytes);
  }
}

Dataset begun(Writer& writer, const std::vector<Capture>& captures) {
  Dataset dataset;
  dataset.captures.resize(captures.size());
  writer.begin(sample_dataset(int(captures.size())), dataset.whole);
  return dataset;
}

Dataset write_in_order(Writer& writer, const std::vector<Capture>& captures) {
  Dataset dataset = begun(writer, captures);
  for (std::size_t i = 0; i < captures.size(); ++i) {
    writer.write(captures[i], dataset.captures[i]);
  }
  finish(writer, dataset);
  return dataset;
}

/// Two threads, the last captures first.
Dataset write_on_two_threads(Writer& writer, const std::vector<Capture>& captures) {
  Dataset dataset = begun(writer, captures);
  run_together(2, [&](int half) {
    for (std::size_t i = captures.size(); i-- > 0;) {
      if (int(i % 2) == half) writer.write(captures[i], dataset.captures[i]);
    }
  });
  finish(writer, dataset);
  return dataset;
}

/// Another process wrote the captures: its records and what it kept are all that is left of that.
Dataset finished_by_another(Writer& writer, const std::vector<Capture>& captures,
                            const Dataset& written) {
  Dataset dataset = begun(writer, captures);
  dataset.captures = written.captures;
  finish(writer, dataset);
  return dataset;
}

/// Many threads write the same captures through one writer, again and again, each as it was written
/// alone: what they share in the writer they share without knowing.
void write_all_at_once(Writer& writer, const std::vector<Capture>& captures,
                       const Dataset& expected) {
  constexpr int kThreads = 8;
  constexpr int kRounds = 12;
  begun(writer, captures);
  std::atomic<bool> differs = false;
  run_together(kThreads, [&](int thread) {
    for (int round = 0; round < kRounds && !differs; ++round) {
      const std::size_t i = std::size_t(thread + round) % captures.size();
      MemoryFiles files(true);
      writer.write(captures[i], files);
      if (!(files == expected.captures[i])) differs = true;
    }
  });
  require(!differs, "writes something else when several threads write at once");
}

/// The first name it needs that no frame of the checks has: a channel of another plugin.
std::string foreign_need(const Writer& writer, const Frame& frame) {
  for (const std::string& name : writer.needs()) {
    if (!frame.has(name) && !painted_annotations().contains(name)) return name;
  }
  return {};
}

void check_dataset(const CheckRun& run, const Subject& subject, const std::string& which,
                   const Value& params) {
  const std::vector<Capture> captures = sample_captures(kCaptures, subject.host);
  const std::string foreign =
      foreign_need(*subject.make<Writer>(subject.host, params), captures.front().frames.front());
  if (!foreign.empty()) {
    run.skip("captures are written" + which, "needs '" + foreign + "', which another plugin makes");
    return;
  }
  const auto fresh = [&](Host& host) { return subject.make<Writer>(host, params); };
  Dataset dataset;
  run.check("captures are written and left as they were" + which, [&] {
    const auto fingerprints = [&captures] {
      std::string all;
      for (const Capture& capture : captures) all += fingerprint(capture);
      return all;
    };
    const std::string before = fingerprints();
    dataset = write_in_order(*fresh(subject.host), captures);
    require(before == fingerprints(), "changes the captures");
  });
  run.check("the same captures give the same bytes" + which, [&] {
    require(dataset == write_in_order(*fresh(subject.host), captures), "differs the second time");
    require(dataset == write_in_order(*fresh(subject.single_threaded_host), captures),
            "differs with one thread");
  });
  run.check("captures may come in any order, on two threads" + which, [&] {
    require(dataset == write_on_two_threads(*fresh(subject.host), captures),
            "differs from captures in order");
  });
  run.check("what finish() writes follows from the records" + which, [&] {
    require(dataset == finished_by_another(*fresh(subject.host), captures, dataset),
            "differs when another process wrote the captures");
  });
  run.check("several threads may write at once" + which, [&] {
    require(dataset.captures.size() == captures.size(),
            "could not be tried, as nothing is written");
    write_all_at_once(*fresh(subject.host), captures, dataset);
  });
}

Capture capture_that_shows_nothing(Host& host) {
  Scene scene;
  const NodeId camera = scene.create(scene.root(), "cam_0");
  scene.edit(camera).camera = Camera::from_lens(3, 2, 24.0, 20.955);
  Capture capture;
  capture.frames.push_back(painted_frame(scene, camera, host));
  return capture;
}

}  // namespace

std::optional<Value> usable_switches(const Subject& subject) {
  Value params = Value::make_map();
  for (const ParamSpec& spec : subject.registry.describe(subject.entry.kind, subject.entry.type)) {
    if (spec.type == ParamType::Bool) params.set(spec.key, Value::boolean(true));
  }
  if (params.map.empty()) return std::nullopt;
  try {
    subject.make<Writer>(subject.host, params);
  } catch (const Error&) {
    return std::nullopt;
  }
  return params;
}

std::string writer_output(const Subject& subject) {
  const std::vector<Capture> captures = sample_captures(kCaptures, subject.host);
  const auto writer = subject.make<Writer>();
  if (!foreign_need(*writer, captures.front().frames.front()).empty()) return {};
  const Dataset dataset = write_in_order(*writer, captures);
  std::string all;
  const auto append = [&](const MemoryFiles& files) {
    for (const auto& [path, bytes] : files.files) {
      all += path + '\0';
      all.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    }
    for (const std::string& record : files.records) all += record + '\n';
  };
  for (const MemoryFiles& capture : dataset.captures) append(capture);
  append(dataset.whole);
  return all;
}

void check_writer(const CheckRun& run, const Subject& subject) {
  run.check("a dataset without captures is survived",
            [&] { write_in_order(*subject.make<Writer>(), {}); });
  run.check("a capture without frames is survived", [&] {
    std::vector<Capture> captures(1);
    write_in_order(*subject.make<Writer>(), captures);
  });
  run.check("a frame that shows nothing is survived", [&] {
    const auto writer = subject.make<Writer>();
    std::vector<Capture> captures;
    captures.push_back(capture_that_shows_nothing(subject.host));
    if (foreign_need(*writer, captures.front().frames.front()).empty()) {
      write_in_order(*writer, captures);
    }
  });
  check_dataset(run, subject, "", Value::make_map());
  if (const auto params = usable_switches(subject)) {
    check_dataset(run, subject, ", every switch on", *params);
  }
}

}  // namespace diorama::conformance
