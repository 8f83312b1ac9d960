// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/component.h"
#include "diorama/frame.h"
#include "diorama/scene.h"

namespace diorama {

/// Derives channels or annotations from what was rendered. Called by one thread at a time. With its
/// default parameters it needs and provides what its plugin lists (DIORAMA_ADD_ANNOTATOR), so that
/// none is made that no job uses.
class DIORAMA_SDK_API Annotator : public Component {
 public:
  static constexpr ComponentKind kKind = ComponentKind::Annotator;

  ~Annotator() override;

  virtual NameSet needs() const = 0;     ///< Channels and annotations that must be there before.
  virtual NameSet provides() const = 0;  ///< Channels and annotations that writers may demand.

  /// Lets do_annotate() work on the frame and checks what it did. Throws Error naming the channel
  /// when it sets one that it does not provide, leaves one out that it provides, or gives one
  /// another size than the picture or another pixel type than frame.h says.
  void annotate(const Scene& scene, Frame& frame) const;

 private:
  /// Meanwhile the frame has the channels that stand in needs() and provides(), and no others.
  virtual void do_annotate(const Scene& scene, Frame& frame) const = 0;
};

}  // namespace diorama
