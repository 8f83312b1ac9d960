// SPDX-License-Identifier: Apache-2.0
#include "random_labels.h"

#include "diorama/node_pattern.h"

#include "diorama/error.h"
#include "sampling.h"

namespace diorama {
namespace {

constexpr const char* kModes[] = {"replace", "add", "clear"};

}  // namespace

void RandomLabels::Params::visit(ParamVisitor& v) {
  v.param("nodes", nodes, {"Nodes to label.", kNodePattern});
  v.choice("mode", mode, kModes,
           {"replace: the only label of the node; add: its other taxonomies stay; clear: no label "
            "in any taxonomy, whatever `labels` says."});
  v.param("taxonomy", taxonomy, {"Taxonomy of the label."});
  v.param("labels", labels, {"Labels to choose from."});
}

RandomLabels::RandomLabels(Params params, Host&) : params_(std::move(params)) {
  if (params_.labels.texts().empty()) {
    throw Error(ErrorKind::Config, "'labels': expected at least one");
  }
}

void RandomLabels::randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) {
  const auto change = [&](NodeId node, NodeDraws& draws) {
    Labels& labels = scene.edit(node).labels;
    if (params_.mode != "add") labels.clear();
    if (params_.mode == "clear") return;
    labels[params_.taxonomy] = params_.labels.texts()[draws.text(params_.labels)];
  };
  draw_for_each(scene, scene.match(params_.nodes), context, rng, change);
}

}  // namespace diorama
