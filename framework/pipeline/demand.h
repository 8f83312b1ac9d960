// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <vector>

#include "diorama/annotator.h"
#include "diorama/frame.h"

namespace diorama {

/// Who wants what: a writer's name and its needs().
struct Need {
  std::string who;
  NameSet names;
};

/// An annotator as the resolution sees it.
struct AnnotatorOffer {
  std::string type;
  NameSet needs;
  NameSet provides;
  bool is_listed = false;  ///< By the job: its channels come before those of the renderer.
  std::string where = {};  ///< In the job, when it is listed there.
};

/// What has to be made so that every need is met.
struct Demand {
  NameSet channels;                     ///< Asked of the renderer.
  std::vector<std::size_t> annotators;  ///< Indices into the offers, in an order that works.
  bool visibility = false;              ///< Instance::visibility ...
  bool amodal_mask = false;             ///< ... with masks.
  bool occlusion_order = false;         ///< Frame::occlusions.
  bool motion = false;                  ///< kMotion, when the renderer does not provide it.
  bool flow_forward = false;            ///< kFlowForward and its states.
  bool flow_backward = false;           ///< kFlowBackward and its states.
};

/// Annotations that the pipeline itself makes, with Renderer::cover().
inline constexpr std::string_view kVisibility = "visibility";
inline constexpr std::string_view kAmodalMask = "amodal_mask";
inline constexpr std::string_view kOcclusionOrder = "occlusion_order";
inline constexpr std::string_view kInstances = "instances";

/// Throws Error(Config) that names the first writer whose need nothing provides, and what would,
/// and when two listed offers provide the same.
Demand resolve_demand(std::span<const Need> needs, const NameSet& renderer_provides,
                      const std::string& renderer, std::span<const AnnotatorOffer> offers);

}  // namespace diorama
