// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <diorama/host.h>
#include <diorama/node_pattern.h>
#include <diorama/params.h>
#include <diorama/randomizer.h>

namespace dice {

/// Labels things by the face that they show upwards as they lie now. Nodes called PREFIX_WORD below
/// them look along +z out of the faces; WORD becomes the label. What leans, and what lies on
/// another of the nodes, has no label that a picture could show: it is hidden, so that no picture
/// has it without a label.
class NumberOnTop final : public diorama::Randomizer {
 public:
  struct Params {
    std::string nodes = "/Assets/*";
    std::string prefix = "face_";
    std::string taxonomy = "class";
    double max_lean_deg = 5.0;
    void visit(diorama::ParamVisitor& v);
  };

  NumberOnTop(Params params, diorama::Host& host) : params_(std::move(params)), host_(host) {}
  void randomize(diorama::Scene& scene, const diorama::RandomizeContext& context,
                 const diorama::Rng& rng) override;

 private:
  Params params_;
  diorama::Host& host_;
};

/// The node below whose +z is nearest to the world's, and the angle between both; a null id without
/// such nodes.
struct TopFace {
  diorama::NodeId node;
  double lean_rad = diorama::kPi;
};
TopFace top_face(const diorama::Scene& scene, diorama::NodeId thing, std::string_view prefix);

}  // namespace dice
