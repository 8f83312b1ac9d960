// SPDX-License-Identifier: Apache-2.0
#include "diorama/scene.h"

#include <cstdint>
#include <set>

#include "diorama/rng.h"
#include "error_text.h"
#include "support/catch.h"

using namespace diorama;

namespace {

Transform moved(const Vec3& translation) {
  Transform transform;
  transform.translation = translation;
  return transform;
}

std::vector<std::string> paths(const Scene& scene, const std::vector<NodeId>& nodes) {
  std::vector<std::string> names;
  for (const NodeId node : nodes) names.push_back(scene.path(node));
  return names;
}

using Names = std::vector<std::string>;

/// /Assets/{cup{handle,body},banana,banana_01}, /Environment/room/{TableDining,wall}
struct Kitchen {
  Scene scene;
  NodeId assets = scene.create(scene.root(), "Assets");
  NodeId cup = scene.create(assets, "cup");
  NodeId environment = scene.create(scene.root(), "Environment");
  NodeId handle = scene.create(cup, "handle");
  NodeId banana = scene.create(assets, "banana");
  NodeId second_banana = scene.create(assets, "banana");
  NodeId room = scene.create(environment, "room");
  NodeId table = scene.create(room, "TableDining");
  NodeId body = scene.create(cup, "body");
  NodeId wall = scene.create(room, "wall");
};

}  // namespace

TEST_CASE("A taken name gets the next free number", "[scene]") {
  Scene scene;
  const NodeId parent = scene.create(scene.root(), "Assets");
  Names names;
  for (int i = 0; i < 12; ++i) names.push_back(scene[scene.create(parent, "banana")].name);
  CHECK(names[0] == "banana");
  CHECK(names[1] == "banana_01");
  CHECK(names[11] == "banana_11");
  CHECK(scene[scene.create(parent, "banana_12")].name == "banana_12");
  CHECK(scene[scene.create(parent, "banana")].name == "banana_13");
  CHECK(scene[scene.create(scene.root(), "banana")].name == "banana");
  scene.erase(scene.require("/Assets/banana"));
  CHECK(scene[scene.create(parent, "banana")].name == "banana");
}

TEST_CASE("Ids follow creation and are never used again", "[scene]") {
  Scene scene;
  CHECK(scene.root().index == 0);
  const NodeId first = scene.create(scene.root(), "a");
  CHECK(first.index == 1);
  scene.erase(first);
  CHECK(scene.create(scene.root(), "a").index == 2);
  CHECK_FALSE(scene.contains(first));
}

TEST_CASE("A name may not be empty nor hold a slash", "[scene]") {
  Scene scene;
  CHECK(test::error_text([&] { scene.create(scene.root(), "a/b"); }) ==
        "Scene::create below /: the name 'a/b' is empty or holds a '/'");
  CHECK(test::error_text([&] { scene.create(scene.root(), ""); }) ==
        "Scene::create below /: the name '' is empty or holds a '/'");
}

TEST_CASE("Erasing takes the whole subtree away", "[scene]") {
  Kitchen k;
  k.scene.erase(k.cup);
  CHECK_FALSE(k.scene.contains(k.cup));
  CHECK_FALSE(k.scene.contains(k.handle));
  CHECK_FALSE(k.scene.find("/Assets/cup"));
  CHECK_FALSE(k.scene.find("/Assets/cup/body"));
  CHECK(paths(k.scene, k.scene.subtree(k.assets)) ==
        Names{"/Assets", "/Assets/banana", "/Assets/banana_01"});
  CHECK(test::error_text([&] { k.scene[k.handle]; }) ==
        "Scene: node 4 is not (or no longer) in the scene");
  CHECK(test::error_text([&] { k.scene.edit(NodeId{}); }) ==
        "Scene: a null node id is not (or no longer) in the scene");
  CHECK(test::error_text([&] { k.scene.erase(k.scene.root()); }) ==
        "Scene::erase: the root cannot be erased");
}

