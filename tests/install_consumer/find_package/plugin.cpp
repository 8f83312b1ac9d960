// SPDX-License-Identifier: Apache-2.0
#include <diorama/plugin.h>
#include <diorama/randomizer.h>

int helper_of_the_stranger(int x) { return x + 1; }

struct Stranger final : diorama::Randomizer {
  struct Params {
    int steps = helper_of_the_stranger(1);
    void visit(diorama::ParamVisitor& v) { v.param("steps", steps, {"Steps."}); }
  };
  Stranger(Params, diorama::Host&) {}
  void randomize(diorama::Scene&, const diorama::RandomizeContext&, const diorama::Rng&) override {}
};

DIORAMA_PLUGIN("stranger_plugin", "1.2.3", "MIT") {
  DIORAMA_ADD(Stranger, "stranger", "Does nothing.");
}
