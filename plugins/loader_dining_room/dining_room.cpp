// SPDX-License-Identifier: Apache-2.0
#include "loader_dining_room/dining_room.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "loader_dining_room/decor.h"
#include "loader_dining_room/furniture.h"
#include "loader_dining_room/room_materials.h"
#include "loader_dining_room/room_plan.h"
#include "loader_dining_room/room_shell.h"

namespace diorama::dining_room {

using namespace modelling;

namespace {

/// Puts things into one room.
class Furnisher {
 public:
  Furnisher(const RoomPlan& plan, const RoomMaterials& materials, const Rng& rng, Host& host,
            Scene& scene, NodeId root, const Affine& root_from_room)
      : plan_(plan),
        m_(materials),
        rng_(rng),
        host_(host),
        scene_(scene),
        root_(root),
        root_from_room_(root_from_room) {
    spines_ = make_picture_material(
        "shader_book_covers", make_book_spines(rng_.fork("spines"), kSpinesPerTexture, 1024, 512),
        0.6);
  }

  void furnish() {
    put_rug();
    put_table();
    put_chairs();
    if (rng_.fork("laid").chance(0.5)) lay_table(rng_.fork("laying"));
    put_sideboard(rng_.fork("sideboard"));
    if (plan_.bookcase) put_bookcase(rng_.fork("bookcase"));
    put_pictures();
    put_lights();
    if (plan_.floor_plant) {
      const Rng rng = rng_.fork("floor plant");
      const Piece plant = build_plant(Rng(rng).uniform(0.8, 1.15), m_, rng);
      put("LargePlantContainerFactory", rng, plant,
          at(plan_.floor_plant->x(), plan_.floor_plant->y(), 0));
    }
  }

 private:
  void put(std::string_view factory, const Rng& rng, const Piece& piece,
           const Affine& room_from_piece) {
    place(scene_, root_, factory_name(factory, rng), piece, root_from_room_ * room_from_piece);
  }

  void put_rug() {
    if (plan_.rug_thickness == 0.0) return;
    const Rng rng = rng_.fork("rug");
    const bool is_round = plan_.table_shape == TableShape::Round;
    put("RugFactory", rng, build_rug(plan_.rug_size, plan_.rug_thickness, is_round, host_, rng),
        at(plan_.table_centre.x(), plan_.table_centre.y(), 0));
  }

  void put_table() {
    const Rng rng = rng_.fork("table");
    put("TableDiningFactory", rng, build_table(plan_, m_, rng),
        at(plan_.table_centre.x(), plan_.table_centre.y(), plan_.rug_thickness));
  }

  void put_chairs() {
    const Rng rng = rng_.fork("chairs");
    const Piece chair = build_chair(plan_.table_height, m_, rng);
    for (std::size_t i = 0; i < plan_.seats.size(); ++i) {
      const RoomPlan::Seat& seat = plan_.seats[i];
      place(scene_, root_, factory_name("ChairFactory", rng, rng.fork(i)), chair,
            root_from_room_ * at(seat.place.x(), seat.place.y(), plan_.rug_thickness) *
                turned_z(seat.yaw));
    }
  }

