// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <utility>

#include "embree_support/path_renderer.h"
#include "path_tracer.h"
#include "virtual_light_tracer.h"

namespace diorama {

/// The project's own path tracer on the CPU; see README.md beside this file.
class EmbreeRenderer final : public PathRenderer {
 public:
  using Params = PictureParams;

  EmbreeRenderer(Params params, Host& host) : PathRenderer(std::move(params), host) {}

 private:
  using Clock = std::chrono::steady_clock;

  Film trace(const View& view, const PathSettings& settings, SamplePlan& plan) override;
  std::size_t traced_bytes(std::size_t pixels) const override;
  /// `sets`: null where there are no virtual lights.
  Film trace_in_rounds(const PathTracer& tracer, SamplePlan& plan, VirtualLightSets* sets,
                       int width, int height, Clock::time_point start, RayCounts& rays);
};

}  // namespace diorama
