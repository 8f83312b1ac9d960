// SPDX-License-Identifier: Apache-2.0
#include "virtual_light_tracer.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "vertices.h"

namespace diorama {
namespace {

constexpr std::size_t kTrials = 4;        // places on each side of a part
constexpr std::size_t kEyesPerPart = 32;  // that look at it
constexpr double kEyePaths = 1500.0;      // from the camera
constexpr int kEyeBounces = 3;            // surfaces of each
constexpr float kNearest = 0.2f;          // metres: closer eyes count as far away as that
constexpr double kUnseenShare = 0.2;      // of the lights, by brightness alone
constexpr std::size_t kChunk = 2048;      // of places, for a thread
// Beyond these numbers more bring nothing (measured); finding them takes a few of the paths' rays.
constexpr std::uint64_t kPathsPerPart = 64;
constexpr std::uint64_t kMostParts = 1u << 14;
// All pixels share the luck of a set: the more paths, the more lights.
constexpr std::uint64_t kPathsPerLight = 32;
constexpr std::uint64_t kFewLights = 1u << 11;
constexpr std::uint64_t kMostLights = 1u << 16;
constexpr std::uint64_t kLeastPaths = 1u
                                      << 16;  // pictures of fewer are done before lights are found
constexpr std::uint64_t kMostPaths = 1u << 21;  // that one set serves
constexpr int kMostStraightPasses = 8;
constexpr float kClear = 0.5f;  // transmission of what is looked through

constexpr std::uint64_t kTrialPurpose = 0x545249414C53u;
constexpr std::uint64_t kEyePurpose = 0x45594553u;
constexpr std::uint64_t kLightPurpose = 0x4C4947485453u;

}  // namespace

VirtualLightTracer::VirtualLightTracer(const EmbreeScene& scene, const View& view,
                                       const PathTracer& tracer, const SurfaceParts& parts,
                                       std::uint64_t seed, Host& host, RayCounts& counts)
    : scene_(scene), view_(view), tracer_(tracer), parts_(parts), seed_(seed), host_(host) {
  find_shares(counts);
}

/// Calls `take` with the number of each place and its light, from several threads.
template <class Take>
void VirtualLightTracer::light(const std::vector<std::uint32_t>& sides, std::uint64_t purpose,
                               RayCounts& counts, Take&& take) const {
  const auto key = std::uint32_t(mix_bits(seed_ ^ purpose));
  const std::size_t chunks = (sides.size() + kChunk - 1) / kChunk;
  std::vector<RayCounts> rays(chunks);
  host_.parallel_for(chunks, [&](std::size_t chunk) {
    const std::size_t begin = chunk * kChunk;
    const std::size_t size = std::min(kChunk, sides.size() - begin);
    std::vector<SurfaceParts::Point> places;
    places.reserve(size);
    for (std::size_t i = begin; i < begin + size; ++i) {
      PathSampler sampler({key, std::uint32_t(i)});
      const float choice = sampler.next().x();
      places.push_back(parts_.point(sides[i], choice, sampler.next()));
    }
    std::vector<VirtualLights::Light> lights(size);
    tracer_.light(places, key, std::uint32_t(begin), lights, rays[chunk]);
    for (std::size_t i = 0; i < size; ++i) take(begin + i, std::move(lights[i]));
  });
  for (const RayCounts& own : rays) counts += own;
}

/// Of every side, one behind the other.
std::vector<VirtualLightTracer::Trial> VirtualLightTracer::trials(RayCounts& counts) const {
  std::vector<std::uint32_t> sides(kTrials * parts_.count());
  for (std::size_t i = 0; i < sides.size(); ++i) sides[i] = std::uint32_t(i / kTrials);
  std::vector<Trial> trials(sides.size());
  light(sides, kTrialPurpose, counts, [&](std::size_t i, const VirtualLights::Light& light) {
    if (!(light.irradiance.maxCoeff() > 0.0f)) return;
    const float brightness = luminance(light.mean_radiance());
    trials[i] = {light.position, light.flat_normal, brightness,
                 light.is_by_small_light ? brightness : 0.0f};
  });
  return trials;
}

/// Where a ray through the picture arrives, and others that surfaces scatter.
void VirtualLightTracer::look_along(const Vec2f& pixel, std::uint64_t number,
                                    std::vector<Eye>& eyes, RayCounts& counts) const {
  std::uint64_t key = mix_bits(seed_ ^ kEyePurpose ^ mix_bits(number));
  const auto next = [&] {
    key = mix_bits(key + 0x9E3779B97F4A7C15u);
    return unit_fraction(key);
  };
  const CameraRay ray = view_.sample_ray(pixel, {next(), next()});
  if (!(ray.t_max > 0.0f)) return;
  Vec3f origin = ray.origin;
  Vec3f direction = ray.direction;
  float t_min = ray.t_min;
  float t_max = ray.t_max;
  int passes = 0;
  for (int bounce = 0; bounce < kEyeBounces;) {
    const RayHit hit = scene_.intersect(origin, direction, t_min, t_max);
    ++counts.rays;
    if (!hit) return;
    const SurfaceGeometry surface = surface_at(hit, origin, direction);
    const Vec3f step = step_off(surface.position, surface.flat_normal);
    t_min = 0.0f;
    t_max = kInfinite;
    if (hit.instance->material(hit.triangle).source->transmission > kClear) {
      if (++passes > kMostStraightPasses) return;
      origin = surface.position - step;
      continue;
    }
    eyes.push_back({surface.position, surface.flat_normal});
    const Vec3f local = cosine_hemisphere({next(), next()});
    direction = unit(basis_around(surface.flat_normal).to_world(local));
    origin = surface.position + step;
    ++bounce;
  }
}

std::vector<VirtualLightTracer::Eye> VirtualLightTracer::eyes(RayCounts& counts) const {
  const auto width = std::size_t(view_.camera().width);
  const auto height = std::size_t(view_.camera().height);
  const double spacing = std::max(1.0, std::sqrt(double(width * height) / kEyePaths));
  const auto rows = std::size_t(std::ceil(double(height) / spacing));
  const auto columns = std::size_t(std::ceil(double(width) / spacing));
  std::vector<std::vector<Eye>> found(rows);
  std::vector<RayCounts> rays(rows);
  host_.parallel_for(rows, [&](std::size_t row) {
    for (std::size_t column = 0; column < columns; ++column) {
      const std::uint64_t number = row * columns + column;
      const std::uint64_t bits = mix_bits(seed_ ^ mix_bits(number));
      const Vec2f within(unit_fraction(bits), unit_fraction(bits << 24));
      const Vec2f pixel = (Vec2f(float(column), float(row)) + within) * float(spacing);
      if (pixel.x() >= float(width) || pixel.y() >= float(height)) continue;
      look_along(pixel, number, found[row], rays[row]);
    }
  });
  std::vector<Eye> eyes;
  for (const std::vector<Eye>& own : found) eyes.insert(eyes.end(), own.begin(), own.end());
  for (const RayCounts& own : rays) counts += own;
  return eyes;
}

/// Of what a trial scatters: what arrives at an eye, per square metre of both.
double VirtualLightTracer::seen_share(const Trial& trial, const Eye& eye) const {
  const Vec3f from = eye.position + step_off(eye.position, eye.normal);
  const Vec3f to = trial.position + step_off(trial.position, trial.normal) - from;
  const float distance2 = to.squaredNorm();
  if (!(distance2 > 0.0f)) return 0.0;
  const float distance = std::sqrt(distance2);
  const Vec3f direction = to / distance;
  const float here = eye.normal.dot(direction);
  const float there = -trial.normal.dot(direction);
  if (!(here > 0.0f) || !(there > 0.0f)) return 0.0;
  constexpr float kAlmost = 0.99999f;
  const Vec3f left =
      scene_.transmittance(from, direction, kAlmost * distance, Passage::Panes, kMoment);
  return double(luminance(left) * here * there / std::max(distance2, kNearest * kNearest));
}

void VirtualLightTracer::find_shares(RayCounts& counts) {
  const std::vector<Trial> tried = trials(counts);
  const std::vector<Eye> seen_from = eyes(counts);
  const std::size_t size = parts_.count();
  std::vector<double> power(size, 0.0);   // by brightness and area
  std::vector<double> useful(size, 0.0);  // ... and by who sees it
  std::vector<double> of_small_lights(size, 0.0);
  const std::size_t chunks = (size + kChunk - 1) / kChunk;
  host_.parallel_for(chunks, [&](std::size_t chunk) {
    const std::size_t end = std::min(size, (chunk + 1) * kChunk);
    for (std::size_t side = chunk * kChunk; side < end; ++side) {
      const Trial* own = &tried[side * kTrials];
      for (std::size_t k = 0; k < kTrials; ++k) {
        power[side] += double(own[k].brightness);
        of_small_lights[side] += double(own[k].by_small_lights);
      }
      of_small_lights[side] /= std::max(power[side], 1e-30);
      power[side] *= parts_.area(side);
      if (!(power[side] > 0.0) || seen_from.empty()) continue;
      const double offset = double(unit_fraction(mix_bits(seed_ ^ mix_bits(side))));
      for (std::size_t k = 0; k < kEyesPerPart; ++k) {
        const double place = (offset + double(k)) / double(kEyesPerPart) * double(seen_from.size());
        const Trial& trial = own[k % kTrials];
        if (!(trial.brightness > 0.0f)) continue;
        const std::size_t eye = std::min(std::size_t(place), seen_from.size() - 1);
        useful[side] += seen_share(trial, seen_from[eye]);
      }
      useful[side] *= power[side];
    }
  });
  double all_power = 0.0;
  double all_useful = 0.0;
  for (std::size_t side = 0; side < size; ++side) {
    all_power += power[side];
    all_useful += useful[side];
    small_lights_share_ += useful[side] * of_small_lights[side];
  }
  shares_.assign(size, 0.0);
  if (!(all_useful > 0.0)) return;
  small_lights_share_ /= all_useful;
  for (std::size_t side = 0; side < size; ++side) {
    shares_[side] =
        (1.0 - kUnseenShare) * useful[side] / all_useful + kUnseenShare * power[side] / all_power;
  }
}

/// How much of all surfaces would shine as much, if what shines was as bright everywhere.
double VirtualLightTracer::lit_share() const {
  double area = 0.0;
  double all = 0.0;
  double squares = 0.0;
  for (std::size_t side = 0; side < shares_.size(); ++side) {
    area += parts_.area(side);
    if (!(shares_[side] > 0.0)) continue;
    all += shares_[side];
    squares += shares_[side] * shares_[side] / parts_.area(side);
  }
  return squares > 0.0 ? all * all / (squares * area) : 1.0;
}

bool VirtualLightTracer::are_worth_it() const {
  constexpr double kLeastOfSmallLights = 0.1;
  constexpr double kMostLit = 0.01;
  return small_lights_share_ > kLeastOfSmallLights && lit_share() < kMostLit;
}

VirtualLights VirtualLightTracer::lights(std::size_t count, std::uint64_t set,
                                         RayCounts& counts) const {
  const std::uint64_t purpose = mix_bits(kLightPurpose + set);
  VirtualLights result(parts_, shares_);
  // At equal steps through the shares.
  std::vector<std::uint32_t> sides;
  const double offset = double(unit_fraction(mix_bits(seed_ ^ purpose)));
  double end = 0.0;
  for (std::size_t side = 0; side < shares_.size(); ++side) {
    end += shares_[side] * double(count);
    while (double(sides.size()) + offset < end) sides.push_back(std::uint32_t(side));
  }
  if (sides.empty()) return result;
  std::vector<VirtualLights::Light> found(sides.size());
  light(sides, purpose, counts,
        [&](std::size_t i, VirtualLights::Light own) { found[i] = std::move(own); });
  std::vector<VirtualLights::Light> lit;
  std::vector<std::uint32_t> on;
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (!(found[i].irradiance.maxCoeff() > 0.0f)) continue;
    lit.push_back(std::move(found[i]));
    on.push_back(sides[i]);
  }
  result.shine(std::move(lit), on, sides.size());
  return result;
}

