// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "diorama/distribution.h"
#include "diorama/host.h"
#include "diorama/randomizer.h"

namespace diorama {

/// Draws the intrinsics of cameras anew; what is not given stays.
class CameraLens final : public Randomizer {
 public:
  struct Params {
    std::string nodes = "/Cameras/*";
    std::optional<Distribution> focal_length_mm = Range{18.0, 35.0};
    std::optional<Distribution> principal_point_px;
    std::optional<Distribution> f_stop;
    std::optional<Distribution> focus_distance_m;

    void visit(ParamVisitor& v);
  };

  CameraLens(Params params, Host& host);
  void randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) override;

 private:
  Params params_;
};

}  // namespace diorama
