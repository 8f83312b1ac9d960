// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace diorama {

// How likely paths go on that are as bright as behind their first surface, at most 0.95. At 1.5 the
// same error takes 0.89 of the time that it takes at 0.7 (measured); pictures whose paths end soon
// anyway have as little error in less time at 0.7.
inline constexpr float kContinuation = 1.5f;
inline constexpr float kShortContinuation = 0.7f;

// Metres per metre that the width over which paths read textures grows by at scattering surfaces.
// As wide as their lobes, they would take the mean of lit and unlit parts of a surface: a sunny
// patch on a floor of tiles would be off by up to 1.5 % of a room's light; 0.1 % of it is left at
// most (measured). Finer reading takes time: caches miss.
inline constexpr float kMostSpread = 0.01f;

/// How the light paths of a picture go, whatever traces them.
struct PathSettings {
  int max_bounces = 6;  ///< Surfaces after the first that may scatter light.
  float clamp = 0.0f;   ///< Largest luminance of one indirect contribution; 0: no limit.
  /// True: light focused by glass and mirrors is searched by chance, and glass blocks shadow rays.
  /// False: shadow rays pass glass straight, and lights seen over a diffuse surface through a
  /// mirror or glass are left out: far less noise for a little lost light.
  bool has_caustics = false;
  /// Share of the paths that go on behind their first scattering surface, with more weight: less
  /// time for a picture, more noise in its indirect light.
  float indirect_share = 1.0f;
  /// Survival in Russian roulette is this times the light that is left of that behind the first
  /// surface.
  float continuation = kContinuation;
  /// Paths end at their second surface, with light that others found there: see RadianceCache. Far
  /// less noise for a little blur of indirect light.
  bool ends_in_cache = false;
  /// Paths are connected with what surfaces scatter: see VirtualLights. Where nothing moves while
  /// the shutter is open.
  bool has_virtual_lights = false;
  /// Paths of neighbouring pixels use each other's second surfaces: see PathReuse. Not with a
  /// clamp or a cache, nor where anything moves while the shutter is open.
  bool reuses_paths = false;
  /// Every path starts through its pixel's centre. For views without aperture and shutter, and no
  /// more than a path per pixel.
  bool starts_at_centres = false;
};

inline constexpr int kMaxStraightPasses = 64;  ///< Straight through cut-outs and panes.

}  // namespace diorama
