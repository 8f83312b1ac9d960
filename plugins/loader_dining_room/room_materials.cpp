// SPDX-License-Identifier: Apache-2.0
#include "loader_dining_room/room_materials.h"

#include <array>
#include <span>

namespace diorama::dining_room {

using namespace modelling;

namespace {

Color pick(Rng& rng, std::span<const std::uint32_t> palette) {
  return color(palette[rng.index(palette.size())]);
}

Finish plain(const char* name, const Color& c, double roughness, double metallic = 0.0) {
  return {make_plain(name, c, roughness, metallic), 1.0};
}

Finish textured(const char* name, const TextureSet& set, double roughness, double coat = 0.0) {
  return {make_textured(name, set, roughness, coat), 1.0 / set.size_m};
}

constexpr std::array<std::uint32_t, 10> kWallPaints{0xe9e4d8, 0xdfe3dd, 0xcfd8d6, 0xe6d9c6,
                                                    0xb9c4b5, 0xc9cfd8, 0xe8ddd6, 0x9fb0b3,
                                                    0xd8cdb9, 0xefece6};
constexpr std::array<std::uint32_t, 8> kFabrics{0x8a8f94, 0xb6a58a, 0x47576b, 0x6f7f68,
                                                0xa05a43, 0xd9cfbf, 0x3d4247, 0x8c6d7a};
constexpr std::array<std::uint32_t, 7> kShells{0xf0efec, 0x2f3134, 0xc7a13c, 0x6f8f8c,
                                               0xb8563f, 0x9aa08e, 0xd7d2c8};

void choose_shell(RoomMaterials& m, Rng rng, Host& host) {
  const Color paint = pick(rng, kWallPaints);
  const std::uint64_t seed = rng.bits();
  if (rng.chance(0.25)) {
    const bool is_striped = rng.chance(0.5);
    m.wall = textured(
        "shader_wallpaper",
        make_wallpaper(host, paint, blend(paint, color(0x8f8878), 0.22), is_striped, seed, 512),
        0.75);
  } else {
    m.wall = textured("shader_plaster", make_plaster(host, paint, rng.uniform(0.3, 1.0), seed, 512),
                      0.85);
  }
  m.ceiling = plain("shader_ceiling_paint", color(0xf1efea), 0.9);
  m.exterior =
      textured("shader_render", make_plaster(host, color(0xcfc8ba), 2.0, seed + 1, 256), 0.95);
  m.trim = plain("shader_trim_paint", rng.chance(0.8) ? color(0xf3f1ec) : paint * 0.55f, 0.35);
  m.window_frame = rng.chance(0.75) ? plain("shader_window_paint", color(0xf2f1ee), 0.3)
                                    : plain("shader_window_dark", color(0x34363a), 0.4);
}

void choose_floor(RoomMaterials& m, Rng rng, Host& host) {
  const std::uint64_t seed = rng.bits();
  const WoodLook wood = random_wood(rng);
  const double kind = rng.uniform();
  if (kind < 0.45) {
    m.floor = textured("shader_planks", make_planks(host, wood, seed, 1024), 0.38);
  } else if (kind < 0.68) {
    m.floor = textured("shader_herringbone", make_herringbone(host, wood, seed, 1024), 0.35);
  } else {
    static constexpr std::array<std::uint32_t, 5> kTiles{0xd8d0c2, 0xb7b4ad, 0xc9b79c, 0x8f8e8a,
                                                         0xe2ded6};
    TileLook look;
    look.tile = look.other = pick(rng, kTiles);
    look.is_marble = rng.chance(0.5);
    if (rng.chance(0.35)) look.other = blend(look.tile, color(0x2b2d30), 0.75);
    m.floor =
        textured("shader_tiles", make_tiles(host, look, seed, 1024), look.is_marble ? 0.15 : 0.4);
  }
}

void choose_woods(RoomMaterials& m, Rng rng, Host& host) {
  const WoodLook table = random_wood(rng);
  const WoodLook other = rng.chance(0.5) ? table : random_wood(rng);
  const double coat = rng.chance(0.5) ? 0.35 : 0.0;
  m.table_wood = textured("shader_wood_table", make_wood(host, table, rng.bits(), 512), 0.42, coat);
  m.cabinet_wood =
      rng.chance(0.25)
          ? plain("shader_cabinet_paint", pick(rng, kWallPaints) * 0.72f, 0.4)
          : textured("shader_wood_cabinet", make_wood(host, other, rng.bits(), 512), 0.45);
  m.shelf_wood =
      rng.chance(0.3) ? plain("shader_shelf_paint", color(0xeceae5), 0.4) : m.cabinet_wood;
  m.door_wood = rng.chance(0.55)
                    ? plain("shader_door_paint", color(0xf0eee8), 0.33)
                    : textured("shader_wood_door", make_wood(host, other, rng.bits(), 512), 0.4);
  m.counter = m.cabinet_wood;
  if (rng.chance(0.35)) {
    m.counter =
        textured("shader_marble",
                 make_marble(host, color(0xe9e6e1), color(0x7d7b7c), rng.bits(), 512), 0.12);
  }
}

void choose_textiles(RoomMaterials& m, Rng rng, Host& host) {
  const Color cloth = pick(rng, kFabrics);
  m.seat_fabric =
      rng.chance(0.25)
          ? textured("shader_leather", make_leather(host, cloth * 0.7f, rng.bits(), 256), 0.45)
          : textured(
                "shader_fabric",
                make_fabric(host, cloth, blend(cloth, color(0xf0ece4), 0.25), 0.7, rng.bits(), 256),
                0.9);
  const Color drape = rng.chance(0.5) ? blend(cloth, color(0xe9e2d5), 0.6) : color(0xded7ca);
  m.curtain = textured("shader_curtain",
                       make_fabric(host, drape, drape * 0.97f, 0.3, rng.bits(), 256), 0.95);
  m.lampshade =
      textured("shader_lampshade",
               make_fabric(host, color(0xe8dfcf), color(0xe3d9c7), 0.3, rng.bits(), 256), 0.9);
  m.shell = plain("shader_shell", pick(rng, kShells), 0.35);
}

}  // namespace

RoomMaterials choose_materials(Rng rng, Host& host) {
  RoomMaterials m;
  choose_shell(m, rng.fork("shell"), host);
  choose_floor(m, rng.fork("floor"), host);
  choose_woods(m, rng.fork("woods"), host);
  choose_textiles(m, rng.fork("textiles"), host);
  Rng small = rng.fork("small");
  m.leg_metal = small.chance(0.6) ? plain("shader_black_metal", color(0x27282a), 0.42)
                                  : plain("shader_brushed_steel", color(0xb9bbbd), 0.3, 1.0);
  m.brass = small.chance(0.5) ? plain("shader_brass", color(0xd8b46a), 0.25, 1.0)
                              : plain("shader_nickel", color(0xc9c7c3), 0.22, 1.0);
  m.steel = plain("shader_steel", color(0xcfd0d2), 0.18, 1.0);
  m.porcelain = plain("shader_porcelain",
                      small.chance(0.6) ? color(0xf4f3ef) : pick(small, kWallPaints), 0.12);
  m.earthenware = plain("shader_earthenware",
                        pick(small, std::array<std::uint32_t, 6>{0xa65f3e, 0x39566b, 0x6d7a5a,
                                                                 0xd6c8b0, 0x2f3336, 0x8a3f3a}),
                        0.4);
  m.glass = {make_pane("shader_glass"), 1.0};
  m.pane = {make_pane("shader_glass_pane"), 1.0};
  m.frosted = {make_pane("shader_lamp_bulb"), 1.0};
  m.paper = plain("shader_paper", color(0xefe8d8), 0.9);
  m.soil = plain("shader_soil", color(0x3a2b20), 1.0);
  m.leaf = plain("shader_leaf", blend(color(0x2f5a2d), color(0x6b8f4a), small.uniform()), 0.4);
  m.wax = plain("shader_wax", color(0xf3ead6), 0.5);
  m.fruit_a = plain("shader_fruit_a", color(small.chance(0.5) ? 0xb3261e : 0x8fae3a), 0.3);
  m.fruit_b = plain("shader_fruit_b", color(0xe08a1e), 0.45);
  return m;
}

}  // namespace diorama::dining_room
