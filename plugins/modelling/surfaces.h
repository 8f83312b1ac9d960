// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string_view>

#include "modelling/textures.h"

/// Materials with names and sensible constants.
namespace diorama::modelling {

using MaterialPtr = std::shared_ptr<const Material>;

MaterialPtr make_plain(std::string_view name, const Color& color, double roughness,
                       double metallic = 0.0);
/// The textures' repeat is left to the mesh's uvs (Surface::repeats_per_m = 1 / size_m).
MaterialPtr make_textured(std::string_view name, const TextureSet& textures, double roughness,
                          double clearcoat = 0.0);
/// A picture with uvs 0..1, clamped unless it goes around something.
MaterialPtr make_picture_material(std::string_view name, std::shared_ptr<const Texture> picture,
                                  double roughness, Wrap around = Wrap::Clamp);
/// Glass that light passes straight: panes, and thin vessels, whose refraction one hardly sees.
MaterialPtr make_pane(std::string_view name);

}  // namespace diorama::modelling
