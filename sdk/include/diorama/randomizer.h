// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "diorama/component.h"
#include "diorama/frame.h"
#include "diorama/rng.h"
#include "diorama/scene.h"

namespace diorama {

struct RandomizeContext {
  /// "environment" once per visit, before physics; or the name of a capture series ("floating").
  std::string moment;
  int capture = -1;  ///< Capture::index; -1 at the moment "environment".
  Vec3 working_area_world = Vec3::Zero();
  /// How many times this randomizer acted at this moment before, in all earlier visits and in this
  /// one, whether or not this run made them. What a `sequence` goes by.
  int occurrence = 0;
  /// The first frame of the clip that begins, at the moments of clips.
  std::optional<ClipFrame> clip = {};
};

/// Changes poses, lights, materials, cameras. Called by one thread at a time.
class DIORAMA_SDK_API Randomizer : public Component {
 public:
  static constexpr ComponentKind kKind = ComponentKind::Randomizer;

  ~Randomizer() override;

  /// All chance comes from `rng`, which is keyed by visit, capture and this randomizer's name. Fork
  /// it per node path, so that one more node leaves the draws of the others as they were.
  virtual void randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) = 0;

  /// Of randomizers that acted when a clip began: shows one of its frames. Called for all of these
  /// in order, the first one too, once physics has moved its bodies. Poses may change, but none of
  /// rigid bodies, and which mesh a node has. Nothing moves unless a randomizer does more.
  virtual void play(Scene& scene, const ClipFrame& frame);

  /// The same before physics moves on to that frame, of every frame but the first. What goes by
  /// time alone belongs here: colliders without a rigid body that it moves push bodies on their
  /// way.
  virtual void lead(Scene& scene, const ClipFrame& frame);
};

}  // namespace diorama
