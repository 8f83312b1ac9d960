// SPDX-License-Identifier: Apache-2.0
#include "box_tree.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "diorama/geometry.h"
#include "diorama/rng.h"
#include "gpu_scene.h"
#include "plugins/renderer_embree/test_world.h"
#include "support/catch.h"
#include "support/render_host/render_host.h"

namespace diorama {
namespace {

bool contains(const TreeBox& outer, const TreeBox& inner) {
  return (outer.low.array() <= inner.low.array()).all() &&
         (outer.high.array() >= inner.high.array()).all();
}

/// Walks the whole tree: what its leaves hold, and how deep it is.
struct Walk {
  std::vector<std::uint32_t> found;
  int deepest = 0;
  bool is_nested = true;

  void node(const BoxTree& tree, const std::vector<TreeBox>& boxes, bool has_runs,
            std::uint32_t number, const TreeBox& around, int depth) {
    const TreeNode& n = tree.nodes[number];
    if (n.has_a()) child(tree, boxes, has_runs, {n.low_a, n.high_a}, n.child_a, around, depth);
    if (n.has_b()) child(tree, boxes, has_runs, {n.low_b, n.high_b}, n.child_b, around, depth);
  }
  void child(const BoxTree& tree, const std::vector<TreeBox>& boxes, bool has_runs,
             const TreeBox& box, std::uint32_t child, const TreeBox& around, int depth) {
    deepest = std::max(deepest, depth);
    is_nested &= contains(around, box);
    if ((child & TreeNode::kLeaf) == 0) {
      return node(tree, boxes, has_runs, child, box, depth + 1);
    }
    const std::uint32_t rest = child & ~TreeNode::kLeaf;
    const std::uint32_t count = has_runs ? (rest & 7u) + 1 : 1;
    for (std::uint32_t i = 0; i < count; ++i) {
      const std::uint32_t item = has_runs ? tree.order[(rest >> 3) + i] : rest;
      is_nested &= contains(box, boxes[item]);
      found.push_back(item);
    }
  }
};

Walk walk(const BoxTree& tree, const std::vector<TreeBox>& boxes, bool has_runs) {
  Walk walk;
  walk.node(tree, boxes, has_runs, 0, {Vec3f::Constant(-3e38f), Vec3f::Constant(3e38f)}, 1);
  std::ranges::sort(walk.found);
  return walk;
}

std::vector<TreeBox> random_boxes(std::uint32_t count) {
  Rng rng(7);
  std::vector<TreeBox> boxes(count);
  for (TreeBox& box : boxes) {
    const Vec3f at(float(rng.uniform()) * 9.0f, float(rng.uniform()) * 3.0f, float(rng.uniform()));
    box.add(at);
    box.add(Vec3f(at + Vec3f(0.1f, 0.02f, float(rng.uniform()))));
  }
  return boxes;
}

}  // namespace

TEST_CASE("the first levels of a tree are what the tree has there", "[box_tree]") {
  const BoxTree tree = tree_of_runs(random_boxes(500));
  CHECK(tree.top(0).empty());
  CHECK(tree.top(1).size() == 1);
  const auto top = tree.top(4);
  CHECK(top.size() > 4);
  CHECK(top.size() <= 15);
  for (const auto& [number, node] : top) {
    CHECK(node.child_a == tree.nodes[number].child_a);
    CHECK(node.low_b == tree.nodes[number].low_b);
  }
}

TEST_CASE("every box is in one leaf, and within all boxes above it", "[box_tree]") {
  for (const std::uint32_t count : {0u, 1u, 2u, 5u, 37u, 3000u}) {
    std::vector<TreeBox> boxes = random_boxes(count);
    if (count > 5) boxes[3] = TreeBox();  // empty: left out
    for (const bool has_runs : {true, false}) {
      const BoxTree tree = has_runs ? tree_of_runs(boxes) : tree_of_single(boxes);
      const Walk seen = walk(tree, boxes, has_runs);
      CAPTURE(count, has_runs);
      CHECK(seen.is_nested);
      CHECK(seen.deepest <= BoxTree::kDeepest);
      std::vector<std::uint32_t> all;
      for (std::uint32_t i = 0; i < count; ++i) {
        if (count <= 5 || i != 3) all.push_back(i);
      }
      CHECK(seen.found == all);
    }
  }
}

TEST_CASE("no ray enters the box of a child that is not there", "[box_tree]") {
  // As entry_of() of rays.glsl does it.
  const auto enters = [](const Vec3f& low, const Vec3f& high, const Vec3f& origin,
                         const Vec3f& direction) {
    const Vec3f a = (low - origin).cwiseQuotient(direction);
    const Vec3f b = (high - origin).cwiseQuotient(direction);
    const float near = std::max(a.cwiseMin(b).maxCoeff(), 0.0f);
    return near <= std::min(a.cwiseMax(b).minCoeff(), 3e38f) * 1.0000004f;
  };
  const BoxTree none = tree_of_single({});
  const BoxTree one = tree_of_runs(random_boxes(1));
  CHECK_FALSE(none.nodes.at(0).has_a());
  CHECK(one.nodes.at(0).has_a());
  CHECK_FALSE(one.nodes.at(0).has_b());
  Rng rng(3);
  const auto vector = [&rng] {
    return Vec3f(float(rng.uniform(-1, 1)), float(rng.uniform(-1, 1)), float(rng.uniform(-1, 1)));
  };
  int met = 0;
  for (int i = 0; i < 3000; ++i) {
    Vec3f direction = std::pow(10.0f, float(i % 7 - 3)) * vector();
    if (i % 10 == 0) direction.x() = 1e-20f;
    const Vec3f origin = std::pow(10.0f, float(i % 5)) * vector();
    const auto& [low_a, child_a, high_a, pad_a, low_b, child_b, high_b, pad_b] = one.nodes[0];
    met += enters(low_b, high_b, origin, direction) ? 1 : 0;
    met += enters(none.nodes[0].low_a, none.nodes[0].high_a, origin, direction) ? 1 : 0;
    CHECK(enters(low_a, high_a, 0.5f * (low_a + high_a) - direction, direction));
  }
  CHECK(met == 0);
}

TEST_CASE("boxes at one place, and boxes of all sizes, make no deep tree", "[box_tree]") {
  std::vector<TreeBox> same(5000);
  for (TreeBox& box : same) {
    box.add(Vec3f(1.0f, 2.0f, 3.0f));
    box.add(Vec3f(1.5f, 2.5f, 3.5f));
  }
  const Walk equal = walk(tree_of_runs(same), same, true);
  CHECK(equal.found.size() == same.size());
  CHECK(equal.deepest <= 20);
  // Each reaches half as far as the one before: areas alone would cut them off one by one.
  std::vector<TreeBox> shrinking(2000);
  float size = 1e18f;
  for (TreeBox& box : shrinking) {
    box.add(Vec3f::Zero());
    box.add(Vec3f(size, 0.5f * size, size));
    size = std::max(size * 0.9f, 1e-18f);
  }
  const Walk deep = walk(tree_of_single(shrinking), shrinking, false);
  CHECK(deep.found.size() == shrinking.size());
  CHECK(deep.deepest <= BoxTree::kDeepest);
}

TEST_CASE("the box of what moves and turns holds all of it at all times", "[box_tree]") {
  // Up to two turns, around places far beside what turns: arcs reach far beyond their ends.
  Rng rng(11);
  const auto vector = [&rng](double most) {
    return Vec3(rng.uniform(-most, most), rng.uniform(-most, most), rng.uniform(-most, most));
  };
  for (int round = 0; round < 40; ++round) {
    const bool turns = round % 4 != 0;
    test::TestWorld world;
    const NodeId body = world.scene.create(world.base, "body");
    const NodeId node = world.scene.create(body, "part");
    world.scene.edit(node).mesh = std::make_shared<const Mesh>(make_cone(0.2, 0.7, 5));
    world.scene.edit(node).materials = {std::make_shared<const Material>()};
    Affine place = Affine(Eigen::Translation3d(vector(1.5)));
    place.rotate(Eigen::AngleAxisd(rng.uniform(0.0, kPi), vector(1.0).normalized()));
    place.scale(Vec3(1.3, 0.4, -0.8));
    world.scene.set_pose(node, place);
    RigidBody moving;
    moving.linear_velocity = vector(20.0);
    if (turns) moving.angular_velocity = vector(round % 2 == 0 ? 200.0 : 10.0);
    world.scene.edit(body).rigid_body = moving;
    const NodeId camera = world.add_camera(8, 8, 8.0, Vec3(0, 0, 9), Vec3::Zero());
    world.scene.edit(camera).camera->exposure_time_s = 0.06;

    test::RenderHost host(1);
    RenderScene scene(host, {});
    scene.take(world.scene);
    const MeshInstance& instance = scene.instances().at(0);
    REQUIRE(instance.motion != nullptr);
    const TreeBox box = box_over_time(instance, scene.window());
    TreeBox swept;
    constexpr int kTimes = 201;
    for (int k = 0; k < kTimes; ++k) {
      const double seconds = 0.06 * (double(k) / (kTimes - 1) - 0.5);
      const Affine then = instance.motion->motion.then_from_now(seconds);
      for (const Vec3f& p : instance.source().positions) {
        swept.add(Vec3f((then * instance.to_world(p).cast<double>()).cast<float>()));
      }
    }
    CAPTURE(round);
    CHECK(contains(box, swept));
    // What only shifts gets no more than it needs.
    TreeBox still;
    for (const Vec3f& p : instance.source().positions) still.add(instance.to_world(p));
    const Vec3f shift = (0.06 * moving.linear_velocity).cast<float>().cwiseAbs();
    if (!turns) CHECK((box.high - box.low).isApprox(still.high - still.low + shift, 1e-4f));
  }
}

}  // namespace diorama
