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
};

/// Held at most, with what is left of the film.
inline constexpr std::size_t kDenoiserBytesPerPixel = 104;

/// Removes sampling noise from a film: light without the surfaces' own colour is averaged over
/// neighbours that lie on the same plane, face the same way and differ by no more than the noise
/// explains, in rounds of growing reach (Dammertz et al. 2010, with the variance of Schied et al.
/// 2017). Sources seen directly and the surfaces' colours stay as they are.
/// The film's memory is given back on the way.
Image<Vec3f> denoised(Film film, const DenoiseSettings& settings, Isa isa, Host& host);

/// The plain means.
Image<Vec3f> undenoised(const Film& film);

}  // namespace diorama
