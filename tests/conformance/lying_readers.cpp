// SPDX-License-Identifier: Apache-2.0
// A writer of camera poses, and readers of them that break one promise each.
#include <atomic>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <map>
#include <memory>
#include <sstream>
#include <thread>
#include <utility>

#include "diorama/error.h"
#include "diorama/plugin.h"
#include "diorama/reader.h"
#include "diorama/writer.h"

namespace diorama::test {

namespace fs = std::filesystem;

struct NoParams {
  void visit(ParamVisitor&) {}
};

constexpr const char* kEnding = ".poses";

/// A file per capture, a line per frame: name, size, pose row by row.
struct PosesWriter : Writer {
  using Params = NoParams;
  PosesWriter(Params, Host&) {}
  NameSet needs() const override { return {}; }
  void write(const Capture& capture, CaptureFiles& files) const override {
    std::string text;
    for (const Frame& frame : capture.frames) {
      text += frame.camera_name + " " + std::to_string(frame.camera.width) + " " +
              std::to_string(frame.camera.height);
      for (int i = 0; i < 12; ++i) {
        char number[40];
        std::snprintf(number, sizeof number, " %.17g",
                      frame.world_from_camera.matrix()(i / 4, i % 4));
        text += number;
      }
      text += "\n";
    }
    char name[40];
    std::snprintf(name, sizeof name, "%05d%s", capture.index, kEnding);
    files.add_text(name, text);
  }
};

/// Honest.
struct Poses : StoredDataset {
  explicit Poses(fs::path place) : folder(std::move(place)) {
    std::map<int, fs::path> found;
    for (const auto& entry : fs::directory_iterator(folder)) {
      if (entry.path().extension() != kEnding) continue;
      found[std::atoi(entry.path().stem().c_str())] = entry.path();
    }
    if (found.empty()) throw Error(ErrorKind::Asset, folder.string() + ": holds no poses");
    for (const auto& [index, file] : found) {
      known.captures.push_back(index);
      files.push_back(file);
    }
    known.format = "poses";
    known.camera_names = {"cam_0", "cam_1"};
    known.holds = {std::string(kHoldsCameraPose)};
  }
  const StoredInfo& info() const override { return known; }
  const ReadLog& log() const override { return findings; }
  StoredCapture read(std::size_t i, const NameSet&) const override {
    StoredCapture stored;
    stored.capture.index = known.captures.at(i);
    std::ifstream in(files.at(i));
    for (std::string line; std::getline(in, line);) {
      std::istringstream words(line);
      Frame frame;
      words >> frame.camera_name >> frame.camera.width >> frame.camera.height;
      Mat4 matrix = Mat4::Identity();
      for (int k = 0; k < 12; ++k) words >> matrix(k / 4, k % 4);
      if (!words || frame.camera.width < 1 || frame.camera.height < 1) continue;
      frame.world_from_camera.matrix() = matrix;
      stored.capture.frames.push_back(std::move(frame));
      stored.files.emplace_back();
    }
    return stored;
  }
  fs::path folder;
  std::vector<fs::path> files;
  StoredInfo known;
  ReadLog findings;
};

template <class Dataset>
struct PosesReader : Reader {
  using Params = NoParams;
  PosesReader(Params, Host&) {}
  std::vector<std::string> patterns() const override { return {"*.poses"}; }
  Recognition recognise(const fs::path& folder) const override {
    for (const auto& entry : fs::directory_iterator(folder)) {
      if (entry.path().extension() == kEnding) return Recognition::ByFiles;
    }
    return Recognition::No;
  }
  std::unique_ptr<const StoredDataset> open(const fs::path& folder) const override {
    return std::make_unique<Dataset>(folder);
  }
};

/// The next capture, whatever was asked for.
struct InOrderOnly : Poses {
  using Poses::Poses;
  mutable std::size_t next = 0;
  StoredCapture read(std::size_t, const NameSet& wanted) const override {
    return Poses::read(next++ % files.size(), wanted);
  }
};
struct FirstOfAll : Poses {
  using Poses::Poses;
  StoredCapture read(std::size_t i, const NameSet& wanted) const override {
    StoredCapture stored = Poses::read(0, wanted);
    stored.capture.index = known.captures.at(i);
    return stored;
  }
};
/// What is read lies in a place that all threads share.
struct SharesItsBuffer : Poses {
  using Poses::Poses;
  mutable std::atomic<int> place = 0;
  StoredCapture read(std::size_t i, const NameSet& wanted) const override {
    place = int(i);
    // However few processors there are, others have a turn here.
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return Poses::read(std::size_t(place), wanted);
  }
};
struct LeavesANote : Poses {
  explicit LeavesANote(const fs::path& place) : Poses(place) {
    std::ofstream(place / "read.txt") << "I was here";
  }
};
struct NothingUnlessAsked : Poses {
  using Poses::Poses;
  StoredCapture read(std::size_t i, const NameSet& wanted) const override {
    StoredCapture stored = Poses::read(i, wanted);
    if (wanted.empty()) {
      for (Frame& frame : stored.capture.frames) frame.camera = Camera();
    }
    return stored;
  }
};
struct SwapsCameras : Poses {
  using Poses::Poses;
  StoredCapture read(std::size_t i, const NameSet& wanted) const override {
    StoredCapture stored = Poses::read(i, wanted);
    auto& frames = stored.capture.frames;
    if (frames.size() == 2) std::swap(frames[0].world_from_camera, frames[1].world_from_camera);
    return stored;
  }
};
struct LosesTheLast : Poses {
  explicit LosesTheLast(const fs::path& place) : Poses(place) {
    known.captures.pop_back();
    files.pop_back();
  }
};
struct KnowsEverything : PosesReader<Poses> {
  using PosesReader::PosesReader;
  Recognition recognise(const fs::path&) const override { return Recognition::ByName; }
};
struct BlamesTheProgram : PosesReader<Poses> {
  using PosesReader::PosesReader;
  std::unique_ptr<const StoredDataset> open(const fs::path& folder) const override {
    auto dataset = std::make_unique<Poses>(folder);
    if (dataset->read(0, {}).capture.frames.empty()) {
      throw Error(ErrorKind::Internal, "no frames");
    }
    return dataset;
  }
};

}  // namespace diorama::test

