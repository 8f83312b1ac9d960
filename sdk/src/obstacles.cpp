// SPDX-License-Identifier: Apache-2.0
#include "diorama/obstacles.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <mutex>
#include <numeric>
#include <set>
#include <unordered_map>
#include <utility>
#include <vector>

namespace diorama {
namespace {

using Corners = std::array<Vec3, 3>;

struct FloatBox {
  Vec3f min = Vec3f::Constant(std::numeric_limits<float>::infinity());
  Vec3f max = Vec3f::Constant(-std::numeric_limits<float>::infinity());
  void add(const Vec3f& point) {
    min = min.cwiseMin(point);
    max = max.cwiseMax(point);
  }
  Aabb as_double() const { return {min.cast<double>(), max.cast<double>()}; }
};

/// Boxes round the triangles of one mesh, in its own space.
struct MeshTree {
  struct Branch {
    FloatBox box;
    std::uint32_t first = 0;  ///< Of two neighbouring children, or of the leaf's triangles.
    std::uint32_t count = 0;  ///< 0: not a leaf.
  };
  std::vector<Branch> branches;
  std::vector<std::uint32_t> order;

  explicit MeshTree(const Mesh& mesh) : order(mesh.triangles.size()) {
    std::iota(order.begin(), order.end(), 0u);
    std::vector<Vec3f> centres(order.size());
    for (std::size_t i = 0; i < order.size(); ++i) {
      const auto& [a, b, c] = mesh.triangles[i];
      centres[i] = mesh.positions[a] + mesh.positions[b] + mesh.positions[c];
    }
    branches.emplace_back();
    split(mesh, centres, 0, 0, std::uint32_t(order.size()));
  }

  /// Asks wants(box) from the root down and calls test(triangle) in the leaves that are wanted,
  /// until it says true. Halves keep the depth within the stack.
  template <class Wants, class Test>
  bool visit(const Wants& wants, const Test& test) const {
    std::array<std::uint32_t, 64> stack;
    std::size_t depth = 0;
    stack[depth++] = 0;
    while (depth > 0) {
      const Branch& branch = branches[stack[--depth]];
      if (!wants(branch.box)) continue;
      if (branch.count == 0) {
        stack[depth++] = branch.first + 1;
        stack[depth++] = branch.first;
        continue;
      }
      for (std::uint32_t i = 0; i < branch.count; ++i) {
        if (test(order[branch.first + i])) return true;
      }
    }
    return false;
  }

 private:
  void split(const Mesh& mesh, const std::vector<Vec3f>& centres, std::size_t at,
             std::uint32_t begin, std::uint32_t end) {
    constexpr std::uint32_t kLeafSize = 4;
    FloatBox box;
    FloatBox middles;
    for (std::uint32_t i = begin; i < end; ++i) {
      for (const std::uint32_t corner : mesh.triangles[order[i]]) box.add(mesh.positions[corner]);
      middles.add(centres[order[i]]);
    }
    branches[at].box = box;
    if (end - begin <= kLeafSize) {
      branches[at].first = begin;
      branches[at].count = end - begin;
      return;
    }
    Eigen::Index axis = 0;
    (middles.max - middles.min).maxCoeff(&axis);
    const std::uint32_t middle = begin + (end - begin) / 2;
    std::nth_element(order.begin() + begin, order.begin() + middle, order.begin() + end,
                     [&](std::uint32_t a, std::uint32_t b) {
                       const float ca = centres[a][axis];
                       const float cb = centres[b][axis];
                       return ca != cb ? ca < cb : a < b;
                     });
    const auto children = std::uint32_t(branches.size());
    branches[at].first = children;
    branches.resize(branches.size() + 2);
    split(mesh, centres, children, begin, middle);
    split(mesh, centres, children + 1, middle, end);
  }
};

/// Trees of meshes that live; a mesh is immutable and known by its address.
class Trees {
 public:
  std::shared_ptr<const MeshTree> of(const std::shared_ptr<const Mesh>& mesh) {
    const std::lock_guard lock(mutex_);
    if (const auto known = trees_.find(mesh.get()); known != trees_.end()) {
      if (!known->second.mesh.expired()) return known->second.tree;
    }
    std::erase_if(trees_, [](const auto& entry) { return entry.second.mesh.expired(); });
    auto tree = std::make_shared<const MeshTree>(*mesh);
    trees_[mesh.get()] = {mesh, tree};
    return tree;
  }

