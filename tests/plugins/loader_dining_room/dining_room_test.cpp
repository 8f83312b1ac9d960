// SPDX-License-Identifier: Apache-2.0
#include <map>
#include <memory>
#include <set>
#include <string>

#include "loader_dining_room/dining_room.h"
#include "loader_dining_room/dining_room_loader.h"
#include "loader_dining_room/room_plan.h"
#include "support/catch.h"
#include "support/mesh_checks.h"
#include "support/plain_host.h"

using namespace diorama;
using namespace diorama::dining_room;

namespace {

struct Room {
  explicit Room(std::uint64_t seed) {
    root = scene.create(scene.root(), "room");
    build_dining_room(seed, host, scene, root);
  }
  std::vector<NodeId> groups(const std::string& prefix) const {
    std::vector<NodeId> found;
    for (const NodeId id : scene[root].children) {
      if (scene[id].name.starts_with(prefix)) found.push_back(id);
    }
    return found;
  }
  Aabb box(NodeId id) const { return scene.world_bounds(id); }

  test::PlainHost host;
  Scene scene;
  NodeId root;
};

/// Rooms take a second each, so the tests share them.
const Room& shared_room(std::uint64_t seed) {
  static std::map<std::uint64_t, std::unique_ptr<const Room>> rooms;
  auto& room = rooms[seed];
  if (!room) room = std::make_unique<const Room>(seed);
  return *room;
}

/// Whether two boxes share more than `depth` in every direction.
bool overlap(const Aabb& a, const Aabb& b, double depth) {
  return ((a.max.cwiseMin(b.max) - a.min.cwiseMax(b.min)).array() > depth).all();
}

std::uint64_t content_hash(const Room& room) {
  std::uint64_t hash = 0;
  const auto mix = [&](const void* data, std::size_t size) {
    hash = hash * 31 + stable_hash({static_cast<const char*>(data), size});
  };
  for (const NodeId id : room.scene.subtree(room.root)) {
    const Node& node = room.scene[id];
    mix(node.name.data(), node.name.size());
    mix(node.parent_from_node.matrix().data(), 16 * sizeof(double));
    if (node.mesh) mix(node.mesh->positions.data(), node.mesh->positions.size() * sizeof(Vec3f));
    for (const auto& material : node.materials) {
      const auto& texture = material->base_color_texture.texture;
      if (texture) mix(texture->bytes.data(), texture->bytes.size());
    }
  }
  return hash;
}

}  // namespace

