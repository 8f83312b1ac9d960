// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <string_view>

#include "diorama/host.h"
#include "diorama/material.h"

namespace diorama::samples {

enum class Ground { Grass, Dirt, Road, Heath };

/// What a sky is made of.
struct SkyLook {
  std::string_view name;          ///< "Clear/qwantani_4k".
  double sun_elevation_deg = 45;  ///< The moon's, by night.
  double sun_azimuth_deg = 0;
  double turbidity = 2.5;
  double cloud_cover = 0.0;     ///< Share of the sky, 0..1.
  double mean_luminance = 0.8;  ///< Of the upper half without the sun; 1 stands for 1000 nits.
  double sun_strength = 1.0;    ///< 0 behind clouds.
  bool is_night = false;
  Ground ground = Ground::Grass;
  bool is_indoor = false;  ///< Of what stands above only the name counts; see indoor.h.
};
std::span<const SkyLook> skies();

/// An equirectangular image, 1024 x 512, linear: the sky by Preetham, Shirley and Smits (1999) with
/// sun, clouds or stars, hills along the horizon and ground below; or a room. Top row up, centre
/// column +x.
std::shared_ptr<const Texture> make_sky(const SkyLook& look, Host& host);

}  // namespace diorama::samples
