// SPDX-License-Identifier: Apache-2.0
// Components that end the process, and an annotator that cannot even be made.
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <stdexcept>
#include <thread>

#include "diorama/annotator.h"
#include "test_writer.h"

namespace diorama::test {

template <auto Act>
struct Acts final : QuietWriter {
  using QuietWriter::QuietWriter;
  void write(const Capture& capture, CaptureFiles&) const override {
    if (capture.index == 1) Act();
  }
};

void leave() { std::exit(0); }
void leave_quickly() { std::quick_exit(0); }
void leave_at_once() { _exit(0); }
void leave_at_once_by_c() { std::_Exit(0); }
void touch_nothing() { std::raise(SIGSEGV); }
void abort_all() { std::abort(); }
void dig(int depth) {
  volatile char room[4096];
  room[0] = char(depth);
  if (depth > 0) dig(depth + 1);
  room[1] = room[0];  // or there would be no room to keep
}
void dig_down() { dig(1); }
void crash_elsewhere() {
  std::thread([] { std::raise(SIGSEGV); }).join();
}

struct NoLicence final : Annotator {
  struct Params {
    void visit(ParamVisitor&) {}
  };
  NoLicence(Params, Host&) { throw std::runtime_error("no licence for edges"); }
  NameSet needs() const override { return {"color"}; }
  NameSet provides() const override { return {"edges"}; }

 private:
  void do_annotate(const Scene&, Frame&) const override {}
};

struct WantsEdges final : QuietWriter {
  using QuietWriter::QuietWriter;
  NameSet needs() const override { return {"edges"}; }
};

/// Works, but makes what the program's own annotator makes, and says so first in the alphabet.
struct OwnIds final : Annotator {
  struct Params {
    void visit(ParamVisitor&) {}
  };
  OwnIds(Params, Host&) {}
  NameSet needs() const override { return {"leaf_id"}; }
  NameSet provides() const override { return {"instance_id"}; }

 private:
  void do_annotate(const Scene&, Frame& frame) const override {
    frame.set(kInstanceId, Image<std::uint32_t>(3, 3, 0));
  }
};

struct WantsIds final : QuietWriter {
  using QuietWriter::QuietWriter;
  NameSet needs() const override { return {"instance_id"}; }
};

struct AnotherList final : Annotator {
  struct Params {
    void visit(ParamVisitor&) {}
  };
  AnotherList(Params, Host&) {}
  NameSet needs() const override { return {"color"}; }
  NameSet provides() const override { return {"heat"}; }

 private:
  void do_annotate(const Scene&, Frame&) const override {}
};

struct WantsHeat final : QuietWriter {
  using QuietWriter::QuietWriter;
  NameSet needs() const override { return {"heat"}; }
};

}  // namespace diorama::test

DIORAMA_PLUGIN("spoils_runs", "1.0.0", "MIT") {
  using namespace diorama::test;
  DIORAMA_ADD(Acts<leave>, "leaves", "Ends the program.");
  DIORAMA_ADD(Acts<leave_quickly>, "leaves_quickly", "Ends the program, without its destructors.");
  DIORAMA_ADD(Acts<leave_at_once>, "leaves_at_once", "Ends the program, without any handler.");
  DIORAMA_ADD(Acts<leave_at_once_by_c>, "leaves_at_once_by_c", "The same by C's name.");
  DIORAMA_ADD(Acts<touch_nothing>, "crashes", "Crashes.");
  DIORAMA_ADD(Acts<abort_all>, "aborts", "Aborts.");
  DIORAMA_ADD(Acts<dig_down>, "digs", "Has no end of calls.");
  DIORAMA_ADD(Acts<crash_elsewhere>, "crashes_elsewhere", "Crashes in a thread of its own.");
  DIORAMA_ADD(WantsEdges, "wants_edges", "Needs edges.");
  DIORAMA_ADD(WantsIds, "wants_ids", "Needs ids.");
  DIORAMA_ADD(WantsHeat, "wants_heat", "Needs heat.");
  DIORAMA_ADD_ANNOTATOR(NoLicence, "edges", "Makes edges.", "color", "edges");
  DIORAMA_ADD_ANNOTATOR(OwnIds, "a_first", "Makes ids.", "leaf_id", "instance_id");
  DIORAMA_ADD_ANNOTATOR(AnotherList, "heat", "Makes heat.", "", "heat");
}
