// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "diorama/config.h"
#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/randomizer.h"

namespace diorama {

struct NodeDraws;

/// Gives objects that were made of one asset the looks of one of its variants: materials, meshes
/// and visibility of the parts, which have to be those of the variant that was spawned, or more.
class RandomVariant final : public Randomizer {
 public:
  struct Params {
    std::string nodes = "/Assets/*";
    std::string asset;
    Value variants;

    void visit(ParamVisitor& v);
  };

  RandomVariant(Params params, Host& host);
  void randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) override;

 private:
  std::string draw_name(const NodeDraws& draws) const;
  const Scene& variant(const std::string& name);
  void dress(Scene& scene, NodeId node, const std::string& name);

  Params params_;
  Host& host_;
  std::vector<std::pair<std::string, std::vector<std::string>>> sets_;
  std::map<std::string, std::unique_ptr<Scene>> loaded_;  ///< By name with its variants.
};

}  // namespace diorama
