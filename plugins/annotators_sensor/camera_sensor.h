// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "diorama/annotator.h"
#include "diorama/distribution.h"
#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/rng.h"

namespace diorama {

/// How one colour of one pixel turns light into a number.
struct Photosite {
  double full_well = 0.0;   ///< Electrons that give the largest number.
  double read_noise = 0.0;  ///< Standard deviation, electrons.
  bool has_shot_noise = true;
  int largest_code = 0;  ///< Codes are 0 ... largest_code.

  /// The code for light that fills `fill` of the well on average; what lies above the well is cut
  /// off.
  int code(double fill, Rng& rng) const;
};

/// Turns linear light into the picture that a camera takes of it: lens, exposure, noise, sRGB.
class CameraSensor final : public Annotator {
 public:
  struct Params {
    std::string exposure = "auto";
    Distribution exposure_ev = 0.0;
    double burnt_share = 1.0;
    Distribution warmth_ev = 0.0;
    double iso = 400.0;
    double exposure_time_s = 1.0 / 60.0;
    double f_stop = 2.8;
    double vignetting = 1.0;
    double red_shift_px = 0.0;
    double blue_shift_px = 0.0;
    bool shot_noise = true;
    double full_well_electrons = 15000.0;
    double read_noise_electrons = 3.0;
    int bits = 12;
    Distribution smoothing_px = 0.0;
    Distribution contrast = 0.0;
    Distribution saturation = 1.0;
    Distribution sharpening = 0.0;

    void visit(ParamVisitor& v);
  };

  CameraSensor(Params params, Host& host);

  NameSet needs() const override;
  NameSet provides() const override;

  /// Share of the well that light of 1 nit fills.
  double manual_exposure() const;
  Photosite photosite() const;

 private:
  void do_annotate(const Scene& scene, Frame& frame) const override;
  Params params_;
  Host& host_;
};

}  // namespace diorama
