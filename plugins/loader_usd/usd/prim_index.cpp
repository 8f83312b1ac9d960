// SPDX-License-Identifier: Apache-2.0
#include "prim_index.h"

#include <algorithm>
#include <cstring>
#include <map>
#include <optional>
#include <set>
#include <tuple>
#include <unordered_set>
#include <utility>

#include "error.h"
#include "path.h"

namespace diorama::usd {
namespace {

// Far above what scenes need; stops arcs that multiply.
constexpr std::size_t kMaxNodes = 4000;
constexpr int kMaxRecursion = 64;

bool is_class_arc(Arc arc) { return arc == Arc::Inherit || arc == Arc::Specialize; }

std::shared_ptr<const MapFunction> share(MapFunction function) {
  return std::make_shared<const MapFunction>(std::move(function));
}

std::shared_ptr<const MapFunction> identity_map() { return share(MapFunction::identity()); }

bool has_field(const LayerStack& stack, std::string_view path, std::string_view field) {
  return std::any_of(stack.layers.begin(), stack.layers.end(), [&](const auto& entry) {
    const PrimSpec* prim = entry.layer->prim(path);
    return prim && entry.layer->has(prim->fields, field);
  });
}

// Whether the site, or one below it, is where a relocate takes a prim away.
bool holds_relocate_source(const LayerStack& stack, const std::string& path) {
  const auto at = stack.relocate_targets.lower_bound(path);
  return at != stack.relocate_targets.end() && path::has_prefix(at->first, path);
}

void rank_preorder(const PrimIndex& index, int node, std::vector<int>& ranks, int& next) {
  ranks[static_cast<std::size_t>(node)] = next++;
  for (const int child : index.nodes[static_cast<std::size_t>(node)].children) {
    rank_preorder(index, child, ranks, next);
  }
}

// Lists all nodes, strongest first.
class StrengthOrder {
 public:
  explicit StrengthOrder(const PrimIndex& index) : index_(index), ranks_(index.nodes.size()) {
    int next = 0;
    rank_preorder(index, 0, ranks_, next);
  }

  std::vector<int> list() {
    emit(0);
    return std::move(order_);
  }

 private:
  const IndexNode& node(int i) const { return index_.nodes[static_cast<std::size_t>(i)]; }

  // A node with all of its subtree; what it specializes comes behind the rest.
  void emit(int i) {
    std::vector<int> specialized;
    visit(i, specialized);
    std::sort(specialized.begin(), specialized.end(),
              [&](int a, int b) { return key(a) < key(b); });
    for (const int weak : specialized) emit(weak);
  }

  void visit(int i, std::vector<int>& specialized) {
    order_.push_back(i);
    for (const int child : node(i).children) {
      if (node(child).arc == Arc::Specialize) {
        specialized.push_back(child);
      } else {
        visit(child, specialized);
      }
    }
  }

  // Arcs of deeper prims first, then by the strength of the arc as authored, then the implied ones
  // that are nearer to the root.
  std::tuple<int, int, int, int> key(int i) const {
    int origin = i;
    int implied = 0;
    while (node(origin).origin != node(origin).parent) {
      origin = node(origin).origin;
      ++implied;
    }
    return {node(i).levels_below_arc, ranks_[static_cast<std::size_t>(origin)], -implied,
            ranks_[static_cast<std::size_t>(i)]};
  }

  const PrimIndex& index_;
  std::vector<int> ranks_;
  std::vector<int> order_;
};

enum class TaskKind {
  Relocations,
  References,
  Payloads,
  Inherits,
  ImpliedClasses,
  Specializes,
  VariantSets,
  Variant,
  VariantWithoutSelection,
};

struct Task {
  TaskKind kind;
  int node;
  std::string set;  ///< Of variants.
  int sibling = 0;
};

// Names a site in sets.
std::string site_key(const LayerStack& stack, std::string_view path) {
  std::string key(sizeof(void*), '\0');
  const LayerStack* address = &stack;
  std::memcpy(key.data(), &address, sizeof(void*));
  return key.append(path);
}

struct ArcOptions {
  bool contributes = true;
  bool with_ancestors = false;
  bool skip_duplicates = false;
};

}  // namespace

std::vector<int> PrimIndex::strength_order() const {
  std::vector<int> order = StrengthOrder(*this).list();
  order.erase(
      std::remove_if(order.begin(), order.end(),
                     [&](int i) { return !nodes[static_cast<std::size_t>(i)].contributes(); }),
      order.end());
  return order;
}

bool PrimIndex::is_in_direct_arc(int node) const {
  for (int i = node; i > 0; i = nodes[static_cast<std::size_t>(i)].parent) {
    if (!nodes[static_cast<std::size_t>(i)].is_due_to_ancestor()) return true;
  }
  return false;
}

namespace {

// Whether the layer stack relocates something to the path or to what is below it.
bool relocates_to(const LayerStack& stack, const std::string& path) {
  const auto target = stack.relocate_sources.lower_bound(path);
  return target != stack.relocate_sources.end() && path::has_prefix(target->first, path);
}

}  // namespace

// A builder that waits while another one builds the subtree of an arc that it adds.
struct PrimIndexer::Frame {
  Builder* builder;
  int parent;
  std::shared_ptr<const MapFunction> map_to_parent;
  Arc arc;
  std::string requested_path;
  const LayerStack* requested_stack;
  bool skip_duplicates;
  const Frame* previous;
  int depth;
};

class PrimIndexer::Builder {
 public:
  Builder(PrimIndexer& indexer, const Frame* frame, int levels_above)
      : stacks_(indexer.stacks_), indexer_(indexer), frame_(frame), levels_above_(levels_above) {}