 private:
  struct Entry {
    std::weak_ptr<const Mesh> mesh;
    std::shared_ptr<const MeshTree> tree;
  };
  std::mutex mutex_;
  std::unordered_map<const Mesh*, Entry> trees_;
};

Trees& trees() {
  static Trees all;
  return all;
}

Corners corners_of(const Mesh& mesh, std::uint32_t triangle) {
  const auto& [a, b, c] = mesh.triangles[triangle];
  return {mesh.positions[a].cast<double>(), mesh.positions[b].cast<double>(),
          mesh.positions[c].cast<double>()};
}

Corners mapped(const Affine& map, const Corners& corners) {
  return {map * corners[0], map * corners[1], map * corners[2]};
}

Aabb box_of(const Corners& corners) {
  Aabb box;
  for (const Vec3& corner : corners) box.add(corner);
  return box;
}

Aabb grown(const Aabb& box, double by) {
  return {box.min - Vec3::Constant(by), box.max + Vec3::Constant(by)};
}

bool overlaps(const Aabb& a, const Aabb& b) {
  return (a.min.array() <= b.max.array()).all() && (a.max.array() >= b.min.array()).all();
}

bool overlaps(const FloatBox& a, const Aabb& b) { return overlaps(a.as_double(), b); }

/// Slab test of the segment from + t * way, t in [0, t_max].
bool crosses_box(const Aabb& box, const Vec3& from, const Vec3& way, double t_max) {
  double enter = 0.0;
  double leave = t_max;
  for (int axis = 0; axis < 3; ++axis) {
    if (way[axis] == 0.0) {
      if (from[axis] < box.min[axis] || from[axis] > box.max[axis]) return false;
      continue;
    }
    const double a = (box.min[axis] - from[axis]) / way[axis];
    const double b = (box.max[axis] - from[axis]) / way[axis];
    enter = std::max(enter, std::min(a, b));
    leave = std::min(leave, std::max(a, b));
  }
  return enter <= leave;
}

/// Where the segment from + t * way, t in [0, 1], crosses. Moeller and Trumbore 1997.
std::optional<double> crossing(const Corners& corner, const Vec3& from, const Vec3& way) {
  const Vec3 ab = corner[1] - corner[0];
  const Vec3 ac = corner[2] - corner[0];
  const Vec3 p = way.cross(ac);
  const double det = ab.dot(p);
  if (det == 0.0) return std::nullopt;
  const Vec3 to_from = from - corner[0];
  const double u = to_from.dot(p) / det;
  if (u < 0.0 || u > 1.0) return std::nullopt;
  const Vec3 q = to_from.cross(ab);
  const double v = way.dot(q) / det;
  if (v < 0.0 || u + v > 1.0) return std::nullopt;
  const double t = ac.dot(q) / det;
  if (t < 0.0 || t > 1.0) return std::nullopt;
  return t;
}

double squared_distance_to_edge(const Vec3& point, const Vec3& a, const Vec3& b) {
  const Vec3 along = b - a;
  const double length = along.squaredNorm();
  const double t = length > 0.0 ? std::clamp((point - a).dot(along) / length, 0.0, 1.0) : 0.0;
  return (a + t * along - point).squaredNorm();
}

double squared_distance(const Vec3& point, const Corners& corner) {
  const Vec3 normal = (corner[1] - corner[0]).cross(corner[2] - corner[0]);
  bool is_over = normal.squaredNorm() > 0.0;
  double nearest = kInfinity;
  for (std::size_t i = 0; i < 3; ++i) {
    const Vec3& a = corner[i];
    const Vec3& b = corner[(i + 1) % 3];
    is_over = is_over && normal.cross(b - a).dot(point - a) >= 0.0;
    nearest = std::min(nearest, squared_distance_to_edge(point, a, b));
  }
  if (!is_over) return nearest;
  const double height = normal.dot(point - corner[0]);
  return height * height / normal.squaredNorm();
}

double squared_distance(const Vec3& point, const Aabb& box) {
  return (point - point.cwiseMax(box.min).cwiseMin(box.max)).squaredNorm();
}

/// Of two segments a + s * u and b + t * v.
double squared_distance(const Vec3& a, const Vec3& u, const Vec3& b, const Vec3& v) {
  const Vec3 w = a - b;
  const double uu = u.squaredNorm();
  const double vv = v.squaredNorm();
  const double uv = u.dot(v);
  const double uw = u.dot(w);
  const double vw = v.dot(w);
  const double det = uu * vv - uv * uv;
  double s = det > 0.0 ? std::clamp((uv * vw - vv * uw) / det, 0.0, 1.0) : 0.0;
  const double t = vv > 0.0 ? std::clamp((uv * s + vw) / vv, 0.0, 1.0) : 0.0;
  s = uu > 0.0 ? std::clamp((uv * t - uw) / uu, 0.0, 1.0) : 0.0;
  return (w + s * u - t * v).squaredNorm();
}

bool edge_crosses(const Corners& edges, const Corners& face) {
  for (std::size_t i = 0; i < 3; ++i) {
    if (crossing(face, edges[i], edges[(i + 1) % 3] - edges[i])) return true;
  }
  return false;
}

bool are_within(const Corners& a, const Corners& b, double distance) {
  if (edge_crosses(a, b) || edge_crosses(b, a)) return true;
  if (distance <= 0.0) return false;
  const double limit = distance * distance;
  for (std::size_t i = 0; i < 3; ++i) {
    if (squared_distance(a[i], b) <= limit || squared_distance(b[i], a) <= limit) return true;
    for (std::size_t k = 0; k < 3; ++k) {
      if (squared_distance(a[i], a[(i + 1) % 3] - a[i], b[k], b[(k + 1) % 3] - b[k]) <= limit) {
        return true;
      }
    }
  }
  return false;
}

/// Separating axes. Akenine-Moeller 2001.
bool reaches_into(const Aabb& box, const Corners& triangle) {
  const Vec3 half = 0.5 * box.size();
  const Corners corner{triangle[0] - box.centre(), triangle[1] - box.centre(),
                       triangle[2] - box.centre()};
  const auto separates = [&](const Vec3& axis) {
    const double reach = half.dot(axis.cwiseAbs());
    const double a = axis.dot(corner[0]);
    const double b = axis.dot(corner[1]);
    const double c = axis.dot(corner[2]);
    return std::min({a, b, c}) > reach || std::max({a, b, c}) < -reach;
  };
  for (int i = 0; i < 3; ++i) {
    if (separates(Vec3::Unit(i))) return false;
    const std::size_t k = std::size_t(i);
    const Vec3 edge = corner[(k + 1) % 3] - corner[k];
    for (int axis = 0; axis < 3; ++axis) {
      if (separates(Vec3::Unit(axis).cross(edge))) return false;
    }
  }
  return !separates((corner[1] - corner[0]).cross(corner[2] - corner[0]));
}

/// How much the map lengthens a vector at most.
double stretch_of(const Affine& map) {
  const Mat3 square = map.linear().transpose() * map.linear();
  return std::sqrt(
      Eigen::SelfAdjointEigenSolver<Mat3>(square, Eigen::EigenvaluesOnly).eigenvalues().maxCoeff());
}

struct Item {
  NodeId owner;
  std::shared_ptr<const Mesh> mesh;
  Affine world_from_mesh;
  Affine mesh_from_world;
  double mesh_per_world = 1.0;  ///< Stretch of mesh_from_world.
  Aabb box_world;
  mutable std::shared_ptr<const MeshTree> known_tree;

