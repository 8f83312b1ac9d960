// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/renderer.h"
#include "null_scene.h"

namespace diorama {

/// Geometry channels and labels as every renderer gives them, and a picture in one flat colour per
/// node instead of light transport. Needs no engine; for tests and dry runs of a job.
class NullRenderer final : public Renderer {
 public:
  struct Params {
    void visit(ParamVisitor&) {}
  };

  NullRenderer(const Params& params, Host& host);
  NameSet provides() const override;

 private:
  void do_prepare(const Scene& scene) override;
  Frame do_render(const Scene& scene, const RenderRequest& request) override;
  std::vector<CoverageMask> do_cover(const Scene& scene, NodeId camera,
                                     std::span<const LabelledInstance> instances,
                                     bool with_distances) override;
  std::vector<std::uint8_t> do_see(const Scene& scene, NodeId camera,
                                   std::span<const Vec3> points_world) override;

  Host& host_;
  NullScene meshes_;
};

}  // namespace diorama
