// SPDX-License-Identifier: Apache-2.0
#include "diorama/plugin.h"
#include "diorama/writer.h"

namespace diorama::test {

struct Leaks : Writer {
  struct Params {
    void visit(ParamVisitor&) {}
  };
  Leaks(Params, Host&) {}
  NameSet needs() const override { return {}; }
  void write(const Capture&, CaptureFiles&) const override {
    [[maybe_unused]] static thread_local volatile char* lost = nullptr;
    lost = new char[1000];
    lost = nullptr;
  }
};

}  // namespace diorama::test

DIORAMA_PLUGIN("leaks", "1.0.0", "MIT") {
  DIORAMA_ADD(diorama::test::Leaks, "leaks", "Loses memory when it writes.");
}