  /// A few settings near the edge; the middle stays free.
  void lay_table(Rng rng) {
    const Piece plate = build_plate(m_, rng.fork("plate"));
    const Piece glass = build_wineglass(m_, rng.fork("glass"));
    const Piece fork = build_cutlery(Cutlery::Fork, m_);
    const Piece knife = build_cutlery(Cutlery::Knife, m_);
    const double top = plan_.table_height + plan_.rug_thickness;
    const std::size_t count = 1 + rng.index(std::min<std::size_t>(3, plan_.seats.size()));
    for (std::size_t i = 0; i < count; ++i) {
      const RoomPlan::Seat& seat = plan_.seats[i];
      // Square to the edge of the table, however the chair was left.
      const double yaw = plan_.table_shape == TableShape::Round
                             ? seat.yaw
                             : std::round(seat.yaw / (kPi / 2)) * (kPi / 2);
      const Affine setting = at(seat.setting.x(), seat.setting.y(), top) * turned_z(yaw);
      const auto lay = [&](const char* factory, const Piece& piece, const Affine& where) {
        place(scene_, root_, factory_name(factory, rng.fork(factory), rng.fork(factory).fork(i)),
              piece, root_from_room_ * setting * where);
      };
      lay("PlateFactory", plate, Affine::Identity());
      lay("ForkFactory", fork, at(-0.165, -0.02, 0));
      lay("KnifeFactory", knife, at(0.165, -0.02, 0));
      if (rng.chance(0.7)) lay("WineglassFactory", glass, at(0.165, 0.145, 0));
    }
  }

  void put_sideboard(Rng rng) {
    const WallSpot& spot = plan_.sideboard;
    const Cabinet cabinet = build_sideboard(spot.width, m_, rng);
    const Affine base = plan_.room_from_wall(spot.wall) * at(spot.centre, -0.025, 0);
    put("SingleCabinetFactory", rng, cabinet.piece, base);
    // Things in a row along it, none next to another of its kind.
    double x = -spot.width / 2 + 0.17;
    int kind = int(rng.index(6));
    for (std::uint64_t i = 0; x < spot.width / 2 - 0.15; ++i) {
      const Rng own = rng.fork(i);
      Rng chance = own.fork("place");
      const Affine where = base * at(x, -0.22 + chance.uniform(-0.04, 0.04), cabinet.height) *
                           turned_z(chance.uniform(-0.3, 0.3));
      put_small(kind, own, where);
      kind = (kind + 1 + int(chance.index(4))) % 6;
      x += chance.uniform(0.32, 0.46);
    }
  }

  void put_small(int kind, const Rng& rng, const Affine& where) {
    switch (kind) {
      case 0:
        put("VaseFactory", rng, build_vase(m_, rng), where);
        break;
      case 1:
        put("FruitContainerFactory", rng, build_fruit_bowl(m_, rng), where);
        break;
      case 2:
        put_lamp("DeskLampFactory", rng, build_table_lamp(m_, rng), where);
        break;
      case 3:
        put("BookStackFactory", rng, build_book_stack(m_, spines_, rng), where);
        break;
      case 4:
        put("CandleholderFactory", rng, build_candlestick(m_, rng), where);
        break;
      default:
        put("PlantContainerFactory", rng, build_plant(Rng(rng).uniform(0.28, 0.4), m_, rng), where);
        break;
    }
  }

  void put_bookcase(Rng rng) {
    const WallSpot& spot = *plan_.bookcase;
    const Bookcase shelves = build_bookcase(spot.width, plan_.height, m_, rng);
    const Affine base = plan_.room_from_wall(spot.wall) * at(spot.centre, -0.025, 0);
    put("SimpleBookcaseFactory", rng, shelves.piece, base);
    for (std::size_t i = 0; i < shelves.shelf_tops.size(); ++i) {
      const Rng own = rng.fork("shelf").fork(i);
      Rng chance = own.fork("filling");
      const double left = -shelves.clear_width / 2 + 0.004;
      const double filled = shelves.clear_width * chance.uniform(0.35, 0.9);
      put("BookColumnFactory", own,
          build_books(filled, shelves.clear_height, kBookcaseDepth - 0.05, m_, spines_, own),
          base * at(left, -0.012, shelves.shelf_tops[i]));
      const double rest = shelves.clear_width - filled;
      if (rest < 0.24) continue;
      const Affine where =
          base * at(shelves.clear_width / 2 - rest / 2 + 0.02, -0.15, shelves.shelf_tops[i]);
      if (chance.chance(0.5)) {
        put("BowlFactory", own.fork("bowl"), build_bowl(m_, own.fork("bowl")), where);
      } else {
        put("CupFactory", own.fork("cup"), build_cup(m_, own.fork("cup")), where);
      }
    }
  }