  const MeshTree& tree() const {
    if (!known_tree) known_tree = trees().of(mesh);
    return *known_tree;
  }
  Corners corners_world(std::uint32_t triangle) const {
    return mapped(world_from_mesh, corners_of(*mesh, triangle));
  }
};

/// Signed solid angle of the mesh seen from the point, over a whole turn. Van Oosterom and Strackee
/// 1983.
double winding_number(const Item& item, const Vec3& point_world) {
  double sum = 0.0;
  for (std::uint32_t i = 0; i < item.mesh->triangles.size(); ++i) {
    const Corners corner = item.corners_world(i);
    const Vec3 a = corner[0] - point_world;
    const Vec3 b = corner[1] - point_world;
    const Vec3 c = corner[2] - point_world;
    const double scale = a.norm() * b.norm() * c.norm() + a.dot(b) * c.norm() +
                         b.dot(c) * a.norm() + c.dot(a) * b.norm();
    sum += 2.0 * std::atan2(a.dot(b.cross(c)), scale);
  }
  return sum / (4.0 * kPi);
}

bool moves(const Scene& scene, NodeId node) {
  for (; node; node = scene[node].parent) {
    if (scene[node].rigid_body) return true;
  }
  return false;
}

}  // namespace

struct Obstacles::State {
  std::vector<Item> items;
  std::set<NodeId> known;
  Aabb bounds_world;

