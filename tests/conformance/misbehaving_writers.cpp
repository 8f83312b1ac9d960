// SPDX-License-Identifier: Apache-2.0
// Writers that break one promise each.
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>

#include "diorama/plugin.h"
#include "diorama/writer.h"

namespace diorama::test {

class Base : public Writer {
 public:
  struct Params {
    void visit(ParamVisitor&) {}
  };
  Base(Params, Host&) {}
  NameSet needs() const override { return {"color", "instances"}; }
  void write(const Capture& capture, CaptureFiles& files) const override {
    files.add_text(std::to_string(capture.index) + ".txt", capture.phase);
  }
};

struct CountsInstead : Base {
  using Base::Base;
  mutable std::atomic<int> count = 0;  // one name for two captures would be another fault
  void write(const Capture&, CaptureFiles& files) const override {
    const std::string number = std::to_string(count++);
    files.add_text(number + ".txt", number);
  }
};

struct KeepsTheTime : Base {
  using Base::Base;
  static inline int run = 0;
  void begin(const DatasetInfo&, DatasetFiles& files) override {
    files.add_text("run.txt", std::to_string(++run));
  }
};

struct ChangesCaptures : Base {
  using Base::Base;
  void write(const Capture& capture, CaptureFiles&) const override {
    for (const Frame& frame : capture.frames) const_cast<Frame&>(frame).instances.clear();
  }
};

struct NeedsFrames : Base {
  using Base::Base;
  void write(const Capture& capture, CaptureFiles&) const override {
    if (capture.frames.empty()) throw Error(ErrorKind::Internal, "there is nothing to write");
  }
};

struct LeavesItsFolder : Base {
  using Base::Base;
  void finish(const RecordReader&, DatasetFiles& files) override {
    files.add_text("../stolen.txt", "");
  }
};

struct OneNameForAll : Base {
  using Base::Base;
  void write(const Capture&, CaptureFiles& files) const override {
    files.add_text("picture.txt", "");
  }
};

struct WritesByItself : Base {
  using Base::Base;
  void begin(const DatasetInfo&, DatasetFiles&) override {
    std::ofstream("by_itself.txt") << "hello";
    std::puts("I am here");
  }
};

struct WantsMore : Base {
  using Base::Base;
  NameSet needs() const override { return {"edges"}; }
};

}  // namespace diorama::test

DIORAMA_PLUGIN("misbehaving_writers", "1.0.0", "MIT") {
  using namespace diorama::test;
  DIORAMA_ADD(CountsInstead, "counts_instead", "Names files by a counter.");
  DIORAMA_ADD(KeepsTheTime, "keeps_the_time", "Writes something else each time.");
  DIORAMA_ADD(ChangesCaptures, "changes_captures", "Takes what it was lent.");
  DIORAMA_ADD(NeedsFrames, "needs_frames", "Throws at empty captures.");
  DIORAMA_ADD(LeavesItsFolder, "leaves_its_folder", "Writes above its folder.");
  DIORAMA_ADD(OneNameForAll, "one_name_for_all", "Overwrites its files.");
  DIORAMA_ADD(WritesByItself, "writes_by_itself", "Writes past the host.");
  DIORAMA_ADD(WantsMore, "wants_more", "Needs a channel of another plugin.");
}
