// SPDX-License-Identifier: Apache-2.0
#include "diorama/reader.h"

#include <algorithm>
#include <atomic>
#include <fstream>
#include <map>
#include <memory>
#include <span>

#include "diorama/writer.h"
#include "framework/conformance/fingerprint.h"
#include "framework/conformance/kinds.h"
#include "framework/conformance/run_together.h"
#include "framework/conformance/sample_scene.h"
#include "framework/datasets/frame_difference.h"
#include "framework/host/scratch_folder.h"

namespace diorama::conformance {
namespace {

namespace fs = std::filesystem;

constexpr int kCaptures = 3;

class Folder {
 public:
  explicit Folder(const std::string& name) : scratch_(name) {}
  const fs::path& path() const { return scratch_.path(); }
  void append(const std::string& file, std::span<const std::byte> bytes) const {
    put(file, bytes.data(), bytes.size(), std::ios::app);
  }
  void write(const std::string& file, const void* data, std::size_t size) const {
    put(file, data, size, std::ios::out);
  }

 private:
  void put(const std::string& file, const void* data, std::size_t size,
           std::ios::openmode mode) const {
    fs::create_directories((path() / file).parent_path());
    std::ofstream out(path() / file, std::ios::binary | mode);
    out.write(static_cast<const char*>(data), std::streamsize(size));
    if (!out.flush())
      throw Error(ErrorKind::Output, (path() / file).string() + ": cannot be written");
  }
  ScratchFolder scratch_;
};

/// A writer's files on disk, records kept for finish().
class FilesInFolder final : public CaptureFiles {
 public:
  explicit FilesInFolder(const Folder& folder) : folder_(folder) {}
  void add(std::string_view path, std::vector<std::byte> bytes) override {
    folder_.write(std::string(path), bytes.data(), bytes.size());
  }
  void append(std::string_view path, std::span<const std::byte> bytes) override {
    folder_.append(std::string(path), bytes);
  }
  void append_kept(std::string_view path, int capture) override {
    append(path, kept_by_all.at(std::size_t(capture)));
  }
  void record(std::string_view line) override { records.emplace_back(line); }
  void keep(std::span<const std::byte> bytes) override {
    kept.insert(kept.end(), bytes.begin(), bytes.end());
  }
  std::vector<std::string> records;
  std::vector<std::byte> kept;
  std::vector<std::vector<std::byte>> kept_by_all;  ///< Of finish(): by captures.

