// SPDX-License-Identifier: Apache-2.0
#include "path_tracer.h"

#include <algorithm>
#include <cmath>

namespace diorama {
namespace {

constexpr float kInfinite = std::numeric_limits<float>::infinity();
constexpr int kMaxPassages = 64;         // straight through cut-outs and panes
constexpr float kSoftenedAlpha = 0.15f;  // floor after a diffuse bounce, without caustics
constexpr float kMirrorSpread = 0.05f;

float roughness_to_alpha(float roughness) {
  const float r = std::clamp(roughness, 0.0f, 1.0f);
  return std::max(Bsdf::kMinAlpha, r * r);
}

/// Far enough from the surface that the next ray does not meet it again.
Vec3f leave(const SurfaceGeometry& s, const Vec3f& direction) {
  const float distance = 2e-5f * (1.0f + s.position.cwiseAbs().maxCoeff());
  return s.position + (direction.dot(s.flat_normal) < 0.0f ? -distance : distance) * s.flat_normal;
}

Vec3f mapped_normal(const RayHit& hit, const SurfaceGeometry& s, const TextureSlot& map,
                    float uv_footprint, const Vec3f& to_viewer) {
  const MeshInstance& instance = *hit.instance;
  const Mesh& mesh = *instance.mesh;
  if (mesh.uvs.empty()) return s.normal;
  const auto& corners = mesh.triangles[hit.triangle];
  const Vec2f e = mesh.uvs[corners[1]] - mesh.uvs[corners[0]];
  const Vec2f f = mesh.uvs[corners[2]] - mesh.uvs[corners[0]];
  const float det = e.x() * f.y() - e.y() * f.x();
  if (det == 0.0f) return s.normal;
  const Vec3f a = instance.vertex(corners[0]);
  const Vec3f ab = instance.vertex(corners[1]) - a;
  const Vec3f ac = instance.vertex(corners[2]) - a;
  const Vec3f along_u = (ab * f.y() - ac * e.y()) / det;
  const Vec3f along_v = (ac * e.x() - ab * f.x()) / det;
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

Vec3f base_color_at(const RayHit& hit, const SurfaceGeometry& surface, float uv_footprint) {
  const Mesh& mesh = *hit.instance->mesh;
  const ShadingMaterial& material = hit.instance->material(hit.triangle);
  Vec3f color = material.source->base_color;
  if (material.base_color) {
    const Rgba texel = material.base_color.at(surface.uv, uv_footprint);
    color = color.cwiseProduct(Vec3f(texel.head<3>().matrix()));
  }
  if (!mesh.colors.empty()) {
    const auto& corners = mesh.triangles[hit.triangle];
    color = color.cwiseProduct(mesh.colors[corners[0]] * (1.0f - hit.u - hit.v) +
                               mesh.colors[corners[1]] * hit.u + mesh.colors[corners[2]] * hit.v);
  }
  return color.cwiseMax(0.0f);
}

struct PathTracer::Path {
  explicit Path(PathSampler source) : sampler(source) {}

  PathSampler sampler;
  PathSample result;
  Vec3f origin;
  Vec3f direction;
  float t_min = 0.0f;
  float t_max = kInfinite;
  Vec3f throughput = Vec3f::Ones();
  int bounce = 0;
  int passages = 0;
  bool is_camera_ray = true;
  bool has_scattered = false;  ///< Over a surface that is no mirror.
  bool hides_lights = false;   ///< Their light was already counted, or is left out on purpose.
  bool is_over = false;
  Receiver last;  ///< The last vertex that took light samples.
  float last_density = kInfinite;
  float since_last = 0.0f;  ///< Metres travelled from it.
  float width = 0.0f;       ///< Of the ray's footprint, metres.
  float spread = 0.0f;      ///< Its growth per metre.

  void go(const Vec3f& from, const Vec3f& towards) {
    origin = from;
    direction = towards;
    t_min = 0.0f;
    t_max = kInfinite;
  }
};

PathTracer::PathTracer(const RenderScene& scene, const View& view, const SobolTable& table,
                       const TraceSettings& settings)
    : scene_(scene), view_(view), table_(table), settings_(settings) {}

PathSample PathTracer::trace(int x, int y, std::uint32_t index, std::uint64_t seed) const {
  Path path(PathSampler(table_, seed, x, y, index));
  const Vec2f in_pixel = path.sampler.next();
  const Vec2f aperture = path.sampler.next();
  const Vec2 pixel(double(x) + double(in_pixel.x()), double(y) + double(in_pixel.y()));
  const auto ray = view_.ray(pixel, aperture);
  if (!ray) return path.result;
  path.go(ray->origin, ray->direction);
  path.t_min = ray->t_min;
  path.t_max = ray->t_max;
  path.spread = view_.pixel_angle();

  while (!path.is_over) {
    const RayHit hit = scene_.intersect(path.origin, path.direction, path.t_min, path.t_max);
    ++path.result.rays;
    collect_lights(path, hit ? hit.distance : kInfinite);
    if (!hit) break;
    path.since_last += hit.distance;
    path.width += path.spread * hit.distance;
    const SurfaceGeometry surface = RenderScene::surface_at(hit, path.direction);
    const ShadingMaterial& material = hit.instance->material(hit.triangle);
    if (material.emits) collect_emission(path, hit, surface, material);
    if (path.bounce > settings_.max_bounces) break;
    scatter(path, hit, surface, material);
  }
  return path.result;
}

void PathTracer::add(Path& path, const Vec3f& radiance) const {
  Vec3f value = radiance;
  if (!path.has_scattered) {
    path.result.seen += value;
    return;
  }
  if (settings_.clamp > 0.0f && path.bounce > 1) {
    const float l = luminance(value);
    if (l > settings_.clamp) value *= settings_.clamp / l;
  }
  path.result.scattered += value;
}

void PathTracer::collect_lights(Path& path, float t_max) const {
  const bool is_first = std::isinf(path.last_density);
  if (path.hides_lights || (!is_first && !settings_.samples_bsdf)) return;
  scene_.lights().along_ray(
      path.origin, path.direction, t_max, path.is_camera_ray,
      [&](std::uint32_t light, const Vec3f& radiance, float density) {
        const bool has_rival = !is_first && settings_.samples_lights;
        const float rival =
            has_rival ? scene_.lights().probability(light, path.last) * density : 0.0f;
        add(path, path.throughput.cwiseProduct(radiance) *
                      (has_rival ? mis_weight(path.last_density, rival) : 1.0f));
      });
}

void PathTracer::collect_emission(Path& path, const RayHit& hit, const SurfaceGeometry& surface,
                                  const ShadingMaterial& material) const {
  const bool is_first = std::isinf(path.last_density);
  if (path.hides_lights || (!is_first && !settings_.samples_bsdf)) return;
  if (surface.is_back && !hit.instance->mesh->is_double_sided) return;
  const Vec3f radiance = material.emission_at(surface.uv, path.width * surface.uv_per_metre);
  float weight = 1.0f;
  const std::uint32_t light = hit.instance->slot_lights[hit.instance->slot(hit.triangle)];
  if (!is_first && settings_.samples_lights && light != MeshInstance::kNoLight) {
    const float cosine = surface.flat_normal.dot(path.direction);
    const float rival = scene_.lights().probability(light, path.last) *
                        scene_.lights().density_of_surface(light, path.since_last, cosine);
    weight = mis_weight(path.last_density, rival);
  }
  add(path, path.throughput.cwiseProduct(radiance) * weight);
}

bool PathTracer::pass_or_reflect(Path& path, const SurfaceGeometry& surface,
                                 const ShadingMaterial& material, SurfaceBsdf& bsdf) const {
  const Material& m = *material.source;
  const bool is_pane = m.is_thin_walled && bsdf.transmission > 0.0f;
  const bool is_veil = material.is_cut_out && m.opacity_threshold <= 0.0f;
  if (!is_pane && !is_veil) return false;
  const Vec2f u = path.sampler.next();
  const auto pass = [&] {
    path.is_over = ++path.passages > kMaxPassages;
    path.go(leave(surface, path.direction), path.direction);
    return true;
  };
  float rest = u.x();
  if (is_veil) {
    const float veil = 1.0f - std::clamp(material.opacity_at(surface.uv, 0.0f), 0.0f, 1.0f);
    if (rest < veil) return pass();
    rest = (rest - veil) / (1.0f - veil);
  }
  if (!is_pane) return false;
  const float share = (1.0f - bsdf.metallic) * bsdf.transmission;
  if (rest >= share) {
    bsdf.metallic = share < 1.0f ? bsdf.metallic / (1.0f - share) : 0.0f;
    bsdf.transmission = 0.0f;
    return false;
  }
  const float cosine = std::max(1e-4f, -surface.normal.dot(path.direction));
  const float once = fresnel_dielectric(cosine, std::max(1.0001f, m.ior));
  const float reflected = 2.0f * once / (1.0f + once);
  // Seen directly, both ways get a fair number of samples: a reflection on a dark pane is faint
  // but plain to see.
  const float chance = path.has_scattered ? reflected : std::clamp(reflected, 0.3f, 0.7f);
  if (u.y() >= chance) {
    path.throughput =
        path.throughput.cwiseProduct(bsdf.base) * ((1.0f - reflected) / (1.0f - chance));
    return pass();
  }
  path.throughput *= reflected / chance;
  const Vec3f mirrored = path.direction + 2.0f * cosine * surface.normal;
  path.is_over = surface.flat_normal.dot(mirrored) <= 0.0f;
  path.go(leave(surface, mirrored), mirrored.normalized());
  path.last_density = kInfinite;
  path.hides_lights = path.has_scattered && !settings_.has_caustics;
  path.since_last = 0.0f;
  path.is_camera_ray = false;
  ++path.bounce;
  return true;
}

void PathTracer::sample_light(Path& path, const SurfaceGeometry& surface, const Bsdf& bsdf,
                              const Basis& basis) const {
  const Vec2f choice_u = path.sampler.next();
  const Vec2f place_u = path.sampler.next();
  const Lights& lights = scene_.lights();
  const Lights::Choice choice = lights.choose(path.last, choice_u.x());
  if (!settings_.samples_lights || choice.probability <= 0.0f) return;
  const LightSample s = lights.sample(choice.light, surface.position, place_u);
  if (s.density <= 0.0f) return;
  const Vec3f wi = basis.to_local(s.direction);
  const bool is_behind = wi.z() <= 0.0f;
  if (is_behind && !path.last.is_two_sided) return;
  // Light that the interpolated normal would let through the triangle from behind.
  if ((surface.flat_normal.dot(s.direction) <= 0.0f) != is_behind) return;
  const BsdfValue value = bsdf.evaluate(wi);
  if (value.f_cos.maxCoeff() <= 0.0f) return;

  Vec3f radiance = s.radiance;
  if (s.is_surface) {
    const MeshInstance& emitter = *scene_.instances()[s.geometry];
    const Vec2f uv = emitter.uv(s.triangle, s.barycentric.x(), s.barycentric.y());
    radiance = emitter.material(s.triangle).emission_at(uv, 0.0f);
  }
  const bool is_point = std::isinf(s.density);
  const float density = (is_point ? 1.0f : s.density) * choice.probability;
  const bool has_rival = !is_point && settings_.samples_bsdf;
  const float weight = has_rival ? mis_weight(density, value.density) : 1.0f;
  const Vec3f contribution =
      path.throughput.cwiseProduct(value.f_cos).cwiseProduct(radiance) * (weight / density);
  if (contribution.maxCoeff() <= 0.0f) return;
  const float t_max = std::isinf(s.distance) ? kInfinite : s.distance * 0.9998f - 1e-4f;
  if (t_max <= 0.0f) return;
  ++path.result.shadow_rays;
  const Vec3f kept = scene_.transmittance(leave(surface, s.direction), s.direction, t_max,
                                          !settings_.has_caustics);
  if (kept.maxCoeff() > 0.0f) add(path, contribution.cwiseProduct(kept));
}

void PathTracer::scatter(Path& path, const RayHit& hit, const SurfaceGeometry& surface,
                         const ShadingMaterial& material) const {
  const Material& m = *material.source;
  const float cosine = std::max(0.1f, -surface.normal.dot(path.direction));
  const float footprint = path.width * surface.uv_per_metre / std::sqrt(cosine);
  SurfaceBsdf s;
  s.base = base_color_at(hit, surface, footprint).cwiseMin(1.0f);
  s.metallic = std::clamp(
      material.metallic ? material.metallic.scalar(surface.uv, footprint) : m.metallic, 0.0f, 1.0f);
  s.transmission = std::clamp(m.transmission, 0.0f, 1.0f);
  if (pass_or_reflect(path, surface, material, s)) return;

  s.alpha = roughness_to_alpha(material.roughness ? material.roughness.scalar(surface.uv, footprint)
                                                  : m.roughness);
  s.coat_alpha = roughness_to_alpha(m.clearcoat_roughness);
  const bool is_softened = path.has_scattered && !settings_.has_caustics;
  if (is_softened) {
    s.alpha = material.glass ? s.alpha : std::max(s.alpha, kSoftenedAlpha);
    s.coat_alpha = std::max(s.coat_alpha, kSoftenedAlpha);
  }
  const float ratio = (m.ior - 1.0f) / (m.ior + 1.0f);
  s.f0 = ratio * ratio;
  s.specular = std::clamp(m.specular, 0.0f, 1.0f);
  s.coat = std::clamp(m.clearcoat, 0.0f, 1.0f);
  s.glass = material.glass;
  s.is_inside = surface.is_back;

  const Vec3f to_viewer = -path.direction;
  const Vec3f normal = material.normal
                           ? mapped_normal(hit, surface, material.normal, footprint, to_viewer)
                           : surface.normal;
  const Basis basis = basis_around(normal);
  Vec3f wo = basis.to_local(to_viewer);
  wo.z() = std::max(wo.z(), 1e-4f);
  const Bsdf bsdf(s, scene_.albedo_tables(), wo.normalized());

  const bool is_mirror = s.metallic > 0.9f && s.alpha < kMirrorSpread * kMirrorSpread;
  if (!path.result.has_surface && bsdf.has_smooth_part() && !is_mirror) {
    path.result.has_surface = true;
    path.result.albedo = path.throughput.cwiseProduct(bsdf.albedo());
    path.result.normal = normal;
    path.result.position = surface.position;
  }
  path.is_camera_ray = false;
  if (bsdf.has_smooth_part()) {
    path.has_scattered = true;
    path.last = {surface.position, normal, bsdf.transmits() && !is_softened, 0.0f};
    sample_light(path, surface, bsdf, basis);
  }

  const Vec2f lobe_u = path.sampler.next();
  const Vec2f place_u = path.sampler.next();
  const BsdfSample next = bsdf.sample(lobe_u.x(), place_u);
  path.is_over = true;
  if (!(next.weight.maxCoeff() > 0.0f)) return;
  const Vec3f direction = basis.to_world(next.wi).normalized();
  if ((surface.flat_normal.dot(direction) <= 0.0f) != next.is_transmitted) return;
  path.throughput = path.throughput.cwiseProduct(next.weight);
  if (path.bounce >= 3) {
    const float survival = std::min(0.95f, 1.5f * path.throughput.maxCoeff());
    if (lobe_u.y() >= survival) return;
    path.throughput /= survival;
  }
  path.is_over = false;
  ++path.bounce;
  path.last_density = next.density;
  path.since_last = 0.0f;
  path.hides_lights = path.has_scattered && !settings_.has_caustics &&
                      (std::isinf(next.density) || (next.is_transmitted && is_softened));
  path.spread = std::max(path.spread, next.spread);
  path.go(leave(surface, direction), direction);
}

}  // namespace diorama
