// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "denoiser.h"
#include "diorama/host.h"
#include "film.h"
#include "isa.h"

namespace diorama {

/// What is held at most beside film and picture.
std::size_t network_filter_bytes(int width, int height);

/// A filter that was trained on pictures of this renderer (denoiser_network.h): light that falls on
/// surfaces is averaged with weights from a network, then takes the surfaces' colours, averaged
/// over the next pixels alone. `other` is what another filter made of the film (plane_filter.h):
/// the network sees it, and says how much of each pixel is taken from it. `exposure` is the film's.
/// Large pictures are filtered tile by tile; tiles see the results of those before them in place of
/// `other`. Numbers that are none count as zero.
Image<Vec3f> filtered_by_network(const Film& film, Image<Vec3f> other,
                                 const DenoiseSettings& settings, double exposure, Isa isa,
                                 Host& host);

}  // namespace diorama
