// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/plugin.h"

namespace diorama::test {

/// A writer that writes nothing.
class QuietWriter : public Writer {
 public:
  struct Params {
    int size = 3;
    void visit(ParamVisitor& v) { v.param("size", size, {"Some number.", "m", 1, 9}); }
  };
  QuietWriter(Params, Host&) {}
  NameSet needs() const override { return {}; }
  void write(const Capture&, CaptureFiles&) const override {}
};

}  // namespace diorama::test
