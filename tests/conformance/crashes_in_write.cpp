// SPDX-License-Identifier: Apache-2.0
#include <csignal>

#include "diorama/plugin.h"
#include "diorama/writer.h"

namespace diorama::test {

struct Crashes : Writer {
  struct Params {
    void visit(ParamVisitor&) {}
  };
  Crashes(Params, Host&) {}
  NameSet needs() const override { return {}; }
  void write(const Capture&, CaptureFiles&) const override { std::raise(SIGSEGV); }
};

}  // namespace diorama::test

DIORAMA_PLUGIN("crashes_in_write", "1.0.0", "MIT") {
  DIORAMA_ADD(diorama::test::Crashes, "crashes", "Crashes when it writes.");
}
