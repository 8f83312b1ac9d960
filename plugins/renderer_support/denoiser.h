// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "diorama/host.h"
#include "film.h"
#include "isa.h"

namespace diorama {

struct DenoiseSettings {
  Vec3f view_position;  ///< Sets the scale at which surfaces count as one plane.
  /// Luminance that a single path may have, over a few times that of the other paths around; what
  /// one brings beyond is spread over a wide neighbourhood. With more than 16 paths per pixel it
  /// grows with their number. 0: no limit.
  float brightest_path = 0.0f;
  bool is_quick = false;  ///< By planes alone: an eighth of the time.
};

/// What is held at most to denoise a picture of this size, the film included.
std::size_t denoiser_bytes(int width, int height, bool is_quick);

/// At glass paths choose between ways, so that the colours of what is seen there, where it is and
/// how it faces are means over chances. A filter that multiplies by such colours shows their grain,
/// and takes pixels with a rare choice for things of their own. So they are averaged over the
/// pixels around that are seen so, too (FilmPixel::chance_share), 5 x 5 at most, until 128 paths
/// make them. Lights that are seen there are averaged over 3 x 3 pixels where half of those around
/// see some and chance explains how they differ: else they stay, or small ones would become blots.
void average_chances(Film& film, Host& host);

/// What a filter that looks at planes (plane_filter.h) makes of a film, with the mean that it had
/// with its noise, as far as the noise lets that be known.
Image<Vec3f> denoised_on_planes(const Film& film, const DenoiseSettings& settings, Isa isa,
                                Host& host);

/// Removes sampling noise from a film, after average_chances(), by two filters: one that was
/// trained (network_filter.h) sees what the one that looks at planes made of it, and takes of that
/// what it thinks right. The film's memory is given back on the way.
Image<Vec3f> denoised(Film film, const DenoiseSettings& settings, Isa isa, Host& host);

/// The plain means.
Image<Vec3f> undenoised(const Film& film);

inline constexpr int kExposureBlock = 16;  ///< Pixels.
/// The exposure of a film's means over blocks of so many pixels: it hardly depends on the noise.
double quiet_exposure(const Film& film);

}  // namespace diorama
