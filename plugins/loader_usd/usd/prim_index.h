// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "layer_stack.h"
#include "map_function.h"

namespace diorama::usd {

/// The ways in which one site brings in another, strongest first.
enum class Arc { Root, Inherit, Variant, Relocate, Reference, Payload, Specialize };

/// One site (a path in a layer stack) that may have opinions about a prim.
struct IndexNode {
  static constexpr int kNone = -1;

  int parent = kNone;
  /// The node whose opinion this arc comes from: the parent, or for an implied class arc the node
  /// of the class arc that implies it.
  int origin = kNone;
  Arc arc = Arc::Root;
  const LayerStack* stack = nullptr;
  std::string path;  ///< With variants selected on the way.
  std::shared_ptr<const MapFunction> map_to_parent;
  std::shared_ptr<const MapFunction> map_to_root;
  int namespace_depth = 0;   ///< Depth of the prim that the arc was found on.
  int sibling = 0;           ///< Place of the arc in its list.
  int levels_below_arc = 0;  ///< How far below the prim with the arc the index now stands.
  bool is_inert = false;     ///< Kept for its arcs only; it has no opinions.
  bool has_specs = false;
  std::vector<int> children;  ///< Strongest first.

  bool is_due_to_ancestor() const { return levels_below_arc > 0; }
  bool contributes() const { return has_specs && !is_inert; }
};

/// All sites that have opinions about one prim of a composed scene, as a tree.
class PrimIndex {
 public:
  std::vector<IndexNode> nodes;  ///< The first one is the root.
  /// Whether the prim is an instance: what is below it comes from its arcs alone.
  bool is_instance = false;

  /// Contributing nodes, strongest first. What a prim specializes is weaker than everything else.
  std::vector<int> strength_order() const;
  bool is_in_direct_arc(int node) const;
};

/// Builds prim indices by USD's rules for composition (strength order: local, inherits, variants,
/// relocates, references, payloads, specializes). Problems go to the diagnostics.
class PrimIndexer {
 public:
  /// `selections`, variant by set, are stronger than what layers say of root prims.
  PrimIndexer(LayerStacks& stacks, const LayerStack& root,
              std::map<std::string, std::string> selections = {})
      : stacks_(stacks), root_(root), selections_(std::move(selections)) {}

  /// The index of the pseudo-root.
  PrimIndex root_index() const;
  /// The index of the child `name` of the prim that `parent` describes.
  PrimIndex child_index(const PrimIndex& parent, std::string_view name);

 private:
  struct Frame;
  class Builder;

  LayerStacks& stacks_;
  const LayerStack& root_;
  std::map<std::string, std::string> selections_;
};

/// Names of the composed children, in composed order.
Strings child_names(const PrimIndex& index);

}  // namespace diorama::usd
