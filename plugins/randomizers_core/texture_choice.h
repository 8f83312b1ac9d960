// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "diorama/distribution.h"
#include "diorama/host.h"

namespace diorama {

struct NodeDraws;

/// Images to choose from. They are looked up at once, read when picked, and kept as long as a scene
/// uses them.
class TextureChoice {
 public:
  /// Throws Error(Asset) when one is not there. The host must outlive this.
  TextureChoice(TextDistribution names, const Host& host);

  bool is_empty() const { return names_.texts().empty(); }
  /// Not when it is empty.
  std::shared_ptr<const Texture> draw(NodeDraws& draws);

 private:
  TextDistribution names_;
  const Host& host_;
  std::vector<std::weak_ptr<const Texture>> read_;  ///< One per name.
};

}  // namespace diorama
