// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "path_tracer.h"
#include "renderer_support/sample_plan.h"

namespace diorama {

struct PictureCounts {
  std::uint64_t paths = 0;  ///< Those that learn among them.
  RayCounts rays;
};

/// The light paths of a picture, with virtual lights and a radiance cache of its own where
/// `settings` ask for them (they name none themselves). `settings.host` is not needed. Adds to
/// `counts`.
Film picture_film(const EmbreeScene& scene, const View& view, TraceSettings settings, Isa isa,
                  SamplePlan& plan, Host& host, PictureCounts& counts);

}  // namespace diorama
