// SPDX-License-Identifier: Apache-2.0
#include "virtual_lights.h"

#include <utility>

namespace diorama {

VirtualLights::VirtualLights(const SurfaceParts& parts, std::span<const double> shares)
    : parts_(&parts), density_(parts.count(), 0.0f) {
  for (std::size_t side = 0; side < shares.size(); ++side) {
    if (shares[side] > 0.0) density_[side] = float(shares[side] / parts.area(side));
  }
}

void VirtualLights::shine(std::vector<Light> found, std::span<const std::uint32_t> on,
                          std::size_t tried) {
  lights_ = std::move(found);
  candidates_.clear();
  for (std::size_t i = 0; i < lights_.size(); ++i) {
    Light& light = lights_[i];
    const float density = density_[on[i]];
    light.irradiance *= float(lights_.size()) / (float(tried) * density);
    candidates_.push_back(
        {light.position, density, light.flat_normal, luminance(light.mean_radiance())});
  }
}

}  // namespace diorama
