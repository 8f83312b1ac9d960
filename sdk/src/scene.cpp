// SPDX-License-Identifier: Apache-2.0
#include "diorama/scene.h"

#include <algorithm>
#include <atomic>

#include "diorama/error.h"

namespace diorama {

namespace {

struct Slot {
  Node node;
  std::map<std::string, NodeId, std::less<>> children_by_name;
  /// Where the search for a free number starts, per stem: many children of one stem stay cheap.
  std::map<std::string, int, std::less<>> next_number;
};

std::string numbered(std::string_view stem, int number) {
  const std::string digits = std::to_string(number);
  return std::string(stem) + "_" + (digits.size() < 2 ? "0" : "") + digits;
}

/// One step of a pattern: a character, '*', '**', or "/**/" which also fits a single '/'.
struct PatternStep {
  enum class Kind { Character, AnyInName, Any, AnyFolders } kind;
  char character = 0;
};

std::vector<PatternStep> parsed(std::string_view pattern) {
  std::vector<PatternStep> steps;
  for (std::size_t i = 0; i < pattern.size(); ++i) {
    if (pattern.substr(i, 4) == "/**/") {
      steps.push_back({PatternStep::Kind::AnyFolders});
      i += 3;
    } else if (pattern.substr(i, 2) == "**") {
      steps.push_back({PatternStep::Kind::Any});
      i += 1;
    } else if (pattern[i] == '*') {
      steps.push_back({PatternStep::Kind::AnyInName});
    } else {
      steps.push_back({PatternStep::Kind::Character, pattern[i]});
    }
  }
  return steps;
}

/// How far a pattern has been followed along a path, name by name: no backtracking, whatever the
/// pattern, and what a parent's path has reached serves all of its children.
class PatternPlaces {
 public:
  /// Nothing of the path has been read.
  explicit PatternPlaces(const std::vector<PatternStep>& steps)
      : steps_(&steps), reached_(steps.size() + 1, 0), opened_(steps.size(), 0) {
    reached_[0] = 1;
    skip_empty_steps();
  }
  void read(std::string_view text) {
    for (const char character : text) read(character);
  }
  bool is_at_end() const { return reached_.back() != 0; }
  /// Nothing that begins with what was read fits.
  bool is_lost() const {
    const auto is_set = [](char place) { return place != 0; };
    return std::none_of(reached_.begin(), reached_.end(), is_set) &&
           std::none_of(opened_.begin(), opened_.end(), is_set);
  }

 private:
  using Kind = PatternStep::Kind;

  /// From behind, as each place depends on itself and on the one before as they were.
  void read(char character) {
    for (std::size_t i = steps_->size(); i > 0; --i) {
      const PatternStep& step = (*steps_)[i - 1];
      const bool was_before = reached_[i - 1] != 0;
      switch (step.kind) {
        case Kind::Character:
          reached_[i] = was_before && character == step.character;
          break;
        case Kind::AnyInName:
          reached_[i] = reached_[i] && character != '/';
          break;
        case Kind::Any:
          break;
        case Kind::AnyFolders:
          if (was_before && character == '/') opened_[i - 1] = 1;
          reached_[i] = opened_[i - 1] && character == '/';
          break;
      }
    }
    reached_[0] = 0;
    skip_empty_steps();
  }
  void skip_empty_steps() {
    for (std::size_t i = 0; i < steps_->size(); ++i) {
      const Kind kind = (*steps_)[i].kind;
      if (reached_[i] && (kind == Kind::AnyInName || kind == Kind::Any)) reached_[i + 1] = 1;
    }
  }

  const std::vector<PatternStep>* steps_;
  std::vector<char> reached_;  ///< By number of steps: they fit all that was read.
  std::vector<char> opened_;   ///< By step: a '/' that it begins with was read.
};

/// Drawn from one count by all scenes: equal revisions mean the same scene, unchanged.
std::uint64_t next_revision() {
  static std::atomic<std::uint64_t> last{0};
  return ++last;
}

void add_mesh(Aabb& box, const Mesh& mesh, const Affine& box_from_mesh) {
  for (const Vec3f& position : mesh.positions) box.add(box_from_mesh * position.cast<double>());
}

}  // namespace

struct Scene::State {
  std::vector<std::unique_ptr<Slot>> slots;  // by id; null: erased
  std::uint64_t pose_revision = next_revision();
  std::uint64_t shape_revision = next_revision();

