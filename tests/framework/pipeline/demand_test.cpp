// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/demand.h"

#include "diorama/error.h"
#include "support/catch.h"

using namespace diorama;

namespace {

const NameSet kRendered{"color", "leaf_id", "position"};
const std::vector<AnnotatorOffer> kOffers{
    {"boxes", {"instances", "position"}, {"boxes"}},
    {"instances", {"instance_id"}, {"instances"}},
    {"instance_ids", {"leaf_id"}, {"instance_id"}},
    {"loop_a", {"b"}, {"a"}},
    {"loop_b", {"a"}, {"b"}},
};

Demand demand_for(NameSet names) {
  const std::vector<Need> needs{{"writer 'w'", std::move(names)}};
  return resolve_demand(needs, kRendered, "renderer 'r'", kOffers);
}

}  // namespace

TEST_CASE("Needs become channels and annotators in an order that works", "[demand]") {
  const Demand demand = demand_for({"boxes", "color"});
  CHECK(demand.channels == NameSet{"color", "leaf_id", "position"});
  CHECK(demand.annotators == std::vector<std::size_t>{2, 1, 0});
  CHECK_FALSE(demand.visibility);
}

TEST_CASE("Only what is asked for is made", "[demand]") {
  const Demand demand = demand_for({"color"});
  CHECK(demand.channels == NameSet{"color"});
  CHECK(demand.annotators.empty());
}

TEST_CASE("Without writers nothing is made", "[demand]") {
  const Demand demand = resolve_demand({}, kRendered, "renderer 'r'", kOffers);
  CHECK(demand.channels.empty());
  CHECK(demand.annotators.empty());
}

TEST_CASE("Visibility brings instances and their ids along", "[demand]") {
  const Demand plain = demand_for({"visibility"});
  CHECK(plain.visibility);
  CHECK_FALSE(plain.amodal_mask);
  CHECK(plain.channels == NameSet{"leaf_id"});
  CHECK(demand_for({"amodal_mask"}).amodal_mask);
  CHECK_FALSE(plain.occlusion_order);
  const Demand ordered = demand_for({"occlusion_order"});
  CHECK(ordered.occlusion_order);
  CHECK(ordered.visibility);
  CHECK(ordered.channels == NameSet{"leaf_id"});
}

TEST_CASE("Motion is made from ids and positions unless the renderer provides it", "[demand]") {
  const Demand made = demand_for({"motion"});
  CHECK(made.motion);
  CHECK(made.channels == NameSet{"leaf_id", "position"});
  const std::vector<Need> needs{{"writer 'w'", {"motion"}}};
  const Demand rendered = resolve_demand(needs, {"motion"}, "renderer 'r'", kOffers);
  CHECK_FALSE(rendered.motion);
  CHECK(rendered.channels == NameSet{"motion"});
}

TEST_CASE("A need that nothing provides names the writer, the need and what there is", "[demand]") {
  CHECK_THROWS_WITH(demand_for({"heat"}),
                    ContainsSubstring("writer 'w': needs 'heat', which neither renderer 'r' nor an "
                                      "annotator provides") &&
                        ContainsSubstring("color") && ContainsSubstring("visibility"));
  const std::vector<Need> needs{{"writer 'w'", {"boxes"}}};
  CHECK_THROWS_WITH(resolve_demand(needs, {"color", "leaf_id"}, "renderer 'r'", kOffers),
                    ContainsSubstring("writer 'w' (through annotator 'boxes'): needs 'position'"));
}

TEST_CASE("What the job lists comes before the renderer's own", "[demand]") {
  const std::vector<AnnotatorOffer> offers{{"film", {"light"}, {"color"}, false},
                                           {"sensor", {"light"}, {"color"}, true}};
  const std::vector<Need> needs{{"writer 'w'", {"color"}}};
  const NameSet rendered{"color", "light"};
  const Demand listed = resolve_demand(needs, rendered, "renderer 'r'", offers);
  CHECK(listed.annotators == std::vector<std::size_t>{1});
  CHECK(listed.channels == NameSet{"light"});
  const Demand unlisted =
      resolve_demand(needs, rendered, "renderer 'r'", std::span(offers).first(1));
  CHECK(unlisted.annotators.empty());
  CHECK(unlisted.channels == NameSet{"color"});
}

TEST_CASE("Annotators that wait for each other are refused", "[demand]") {
  CHECK_THROWS_WITH(demand_for({"a"}), ContainsSubstring("needs its own output"));
}

TEST_CASE("Listed annotators that make the same are refused", "[demand]") {
  const std::vector<AnnotatorOffer> offers{
      {"python", {}, {"edges"}, true, "job.yaml:3: annotators[0]"},
      {"python", {}, {"edges", "more"}, true, "job.yaml:4: annotators[1]"}};
  CHECK_THROWS_WITH(resolve_demand({}, {}, "renderer 'r'", offers),
                    "job.yaml:4: annotators[1]: python makes 'edges', which another entry of "
                    "'annotators' (job.yaml:3: annotators[0]) makes already");
}