  void start(const LayerStack& stack, const std::string& path, bool contributes);
  void start_child(const PrimIndex& parent, std::string_view name, bool contributes);
  void build_with_ancestors(const LayerStack& stack, const std::string& path, bool contributes);
  void run(bool with_variants);
  PrimIndex take() { return std::move(index_); }
  const PrimIndex& index() const { return index_; }
  void finish();

 private:
  IndexNode& node(int i) { return index_.nodes[static_cast<std::size_t>(i)]; }
  const IndexNode& node(int i) const { return index_.nodes[static_cast<std::size_t>(i)]; }

  void copy_subtree(const PrimIndex& source, std::string_view name);
  void disable_shadowed_by_instance();
  void add_task(Task task);
  void add_tasks(int node, bool skip_expressed);
  void add_tasks_recursively(int node, bool skip_expressed);
  Task pop_task();
  void run_task(const Task& task);

  int add_arc(Arc arc, int parent, int origin, const LayerStack& stack, const std::string& path,
              std::shared_ptr<const MapFunction> map, int sibling, ArcOptions options);
  int append(PrimIndex subtree, int parent, IndexNode arc_node);
  void insert_child(int parent, int child);
  bool is_stronger_sibling(int a, int b) const;
  bool has_few_nodes() const;
  void know_sites();
  bool has_site(const LayerStack& stack, const std::string& path);
  bool may_be_near(const LayerStack& stack, const std::string& path);
  bool is_cycle(Arc arc, int parent, const LayerStack& stack, const std::string& path);
  bool is_duplicate(const LayerStack& stack, const std::string& path);

  void eval_relocations(int node);
  void elide(int node);
  void elide_relocated(int node);
  void eval_references(int node, Arc arc);
  void eval_classes(int node, Arc arc);
  int add_class_arc(Arc arc, int parent, int origin, std::shared_ptr<const MapFunction> map,
                    int sibling, const LayerStack* ignored_stack, const std::string& ignored_path);
  void eval_implied_classes(int node);
  void eval_implied_class_tree(int destination, int source, const MapFunction& transfer,
                               bool is_start);
  bool has_class_child(int node) const;
  int class_hierarchy_start(int node);

  void eval_variant_sets(int node);
  void eval_variant(const Task& task);
  std::optional<std::string> prior_selection(int node, const std::string& path_in_root, int levels,
                                             const std::string& set) const;
  std::optional<std::string> find_selection(int node, const std::string& set) const;
  std::optional<std::string> search_selection(
      int node, const std::string& path, const std::string& set,
      std::vector<std::pair<const Frame*, const Builder*>>& frames) const;
  std::optional<std::string> selection_at(int node, const std::string& path,
                                          const std::string& set) const;

  bool compose_instanceable() const;