  void put_pictures() {
    for (std::size_t i = 0; i < plan_.pictures.size(); ++i) {
      const WallSpot& spot = plan_.pictures[i];
      const Rng own = rng_.fork("picture").fork(i);
      Rng chance = own.fork("shape");
      const bool is_first = i == 0;  // hangs over the sideboard
      const double ratio = is_first ? chance.uniform(0.55, 0.75) : chance.uniform(0.8, 1.4);
      const double height = spot.width * ratio;
      const double z = is_first ? std::max(1.65, 1.42 + height / 2) : chance.uniform(1.5, 1.6);
      put("WallArtFactory", own, build_picture(spot.width, height, m_, host_, own),
          plan_.room_from_wall(spot.wall) * at(spot.centre, -0.001, z));
    }
  }

  void put_lights() {
    const Rng rng = rng_.fork("lights");
    const CeilingLight light = build_ceiling_light(m_, rng);
    Rng chance = rng.fork("number");
    const std::size_t count = plan_.table_length > 1.9 && chance.chance(0.6) ? 2 : 1;
    for (std::size_t i = 0; i < count; ++i) {
      const double x = plan_.table_centre.x() + (double(i) - 0.5 * double(count - 1)) * 0.75;
      const Affine where = at(x, plan_.table_centre.y(), plan_.height);
      put_light_parts("CeilingLightFactory", rng, rng.fork(i), light, where, 1.0 / double(count));
    }
  }

  void put_lamp(const char* factory, const Rng& rng, const CeilingLight& lamp,
                const Affine& where) {
    put_light_parts(factory, rng, rng, lamp, where, 1.0);
  }

  /// Body, bulb glass and the light itself, as three neighbours.
  void put_light_parts(const char* factory, const Rng& rng, const Rng& object,
                       const CeilingLight& light, const Affine& where, double share) {
    const Affine pose = root_from_room_ * where;
    place(scene_, root_, factory_name(factory, rng, object), light.body, pose);
    place(scene_, root_, factory_name(factory, rng, object, "_001_SPLIT_GLASS"), light.glass, pose);
    const std::string name = factory_name("PointLampFactory", rng.fork("bulb"), object);
    const NodeId group = scene_.create(root_, name);
    scene_.set_pose(group, Affine(pose * at(light.bulb)));
    const NodeId lamp = scene_.create(group, name);
    Light sphere;
    sphere.kind = LightKind::Sphere;
    sphere.radius_m = light.bulb_radius;
    // Luminance (nits) of a sphere that gives these lumens: flux = pi * area * luminance.
    const double area = 4 * kPi * light.bulb_radius * light.bulb_radius;
    sphere.color = black_body_color(light.kelvin) * float(light.lumens * share / (kPi * area));
    scene_.edit(lamp).light = sphere;
  }

  const RoomPlan& plan_;
  const RoomMaterials& m_;
  Rng rng_;
  Host& host_;
  Scene& scene_;
  NodeId root_;
  Affine root_from_room_;
  MaterialPtr spines_;
};

}  // namespace

void build_dining_room(std::uint64_t seed, Host& host, Scene& scene, NodeId root) {
  const Rng rng = Rng(seed).fork("dining_room");
  const RoomPlan plan = plan_room(rng.fork("plan"));
  const RoomMaterials materials = choose_materials(rng.fork("materials"), host);
  Rng place_rng = rng.fork("place");
  // Exported rooms are part of a house: they do not stand at the origin.
  const Affine root_from_room =
      at(0.5 * double(place_rng.index(20)), 0.5 * double(place_rng.index(20)), 0);
  build_shell(plan, materials, rng.fork("shell"), scene, root, root_from_room);
  Furnisher(plan, materials, rng.fork("furniture"), host, scene, root, root_from_room).furnish();
}

}  // namespace diorama::dining_room
