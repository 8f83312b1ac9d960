// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/component.h"
#include "diorama/frame.h"
#include "diorama/scene.h"

namespace diorama {

/// Derives channels or instance fields from what was rendered. Called on the main thread.
class DIORAMA_SDK_API Annotator : public Component {
 public:
  static constexpr ComponentKind kKind = ComponentKind::Annotator;

  ~Annotator() override;

  virtual NameSet needs() const = 0;     ///< Channels and annotations that must be there before.
  virtual NameSet provides() const = 0;  ///< Channels and annotations that writers may demand.
  virtual void annotate(const Scene& scene, Frame& frame) const = 0;
};

}  // namespace diorama