  void add_mesh(const Scene& scene, NodeId owner, NodeId node, Hidden hidden) {
    const auto& mesh = scene[node].mesh;
    if (!mesh || mesh->triangles.empty()) return;
    if (hidden == Hidden::LeaveOut && !scene.is_visible(node)) return;
    Item item;
    item.world_from_mesh = scene.world_from_node(node);
    if (std::abs(item.world_from_mesh.linear().determinant()) < 1e-18) return;
    if (!known.insert(node).second) return;
    item.owner = owner;
    item.mesh = mesh;
    item.mesh_from_world = item.world_from_mesh.inverse();
    item.mesh_per_world = stretch_of(item.mesh_from_world);
    item.box_world = mesh->bounds().mapped(item.world_from_mesh);
    // A thing that fell out of its room makes the room no smaller.
    if (!moves(scene, node)) bounds_world.add(item.box_world);
    items.push_back(std::move(item));
  }

  /// Calls test(t, triangle) for crossings until it says true.
  template <class Test>
  static bool visit_crossings(const Item& item, const Vec3& from_world, const Vec3& way_world,
                              const double& t_max, const Test& test) {
    if (!crosses_box(item.box_world, from_world, way_world, t_max)) return false;
    const Vec3 from = item.mesh_from_world * from_world;
    const Vec3 way = item.mesh_from_world.linear() * way_world;
    return item.tree().visit(
        [&](const FloatBox& box) { return crosses_box(box.as_double(), from, way, t_max); },
        [&](std::uint32_t triangle) {
          const auto t = crossing(corners_of(*item.mesh, triangle), from, way);
          return t && test(*t, triangle);
        });
  }

  static bool is_leaving(const Item& item, std::uint32_t triangle, const Vec3& way_world) {
    const Corners corner = item.corners_world(triangle);
    const double side = item.world_from_mesh.linear().determinant() < 0.0 ? -1.0 : 1.0;
    return side * (corner[1] - corner[0]).cross(corner[2] - corner[0]).dot(way_world) > 0.0;
  }

  /// Whether rays to all sides leave the mesh and its solid angle is that of a closed one: a cup's
  /// is not.
  static bool is_enclosed(const Item& item, const Vec3& point_world) {
    // No symmetry of a model leads a ray along its edges.
    static const std::array<Vec3, 5> kDirections{
        Vec3(0.4123, 0.2718, 0.8696), Vec3(-0.6321, 0.5113, 0.5822), Vec3(0.2239, -0.8911, 0.3947),
        Vec3(0.7517, 0.1879, -0.6321), Vec3(-0.3571, -0.4409, -0.8234)};
    const double length = 2.0 * item.box_world.size().norm();
    for (const Vec3& direction : kDirections) {
      const Vec3 way = length * direction;
      int turns = 0;
      visit_crossings(item, point_world, way, 1.0, [&](double, std::uint32_t triangle) {
        turns += is_leaving(item, triangle, way) ? 1 : -1;
        return false;
      });
      if (turns == 0) return false;
    }
    constexpr double kClosed = 0.99;
    return std::abs(winding_number(item, point_world)) > kClosed;
  }

