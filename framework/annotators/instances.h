// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "diorama/annotator.h"
#include "diorama/host.h"
#include "diorama/params.h"

namespace diorama {

/// Box, in its node's space, of the instance's own leaves. A labelled node below another one is an
/// instance of its own and does not widen the outer one.
Aabb instance_bounds(const Scene& scene, const LabelledInstance& instance);

/// Keypoints of a labelled node and of what below it belongs to it, in its space; each name once.
std::vector<Keypoint> instance_keypoints(const Scene& scene, NodeId labelled);

/// Of the rigid body at or nearest above a labelled node, at the node's origin; nothing without
/// one.
std::optional<Velocity> instance_velocity(const Scene& scene, NodeId labelled);

/// Sets Instance::tight_box of those that have pixels; `ids` is kInstanceId.
void measure_tight_boxes(const Image<std::uint32_t>& ids, std::vector<Instance>& instances);

/// Fills Frame::instances: one entry per labelled instance of the scene, in the order of
/// labelled_instances(), everything but `visibility` (see visibility.h); and Frame::joints.
class Instances final : public Annotator {
 public:
  struct Params {
    void visit(ParamVisitor&) {}
  };
  Instances(Params, Host&) {}

  NameSet needs() const override;
  NameSet provides() const override;  ///< The annotation "instances".

 private:
  void do_annotate(const Scene& scene, Frame& frame) const override;
};

}  // namespace diorama
