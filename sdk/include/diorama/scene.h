// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "diorama/camera.h"
#include "diorama/geometry.h"
#include "diorama/light.h"
#include "diorama/material.h"
#include "diorama/math.h"
#include "diorama/physics_properties.h"

namespace diorama {

/// Names a node of one scene. Ids are given in creation order and never reused, so equal scripts
/// give equal ids. `index` of a node with a mesh is what the leaf id channel holds (frame.h): 0 is
/// the root, which never has a mesh, and so also "nothing".
struct NodeId {
  std::uint32_t index = kNone;
  static constexpr std::uint32_t kNone = 0xFFFFFFFFu;
  explicit operator bool() const { return index != kNone; }
  friend bool operator==(const NodeId&, const NodeId&) = default;
  friend auto operator<=>(const NodeId&, const NodeId&) = default;
};

/// Taxonomy to label: {"class": "banana"}.
using Labels = std::map<std::string, std::string, std::less<>>;

/// A named point of a thing, such as the tip of a pen.
struct Keypoint {
  std::string name;
  Vec3 position = Vec3::Zero();  ///< Metres, in the space of the node that has it.
};

enum class JointKind : std::uint8_t { Fixed, Revolute, Prismatic };

/// Says how two nodes, its bodies, may move against each other; its own node stands for the joint
/// and has its name. Joint space is where the joint is, seen from either body:
///
///     world_from_parent * parent_from_joint * motion = world_from_child * child_from_joint
///
/// with `motion` a turn about, or a shift along, `axis` by the joint's position. It is in metres
/// where the asset has its own size, and grows with the asset. The poses of the bodies are the
/// truth; joints.h reads positions from them and poses bodies by positions.
struct Joint {
  JointKind kind = JointKind::Fixed;
  NodeId parent_body;  ///< Any node; what has no RigidBody at or above it stands still.
  NodeId child_body;   ///< The joint's own node: a frame between two of CompoundJoint (joints.h).
  Affine parent_from_joint = Affine::Identity();
  Affine child_from_joint = Affine::Identity();
  Vec3 axis = Vec3::UnitX();  ///< In joint space, unit length.
  double lower = -kInfinity;  ///< Radians or metres, at most `upper`; -infinity: no limit.
  double upper = kInfinity;
  /// Its position follows that of another joint: multiplier * position + offset.
  struct Mimic {
    NodeId joint;
    double multiplier = 1.0;
    double offset = 0.0;
  };
  std::optional<Mimic> mimic;
};

/// The time in which the file of an asset moves. At another time it is another asset with the same
/// nodes, "walker.usd{time=1.5}", see Loader::load.
struct Animation {
  std::string asset;  ///< What was loaded, without a time.
  double start_s = 0.0;
  double end_s = 0.0;  ///< At least `start_s`.
};

struct Node {
  std::string name;
  NodeId parent;
  std::vector<NodeId> children;
  Affine parent_from_node = Affine::Identity();
  bool is_visible = true;  ///< False hides the whole subtree (from cameras, not from physics).
  Labels labels;
  std::shared_ptr<const Mesh> mesh;
  /// One per material slot of the mesh; a missing slot renders with a default Material.
  std::vector<std::shared_ptr<const Material>> materials;
  std::optional<Light> light;
  std::optional<Camera> camera;
  std::optional<Collider> collider;
  std::optional<RigidBody> rigid_body;
  std::vector<Keypoint> keypoints;
  /// Both bodies are nodes of the same scene. When an asset is copied, joints that lead out of it
  /// stay behind.
  std::optional<Joint> joint;
  std::optional<Animation> animation;  ///< Of the top node of an asset.
};

/// Everything that can be seen and simulated: a tree of named nodes. A concrete class on purpose:
/// there will be one implementation. Not thread safe for writing; reading from many threads is
/// fine.
class DIORAMA_SDK_API Scene {
 public:
  Scene();
  ~Scene();
  Scene(Scene&&) noexcept;
  Scene& operator=(Scene&&) noexcept;

  NodeId root() const;
  /// Adds a child. A taken name gets a number: "banana", "banana_01", "banana_02" ... A name may
  /// not be empty nor hold '/'.
  NodeId create(NodeId parent, std::string_view stem);
  /// Erases the node and all below it; its ids throw from now on.
  void erase(NodeId subtree);
  bool contains(NodeId node) const;

  /// By absolute path "/Assets/banana"; a null id when absent.
  NodeId find(std::string_view path) const;
  /// The same; throws Error naming the nearest existing ancestor when absent.
  NodeId require(std::string_view path) const;
  /// All nodes whose path fits the pattern, in creation order. '*' stands for any text without '/',
  /// "**" for any text, "/**/" also for one '/': "/Assets/*", "/Environment/**/TableDining*".
  std::vector<NodeId> match(std::string_view pattern) const;
  std::string path(NodeId node) const;
  /// The node and all below it, parents before children, children in order.
  std::vector<NodeId> subtree(NodeId node) const;

  const Node& operator[](NodeId node) const;
  Affine world_from_node(NodeId node) const;
  /// False when the node or one of its ancestors is hidden.
  bool is_visible(NodeId node) const;
  /// Labels of the node and, per taxonomy, of its nearest labelled ancestor.
  Labels effective_labels(NodeId node) const;
  /// World box of the visible meshes at and below the node; empty when there are none.
  Aabb world_bounds(NodeId node) const;

  /// Counts as a pose change. Throws when a number is not finite.
  void set_pose(NodeId node, const Affine& parent_from_node);
  void set_pose(NodeId node, const Transform& parent_from_node);
  /// Of a node's rigid body, else of its camera (Error without either), m/s and rad/s, world.
  /// Counts as a pose change.
  void set_velocity(NodeId node, const Vec3& linear, const Vec3& angular);
  /// Anything but the pose, the name and the tree. Counts as a shape change. The reference is valid
  /// until the next create() or erase().
  Node& edit(NodeId node);

  std::uint64_t pose_revision() const;   ///< A renderer updates transforms when this moved ...
  std::uint64_t shape_revision() const;  ///< ... and looks at every node when this did.

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// A labelled thing: the nodes with visible meshes whose nearest labelled node (itself or an
/// ancestor) is `node`. Meshes without triangles do not count.
struct LabelledInstance {
  NodeId node;
  std::vector<NodeId> leaves;  ///< Never empty; in creation order.
};

/// In creation order of the labelled nodes. Hidden meshes do not count.
DIORAMA_SDK_API std::vector<LabelledInstance> labelled_instances(const Scene& scene);

/// Box, in the space of `node`, of all meshes below it (visible ones only); empty without any.
DIORAMA_SDK_API Aabb node_bounds(const Scene& scene, NodeId node);

}  // namespace diorama
