// SPDX-License-Identifier: Apache-2.0
#include "embree_renderer.h"

#include "embree_support/picture_film.h"
#include "embree_support/virtual_light_tracer.h"

namespace diorama {

std::size_t EmbreeRenderer::traced_bytes(std::size_t pixels) const {
  const bool has_sets = has_virtual_lights() && pixels > 0;
  const bool has_sums = has_rounds() || (has_sets && std::uint32_t(samples()) >
                                                         VirtualLightSets::most_samples(pixels));
  return (has_sums ? pixels * sizeof(PixelSum) : 0) +
         (has_sets ? VirtualLightSets::most_bytes(meshes().instances()) : 0);
}

Film EmbreeRenderer::trace(const View& view, const PathSettings& path_settings, SamplePlan& plan) {
  TraceSettings settings{path_settings};
  if (settings.starts_at_centres) settings.first_hits = &first_hits(view);
  PictureCounts own;
  Film film = picture_film(meshes(), view, settings, isa(), plan, host(), own);
  counts().paths += own.paths;
  counts().rays = own.rays.rays;
  counts().shadow_rays = own.rays.shadow_rays;
  return film;
}

}  // namespace diorama
