// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/host.h"
#include "film.h"
#include "isa.h"

namespace diorama {

/// Removes sampling noise from a film: light without the surfaces' own colour is averaged over
/// neighbours that lie on the same plane, face the same way and differ by no more than the noise
/// explains, in rounds of growing reach (Dammertz et al. 2010, with the variance of Schied et al.
/// 2017). Sources seen directly and the surfaces' colours stay as they are.
/// `view_position` sets the scale at which surfaces count as one plane.
Image<Vec3f> denoised(const Film& film, const Vec3f& view_position, Isa isa, Host& host);

/// The plain means.
Image<Vec3f> undenoised(const Film& film);

}  // namespace diorama
