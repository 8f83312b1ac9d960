// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/annotator.h"
#include "diorama/host.h"
#include "diorama/params.h"

namespace diorama {

/// Turns exact depth into what a pair of cameras, or a camera and a projector, measures: disparity
/// with noise in steps, and nothing where the two cannot be matched.
class DepthSensor final : public Annotator {
 public:
  struct Params {
    double baseline_m = 0.055;
    double disparity_noise_px = 0.08;
    double disparity_step_px = 0.0625;
    double min_m = 0.3;
    double max_m = 8.0;
    double max_incidence_deg = 80.0;
    double edge_step_px = 1.0;
    int edge_radius_px = 2;
    bool shadows = true;
    double dropout = 0.001;

    void visit(ParamVisitor& v);
  };

  DepthSensor(Params params, Host& host);

  NameSet needs() const override;
  NameSet provides() const override;

 private:
  void do_annotate(const Scene& scene, Frame& frame) const override;
  Image<float> measured(const Image<float>& depth, const Camera& camera, std::uint64_t seed) const;

  Params params_;
  Host& host_;
};

}  // namespace diorama