DIORAMA_PLUGIN("lying_readers", "1.0.0", "MIT") {
  using namespace diorama::test;
  DIORAMA_ADD(PosesWriter, "poses", "Writes the poses of cameras.");
  DIORAMA_ADD_READER(PosesReader<Poses>, "honest", "Reads poses.", "*.poses");
  DIORAMA_ADD_READER(PosesReader<InOrderOnly>, "in_order_only", "Reads on.", "*.poses");
  DIORAMA_ADD_READER(PosesReader<FirstOfAll>, "first_of_all", "Reads one file.", "*.poses");
  DIORAMA_ADD_READER(PosesReader<SharesItsBuffer>, "shares_its_buffer", "Races.", "*.poses");
  DIORAMA_ADD_READER(PosesReader<LeavesANote>, "leaves_a_note", "Writes too.", "*.poses");
  DIORAMA_ADD_READER(PosesReader<NothingUnlessAsked>, "no_sizes", "Leaves sizes out.", "*.poses");
  DIORAMA_ADD_READER(PosesReader<SwapsCameras>, "swaps_cameras", "Mixes cameras up.", "*.poses");
  DIORAMA_ADD_READER(PosesReader<LosesTheLast>, "loses_the_last", "Ends too early.", "*.poses");
  DIORAMA_ADD_READER(KnowsEverything, "knows_everything", "Claims all folders.", "*.poses");
  DIORAMA_ADD_READER(BlamesTheProgram, "blames_the_program", "Throws another error.", "*.poses");
}