  LayerStacks& stacks_;
  PrimIndexer& indexer_;
  const Frame* frame_;
  int levels_above_;  ///< How far above the requested prim this builder works.
  bool with_variants_ = true;
  PrimIndex index_;
  std::vector<Task> tasks_;
  // What long chains of arcs ask for again and again, for the first so many nodes.
  static constexpr std::size_t kFewNodes = 64;
  std::size_t known_sites_ = 0;
  bool holds_relocates_ = false;
  std::unordered_set<std::string> sites_;            ///< Keys of the nodes' sites ...
  std::unordered_set<std::string> sites_and_above_;  ///< ... and of all that are above them.
  std::vector<int> class_starts_;                    ///< kNone: not known.
};

// --- Beginning an index ---------------------------------------------------------------------

void PrimIndexer::Builder::start(const LayerStack& stack, const std::string& path,
                                 bool contributes) {
  IndexNode root;
  root.stack = &stack;
  root.path = path;
  root.map_to_parent = root.map_to_root = identity_map();
  root.has_specs = stack.has_prim(path);
  root.is_inert = !contributes;
  index_.nodes = {std::move(root)};
}

void PrimIndexer::Builder::start_child(const PrimIndex& parent, std::string_view name,
                                       bool contributes) {
  index_ = parent;
  if (index_.is_instance) disable_shadowed_by_instance();
  index_.is_instance = false;
  copy_subtree(index_, name);
  if (!contributes) node(0).is_inert = true;
}

// Opinions about what is below an instance count only if its arcs bring them.
void PrimIndexer::Builder::disable_shadowed_by_instance() {
  std::vector<int> pending{0};
  while (!pending.empty()) {
    const int i = pending.back();
    pending.pop_back();
    if (i != 0 && index_.is_in_direct_arc(i) && node(i).contributes()) continue;
    node(i).is_inert = true;
    for (const int child : node(i).children) pending.push_back(child);
  }
}

// Moves every node down to its child `name` and drops subtrees without opinions. What a layer stack
// relocates to there or below needs no opinion: the relocation brings some.
void PrimIndexer::Builder::copy_subtree(const PrimIndex& source, std::string_view name) {
  PrimIndex moved = source;
  for (IndexNode& each : moved.nodes) {
    each.path = path::append_child(each.path, name);
    if (each.has_specs) each.has_specs = each.stack->has_prim(each.path);
    ++each.levels_below_arc;
  }
  moved.nodes[0].levels_below_arc = 0;
  const std::size_t count = moved.nodes.size();
  std::vector<char> is_kept(count, 0);
  // Children have higher numbers than their parents, so one pass from the back sees subtrees first.
  for (std::size_t i = count; i-- > 0;) {
    IndexNode& each = moved.nodes[i];
    const bool is_root_class = each.arc == Arc::Inherit && each.stack == &indexer_.root_ &&
                               path::depth(each.path) > each.levels_below_arc + 1;
    const bool is_held = i == 0 || each.contributes() || each.arc == Arc::Specialize ||
                         is_root_class || relocates_to(*each.stack, each.path) || is_kept[i];
    if (!is_held) continue;
    for (int k = static_cast<int>(i);
         k != IndexNode::kNone && !is_kept[static_cast<std::size_t>(k)];
         k = moved.nodes[static_cast<std::size_t>(k)].parent) {
      is_kept[static_cast<std::size_t>(k)] = 1;
    }
    is_kept[i] = 1;
  }
  // Origins decide about strength, so they stay as long as what they imply.
  for (bool is_settled = false; !is_settled;) {
    is_settled = true;
    for (std::size_t i = 1; i < count; ++i) {
      if (!is_kept[i]) continue;
      for (int k = moved.nodes[i].origin;
           k != IndexNode::kNone && !is_kept[static_cast<std::size_t>(k)];
           k = moved.nodes[static_cast<std::size_t>(k)].parent) {
        is_kept[static_cast<std::size_t>(k)] = 1;
        is_settled = false;
      }
    }
  }
  std::vector<int> new_index(count, IndexNode::kNone);
  index_.nodes.clear();
  for (std::size_t i = 0; i < count; ++i) {
    if (!is_kept[i]) continue;
    new_index[i] = static_cast<int>(index_.nodes.size());
    index_.nodes.push_back(std::move(moved.nodes[i]));
  }
  const auto renumber = [&](int i) {
    return i == IndexNode::kNone ? i : new_index[static_cast<std::size_t>(i)];
  };
  for (IndexNode& each : index_.nodes) {
    each.parent = renumber(each.parent);
    each.origin = renumber(each.origin);
    std::vector<int> children;
    for (const int child : each.children) {
      if (renumber(child) != IndexNode::kNone) children.push_back(renumber(child));
    }
    each.children = std::move(children);
  }
}

// The index of a site below the root of its layer stack: of its ancestors first, then downwards.
void PrimIndexer::Builder::build_with_ancestors(const LayerStack& stack, const std::string& path,
                                                bool contributes) {
  const std::string parent_path(path::parent(path));
  Builder parent(indexer_, frame_, levels_above_ + 1);
  if (parent_path == "/") {
    parent.start(stack, "/", true);
  } else {
    parent.build_with_ancestors(stack, parent_path, true);
    parent.run(true);
    parent.finish();
  }
  start_child(parent.index_, path::name(path), contributes);
}

void PrimIndexer::Builder::finish() { index_.is_instance = compose_instanceable(); }

bool PrimIndexer::Builder::compose_instanceable() const {
  if (node(0).path == "/") return false;
  bool has_shareable = false;
  for (std::size_t i = 1; i < index_.nodes.size(); ++i) {
    const int k = static_cast<int>(i);
    has_shareable |= node(k).contributes() && index_.is_in_direct_arc(k);
  }
  if (!has_shareable) return false;
  for (const int i : index_.strength_order()) {
    for (const auto& entry : node(i).stack->layers) {
      const PrimSpec* prim = entry.layer->prim(node(i).path);
      if (!prim) continue;
      if (const auto value = entry.layer->get(*prim, "instanceable").as_bool()) return *value;
    }
  }
  return false;
}

// --- Tasks ----------------------------------------------------------------------------------

void PrimIndexer::Builder::add_task(Task task) {
  const bool is_known = task.kind == TaskKind::ImpliedClasses &&
                        std::any_of(tasks_.begin(), tasks_.end(), [&](const Task& other) {
                          return other.kind == task.kind && other.node == task.node;
                        });
  if (!is_known) tasks_.push_back(std::move(task));
}

void PrimIndexer::Builder::add_tasks_recursively(int i, bool skip_expressed) {
  // By value: tasks only, no nodes are added here.
  for (const int child : node(i).children) add_tasks_recursively(child, skip_expressed);
  const bool has_relocates = !node(i).stack->relocate_sources.empty();
  if (has_relocates && !skip_expressed) add_task({TaskKind::Relocations, i, {}, 0});
  if (!node(i).contributes()) return;
  const LayerStack& stack = *node(i).stack;
  const std::string& path = node(i).path;
  if (with_variants_ && has_field(stack, path, "variantSetNames")) {
    add_task({TaskKind::VariantSets, i, {}, 0});
  }
  if (skip_expressed) return;
  if (has_field(stack, path, "specializes")) add_task({TaskKind::Specializes, i, {}, 0});
  if (has_field(stack, path, "inheritPaths")) add_task({TaskKind::Inherits, i, {}, 0});
  if (has_field(stack, path, "payload")) add_task({TaskKind::Payloads, i, {}, 0});
  if (has_field(stack, path, "references")) add_task({TaskKind::References, i, {}, 0});
}

void PrimIndexer::Builder::add_tasks(int i, bool skip_expressed) {
  if (is_class_arc(node(i).arc)) {
    add_task({TaskKind::ImpliedClasses, class_hierarchy_start(i), {}, 0});
  } else if (has_class_child(i)) {
    add_task({TaskKind::ImpliedClasses, i, {}, 0});
  }
  add_tasks_recursively(i, skip_expressed);
}

Task PrimIndexer::Builder::pop_task() {
  const auto by_kind = [](const Task& a, const Task& b) { return a.kind < b.kind; };
  const TaskKind kind = std::min_element(tasks_.begin(), tasks_.end(), by_kind)->kind;
  // Variants by strength of their nodes, everything else as it came.
  std::vector<int> ranks;
  if (kind >= TaskKind::VariantSets) {
    ranks.resize(index_.nodes.size());
    int next = 0;
    rank_preorder(index_, 0, ranks, next);
  }
  const auto key = [&](const Task& task) {
    const bool is_ranked = !ranks.empty() && task.kind == kind;
    return std::tuple(task.kind, is_ranked ? ranks[static_cast<std::size_t>(task.node)] : 0,
                      task.sibling);
  };
  const auto first = std::min_element(
      tasks_.begin(), tasks_.end(), [&](const Task& a, const Task& b) { return key(a) < key(b); });
  Task task = std::move(*first);
  tasks_.erase(first);
  return task;
}

void PrimIndexer::Builder::run(bool with_variants) {
  with_variants_ = with_variants;
  add_tasks_recursively(0, false);
  while (!tasks_.empty()) {
    const Task task = pop_task();
    // Nothing stronger is left, so sets without a selection stay without one.
    if (task.kind == TaskKind::VariantWithoutSelection) break;
    run_task(task);
  }
  tasks_.clear();
}

void PrimIndexer::Builder::run_task(const Task& task) {
  switch (task.kind) {
    case TaskKind::Relocations:
      return eval_relocations(task.node);
    case TaskKind::References:
      return eval_references(task.node, Arc::Reference);
    case TaskKind::Payloads:
      return eval_references(task.node, Arc::Payload);
    case TaskKind::Inherits:
      return eval_classes(task.node, Arc::Inherit);
    case TaskKind::ImpliedClasses:
      return eval_implied_classes(task.node);
    case TaskKind::Specializes:
      return eval_classes(task.node, Arc::Specialize);
    case TaskKind::VariantSets:
      return eval_variant_sets(task.node);
    case TaskKind::Variant:
      return eval_variant(task);
    case TaskKind::VariantWithoutSelection:
      return;
  }
}

// --- Arcs -----------------------------------------------------------------------------------

bool PrimIndexer::Builder::is_stronger_sibling(int a, int b) const {
  const IndexNode& x = node(a);
  const IndexNode& y = node(b);
  if (x.arc != y.arc) return x.arc < y.arc;
  if (x.namespace_depth != y.namespace_depth) return x.namespace_depth > y.namespace_depth;
  if (x.origin != y.origin) {
    std::vector<int> ranks(index_.nodes.size(), static_cast<int>(index_.nodes.size()));
    int next = 0;
    rank_preorder(index_, 0, ranks, next);
    return ranks[static_cast<std::size_t>(x.origin)] < ranks[static_cast<std::size_t>(y.origin)];
  }
  return x.sibling < y.sibling;
}

void PrimIndexer::Builder::insert_child(int parent, int child) {
  auto& children = node(parent).children;
  auto at = children.begin();
  while (at != children.end() && !is_stronger_sibling(child, *at)) ++at;
  node(parent).children.insert(at, child);
}

int PrimIndexer::Builder::append(PrimIndex subtree, int parent, IndexNode arc_node) {
  const int base = static_cast<int>(index_.nodes.size());
  for (std::size_t i = 0; i < subtree.nodes.size(); ++i) {
    IndexNode each = std::move(subtree.nodes[i]);
    for (int& child : each.children) child += base;
    if (i == 0) {
      arc_node.children = std::move(each.children);
      arc_node.is_inert = each.is_inert;
      arc_node.has_specs = each.has_specs;
      each = std::exchange(arc_node, {});
    } else {
      each.parent += base;
      each.origin += base;
    }
    index_.nodes.push_back(std::move(each));
    IndexNode& added = index_.nodes.back();
    added.map_to_root = share(node(added.parent).map_to_root->compose(*added.map_to_parent));
  }
  insert_child(parent, base);
  return base;
}

// Copies of a parent's nodes are known when they are first asked for, arcs as they are added.
// Looking at a few nodes is quicker than knowing them.
bool PrimIndexer::Builder::has_few_nodes() const { return index_.nodes.size() < kFewNodes; }

void PrimIndexer::Builder::know_sites() {
  for (; known_sites_ < index_.nodes.size(); ++known_sites_) {
    const IndexNode& each = index_.nodes[known_sites_];
    holds_relocates_ |= each.arc == Arc::Relocate;
    sites_.insert(site_key(*each.stack, each.path));
    for (std::string_view at = each.path; !at.empty(); at = path::parent(at)) {
      if (!sites_and_above_.insert(site_key(*each.stack, at)).second) break;
    }
  }
}

// Whether a node may stand at the site, above it or below it.
bool PrimIndexer::Builder::may_be_near(const LayerStack& stack, const std::string& path) {
  if (has_few_nodes()) return true;
  know_sites();
  if (holds_relocates_) return true;
  if (sites_and_above_.contains(site_key(stack, path))) return true;
  for (std::string_view at = path; !at.empty(); at = path::parent(at)) {
    if (sites_.contains(site_key(stack, at))) return true;
  }
  return false;
}

bool PrimIndexer::Builder::is_cycle(Arc arc, int parent, const LayerStack& stack,
                                    const std::string& path) {
  if (arc == Arc::Variant || arc == Arc::Relocate) return false;
  std::string child_path = path;
  Builder* builder = this;
  int at = parent;
  for (;;) {
    const bool is_near = builder->may_be_near(stack, child_path);
    for (int i = at; is_near && i != IndexNode::kNone; i = builder->node(i).parent) {
      const IndexNode& site = builder->node(i);
      // Relocated prims stand below their own source.
      if (site.arc == Arc::Relocate) return false;
      if (site.stack == &stack &&
          (path::has_prefix(site.path, child_path) || path::has_prefix(child_path, site.path))) {
        return true;
      }
    }
    const Frame* frame = builder->frame_;
    if (!frame) return false;
    // Compare paths as they will be when the frame's subtree is complete.
    const std::string& current = builder->node(0).path;
    child_path = current == child_path
                     ? frame->requested_path
                     : (path::has_prefix(frame->requested_path, current)
                            ? path::replace_prefix(frame->requested_path, current, child_path)
                            : child_path);
    at = frame->parent;
    builder = frame->builder;
  }
}

bool PrimIndexer::Builder::has_site(const LayerStack& stack, const std::string& path) {
  if (has_few_nodes()) {
    return std::any_of(index_.nodes.begin(), index_.nodes.end(), [&](const IndexNode& each) {
      return each.stack == &stack && each.path == path;
    });
  }
  know_sites();
  return sites_.contains(site_key(stack, path));
}

bool PrimIndexer::Builder::is_duplicate(const LayerStack& stack, const std::string& path) {
  std::string site_path = path;
  Builder* builder = this;
  for (;;) {
    if (builder->has_site(stack, site_path)) return true;
    const Frame* frame = builder->frame_;
    if (!frame) return false;
    const std::string& current = builder->node(0).path;
    if (path::has_prefix(frame->requested_path, current)) {
      site_path = path::replace_prefix(frame->requested_path, current, site_path);
    }
    builder = frame->builder;
  }
}

int PrimIndexer::Builder::add_arc(Arc arc, int parent, int origin, const LayerStack& stack,
                                  const std::string& path, std::shared_ptr<const MapFunction> map,
                                  int sibling, ArcOptions options) {
  if (is_cycle(arc, parent, stack, path)) {
    stacks_.diagnostics().warn(node(parent).stack->root().identifier() + ": <" + node(parent).path +
                               "> leads back to itself through <" + path + "> of " +
                               stack.root().identifier());
    return IndexNode::kNone;
  }
  const int depth = frame_ ? frame_->depth : 0;
  if (index_.nodes.size() > kMaxNodes || depth > kMaxRecursion) {
    stacks_.diagnostics().warn(node(parent).stack->root().identifier() + ": <" + node(parent).path +
                               "> is composed of too many parts");
    return IndexNode::kNone;
  }
  options.skip_duplicates |= frame_ && frame_->skip_duplicates;
  if (options.skip_duplicates && is_duplicate(stack, path)) return IndexNode::kNone;
  if (options.contributes && options.with_ancestors && holds_relocate_source(stack, path)) {
    options.contributes = false;
  }
  IndexNode arc_node;
  arc_node.parent = parent;
  arc_node.origin = origin;
  arc_node.arc = arc;
  arc_node.stack = &stack;
  arc_node.path = path;
  arc_node.map_to_parent = map;
  arc_node.namespace_depth = path::depth(node(parent).path);
  arc_node.sibling = sibling;

  const Frame frame{this,   parent,   map, arc, path, &stack, options.skip_duplicates,
                    frame_, depth + 1};
  Builder subtree(indexer_, &frame, levels_above_);
  if (options.with_ancestors) {
    subtree.build_with_ancestors(stack, path, options.contributes);
    subtree.run(false);
  } else {
    subtree.start(stack, path, options.contributes);
  }
  const int added = append(subtree.take(), parent, std::move(arc_node));
  add_tasks(added, options.with_ancestors);
  return added;
}

// --- References and payloads ----------------------------------------------------------------

void PrimIndexer::Builder::eval_references(int i, Arc arc) {
  if (!node(i).contributes()) return;
  const LayerStack& stack = *node(i).stack;
  const std::string site = node(i).path;
  const char* field = arc == Arc::Payload ? "payload" : "references";
  const auto arcs = compose_references(stacks_, stack, site, field);
  for (std::size_t number = 0; number < arcs.size(); ++number) {
    const auto& [reference, authored, source] = arcs[number];
    const std::string where = source->identifier() + ": <" + site + "> " +
                              (arc == Arc::Payload ? "payload" : "reference") + " @" + authored +
                              "@";
    const LayerStack* target_stack = &stack;
    LayerOffset offset = reference.offset;
    if (!authored.empty()) {
      if (reference.asset.empty()) continue;
      try {
        if (!stacks_.assets().exists(reference.asset)) {
          stacks_.diagnostics().missing(
              reference.asset, where + " " + stacks_.assets().missing_text(reference.asset));
          continue;
        }
        target_stack = &stacks_.open(reference.asset, stack.expression_variables);
      } catch (const FormatError& error) {
        stacks_.diagnostics().missing(reference.asset,
                                      where + " could not be read: " + error.what());
        continue;
      }
      offset.scale *= time_codes_per_second(*source) / target_stack->time_codes_per_second;
    }
    std::string path = reference.path;
    if (path.empty()) {
      const Layer& layer = target_stack->root();
      const Value value = layer.get(layer.root(), "defaultPrim");
      const std::string* name = value.as_text();
      if (name && path::is_identifier(*name)) path = "/" + *name;
      if (name && path::is_prim_path(*name) && name->starts_with('/')) path = *name;
    }
    if (!path::is_prim_path(path) || !path.starts_with('/')) {
      stacks_.diagnostics().warn(where + " names no prim and " + target_stack->root().identifier() +
                                 " has no default prim");
      continue;
    }
    MapFunction map = MapFunction::between(path, path::strip_variants(site), offset);
    if (authored.empty()) map = map.with_root_identity();
    ArcOptions options;
    options.with_ancestors = !path::is_root_prim(path);
    const int added = add_arc(arc, i, i, *target_stack, path, share(std::move(map)),
                              static_cast<int>(number), options);
    const bool is_found = added == IndexNode::kNone ||
                          std::any_of(index_.nodes.begin() + added, index_.nodes.end(),
                                      [](const IndexNode& each) { return each.has_specs; });
    if (!is_found) {
      stacks_.diagnostics().warn(where + ": there is no prim <" + path + "> in " +
                                 target_stack->root().identifier());
    }
  }
}

// --- Inherits and specializes ---------------------------------------------------------------

void PrimIndexer::Builder::eval_classes(int i, Arc arc) {
  if (!node(i).contributes()) return;
  const std::string site = node(i).path;
  const Strings classes =
      compose_strings(*node(i).stack, site, arc == Arc::Inherit ? "inheritPaths" : "specializes");
  for (std::size_t number = 0; number < classes.size(); ++number) {
    const std::string& path = classes[number];
    if (!path.starts_with('/') || !path::is_prim_path(path)) {
      stacks_.diagnostics().warn(node(i).stack->root().identifier() + ": <" + site +
                                 "> inherits from <" + path + ">, which is not a prim");
      continue;
    }
    auto map = share(MapFunction::between(path, path::strip_variants(site)).with_root_identity());
    add_class_arc(arc, i, i, std::move(map), static_cast<int>(number), nullptr, {});
  }
}

int PrimIndexer::Builder::add_class_arc(Arc arc, int parent, int origin,
                                        std::shared_ptr<const MapFunction> map, int sibling,
                                        const LayerStack* ignored_stack,
                                        const std::string& ignored_path) {
  const std::string parent_path = node(parent).path;
  const std::string plain = path::strip_variants(parent_path);
  auto path = map->to_source(plain);
  if (path && path::has_variants(parent_path)) {
    // Look inside of the same variants, as far as the class is inside of them.
    std::string_view variant = parent_path;
    while (!path::is_variant(variant)) variant = path::parent(variant);
    const std::string plain_variant = path::strip_variants(variant);
    if (path::has_prefix(*path, plain_variant)) {
      path = path::replace_prefix(*path, plain_variant, variant);
    }
  }
  if (!path || *path == "/") return IndexNode::kNone;
  const LayerStack& stack = *node(parent).stack;
  for (const int child : node(parent).children) {
    const IndexNode& each = node(child);
    if (node(parent).arc == Arc::Relocate) {
      if (each.arc == arc && *each.map_to_parent == *map &&
          node(each.origin).levels_below_arc == node(origin).levels_below_arc) {
        return child;
      }
    } else if (each.stack == &stack && each.path == *path) {
      return child;
    }
  }
  ArcOptions options;
  options.contributes = *path != parent_path && !(ignored_stack == &stack && ignored_path == *path);
  options.skip_duplicates = options.contributes;
  options.with_ancestors = options.contributes && !path::is_root_prim(*path);
  return add_arc(arc, parent, origin, stack, *path, std::move(map), sibling, options);
}

bool PrimIndexer::Builder::has_class_child(int i) const {
  return std::any_of(node(i).children.begin(), node(i).children.end(),
                     [&](int child) { return is_class_arc(node(child).arc); });
}

// The prim that begins the chain of classes which the node belongs to.
int PrimIndexer::Builder::class_hierarchy_start(int i) {
  class_starts_.resize(index_.nodes.size(), IndexNode::kNone);
  const int level = node(i).levels_below_arc;
  int start = i;
  while (is_class_arc(node(start).arc) && node(start).levels_below_arc == level) {
    start = node(start).parent;
    const int known = class_starts_[static_cast<std::size_t>(start)];
    if (known != IndexNode::kNone && node(start).levels_below_arc == level) {
      start = known;
      break;
    }
  }
  class_starts_[static_cast<std::size_t>(i)] = start;
  return start;
}

// What a referenced prim inherits, the referring prim inherits as well, in its own namespace.
void PrimIndexer::Builder::eval_implied_classes(int i) {
  if (node(i).parent == IndexNode::kNone || !has_class_child(i)) return;
  const MapFunction transfer = node(i).map_to_parent->with_root_identity();
  eval_implied_class_tree(node(i).parent, i, transfer, true);
}

void PrimIndexer::Builder::eval_implied_class_tree(int destination, int source,
                                                   const MapFunction& transfer, bool is_start) {
  if (node(destination).arc == Arc::Relocate) {
    const MapFunction onward =
        node(destination).map_to_parent->with_root_identity().compose(transfer);
    eval_implied_class_tree(node(destination).parent, source, onward, is_start);
    add_task({TaskKind::ImpliedClasses, destination, {}, 0});
    return;
  }
  // A copy: arcs that are added below move the list.
  const std::vector<int> children = node(source).children;
  for (const int child : children) {
    if (!is_class_arc(node(child).arc)) continue;
    // A class of a class continues the chain; it is not a class of the destination.
    const bool continues_chain = is_start && is_class_arc(node(source).arc) &&
                                 node(source).levels_below_arc == node(child).levels_below_arc;
    if (continues_chain) continue;
    const MapFunction own = *node(child).map_to_parent;
    auto implied =
        share(transfer.is_identity()
                  ? own
                  : transfer.compose(own.compose(transfer.inverse())).with_root_identity());
    int added = IndexNode::kNone;
    for (const int known : node(destination).children) {
      if (node(known).origin == child && *node(known).map_to_parent == *implied) added = known;
    }
    if (added == IndexNode::kNone) {
      const std::string site = node(child).path;
      added = add_class_arc(node(child).arc, destination, child, implied, node(child).sibling,
                            node(child).stack, site);
    }
    if (added == IndexNode::kNone || !has_class_child(child)) continue;
    const MapFunction onward = implied->inverse().compose(transfer.compose(own));
    eval_implied_class_tree(added, child, onward, false);
  }
}

// --- Relocates ------------------------------------------------------------------------------

void PrimIndexer::Builder::elide(int i) {
  node(i).is_inert = true;
  for (const int child : node(i).children) elide(child);
}

void PrimIndexer::Builder::elide_relocated(int i) {
  for (const int child : node(i).children) {
    if (node(child).arc == Arc::Relocate) continue;
    if (!node(child).is_inert && node(child).stack->relocate_targets.contains(node(child).path)) {
      elide(child);
    } else {
      elide_relocated(child);
    }
  }
}

// A prim that was relocated brings the arcs of where it came from.
void PrimIndexer::Builder::eval_relocations(int i) {
  const LayerStack& stack = *node(i).stack;
  const auto found = stack.relocate_sources.find(node(i).path);
  if (found == stack.relocate_sources.end()) return;
  for (const int child : node(i).children) {
    if (node(child).arc != Arc::Variant) elide(child);
  }
  ArcOptions options;
  options.contributes = false;
  options.with_ancestors = true;
  const int added = add_arc(
      Arc::Relocate, i, i, stack, found->second,
      share(MapFunction::between(found->second, found->first).with_root_identity()), 0, options);
  if (added != IndexNode::kNone) elide_relocated(added);
}

// --- Variants -------------------------------------------------------------------------------

void PrimIndexer::Builder::eval_variant_sets(int i) {
  if (!node(i).contributes()) return;
  const Strings sets = compose_strings(*node(i).stack, node(i).path, "variantSetNames");
  for (std::size_t number = 0; number < sets.size(); ++number) {
    add_task({TaskKind::Variant, i, sets[number], static_cast<int>(number)});
  }
}

void PrimIndexer::Builder::eval_variant(const Task& task) {
  if (!node(task.node).contributes()) return;
  const auto selection = find_selection(task.node, task.set);
  if (!selection || selection->empty()) {
    add_task({TaskKind::VariantWithoutSelection, task.node, task.set, task.sibling});
    return;
  }
  const std::string path = path::append_variant(node(task.node).path, task.set, *selection);
  const int added = add_arc(Arc::Variant, task.node, task.node, *node(task.node).stack, path,
                            identity_map(), task.sibling, {});
  if (added == IndexNode::kNone) return;
  // The variant may select variants of sets that had no selection so far.
  for (Task& other : tasks_) {
    if (other.kind == TaskKind::VariantWithoutSelection) other.kind = TaskKind::Variant;
  }
}

std::optional<std::string> PrimIndexer::Builder::prior_selection(int i,
                                                                 const std::string& path_in_root,
                                                                 int levels,
                                                                 const std::string& set) const {
  const IndexNode& each = node(i);
  if (each.arc == Arc::Variant && each.levels_below_arc == levels) {
    std::string_view variant = each.path;
    for (int k = 0; k < levels; ++k) variant = path::parent(variant);
    if (path::is_variant(variant)) {
      const auto [name, selection] = path::variant_selection(variant);
      const auto path = each.map_to_root->to_source(path_in_root);
      if (name == set && path && path::strip_variants(variant) == *path) return selection;
    }
  }
  for (const int child : each.children) {
    if (auto found = prior_selection(child, path_in_root, levels, set)) return found;
  }
  return std::nullopt;
}

std::optional<std::string> PrimIndexer::Builder::selection_at(int i, const std::string& path,
                                                              const std::string& set) const {
  const IndexNode& each = node(i);
  if (each.is_inert) return std::nullopt;
  std::string site = path;
  const std::string plain = path::strip_variants(each.path);
  if (path::has_variants(each.path) && path::has_prefix(path, plain)) {
    site = path::replace_prefix(path, plain, each.path);
  }
  for (const auto& entry : each.stack->layers) {
    const PrimSpec* prim = entry.layer->prim(site);
    if (!prim) continue;
    const Value value = entry.layer->get(*prim, "variantSelection");
    if (!value.as_string_pairs()) continue;
    for (const auto& [name, selection] : *value.as_string_pairs()) {
      if (name != set) continue;
      return stacks_.evaluate(selection, *entry.layer, each.stack->expression_variables);
    }
  }
  return std::nullopt;
}

std::optional<std::string> PrimIndexer::Builder::search_selection(
    int i, const std::string& path, const std::string& set,
    std::vector<std::pair<const Frame*, const Builder*>>& frames) const {
  if (auto found = selection_at(i, path, set)) return found;
  if (!frames.empty() && frames.back().first->builder == this && frames.back().first->parent == i) {
    // Here the subtree will be attached that another builder is working on.
    const auto [frame, builder] = frames.back();
    frames.pop_back();
    const auto inside = frame->map_to_parent->to_source(path);
    return inside ? builder->search_selection(0, *inside, set, frames) : std::nullopt;
  }
  for (const int child : node(i).children) {
    const auto inside = node(child).map_to_parent->to_source(path);
    if (!inside) continue;
    if (auto found = search_selection(child, *inside, set, frames)) return found;
  }
  return std::nullopt;
}

// The strongest selection in everything that is known so far, also around the subtree that this
// builder works on.
std::optional<std::string> PrimIndexer::Builder::find_selection(int i,
                                                                const std::string& set) const {
  const Builder* builder = this;
  std::string path = path::strip_variants(node(i).path);
  int start = i;
  if (node(i).parent != IndexNode::kNone) {
    if (const auto mapped = node(i).map_to_root->to_target(path)) {
      path = *mapped;
      start = 0;
    }
  }
  if (start == 0) {
    if (auto found = prior_selection(0, path, levels_above_, set)) return found;
  }
  std::vector<std::pair<const Frame*, const Builder*>> frames;
  for (const Frame* frame = frame_; frame && start == 0; frame = frame->previous) {
    const auto outside = frame->map_to_parent->to_target(path);
    if (!outside) break;
    const Builder* outer = frame->builder;
    const auto in_root = outer->node(frame->parent).map_to_root->to_target(*outside);
    if (!in_root) break;
    if (auto found = outer->prior_selection(0, *in_root, levels_above_, set)) return found;
    frames.emplace_back(frame, builder);
    builder = outer;
    path = *in_root;
  }
  const auto& selections = indexer_.selections_;
  const bool is_in_stage = start == 0 && !builder->frame_;
  if (is_in_stage && !selections.empty() && path::is_root_prim(path)) {
    if (const auto own = selections.find(set); own != selections.end()) return own->second;
  }
  return builder->search_selection(start, path, set, frames);
}

// --- PrimIndexer ----------------------------------------------------------------------------

PrimIndex PrimIndexer::root_index() const {
  PrimIndex index;
  IndexNode root;
  root.stack = &root_;
  root.path = "/";
  root.map_to_parent = root.map_to_root = identity_map();
  root.has_specs = true;
  index.nodes.push_back(std::move(root));
  return index;
}

PrimIndex PrimIndexer::child_index(const PrimIndex& parent, std::string_view name) {
  Builder builder(*this, nullptr, 0);
  builder.start_child(parent, name, true);
  builder.run(true);
  builder.finish();
  return builder.take();
}

namespace {

// Children that the node's layer stack relocates: away, to another name in place, or here.
void apply_relocates(const IndexNode& node, Strings& names,
                     std::set<std::string, std::less<>>& known) {
  std::set<std::string, std::less<>> arrivals;
  for (const auto& [source, target] : node.stack->relocate_targets) {
    const bool leaves = path::parent(source) == node.path;
    const bool arrives = !target.empty() && path::parent(target) == node.path;
    const std::string from(path::name(source));
    const std::string to(path::name(target));
    const auto at = leaves ? std::find(names.begin(), names.end(), from) : names.end();
    if (at != names.end()) {
      known.erase(from);
      if (arrives && known.insert(to).second) {
        *at = to;
        continue;
      }
      names.erase(at);
    }
    if (arrives) arrivals.insert(to);
  }
  for (const std::string& name : arrivals) {
    if (known.insert(name).second) names.push_back(name);
  }
}

void add_child_names(const IndexNode& node, Strings& names,
                     std::set<std::string, std::less<>>& known) {
  for (auto entry = node.stack->layers.rbegin(); entry != node.stack->layers.rend(); ++entry) {
    const PrimSpec* prim = entry->layer->prim(node.path);
    if (!prim) continue;
    const Value children = entry->layer->get(*prim, "primChildren");
    if (children.as_strings()) {
      for (const std::string& name : *children.as_strings()) {
        const bool is_gone =
            node.stack->relocate_targets.contains(path::append_child(node.path, name));
        if (!is_gone && known.insert(name).second) names.push_back(name);
      }
    }
    const Value wanted = entry->layer->get(*prim, "primOrder");
    if (wanted.as_strings()) reorder(names, *wanted.as_strings());
  }
}

}  // namespace

Strings child_names(const PrimIndex& index) {
  Strings names;
  std::set<std::string, std::less<>> known;
  std::vector<int> order = StrengthOrder(index).list();
  for (auto it = order.rbegin(); it != order.rend(); ++it) {
    const IndexNode& node = index.nodes[static_cast<std::size_t>(*it)];
    const bool is_hidden = node.is_inert || (index.is_instance && !index.is_in_direct_arc(*it));
    if (is_hidden) continue;
    if (!node.stack->relocate_targets.empty()) apply_relocates(node, names, known);
    if (node.has_specs) add_child_names(node, names, known);
  }
  return names;
}

}  // namespace diorama::usd