VirtualLightSets::VirtualLightSets(const EmbreeScene& scene, const View& view,
                                   const TraceSettings& settings, Isa isa, std::uint64_t paths,
                                   std::uint64_t seed, Host& host, RayCounts& counts)
    : parts_(scene.instances(), std::min<std::size_t>(kMostParts, paths / kPathsPerPart)),
      alone_(scene, view, settings, isa),
      tracer_(scene, view, alone_, parts_, seed, host, counts),
      lights_(parts_, {}) {}

std::unique_ptr<VirtualLightSets> VirtualLightSets::for_picture(const EmbreeScene& scene,
                                                                const View& view,
                                                                const PathSettings& settings,
                                                                Isa isa, SamplePlan& plan,
                                                                Host& host, RayCounts& counts) {
  const std::uint64_t paths = plan.path_count();
  const bool is_possible = settings.has_virtual_lights && !view.has_shutter();
  const bool has_any =
      settings.reuses_paths ? scene.lights().has_lamps() : scene.lights().has_small_lights();
  if (!is_possible || !has_any || paths < kLeastPaths) return nullptr;
  TraceSettings own;
  static_cast<PathSettings&>(own) = settings;
  own.host = &host;
  std::unique_ptr<VirtualLightSets> sets(
      new VirtualLightSets(scene, view, own, isa, paths, plan.seed(), host, counts));
  if (!sets->tracer_.are_worth_it()) return nullptr;
  plan.limit_rounds(most_samples(plan.pixel_count()));
  sets->make(std::min(paths, kMostPaths), counts);
  return sets;
}

