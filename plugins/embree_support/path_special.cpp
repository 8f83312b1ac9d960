// SPDX-License-Identifier: Apache-2.0
// What few surfaces and cameras need. Not part of the kernels: it is compiled once, for any
// processor.
#include <algorithm>
#include <cmath>

#include "path.h"

namespace diorama {
namespace {

Vec3f leave(const SurfaceGeometry& s, const Vec3f& towards) {
  return diorama::leave(s.position, s.flat_normal, step_off(s.position, s.flat_normal), towards);
}

Vec3f mapped_normal(const RayHit& hit, const SurfaceGeometry& s, const TextureSlot& map,
                    float uv_footprint, const Vec3f& to_viewer) {
  const MeshInstance& instance = *hit.instance;
  if (!instance.shading->has_uvs()) return s.normal;
  const auto corners = instance.shading->corners(hit.triangle);
  const auto& uvs = instance.shading->uvs(hit.triangle);
  const Vec2f e = uvs[1] - uvs[0];
  const Vec2f f = uvs[2] - uvs[0];
  const float det = e.x() * f.y() - e.y() * f.x();
  if (det == 0.0f) return s.normal;
  const Vec3f a = instance.vertex(corners[0]);
  const Vec3f ab = instance.vertex(corners[1]) - a;
  const Vec3f ac = instance.vertex(corners[2]) - a;
  Vec3f along_u = (ab * f.y() - ac * e.y()) / det;
  Vec3f along_v = (ac * e.x() - ab * f.x()) / det;
  if (instance.motion) [[unlikely]] {
    along_u = instance.motion->turned(along_u, hit.time);
    along_v = instance.motion->turned(along_v, hit.time);
  }
  const Vec3f tangent = (along_u - s.normal * s.normal.dot(along_u)).normalized();
  Vec3f bitangent = s.normal.cross(tangent);
  if (bitangent.dot(along_v) < 0.0f) bitangent = -bitangent;
  const Vec3f local = map.at(s.uv, uv_footprint).head<3>().matrix();
  Vec3f n = local.x() * tangent + local.y() * bitangent + std::max(0.05f, local.z()) * s.normal;
  if (!n.allFinite() || n.squaredNorm() < 1e-8f) return s.normal;
  n.normalize();
  // Facets that face away are not seen: the part of the map that is seen leans to the viewer.
  constexpr float kHorizon = 0.05f;
  const float facing = n.dot(to_viewer);
  if (facing < kHorizon) n = (n + (kHorizon - facing) * to_viewer).normalized();
  return n;
}

}  // namespace

void PathTracer::open_shutter(Path& path, int row, CameraRay& ray) const {
  const double seconds = view_.seconds(row, double(path.sampler.next().x()));
  path.time = float(double(kMoment) + seconds / scene_.window());
  ray = view_.moved(ray, seconds);
}

void PathTracer::collect_emission(Path& path, const Vec3f& direction, const RayHit& hit,
                                  const SurfaceGeometry& surface,
                                  const ShadingMaterial& material) const {
  const bool is_first = std::isinf(path.last_density);
  if (path.hides_lights || (!is_first && !settings_.samples_bsdf)) return;
  if (surface.is_back && !hit.instance->source().is_double_sided) return;
  const Vec3f radiance = material.emission_at(surface.uv, path.width * surface.uv_per_metre);
  float weight = 1.0f;
  const std::uint32_t light = hit.instance->triangle_lights[hit.triangle];
  if (!is_first && settings_.samples_lights && light != MeshInstance::kNoLight) {
    const float cosine = surface.flat_normal.dot(direction);
    const float rival = choice_probability(scene_.lights(), light, path.last) *
                        scene_.lights().density_of_surface(light, path.since_last, cosine);
    weight = mis_weight(path.last_density, rival);
  }
  if (light == MeshInstance::kNoLight) {
    return add(path, path.bounce, path.throughput.cwiseProduct(radiance) * weight);
  }
  weight *= path.light_share;
  add(path, path.bounce, path.throughput.cwiseProduct(radiance) * weight, path.lamp_slot());
}

PathTracer::StraightPass PathTracer::pass_or_reflect(Path& path, const Vec3f& direction,
                                                     const RayHit& hit,
                                                     const SurfaceGeometry& surface,
                                                     const ShadingMaterial& material,
                                                     SurfaceBsdf& bsdf) const {
  const Material& m = *material.source;
  const Vec2f u = path.sampler.next();
  const auto pass = [&]() -> StraightPass {
    const bool goes_on = ++path.straight_passes <= kMaxStraightPasses;
    const Onward onward = go_through(
        surface.position, surface.flat_normal, step_off(surface.position, surface.flat_normal),
        direction, hit.distance, {std::int32_t(hit.number), std::int32_t(hit.triangle)});
    path.since_last -= onward.back;
    return {false, goes_on, onward.origin, direction, onward.left};
  };
  float rest = u.x();
  if (material.is_blended) {
    const float gap = 1.0f - std::clamp(material.opacity_at(surface.uv, 0.0f), 0.0f, 1.0f);
    if (gap > 0.0f) path.choose();
    if (rest < gap) return pass();
    rest = (rest - gap) / (1.0f - gap);
  }
  if (!material.is_thin_glass) return {.is_scattered = true};
  const float share = (1.0f - bsdf.metallic) * bsdf.transmission;
  if (share > 0.0f) path.choose();
  if (rest >= share) {
    bsdf.metallic = share < 1.0f ? bsdf.metallic / (1.0f - share) : 0.0f;
    bsdf.transmission = 0.0f;
    bsdf.finish();
    return {.is_scattered = true};
  }
  const float cosine = std::max(1e-4f, -surface.normal.dot(direction));
  const float once = fresnel_dielectric(cosine, std::max(1.0001f, m.ior));
  const float reflected = 2.0f * once / (1.0f + once);
  // A reflection on the first pane seen is faint but plain to see: it gets one sample of four,
  // which stratified samples divide without noise. Panes behind it are left to their own share, or
  // bright skies behind double windows would have black pixels.
  const bool is_first_seen = !path.has_scattered && path.straight_passes == 0 && path.bounce == 0;
  const float chance = is_first_seen ? std::clamp(reflected, 0.25f, 0.75f) : reflected;
  if (u.y() >= chance) {
    path.throughput =
        path.throughput.cwiseProduct(bsdf.base) * ((1.0f - reflected) / (1.0f - chance));
    return pass();
  }
  path.throughput *= reflected / chance;
  const Vec3f reflection = direction + 2.0f * cosine * surface.normal;
  path.last_density = kInfinite;
  path.is_connected = false;
  path.light_share = 1.0f;
  path.hides_lights = path.is_soft(settings_);
  path.since_last = 0.0f;
  path.is_camera_ray = false;
  ++path.bounce;
  const bool goes_on = surface.flat_normal.dot(reflection) > 0.0f;
  return {false, goes_on, leave(surface, reflection), unit(reflection), {}};
}

void PathTracer::read_textures(const Path& path, const Vec3f& direction, const RayHit& hit,
                               const SurfaceGeometry& surface, const ShadingMaterial& material,
                               bool is_soft, SurfaceBsdf& s, Vec3f& normal) const {
  const float cosine = std::max(0.1f, -surface.normal.dot(direction));
  const float footprint = path.width * surface.uv_per_metre / std::sqrt(cosine);
  s.base = base_color_at(hit, surface, footprint).cwiseMin(1.0f);
  if (material.metallic) {
    s.metallic = std::clamp(material.metallic.scalar(surface.uv, footprint), 0.0f, 1.0f);
  }
  if (material.roughness) {
    const float roughness = material.roughness.scalar(surface.uv, footprint);
    s.alpha = ShadingMaterial::alpha_of(roughness, is_soft && !s.glass);
  }
  if (material.normal) {
    normal = mapped_normal(hit, surface, material.normal, footprint, -direction);
  }
}

}  // namespace diorama