  /// Goes down both trees at once, the larger of two boxes first.
  static bool is_near(const Item& item, const Item& other, double distance) {
    if (!overlaps(grown(other.box_world, distance), item.box_world)) return false;
    constexpr double kRounding = 1e-12;
    const Affine item_from_other = item.mesh_from_world * other.world_from_mesh;
    const Mat3 size_from_other = item_from_other.linear().cwiseAbs();
    const double reach = distance * item.mesh_per_world;
    const auto& own = item.tree().branches;
    const auto& others = other.tree().branches;
    std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs{{0, 0}};
    while (!pairs.empty()) {
      const MeshTree::Branch& a = own[pairs.back().first];
      const MeshTree::Branch& b = others[pairs.back().second];
      const auto [at_a, at_b] = pairs.back();
      pairs.pop_back();
      const Aabb box_a = a.box.as_double();
      const Aabb box_b = b.box.as_double();
      const Vec3 middle = item_from_other * box_b.centre();
      Vec3 half = size_from_other * (0.5 * box_b.size()) + Vec3::Constant(reach);
      half.array() += kRounding * (middle.cwiseAbs().sum() + half.sum());
      if (!overlaps(box_a, {middle - half, middle + half})) continue;
      const bool is_b_larger = half.squaredNorm() > 0.25 * box_a.size().squaredNorm();
      if (b.count == 0 && (a.count > 0 || is_b_larger)) {
        pairs.emplace_back(at_a, b.first + 1);
        pairs.emplace_back(at_a, b.first);
      } else if (a.count == 0) {
        pairs.emplace_back(a.first + 1, at_b);
        pairs.emplace_back(a.first, at_b);
      } else if (are_leaves_within(item, a, other, b, item_from_other, distance)) {
        return true;
      }
    }
    return false;
  }

