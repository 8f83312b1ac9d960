// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <utility>

#include "embree_support/path_renderer.h"

namespace diorama {

/// The project's own path tracer on the CPU; see README.md beside this file.
class EmbreeRenderer final : public PathRenderer {
 public:
  using Params = PictureParams;

  EmbreeRenderer(Params params, Host& host) : PathRenderer(std::move(params), host) {}

 private:
  Film trace(const View& view, const PathSettings& settings, SamplePlan& plan) override;
  std::size_t traced_bytes(std::size_t pixels) const override;
  bool can_reuse_paths() const override { return true; }
};

}  // namespace diorama