 private:
  const Folder& folder_;
};

void write_dataset(Writer& writer, const std::vector<Capture>& captures, const Folder& folder) {
  std::vector<std::vector<std::string>> records;
  FilesInFolder whole(folder);
  writer.begin(sample_dataset(int(captures.size())), whole);
  for (const Capture& capture : captures) {
    FilesInFolder files(folder);
    writer.write(capture, files);
    records.push_back(std::move(files.records));
    whole.kept_by_all.push_back(std::move(files.kept));
  }
  writer.finish(
      [&records](const RecordVisitor& visit) {
        for (std::size_t i = 0; i < records.size(); ++i) {
          for (const std::string& line : records[i]) visit(int(i), line);
        }
      },
      whole);
}

void read_all(const StoredDataset& dataset) {
  for (std::size_t i = 0; i < dataset.info().captures.size(); ++i) {
    dataset.read(i, dataset.info().holds);
  }
}

/// Files that are not what their names say: findings or one Error(Asset), nothing else.
void read_nonsense(const Reader& reader, const std::string& content) {
  const Folder folder("nonsense");
  for (std::string file : reader.patterns()) {
    std::replace(file.begin(), file.end(), '*', 'x');
    folder.write(file, content.data(), content.size());
  }
  reader.recognise(folder.path());
  try {
    read_all(*reader.open(folder.path()));
  } catch (const Error& error) {
    require(error.kind() == ErrorKind::Asset,
            std::string("throws another error than Error(Asset): ") + error.what());
  }
}

/// Why the dataset that was read is not the one that was written; empty when it is. Findings do not
/// count: painted frames are no pictures of a world.
std::string difference(const StoredDataset& dataset, const std::vector<Capture>& captures) {
  const StoredInfo& info = dataset.info();
  if (info.captures.size() != captures.size()) {
    return "gives " + std::to_string(info.captures.size()) + " captures of " +
           std::to_string(captures.size());
  }
  for (std::size_t i = 0; i < captures.size(); ++i) {
    const StoredCapture stored = dataset.read(i, info.holds);
    const std::string where = "capture " + std::to_string(i) + ": ";
    if (stored.capture.frames.size() != captures[i].frames.size()) {
      return where + "gives " + std::to_string(stored.capture.frames.size()) + " frames of " +
             std::to_string(captures[i].frames.size());
    }
    for (std::size_t k = 0; k < captures[i].frames.size(); ++k) {
      const auto differences =
          frame_differences(info, captures[i].frames[k], stored.capture.frames[k]);
      if (!differences.empty()) return where + differences.front();
    }
  }
  return {};
}

/// The names of all files below a folder and what they hold.
std::map<std::string, std::string> content_of(const fs::path& folder) {
  std::map<std::string, std::string> content;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (!entry.is_regular_file()) continue;
    std::ifstream in(entry.path(), std::ios::binary);
    content[entry.path().string()].assign(std::istreambuf_iterator<char>(in), {});
  }
  return content;
}

std::string told(const StoredDataset& dataset, std::size_t i) {
  return fingerprint(dataset.read(i, dataset.info().holds).capture);
}

/// Amodal masks come with the objects, whether or not the pixels of these are asked for, too.
void check_asked_alone(const StoredDataset& dataset) {
  const NameSet& holds = dataset.info().holds;
  const NameSet wanted{"amodal_mask", std::string(kHoldsInstances)};
  if (!holds.contains("amodal_mask")) return;
  for (std::size_t i = 0; i < dataset.info().captures.size(); ++i) {
    const StoredCapture whole = dataset.read(i, holds);
    const StoredCapture alone = dataset.read(i, wanted);
    for (std::size_t k = 0; k < whole.capture.frames.size(); ++k) {
      const std::vector<Instance>& instances = alone.capture.frames.at(k).instances;
      for (const Instance& instance : whole.capture.frames[k].instances) {
        if (!instance.visibility || instance.visibility->amodal_mask.bits.empty()) continue;
        const auto same = std::ranges::find(instances, instance.id, &Instance::id);
        require(same != instances.end() && same->visibility &&
                    same->visibility->amodal_mask.bits == instance.visibility->amodal_mask.bits,
                "gives no amodal masks when they are asked for alone");
      }
    }
  }
}

/// A dataset that is read by several threads, in any order, while another one is open.
void check_reading(const Reader& reader, const fs::path& folder,
                   const std::map<std::string, std::string>& written) {
  const auto dataset = reader.open(folder);
  const std::size_t count = dataset->info().captures.size();
  std::vector<std::string> in_order;
  for (std::size_t i = 0; i < count; ++i) in_order.push_back(told(*dataset, i));
  const auto again = reader.open(folder);
  for (std::size_t i = count; i-- > 0;) {
    require(told(*again, i) == in_order[i], "gives something else when captures come backwards");
    require(told(*dataset, i) == in_order[i], "gives something else the second time");
  }
  for (std::size_t i = 0; i < count; ++i) {
    const StoredCapture bare = dataset->read(i, {});
    const StoredCapture whole = dataset->read(i, dataset->info().holds);
    require(bare.capture.frames.size() == whole.capture.frames.size(),
            "gives other frames when nothing is asked of them");
    for (std::size_t k = 0; k < bare.capture.frames.size(); ++k) {
      const Camera& camera = bare.capture.frames[k].camera;
      const Camera& known = whole.capture.frames[k].camera;
      require(camera.width == known.width && camera.height == known.height,
              "gives no camera sizes when nothing is asked of a frame");
    }
  }
  check_asked_alone(*dataset);
  constexpr int kRounds = 20;
  std::atomic<bool> is_same = true;
  for (int round = 0; round < kRounds; ++round) {
    run_together(2, [&](int thread) {
      const std::size_t first = thread == 0 ? 0 : count / 2;
      for (std::size_t k = 0; k < count; ++k) {
        const std::size_t i = (first + k) % count;
        if (told(*dataset, i) != in_order[i]) is_same = false;
      }
    });
  }
  require(is_same, "gives something else when several threads read at once");
  require(content_of(folder) == written, "changes the dataset that it reads");
}

Subject writer_subject(const Subject& subject, const std::string& type) {
  return {subject.registry.entry(ComponentKind::Writer, type), subject.registry, subject.host,
          subject.single_threaded_host};
}

void check_round_trip(const CheckRun& run, const Subject& subject, const Reader& reader,
                      const std::string& writer_type, const std::string& which,
                      const Value& params) {
  const std::string name =
      "what " + writer_type + " writes comes back as far as it is held" + which;
  const std::vector<Capture> captures = sample_captures(kCaptures, subject.host);
  const auto writer = writer_subject(subject, writer_type).make<Writer>(subject.host, params);
  for (const std::string& need : writer->needs()) {
    const bool is_there =
        captures.front().frames.front().has(need) || painted_annotations().contains(need);
    if (!is_there) {
      run.skip(name, "the writer needs '" + need + "', which another plugin makes");
      return;
    }
  }
  const Folder folder("round_trip");
  write_dataset(*writer, captures, folder);
  const auto written = content_of(folder.path());
  if (reader.recognise(folder.path()) == Recognition::No) {
    run.skip(name, "the reader does not know the folder");
    return;
  }
  if (reader.open(folder.path())->info().holds.empty()) {
    run.skip(name, "the writer leaves nothing that could be read");
    return;
  }
  run.check(name, [&] {
    const std::string found = difference(*reader.open(folder.path()), captures);
    require(found.empty(), found);
  });
  run.check("what " + writer_type + " writes is read in any order, by several threads" + which,
            [&] { check_reading(reader, folder.path(), written); });
}

}  // namespace