TEST_CASE("every mesh of a room is sound", "[dining_room][slow]") {
  for (const std::uint64_t seed : {1, 2, 9}) {
    const Room& room = shared_room(seed);
    std::size_t triangles = 0;
    for (const NodeId id : room.scene.subtree(room.root)) {
      const Node& node = room.scene[id];
      if (!node.mesh) continue;
      INFO("seed " << seed << " " << node.name);
      REQUIRE_NOTHROW(node.mesh->validate(node.name));
      const test::MeshFaults faults = test::mesh_faults(*node.mesh);
      CHECK(faults.open_edges == 0);
      CHECK(faults.flipped == 0);
      CHECK(faults.degenerate == 0);
      CHECK(faults.volume > 0);
      std::size_t slots = 1;
      for (const std::uint16_t slot : node.mesh->material_slots)
        slots = std::max<std::size_t>(slots, slot + 1u);
      CHECK(node.materials.size() >= slots);
      triangles += node.mesh->triangles.size();
    }
    CHECK(triangles > 50'000);
    CHECK(triangles < 300'000);
  }
}

TEST_CASE("names and tree are those of an exported room", "[dining_room]") {
  const Room& room = shared_room(1);
  for (const char* part :
       {"dining_room_0_0_floor", "dining_room_0_0_wall", "dining_room_0_0_ceiling",
        "dining_room_0_0_exterior", "skirtingboard_ceiling", "skirtingboard_support"}) {
    INFO(part);
    CHECK(room.groups(part).size() == 1);
  }
  CHECK(room.groups("TableDiningFactory_").size() == 1);
  CHECK(room.groups("ChairFactory_").size() >= 4);
  bool has_bulb_glass = false;
  for (const NodeId id : room.scene[room.root].children) {
    const Node& group = room.scene[id];
    CHECK(group.name.size() <= 63);
    REQUIRE(group.children.size() == 1);
    const Node& leaf = room.scene[group.children[0]];
    CHECK(leaf.name == group.name);
    CHECK((leaf.mesh != nullptr) != leaf.light.has_value());
    has_bulb_glass |=
        group.name.starts_with("CeilingLightFactory_") && group.name.ends_with("__001_SPLIT_GLA");
    if (!leaf.mesh) continue;
    // The group stands at the mean of the vertices.
    Vec3 mean = Vec3::Zero();
    for (const Vec3f& p : leaf.mesh->positions) mean += p.cast<double>();
    CHECK((mean / double(leaf.mesh->positions.size())).norm() < 1e-4);
  }
  CHECK(has_bulb_glass);
  CHECK(!room.groups("PointLampFactory_").empty());
}

TEST_CASE("furniture stands on the floor and keeps its distance", "[dining_room][slow]") {
  for (const std::uint64_t seed : {1, 2, 9}) {
    const Room& room = shared_room(seed);
    INFO("seed " << seed);
    const Aabb floor = room.box(room.groups("dining_room_0_0_floor")[0]);
    CHECK(floor.max.z() == Approx(0).margin(1e-6));
    std::map<std::string, Aabb> standing;
    for (const char* kind :
         {"TableDiningFactory_", "ChairFactory_", "SingleCabinetFactory_", "SimpleBookcaseFactory_",
          "LargePlantContainerFactory_", "PanelDoorFactory_"}) {
      for (const NodeId id : room.groups(kind)) {
        const Aabb box = room.box(id);
        INFO(room.scene[id].name);
        CHECK(box.min.z() > -1e-4);
        CHECK(box.min.z() < 0.02);  // the rug is thinner
        CHECK(box.max.z() < 2.3);
        standing.emplace(room.scene[id].name, box);
      }
    }
    for (auto a = standing.begin(); a != standing.end(); ++a) {
      for (auto b = std::next(a); b != standing.end(); ++b) {
        // Chairs go under the table and, turned, their boxes may meet.
        const bool is_tucked =
            a->first.starts_with("ChairFactory") &&
            (b->first.starts_with("TableDining") || b->first.starts_with("ChairFactory"));
        INFO(a->first << " and " << b->first);
        if (!is_tucked) CHECK(!overlap(a->second, b->second, 0.002));
      }
    }
    const Aabb table = room.box(room.groups("TableDiningFactory_")[0]);
    CHECK(table.size().z() > 0.65);
    CHECK(table.size().z() < 0.85);
    // What lies on the table lies on its top, near its edge.
    for (const char* kind : {"PlateFactory_", "WineglassFactory_", "ForkFactory_"}) {
      for (const NodeId id : room.groups(kind))
        CHECK(room.box(id).min.z() == Approx(table.max.z()).margin(1e-3));
    }
  }
}

TEST_CASE("plans keep ways free, whatever the seed", "[dining_room]") {
  std::set<int> seats;
  int windows = 0;
  for (std::uint64_t seed = 0; seed < 300; ++seed) {
    const RoomPlan plan = plan_room(Rng(seed));
    INFO("seed " << seed);
    CHECK(plan.seats.size() >= 4);
    CHECK(plan.seats.size() <= 8);
    seats.insert(int(plan.seats.size()));
    windows += int(plan.windows.size());
    CHECK(!plan.windows.empty());
    const Vec2 half(plan.table_length / 2, plan.table_width / 2);
    CHECK(((plan.table_centre - half).array() > 1.0).all());
    CHECK(((Vec2(plan.width, plan.depth) - plan.table_centre - half).array() > 1.0).all());
    for (const WallOpening& w : plan.windows) {
      CHECK(w.wall != plan.door.wall);
      CHECK(w.wall != -1);
      CHECK(w.centre - w.width / 2 > 0.2);
      CHECK(w.centre + w.width / 2 < plan.wall_length(w.wall) - 0.2);
      CHECK(w.sill + w.height < plan.height - 0.2);
    }
    CHECK(plan.sideboard.centre - plan.sideboard.width / 2 > 0.1);
    CHECK(plan.sideboard.centre + plan.sideboard.width / 2 <
          plan.wall_length(plan.sideboard.wall) - 0.1);
    // Every chair, pulled out, keeps 0.4 m to the walls.
    for (const RoomPlan::Seat& seat : plan.seats) {
      CHECK((seat.place.array() > 0.4 + kSeatDepth / 2).all());
      CHECK(((Vec2(plan.width, plan.depth) - seat.place).array() > 0.4 + kSeatDepth / 2).all());
    }
  }
  CHECK(seats.size() >= 4);
  CHECK(windows > 400);
}

TEST_CASE("the seed decides everything", "[dining_room]") {
  const std::uint64_t hash = content_hash(shared_room(2));
  CHECK(hash == content_hash(Room(2)));
  CHECK(hash != content_hash(shared_room(9)));
}

TEST_CASE("chairs share one mesh", "[dining_room]") {
  const Room& room = shared_room(1);
  std::set<const Mesh*> meshes;
  for (const NodeId id : room.groups("ChairFactory_"))
    meshes.insert(room.scene[room.scene[id].children[0]].mesh.get());
  CHECK(meshes.size() == 1);
}

TEST_CASE("the loader lists its rooms and refuses other names", "[dining_room]") {
  test::PlainHost host;
  DiningRoomLoader loader({.first_seed = 7, .count = 3}, host);
  CHECK(loader.claims() == std::vector<std::string>{"dining_room:"});
  CHECK(loader.assets() ==
        std::vector<std::string>{"dining_room:7", "dining_room:8", "dining_room:9"});
  Scene scene;
  const NodeId root = scene.create(scene.root(), "x");
  for (const char* bad :
       {"dining_room:", "dining_room:-3", "dining_room:7b", "dining_room:99999999999999999999"}) {
    INFO(bad);
    CHECK_THROWS_WITH(loader.load(bad, scene, root),
                      ContainsSubstring(std::string(bad) + ": expected dining_room:SEED"));
  }
}