  static bool are_leaves_within(const Item& item, const MeshTree::Branch& a, const Item& other,
                                const MeshTree::Branch& b, const Affine& item_from_other,
                                double distance) {
    const double reach = distance * item.mesh_per_world;
    for (std::uint32_t i = 0; i < b.count; ++i) {
      const Corners corner = corners_of(*other.mesh, other.tree().order[b.first + i]);
      const Aabb near = grown(box_of(mapped(item_from_other, corner)), reach);
      const Corners in_world = mapped(other.world_from_mesh, corner);
      for (std::uint32_t k = 0; k < a.count; ++k) {
        const std::uint32_t triangle = item.tree().order[a.first + k];
        if (!overlaps(box_of(corners_of(*item.mesh, triangle)), near)) continue;
        if (are_within(item.corners_world(triangle), in_world, distance)) return true;
      }
    }
    return false;
  }
};

Obstacles::Obstacles(const Scene& scene, std::span<const NodeId> owners, Hidden hidden)
    : state_(std::make_unique<State>()) {
  for (const NodeId owner : owners) add(scene, owner, hidden);
}

Obstacles::Obstacles(const Scene& scene, std::string_view pattern)
    : state_(std::make_unique<State>()) {
  for (const NodeId node : scene.match(pattern)) {
    state_->add_mesh(scene, node, node, Hidden::LeaveOut);
  }
}

Obstacles::~Obstacles() = default;
Obstacles::Obstacles(Obstacles&&) noexcept = default;
Obstacles& Obstacles::operator=(Obstacles&&) noexcept = default;

void Obstacles::add(const Scene& scene, NodeId owner, Hidden hidden) {
  for (const NodeId node : scene.subtree(owner)) state_->add_mesh(scene, owner, node, hidden);
}

bool Obstacles::is_between(const Vec3& from_world, const Vec3& to_world, NodeId except) const {
  const Vec3 way = to_world - from_world;
  const auto any = [](double, std::uint32_t) { return true; };
  return std::any_of(state_->items.begin(), state_->items.end(), [&](const Item& item) {
    return item.owner != except && State::visit_crossings(item, from_world, way, 1.0, any);
  });
}

std::optional<ObstacleHit> Obstacles::first_hit(const Vec3& from_world, const Vec3& to_world,
                                                NodeId except) const {
  const Vec3 way = to_world - from_world;
  double t_max = 1.0;
  std::optional<ObstacleHit> hit;
  for (const Item& item : state_->items) {
    if (item.owner == except) continue;
    State::visit_crossings(item, from_world, way, t_max, [&](double t, std::uint32_t triangle) {
      if (hit && t >= t_max) return false;
      t_max = t;
      hit = ObstacleHit{t, item.owner, State::is_leaving(item, triangle, way)};
      return false;
    });
  }
  return hit;
}

double Obstacles::distance(const Vec3& point_world, double limit_m, NodeId except) const {
  double nearest = limit_m * limit_m;
  for (const Item& item : state_->items) {
    if (item.owner == except || squared_distance(point_world, item.box_world) >= nearest) continue;
    const Vec3 point = item.mesh_from_world * point_world;
    const double scale = item.mesh_per_world * item.mesh_per_world;
    item.tree().visit(
        [&](const FloatBox& box) {
          return squared_distance(point, box.as_double()) < nearest * scale;
        },
        [&](std::uint32_t triangle) {
          nearest = std::min(nearest, squared_distance(point_world, item.corners_world(triangle)));
          return false;
        });
  }
  return std::sqrt(nearest);
}

bool Obstacles::meets_box(const Aabb& box, const Affine& world_from_box, NodeId except) const {
  const Aabb box_world = box.mapped(world_from_box);
  const Affine box_from_world = world_from_box.inverse();
  return std::any_of(state_->items.begin(), state_->items.end(), [&](const Item& item) {
    if (item.owner == except || !overlaps(item.box_world, box_world)) return false;
    const Affine box_from_mesh = box_from_world * item.world_from_mesh;
    const Aabb box_mesh = box.mapped(item.mesh_from_world * world_from_box);
    return item.tree().visit([&](const FloatBox& branch) { return overlaps(branch, box_mesh); },
                             [&](std::uint32_t triangle) {
                               return reaches_into(
                                   box, mapped(box_from_mesh, corners_of(*item.mesh, triangle)));
                             });
  });
}

std::vector<NodeId> Obstacles::near_node(const Scene& scene, NodeId node, double distance_m,
                                         NodeId except) const {
  State own;
  for (const NodeId below : scene.subtree(node)) own.add_mesh(scene, node, below, Hidden::Count);
  std::set<NodeId> near;
  for (const Item& item : state_->items) {
    if (item.owner == except || item.owner == node || near.contains(item.owner)) continue;
    const bool is_near = std::any_of(own.items.begin(), own.items.end(), [&](const Item& part) {
      return State::is_near(item, part, distance_m);
    });
    if (is_near) near.insert(item.owner);
  }
  return {near.begin(), near.end()};
}

NodeId Obstacles::encloser(const Vec3& point_world, NodeId except) const {
  const double all = state_->bounds_world.size().prod();
  for (const Item& item : state_->items) {
    const Aabb& box = item.box_world;
    const bool spans_all = !state_->bounds_world.is_empty() && box.size().prod() >= 0.5 * all;
    const bool is_possible = item.owner != except && !spans_all &&
                             (point_world.array() > box.min.array()).all() &&
                             (point_world.array() < box.max.array()).all();
    if (is_possible && State::is_enclosed(item, point_world)) return item.owner;
  }
  return {};
}

std::vector<NodeId> unplaced_bodies(const Scene& scene) {
  std::vector<NodeId> nodes;
  for (const NodeId node : scene.subtree(scene.root())) {
    const bool waits =
        scene[node].rigid_body && scene[node].parent_from_node.matrix() == Mat4::Identity();
    if (waits) nodes.push_back(node);
  }
  return nodes;
}

}  // namespace diorama
