// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

/// Repeating noise for textures that tile. Coordinates count lattice cells; the pattern repeats
/// after `period_x` by `period_y` cells. Equal arguments give equal values everywhere.
namespace diorama::modelling {

/// A uniform number in [0, 1) for a lattice point.
double lattice_value(std::uint64_t seed, int x, int y);

/// Gradient noise (Perlin 2002), about -1..1, mean 0.
double gradient_noise(std::uint64_t seed, double x, double y, int period_x, int period_y);

/// Sum of `octaves` gradient noises, each of twice the frequency and `gain` times the height of the
/// one before; about -1..1.
double fractal_noise(std::uint64_t seed, double x, double y, int period_x, int period_y,
                     int octaves, double gain = 0.5);

/// Distance to the nearest of one random point per cell (Worley 1996), and which cell that was.
struct CellNoise {
  double distance = 0.0;
  double second_distance = 0.0;
  std::uint64_t cell = 0;
};
CellNoise cell_noise(std::uint64_t seed, double x, double y, int period_x, int period_y);

}  // namespace diorama::modelling