TEST_CASE("Nodes are found by path", "[scene]") {
  Kitchen k;
  CHECK(k.scene.find("/Assets/cup/handle") == k.handle);
  CHECK(k.scene.find("/") == k.scene.root());
  CHECK(k.scene.path(k.scene.root()) == "/");
  CHECK(k.scene.path(k.table) == "/Environment/room/TableDining");
  for (const char* absent : {"", "Assets", "/assets", "/Assets/", "//Assets", "/Assets/cup/x/y"}) {
    CHECK_FALSE(k.scene.find(absent));
  }
  CHECK(test::error_text([&] { k.scene.require("/Assets/cup/lid/knob"); }) ==
        "there is no node /Assets/cup/lid/knob in the scene; the nearest above it is /Assets/cup");
  CHECK(test::error_text([&] { k.scene.require("/Light"); }) ==
        "there is no node /Light in the scene; the nearest above it is /");
}

TEST_CASE("Patterns match paths in creation order", "[scene]") {
  Kitchen k;
  const auto matches = [&](const char* pattern) { return paths(k.scene, k.scene.match(pattern)); };
  CHECK(matches("/Assets/*") == Names{"/Assets/cup", "/Assets/banana", "/Assets/banana_01"});
  CHECK(matches("/Assets/**") == Names{"/Assets/cup", "/Assets/cup/handle", "/Assets/banana",
                                       "/Assets/banana_01", "/Assets/cup/body"});
  CHECK(matches("/Assets/banana*") == Names{"/Assets/banana", "/Assets/banana_01"});
  CHECK(matches("/*") == Names{"/Assets", "/Environment"});
  CHECK(matches("/Environment/**/Table*") == Names{"/Environment/room/TableDining"});
  CHECK(matches("/Environment/room/**/Table*") == Names{"/Environment/room/TableDining"});
  CHECK(matches("**an*") == Names{"/Assets/cup/handle", "/Assets/banana", "/Assets/banana_01"});
  CHECK(matches("/*/*/h*e") == Names{"/Assets/cup/handle"});
  CHECK(matches("/Assets/cup") == Names{"/Assets/cup"});
  CHECK(matches("/Assets/") == Names{});
  CHECK(matches("/Assets/c*x") == Names{});
  CHECK(matches("/**/handle/**") == Names{});
  k.scene.erase(k.banana);
  CHECK(matches("/Assets/b*") == Names{"/Assets/banana_01"});
}

namespace {

/// What a pattern means, letter by letter.
bool fits(std::string_view pattern, std::string_view path) {
  if (pattern.empty()) return path.empty();
  const auto fits_behind = [&](std::string_view rest, bool crosses_names) {
    for (std::size_t i = 0;; ++i) {
      if (fits(rest, path.substr(i))) return true;
      if (i == path.size() || (path[i] == '/' && !crosses_names)) return false;
    }
  };
  if (pattern.starts_with("/**/")) {
    if (!path.starts_with('/')) return false;
    for (std::size_t i = 0; i < path.size(); ++i) {
      if (path[i] == '/' && fits(pattern.substr(4), path.substr(i + 1))) return true;
    }
    return false;
  }
  if (pattern.starts_with("**")) return fits_behind(pattern.substr(2), true);
  if (pattern.starts_with("*")) return fits_behind(pattern.substr(1), false);
  return !path.empty() && path.front() == pattern.front() &&
         fits(pattern.substr(1), path.substr(1));
}

}  // namespace

TEST_CASE("Patterns mean the same wherever they part a path", "[scene]") {
  Rng rng(20);
  Scene scene;
  std::vector<NodeId> nodes{scene.root()};
  for (int i = 0; i < 150; ++i) {
    std::string name;
    for (std::size_t k = rng.index(3) + 1; k > 0; --k) name += "ab"[rng.index(2)];
    nodes.push_back(scene.create(nodes[rng.index(nodes.size())], name));
  }
  const std::vector<std::string> parts{"a", "b", "/", "*", "**", "/**/", "/a", "b/"};
  int matches = 0;
  for (int i = 0; i < 2000; ++i) {
    std::string pattern = rng.index(4) == 0 ? "" : "/";
    for (std::size_t k = rng.index(6) + 1; k > 0; --k) pattern += parts[rng.index(parts.size())];
    if (pattern.find('*') == std::string::npos) continue;
    std::vector<NodeId> expected;
    for (std::size_t k = 1; k < nodes.size(); ++k) {
      if (fits(pattern, scene.path(nodes[k]))) expected.push_back(nodes[k]);
    }
    CAPTURE(pattern);
    CHECK(scene.match(pattern) == expected);
    matches += expected.empty() ? 0 : 1;
  }
  CHECK(matches > 200);
}

