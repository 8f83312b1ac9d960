// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "diorama/distribution.h"
#include "diorama/host.h"
#include "diorama/randomizer.h"

namespace diorama {

/// Puts each node (the centre of its box) at a place of a camera's picture and at a distance in
/// front of it. Rotation and scale stay.
class CameraRelativePose final : public Randomizer {
 public:
  struct Params {
    std::string nodes = "/Assets/*";
    std::string camera = "/Cameras/*";
    Distribution distance_m = Range{0.8, 1.5};
    Distribution horizontal = Range{-0.8, 0.8};
    Distribution vertical = Range{-0.8, 0.8};

    void visit(ParamVisitor& v);
  };

  CameraRelativePose(Params params, Host& host);
  /// Throws Error(Config) when no camera fits.
  void randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) override;

 private:
  Params params_;
};

}  // namespace diorama
