// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <diorama/distribution.h>
#include <diorama/host.h>
#include <diorama/node_pattern.h>
#include <diorama/params.h>
#include <diorama/randomizer.h>

namespace dice {

/// Holds things in the air over an area, turned any way, and lets go of them with some speed and
/// spin. They start apart from each other, now as a handful, now spread over the area.
class ThrowDice final : public diorama::Randomizer {
 public:
  struct Params {
    std::string nodes = "/Assets/*";
    std::string area = "/Environment/**/area";
    diorama::Distribution spread = diorama::Range{0.3, 1.0};
    diorama::Distribution height_m = diorama::Range{0.02, 0.08};
    double speed = 0.4;
    double spin = 15.0;
    void visit(diorama::ParamVisitor& v);
  };

  ThrowDice(Params params, diorama::Host& host) : params_(std::move(params)), host_(host) {}
  void randomize(diorama::Scene& scene, const diorama::RandomizeContext& context,
                 const diorama::Rng& rng) override;

 private:
  Params params_;
  diorama::Host& host_;
};

}  // namespace dice
