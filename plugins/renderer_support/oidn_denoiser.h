// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/host.h"
#include "film.h"

namespace diorama {

/// The film denoised by Intel's Open Image Denoise; sources seen directly stay as they are. Only
/// where that library was found at build time. Throws Error(Plugin) with the library's own words.
Image<Vec3f> oidn_denoised(const Film& film, const Host& host);

}  // namespace diorama