  Slot& at(NodeId id) const {
    if (id.index < slots.size() && slots[id.index]) return *slots[id.index];
    const std::string which = id ? "node " + std::to_string(id.index) : "a null node id";
    throw Error(ErrorKind::Internal, "Scene: " + which + " is not (or no longer) in the scene");
  }
};

Scene::Scene() : state_(std::make_unique<State>()) {
  state_->slots.push_back(std::make_unique<Slot>());
}
Scene::~Scene() = default;
Scene::Scene(Scene&&) noexcept = default;
Scene& Scene::operator=(Scene&&) noexcept = default;

NodeId Scene::root() const { return NodeId{0}; }

NodeId Scene::create(NodeId parent, std::string_view stem) {
  Slot& above = state_->at(parent);
  if (stem.empty() || stem.find('/') != std::string_view::npos) {
    throw Error(ErrorKind::Internal, "Scene::create below " + path(parent) + ": the name '" +
                                         std::string(stem) + "' is empty or holds a '/'");
  }
  std::string name(stem);
  if (above.children_by_name.contains(name)) {
    int& number = above.next_number.try_emplace(name, 1).first->second;
    do {
      name = numbered(stem, number++);
    } while (above.children_by_name.contains(name));
  }

  const NodeId id{std::uint32_t(state_->slots.size())};
  auto slot = std::make_unique<Slot>();
  slot->node.name = name;
  slot->node.parent = parent;
  state_->slots.push_back(std::move(slot));
  above.node.children.push_back(id);
  above.children_by_name.emplace(std::move(name), id);
  state_->shape_revision = next_revision();
  return id;
}

void Scene::erase(NodeId top) {
  if (top == root()) throw Error(ErrorKind::Internal, "Scene::erase: the root cannot be erased");
  const std::vector<NodeId> gone = subtree(top);
  Slot& parent = state_->at(state_->at(top).node.parent);
  std::erase(parent.node.children, top);
  parent.children_by_name.erase(state_->at(top).node.name);
  for (const NodeId id : gone) state_->slots[id.index].reset();
  state_->shape_revision = next_revision();
}

bool Scene::contains(NodeId node) const {
  return node.index < state_->slots.size() && state_->slots[node.index];
}

NodeId Scene::find(std::string_view path) const {
  if (!path.starts_with('/')) return {};
  if (path == "/") return root();
  NodeId node = root();
  while (!path.empty()) {
    path.remove_prefix(1);  // the slash
    const std::string_view name = path.substr(0, path.find('/'));
    const auto& children = state_->at(node).children_by_name;
    const auto found = children.find(name);
    if (found == children.end()) return {};
    node = found->second;
    path.remove_prefix(name.size());
  }
  return node;
}

NodeId Scene::require(std::string_view path) const {
  if (const NodeId node = find(path)) return node;
  std::string_view above = path.starts_with('/') ? path : "/";
  while (above.size() > 1 && !find(above)) above = above.substr(0, above.rfind('/'));
  if (above.empty()) above = "/";
  throw Error(ErrorKind::Internal, "there is no node " + std::string(path) +
                                       " in the scene; the nearest above it is " +
                                       std::string(above));
}

std::vector<NodeId> Scene::match(std::string_view pattern) const {
  std::vector<NodeId> matches;
  if (pattern.find('*') == std::string_view::npos) {
    if (const NodeId node = find(pattern)) matches.push_back(node);
    return matches;
  }
  const std::vector<PatternStep> steps = parsed(pattern);
  struct Below {
    NodeId parent;
    PatternPlaces places;  // at the parent's path
  };
  std::vector<Below> waiting{{root(), PatternPlaces(steps)}};
  while (!waiting.empty()) {
    const Below below = std::move(waiting.back());
    waiting.pop_back();
    for (const NodeId id : state_->at(below.parent).node.children) {
      const Node& node = state_->at(id).node;
      PatternPlaces places = below.places;
      places.read("/");
      places.read(node.name);
      if (places.is_lost()) continue;
      if (places.is_at_end()) matches.push_back(id);
      if (!node.children.empty()) waiting.push_back({id, std::move(places)});
    }
  }
  std::sort(matches.begin(), matches.end());  // creation order
  return matches;
}

std::string Scene::path(NodeId node) const {
  if (node == root()) return "/";
  std::string path;
  for (; node != root(); node = state_->at(node).node.parent) {
    path.insert(0, "/" + state_->at(node).node.name);
  }
  return path;
}

std::vector<NodeId> Scene::subtree(NodeId top) const {
  std::vector<NodeId> nodes;
  std::vector<NodeId> waiting{top};
  while (!waiting.empty()) {
    const NodeId id = waiting.back();
    waiting.pop_back();
    nodes.push_back(id);
    const std::vector<NodeId>& children = state_->at(id).node.children;
    waiting.insert(waiting.end(), children.rbegin(), children.rend());
  }
  return nodes;
}

const Node& Scene::operator[](NodeId node) const { return state_->at(node).node; }

Affine Scene::world_from_node(NodeId node) const {
  Affine world_from_node = state_->at(node).node.parent_from_node;
  while (node != root()) {
    node = state_->at(node).node.parent;
    world_from_node = state_->at(node).node.parent_from_node * world_from_node;
  }
  return world_from_node;
}

bool Scene::is_visible(NodeId node) const {
  while (state_->at(node).node.is_visible) {
    if (node == root()) return true;
    node = state_->at(node).node.parent;
  }
  return false;
}

Labels Scene::effective_labels(NodeId node) const {
  Labels labels = state_->at(node).node.labels;
  while (node != root()) {
    node = state_->at(node).node.parent;
    const Labels& inherited = state_->at(node).node.labels;
    labels.insert(inherited.begin(), inherited.end());  // keeps what is nearer
  }
  return labels;
}

Aabb Scene::world_bounds(NodeId node) const {
  Aabb box;
  if (!is_visible(node)) return box;
  std::vector<NodeId> waiting{node};
  while (!waiting.empty()) {
    const NodeId id = waiting.back();
    waiting.pop_back();
    const Node& below = (*this)[id];
    if (!below.is_visible) continue;
    if (below.mesh) add_mesh(box, *below.mesh, world_from_node(id));
    waiting.insert(waiting.end(), below.children.begin(), below.children.end());
  }
  return box;
}

void Scene::set_pose(NodeId node, const Affine& parent_from_node) {
  Slot& slot = state_->at(node);
  if (!parent_from_node.matrix().allFinite()) {
    throw Error(ErrorKind::Internal, path(node) + ": the pose is not finite");
  }
  slot.node.parent_from_node = parent_from_node;
  state_->pose_revision = next_revision();
}

void Scene::set_pose(NodeId node, const Transform& parent_from_node) {
  set_pose(node, parent_from_node.affine());
}

void Scene::set_velocity(NodeId node, const Vec3& linear, const Vec3& angular) {
  Node& moving = state_->at(node).node;
  if (moving.rigid_body) {
    moving.rigid_body->linear_velocity = linear;
    moving.rigid_body->angular_velocity = angular;
  } else if (moving.camera) {
    moving.camera->linear_velocity = linear;
    moving.camera->angular_velocity = angular;
  } else {
    throw Error(ErrorKind::Internal,
                path(node) + ": only rigid bodies and cameras have a velocity");
  }
  state_->pose_revision = next_revision();
}

Node& Scene::edit(NodeId node) {
  Slot& slot = state_->at(node);
  state_->shape_revision = next_revision();
  return slot.node;
}

std::uint64_t Scene::pose_revision() const { return state_->pose_revision; }
std::uint64_t Scene::shape_revision() const { return state_->shape_revision; }

std::vector<LabelledInstance> labelled_instances(const Scene& scene) {
  std::map<NodeId, std::vector<NodeId>> leaves;  // by labelled node, so in creation order
  for (const NodeId id : scene.subtree(scene.root())) {
    const Node& node = scene[id];
    if (!node.mesh || node.mesh->triangles.empty() || !scene.is_visible(id)) continue;
    NodeId labelled = id;
    while (labelled && scene[labelled].labels.empty()) labelled = scene[labelled].parent;
    if (labelled) leaves[labelled].push_back(id);
  }
  std::vector<LabelledInstance> instances;
  for (auto& [node, nodes] : leaves) {
    std::sort(nodes.begin(), nodes.end());
    instances.push_back({node, std::move(nodes)});
  }
  return instances;
}

Aabb node_bounds(const Scene& scene, NodeId node) {
  Aabb box;
  const Affine node_from_world = scene.world_from_node(node).inverse();
  for (const NodeId id : scene.subtree(node)) {
    const Node& below = scene[id];
    if (!below.mesh || !scene.is_visible(id)) continue;
    const Affine node_from_mesh =
        id == node ? Affine::Identity() : node_from_world * scene.world_from_node(id);
    add_mesh(box, *below.mesh, node_from_mesh);
  }
  return box;
}

}  // namespace diorama