TEST_CASE("A pattern of many stars against a long path stays quick", "[scene]") {
  Scene scene;
  scene.create(scene.root(), std::string(2000, 'a'));
  std::string pattern = "/";
  for (int i = 0; i < 200; ++i) pattern += "a*";
  CHECK(scene.match(pattern).size() == 1);
  CHECK(scene.match(pattern + "b").empty());
}

TEST_CASE("A subtree lists parents before children and children in order", "[scene]") {
  Kitchen k;
  CHECK(paths(k.scene, k.scene.subtree(k.assets)) == Names{"/Assets", "/Assets/cup",
                                                           "/Assets/cup/handle", "/Assets/cup/body",
                                                           "/Assets/banana", "/Assets/banana_01"});
}

TEST_CASE("World poses are products down the tree", "[scene]") {
  Kitchen k;
  Transform turned = moved(Vec3(1, 2, 3));
  turned.rotation = Quat(Eigen::AngleAxisd(kPi / 2, Vec3::UnitZ()));
  turned.scale = Vec3(2, 2, 2);
  k.scene.set_pose(k.assets, turned);
  k.scene.set_pose(k.cup, moved(Vec3(10, 0, 0)));
  k.scene.set_pose(k.handle, moved(Vec3(0, 0, 5)));
  const Vec3 origin = k.scene.world_from_node(k.handle) * Vec3::Zero();
  CHECK(origin.isApprox(Vec3(1, 22, 13), 1e-12));
}

TEST_CASE("A pose must be finite", "[scene]") {
  Kitchen k;
  Affine broken = Affine::Identity();
  broken(1, 2) = std::numeric_limits<double>::quiet_NaN();
  CHECK(test::error_text([&] { k.scene.set_pose(k.cup, broken); }) ==
        "/Assets/cup: the pose is not finite");
  CHECK(k.scene.world_from_node(k.cup).isApprox(Affine::Identity()));
}

TEST_CASE("Revisions tell poses from shapes", "[scene]") {
  Kitchen k;
  const auto pose = k.scene.pose_revision(), shape = k.scene.shape_revision();
  k.scene.set_pose(k.cup, moved(Vec3(1, 0, 0)));
  CHECK(k.scene.pose_revision() > pose);
  CHECK(k.scene.shape_revision() == shape);
  const auto moved_pose = k.scene.pose_revision();
  k.scene.edit(k.cup).is_visible = false;
  CHECK(k.scene.shape_revision() > shape);
  const auto edited = k.scene.shape_revision();
  const NodeId created = k.scene.create(k.cup, "spoon");
  CHECK(k.scene.shape_revision() > edited);
  const auto grown = k.scene.shape_revision();
  k.scene.erase(created);
  CHECK(k.scene.shape_revision() > grown);
  CHECK(k.scene.pose_revision() == moved_pose);
}

TEST_CASE("no two scenes ever have the same revision", "[scene]") {
  std::set<std::uint64_t> seen;
  for (int i = 0; i < 3; ++i) {
    // After equal changes, and likely at the same address.
    Scene scene;
    const NodeId node = scene.create(scene.root(), "node");
    scene.set_pose(node, Affine::Identity());
    CHECK(seen.insert(scene.pose_revision()).second);
    CHECK(seen.insert(scene.shape_revision()).second);
  }
}

TEST_CASE("Labels are inherited per taxonomy from the nearest ancestor", "[scene]") {
  Kitchen k;
  k.scene.edit(k.assets).labels = {{"class", "thing"}, {"owner", "us"}};
  k.scene.edit(k.cup).labels = {{"class", "cup"}, {"colour", "red"}};
  k.scene.edit(k.handle).labels = {{"colour", "blue"}};
  CHECK(k.scene.effective_labels(k.handle) ==
        Labels{{"class", "cup"}, {"colour", "blue"}, {"owner", "us"}});
  CHECK(k.scene.effective_labels(k.wall).empty());
}

