// SPDX-License-Identifier: Apache-2.0
#include "number_on_top.h"

#include <algorithm>
#include <cmath>

namespace dice {

using diorama::Aabb;
using diorama::NodeId;
using diorama::Scene;
using diorama::Vec3;

namespace {

/// Whether `upper` covers a part of what `lower` shows upwards.
bool lies_on(const Aabb& upper, const Aabb& lower) {
  if (upper.centre().z() < lower.centre().z() + 0.5 * lower.size().z()) return false;
  const Vec3 apart = (upper.centre() - lower.centre()).cwiseAbs();
  const Vec3 reach = 0.4 * (upper.size() + lower.size());
  return apart.x() < reach.x() && apart.y() < reach.y();
}

}  // namespace

TopFace top_face(const Scene& scene, NodeId thing, std::string_view prefix) {
  TopFace top;
  for (const NodeId child : scene.subtree(thing)) {
    if (!std::string_view(scene[child].name).starts_with(prefix)) continue;
    const Vec3 up = scene.world_from_node(child).linear().col(2).normalized();
    const double lean = std::acos(std::clamp(up.z(), -1.0, 1.0));
    if (!top.node || lean < top.lean_rad) top = {child, lean};
  }
  return top;
}

void NumberOnTop::Params::visit(diorama::ParamVisitor& v) {
  v.param("nodes", nodes, {"Things to label.", diorama::kNodePattern});
  v.param("prefix", prefix,
          {"Nodes below whose names begin so look out of the faces; the rest of the name is the "
           "label."});
  v.param("taxonomy", taxonomy, {"Which label is set."});
  v.param("max_lean_deg", max_lean_deg,
          {"What leans more than this has no number on top: it is hidden.", "deg", 0, 90});
}

void NumberOnTop::randomize(Scene& scene, const diorama::RandomizeContext& context,
                            const diorama::Rng&) {
  struct Lying {
    NodeId node;
    Aabb box;
  };
  std::vector<Lying> lying;
  std::size_t found = 0;
  for (const NodeId node : scene.match(params_.nodes)) {
    const TopFace top = top_face(scene, node, params_.prefix);
    if (!top.node) continue;
    ++found;
    if (!scene.is_visible(node)) continue;
    if (top.lean_rad * 180.0 / diorama::kPi > params_.max_lean_deg) {
      scene.edit(node).is_visible = false;
      continue;
    }
    const std::string label = scene[top.node].name.substr(params_.prefix.size());
    scene.edit(node).labels[params_.taxonomy] = label;
    lying.push_back({node, scene.world_bounds(node)});
  }
  if (found == 0) {
    host_.log(diorama::LogLevel::Warning, "number_on_top: nothing that matches '" + params_.nodes +
                                              "' has nodes below called '" + params_.prefix +
                                              "...' at " + context.moment);
  }
  std::stable_sort(lying.begin(), lying.end(), [](const Lying& a, const Lying& b) {
    return a.box.centre().z() < b.box.centre().z();
  });
  std::vector<Lying> kept;
  for (const Lying& upper : lying) {
    const bool covers = std::any_of(kept.begin(), kept.end(), [&](const Lying& lower) {
      return lies_on(upper.box, lower.box);
    });
    if (covers) {
      scene.edit(upper.node).is_visible = false;
    } else {
      kept.push_back(upper);
    }
  }
}

}  // namespace dice