/// Of what the writers of its library leave.
std::string reader_output(const Subject& subject) {
  const auto reader = subject.make<Reader>();
  const std::vector<Capture> captures = sample_captures(kCaptures, subject.host);
  std::string all;
  for (const std::string& type : subject.registry.types(ComponentKind::Writer)) {
    const auto writer = writer_subject(subject, type).make<Writer>();
    const Frame& frame = captures.front().frames.front();
    const bool is_possible = std::ranges::all_of(writer->needs(), [&](const std::string& need) {
      return frame.has(need) || painted_annotations().contains(need);
    });
    if (!is_possible) continue;
    const Folder folder("output");
    write_dataset(*writer, captures, folder);
    if (reader->recognise(folder.path()) == Recognition::No) continue;
    const auto dataset = reader->open(folder.path());
    for (std::size_t i = 0; i < dataset->info().captures.size(); ++i) {
      all += fingerprint(dataset->read(i, dataset->info().holds).capture);
    }
  }
  return all;
}

void check_reader(const CheckRun& run, const Subject& subject) {
  const auto reader = subject.make<Reader>();
  run.check("its patterns are those that the library lists", [&] {
    require(!reader->patterns().empty(), "has none, so it is never asked");
    require(!subject.entry.claims_are_listed || reader->patterns() == subject.entry.claims,
            "patterns() returns others than DIORAMA_ADD_READER says");
  });
  run.check("an empty folder is refused by name", [&] {
    const Folder folder("empty");
    require(reader->recognise(folder.path()) == Recognition::No, "knows an empty folder");
    require_error_naming(folder.path().string(), [&] { reader->open(folder.path()); });
  });
  run.check("files that are not what their names say are survived", [&] {
    for (const std::string& content :
         {std::string(), std::string("{"), std::string("<<< nonsense >>>\n"), std::string(64, '\0'),
          std::string(5000, '\xff'), std::string(20000, '[')}) {
      read_nonsense(*reader, content);
    }
  });
  for (const std::string& type : subject.registry.types(ComponentKind::Writer)) {
    check_round_trip(run, subject, *reader, type, "", Value::make_map());
    if (const auto params = usable_switches(writer_subject(subject, type))) {
      check_round_trip(run, subject, *reader, type, ", every switch on", *params);
    }
  }
}

}  // namespace diorama::conformance