void VirtualLightSets::renew(std::span<const TraceJob> jobs, RayCounts& counts) {
  std::uint64_t paths = 0;
  for (const TraceJob& job : jobs) paths += job.path_count();
  // A few paths more are served by those that there are.
  if (paths >= kFewLights * kPathsPerLight) make(paths, counts);
}

void VirtualLightSets::make(std::uint64_t paths, RayCounts& counts) {
  const std::uint64_t count = paths / kPathsPerLight;
  lights_ =
      tracer_.lights(std::clamp<std::uint64_t>(count, kFewLights, kMostLights), sets_++, counts);
}

std::uint32_t VirtualLightSets::most_samples(std::uint64_t pixels) {
  // Rounds of large pictures take memory: not for a few samples.
  constexpr std::uint64_t kLeastSamples = 4;
  return std::uint32_t(std::max(kLeastSamples, kMostPaths / pixels));
}

std::size_t VirtualLightSets::most_bytes(std::span<const MeshInstance> instances) {
  std::size_t triangles = 0;
  for (const MeshInstance& instance : instances) triangles += instance.shading->number_end();
  constexpr std::size_t kBytesPerPart = 512;  // trials, and a mesh may have a part more
  // While they are made there are two copies.
  return triangles * SurfaceParts::kBytesPerTriangle + 2 * kMostParts * kBytesPerPart +
         2 * kMostLights * (sizeof(VirtualLights::Light) + sizeof(std::uint32_t));
}

}  // namespace diorama
