// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "diorama/frame.h"

namespace diorama {

/// Fills Frame::occlusions. Needs kInstanceId and Frame::instances, so call it after the annotators
/// `instance_ids` and `instances`. `coverage` is what Renderer::cover() gives, with distances, for
/// labelled_instances(), which has the order of Frame::instances. Where two surfaces are equally
/// far the one in kInstanceId is in front; when that is a third, neither is. Throws what
/// check_coverage() throws, and Error(Internal) when distances are missing.
void order_occlusions(std::span<const CoverageMask> coverage, Frame& frame);

}  // namespace diorama
