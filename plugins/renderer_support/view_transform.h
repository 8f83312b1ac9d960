// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/host.h"
#include "diorama/image.h"
#include "film.h"

namespace diorama {

/// The factor that brings a picture's middle tones to a pleasant grey, whatever the scale of its
/// light. The darkest and the brightest tenth do not count, so that a lamp or a window in view does
/// not darken a room. Where they would burn more than that tenth it is less, as far as
/// down to a third, so that nine tenths of a mostly dark picture stay below white. 1 for a picture
/// without light.
double automatic_exposure(const Image<Vec3f>& hdr);
/// The same for a picture that still has its noise.
double automatic_exposure(const Film& film);

enum class ViewTransform { Standard, Filmic };

/// Exposes, maps to [0, 1] and encodes as sRGB. Standard clips at 1; Filmic rolls highlights off.
Image<Rgba8> displayed(const Image<Vec3f>& hdr, double exposure, ViewTransform transform,
                       Host& host);

}  // namespace diorama
