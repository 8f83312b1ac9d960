// SPDX-License-Identifier: Apache-2.0
#include "mesh_instance.h"

namespace diorama {

Vec3f base_color_at(const RayHit& hit, const SurfaceGeometry& surface, float uv_footprint) {
  const Mesh& mesh = hit.instance->source();
  const ShadingMaterial& material = hit.instance->material(hit.triangle);
  Vec3f color = material.source->base_color;
  if (material.base_color) {
    const Rgba texel = material.base_color.at(surface.uv, uv_footprint);
    color = color.cwiseProduct(Vec3f(texel.head<3>().matrix()));
  }
  if (!mesh.colors.empty()) {
    const auto corners = hit.instance->shading->corners(hit.triangle);
    color = color.cwiseProduct(mesh.colors[corners[0]] * (1.0f - hit.u - hit.v) +
                               mesh.colors[corners[1]] * hit.u + mesh.colors[corners[2]] * hit.v);
  }
  return color.cwiseMax(0.0f);
}

}  // namespace diorama
