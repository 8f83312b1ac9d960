// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "diorama/distribution.h"
#include "free_placement.h"

namespace diorama {

/// Puts the centre of each node's box at a random place in a volume. Rotation and scale stay.
class Scatter3d final : public Randomizer {
 public:
  struct Params {
    PlacementParams placement;
    std::optional<std::string> volumes;
    std::optional<std::string> excluded;
    Distribution offset = Distribution::between({-0.5, -0.5, 1.0}, {0.5, 0.5, 1.5});

    void visit(ParamVisitor& v);
  };

  Scatter3d(Params params, Host& host);
  /// Throws Error(Config) when nothing that fits `volumes` has a box.
  void randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) override;

 private:
  Params params_;
  Host& host_;
};

}  // namespace diorama
