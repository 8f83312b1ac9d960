// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>

#include "diorama/host.h"
#include "diorama/rng.h"
#include "modelling/canvas.h"

/// Tiling textures made from noise. Everything follows from the arguments.
namespace diorama::modelling {

/// Textures of one surface; null where a constant does.
struct TextureSet {
  std::shared_ptr<const Texture> color;
  std::shared_ptr<const Texture> normal;  ///< Linear, 0..1 stands for -1..1, +y up.
  double size_m = 1.0;                    ///< What one repeat covers.
};

/// One texel of a pattern: colour and height in metres.
struct Texel {
  Color color = Color::Zero();
  double height_m = 0.0;
};
/// Evaluates pattern(u, v), both 0..1, v upwards, for square textures of `pixels`. With
/// `wants_normal` the heights become a normal map.
TextureSet make_texture_set(Host& host, const char* name, int pixels, double size_m,
                            bool wants_normal, const std::function<Texel(double, double)>& pattern);

/// Grain along u.
struct WoodLook {
  Color light = color(0xb98d5c);
  Color dark = color(0x7d5430);
  double contrast = 0.6;  ///< Of the rings, 0..1.
};
/// A random species from pale ash to dark walnut.
WoodLook random_wood(Rng& rng);
TextureSet make_wood(Host& host, const WoodLook& look, std::uint64_t seed, int pixels);
/// Floors cover 2 m per repeat.
TextureSet make_planks(Host& host, const WoodLook& look, std::uint64_t seed, int pixels);
TextureSet make_herringbone(Host& host, const WoodLook& look, std::uint64_t seed, int pixels);
/// Square tiles with joints; `other` differs for a chequered floor. Marble veins when `is_marble`.
struct TileLook {
  Color tile = color(0xd9d2c5);
  Color other = color(0xd9d2c5);
  Color joint = color(0x9a958c);
  int tiles_per_repeat = 4;
  bool is_marble = false;
};
TextureSet make_tiles(Host& host, const TileLook& look, std::uint64_t seed, int pixels);
TextureSet make_marble(Host& host, const Color& ground, const Color& vein, std::uint64_t seed,
                       int pixels);
TextureSet make_plaster(Host& host, const Color& paint, double roughness, std::uint64_t seed,
                        int pixels);
/// Painted stripes or small ornaments on paper.
TextureSet make_wallpaper(Host& host, const Color& ground, const Color& figure, bool is_striped,
                          std::uint64_t seed, int pixels);
/// `relief` 0..1: how much the threads stand out; below a half without normal map.
TextureSet make_fabric(Host& host, const Color& warp, const Color& weft, double relief,
                       std::uint64_t seed, int pixels);
TextureSet make_leather(Host& host, const Color& color, std::uint64_t seed, int pixels);
TextureSet make_wicker(Host& host, const Color& color, std::uint64_t seed, int pixels);
TextureSet make_cardboard(Host& host, std::uint64_t seed, int pixels);

/// Pictures with uvs 0..1.
std::shared_ptr<const Texture> make_rug(Rng rng, int width, int height);
std::shared_ptr<const Texture> make_painting(Rng rng, int width, int height);
/// `count` book spines side by side, each 1 / count wide, read from bottom to top.
std::shared_ptr<const Texture> make_book_spines(Rng rng, int count, int width, int height);

}  // namespace diorama::modelling
