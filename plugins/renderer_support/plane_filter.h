// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "denoiser.h"
#include "diorama/host.h"
#include "film.h"
#include "isa.h"

namespace diorama {

/// Held at most, beside a film that stays.
inline constexpr std::size_t kPlaneFilterBytesPerPixel = 104;

/// A filter that nobody has trained: light without the surfaces' own colour is averaged over
/// neighbours that lie on the same plane, face the same way and differ by no more than the noise
/// explains, in rounds of growing reach (Dammertz et al. 2010, with the variance of Schied et al.
/// 2017). Sources seen directly and the surfaces' colours stay as they are.
/// The memory of a film that is moved here is given back on the way, that of a large one bit by
/// bit.
Image<Vec3f> filtered_on_planes(Film&& film, const DenoiseSettings& settings, Isa isa, Host& host);
Image<Vec3f> filtered_on_planes(const Film& film, const DenoiseSettings& settings, Isa isa,
                                Host& host);

}  // namespace diorama