TEST_CASE("Hiding a node hides what is below it", "[scene]") {
  Kitchen k;
  k.scene.edit(k.cup).is_visible = false;
  CHECK_FALSE(k.scene.is_visible(k.handle));
  CHECK(k.scene.is_visible(k.assets));
  CHECK(k.scene.is_visible(k.banana));
}

TEST_CASE("Bounds are those of the vertices, not of a turned box", "[scene]") {
  Kitchen k;
  const auto ball = std::make_shared<const Mesh>(make_sphere(1.0, 64));
  k.scene.edit(k.handle).mesh = ball;
  Transform turned = moved(Vec3(5, 0, 0));
  turned.rotation = Quat(Eigen::AngleAxisd(kPi / 4, Vec3::UnitZ()));
  k.scene.set_pose(k.cup, turned);
  k.scene.set_pose(k.handle, moved(Vec3(2, 0, 0)));

  const Aabb world = k.scene.world_bounds(k.assets);
  CHECK(world.size().isApprox(Vec3(2, 2, 2), 0.01));
  CHECK(world.centre().isApprox(Vec3(5 + std::sqrt(2.0), std::sqrt(2.0), 0), 0.01));
  const Aabb own = node_bounds(k.scene, k.cup);
  CHECK(own.min.isApprox(Vec3(1, -1, -1), 0.01));
  CHECK(own.max.isApprox(Vec3(3, 1, 1), 0.01));
  CHECK(k.scene.world_bounds(k.environment).is_empty());

  k.scene.edit(k.handle).is_visible = false;
  CHECK(node_bounds(k.scene, k.cup).is_empty());
  CHECK(k.scene.world_bounds(k.cup).is_empty());
}

TEST_CASE("World bounds are those of what can be seen", "[scene]") {
  Kitchen k;
  k.scene.edit(k.body).mesh = std::make_shared<const Mesh>(make_box(Vec3(1, 2, 3)));
  k.scene.edit(k.handle).mesh = std::make_shared<const Mesh>(make_box(Vec3(40, 50, 60)));
  k.scene.edit(k.handle).is_visible = false;
  CHECK(k.scene.world_bounds(k.cup).size().isApprox(Vec3(1, 2, 3)));
  // Something above may hide it as well.
  k.scene.edit(k.handle).is_visible = true;
  k.scene.edit(k.assets).is_visible = false;
  CHECK(k.scene.world_bounds(k.handle).is_empty());
  CHECK(k.scene.world_bounds(k.scene.root()).is_empty());
}

TEST_CASE("A labelled instance owns the visible meshes whose nearest label it is", "[scene]") {
  Kitchen k;
  const auto mesh = std::make_shared<const Mesh>(make_box(Vec3(1, 2, 3)));
  for (const NodeId node : {k.body, k.handle, k.banana, k.second_banana, k.table, k.wall}) {
    k.scene.edit(node).mesh = mesh;
  }
  k.scene.edit(k.environment).mesh = std::make_shared<const Mesh>();
  k.scene.edit(k.environment).labels = {{"class", "room"}};
  k.scene.edit(k.table).labels = {{"class", "table"}};
  k.scene.edit(k.cup).labels = {{"class", "cup"}};
  k.scene.edit(k.banana).labels = {{"class", "banana"}};
  k.scene.edit(k.banana).is_visible = false;

  const std::vector<LabelledInstance> instances = labelled_instances(k.scene);
  REQUIRE(instances.size() == 3);
  CHECK(instances[0].node == k.cup);
  CHECK(instances[0].leaves == std::vector{k.handle, k.body});
  CHECK(instances[1].node == k.environment);
  CHECK(instances[1].leaves == std::vector{k.wall});
  CHECK(instances[2].node == k.table);
  CHECK(instances[2].leaves == std::vector{k.table});
}
