// SPDX-License-Identifier: Apache-2.0
#include "gpu_path_tracer.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstring>
#include <utility>

#include "diorama/error.h"
#include "gpu_bytes.h"

namespace diorama {
namespace {

/// More would save nothing: a device is busy with a few million paths.
constexpr std::uint32_t kMostSlots = 1u << 17;
/// Bytes that a path takes, but for its ray where the processor makes it.
constexpr std::size_t kPathBytes =
    std::size_t(gpu::kColumnSize) *
        (gpu::kStateColumns + gpu::kResultColumns + gpu::kShadowColumns + 1) +
    3 * sizeof(std::uint32_t);
/// More where it is connected with virtual lights.
constexpr std::size_t kConnectionBytes = std::size_t(gpu::kShadowColumns) * gpu::kColumnSize;
/// More samples of a block in one pass would make a loop of gather.comp long.
constexpr std::uint32_t kMostSamplesPerRange = 4096;

/// Where slots begin among the inputs of a pass.
constexpr std::size_t kJobRoom = 512;
static_assert(sizeof(gpu::Job) <= kJobRoom);
/// Where the film begins in what comes back.
constexpr std::size_t kCountersRoom = 256;
static_assert(sizeof(gpu::Counters) <= kCountersRoom);
// What resolve.comp writes.
static_assert(sizeof(FilmPixel) == 20 * sizeof(float));

}  // namespace

GpuPathTracer::GpuPathTracer(const PathDevice& device, Host& host, std::uint32_t most_slots)
    : device_(device.device),
      kernels_(device.kernels),
      host_(host),
      most_slots_(most_slots > 0 ? std::min(most_slots, device_.info().most_groups)
                                 : slots_for_device()),
      counters_(device_, sizeof(gpu::Counters), VulkanBuffer::Place::Device, "a picture") {}

std::uint32_t GpuPathTracer::slots_for_device() const {
  // A part of the device, which several pictures share; processors gain nothing from many paths.
  const std::uint64_t share =
      device_.info().is_processor ? std::uint64_t(64) << 20 : device_.info().memory / 32;
  const std::uint64_t most = std::min(kMostSlots, device_.info().most_groups);
  return std::uint32_t(
      std::clamp<std::uint64_t>(share / (kPathBytes + kConnectionBytes) / gpu::kGroup, 64, most));
}

std::vector<std::pair<std::string, double>> GpuPathTracer::device_seconds() const {
  if (!(device_.info().nanoseconds_per_tick > 0.0)) return {};
  return {{"transfers", seconds_[kTransfers]},
          {"begin", seconds_[kBegin]},
          {"rays", seconds_[kRays]},
          {"surfaces", seconds_[kSurfaces]},
          {"rays to lights", seconds_[kShadowRays]},
          {"rays to virtual lights", seconds_[kConnections]},
          {"sums", seconds_[kSums]}};
}

void GpuPathTracer::make_room(std::uint32_t slots) {
  constexpr const char* kWhat = "light paths";
  const std::size_t paths = std::size_t(slots) * gpu::kGroup;
  const std::size_t inputs = kJobRoom + slots * (sizeof(gpu::SampleSlot) + sizeof(gpu::SlotRange));
  inputs_.grow(device_, inputs, VulkanBuffer::Place::Device, kWhat);
  inputs_from_host_.grow(device_, inputs, VulkanBuffer::Place::ToDevice, kWhat);
  results_for_host_.grow(device_, kCountersRoom, VulkanBuffer::Place::ToHost, kWhat);
  if (job_.has_camera_rays != 0) {
    camera_rays_.grow(device_, paths * gpu::kCameraRaySize, VulkanBuffer::Place::Device, kWhat);
    job_.camera_rays = camera_rays_.address();
  }
  if (learns()) {
    device_findings_.grow(device_, paths * sizeof(gpu::Finding), VulkanBuffer::Place::Device,
                          kWhat);
    job_.findings = device_findings_.address();
  }
  if (columns_.size() < paths * kPathBytes || job_.capacity < paths) make_columns(paths);
  if (connects()) {
    // In columns as long as all others are.
    connections_.grow(device_, job_.capacity * kConnectionBytes, VulkanBuffer::Place::Device,
                      kWhat);
    job_.connections = connections_.address();
  }
}

void GpuPathTracer::make_columns(std::size_t paths) {
  columns_.grow(device_, paths * kPathBytes, VulkanBuffer::Place::Device, "light paths");
  job_.capacity = std::uint32_t(paths);
  gpu::Address place = columns_.address();
  const auto take = [&](std::size_t bytes_per_path) {
    const gpu::Address begin = place;
    place += bytes_per_path * paths;
    return begin;
  };
  job_.state = take(std::size_t(gpu::kStateColumns) * gpu::kColumnSize);
  job_.results = take(std::size_t(gpu::kResultColumns) * gpu::kColumnSize);
  job_.shadows = take(std::size_t(gpu::kShadowColumns) * gpu::kColumnSize);
  job_.hits = take(gpu::kColumnSize);
  job_.hit_triangles = take(sizeof(std::uint32_t));
  job_.queues[0] = take(sizeof(std::uint32_t));
  job_.queues[1] = take(sizeof(std::uint32_t));
}

LearningPaths GpuPathTracer::learn(std::span<const TraceJob> jobs, Counts& counts) {
  job_.cache_use = gpu::kCacheLearns;
  learning_ = LearningPaths(1);
  const Counts own = trace(jobs);
  counts.rays += own.rays;
  counts.shadow_rays += own.shadow_rays;
  return std::exchange(learning_, {});
}

void GpuPathTracer::count(const LearningPaths& paths) {
  std::vector<gpu::PixelSum> sums(job_.pixel_count);
  paths.for_each([&](const LearningPaths::Path& path) {
    // As gather.comp does it.
    gpu::PixelSum& sum = sums[std::size_t(path.y) * job_.width + std::size_t(path.x)];
    const PathSample& sample = path.sample;
    ++sum.count;
    sum.seen += sample.seen;
    sum.scattered += sample.scattered;
    const float l = luminance(sample.scattered);
    const float off = l - sum.mean;
    sum.mean += off / float(sum.count);
    sum.squares += off * (l - sum.mean);
    sum.brightest = std::max(sum.brightest, l);
    sum.chances += sample.by_chance ? 1 : 0;
    if (!sample.has_surface) return;
    ++sum.surfaces;
    sum.albedo += sample.albedo;
    sum.normal += sample.normal;
    sum.position += sample.position;
  });
  device_.upload(std::as_bytes(std::span(sums)), sums_, 0);
  has_sums_ = true;
}

void GpuPathTracer::begin(const View& view, const PathSettings& settings, const GpuScene& scene,
                          double window, const RadianceCache* cache, bool stays_connected) {
  view_ = &view;
  window_ = window;
  const auto pinhole = view.has_shutter() ? std::nullopt : view.pinhole();
  job_.counters = counters_.address();
  job_.width = std::uint32_t(view.camera().width);
  job_.has_camera_rays = pinhole ? 0 : 1;
  job_.starts_at_centres = settings.starts_at_centres ? 1 : 0;
  job_.iteration_limit = kernels_.iteration_limit;
  job_.max_bounces = settings.max_bounces;
  job_.clamp_to = settings.clamp;
  job_.has_caustics = settings.has_caustics ? 1 : 0;
  job_.indirect_share = settings.indirect_share;
  job_.continuation = settings.continuation;
  job_.most_spread = kMostSpread;
  job_.pixel_angle = view.pixel_angle();
  if (pinhole) {
    job_.camera = pinhole->origin;
    job_.towards = pinhole->towards;
    job_.per_column = pinhole->per_column;
    job_.per_row = pinhole->per_row;
    job_.near = pinhole->near;
    job_.far = std::min(pinhole->far, gpu::kInfinite);
  }
  const std::size_t pixels = std::size_t(view.camera().width) * std::size_t(view.camera().height);
  sums_.grow(device_, pixels * sizeof(gpu::PixelSum), VulkanBuffer::Place::Device,
             "the sums of a picture");
  film_.grow(device_, pixels * sizeof(FilmPixel), VulkanBuffer::Place::Device, "a picture");
  job_.sums = sums_.address();
  job_.film = film_.address();
  job_.pixel_count = std::uint32_t(pixels);
  has_sums_ = false;
  if (!stays_connected) job_.part_triangles = 0;
  job_.cache_use = gpu::kNoCache;
  if (cache) {
    const auto bytes = std::as_bytes(cache->table());
    cache_.grow(device_, bytes.size(), VulkanBuffer::Place::Device, "a cache of light");
    device_.upload(bytes, cache_, 0);
    job_.cache = cache_.address();
    job_.cache_mask = std::uint32_t(cache->table().size() - 1);
    job_.cache_eye = cache->eye();
    job_.cache_use = gpu::kCacheEnds;
  }
  seconds_ = {};
  scene_ = &scene;
  push_.world = scene.world();
  rays_ = scene.traces_by_query() ? &*kernels_.by_query : &kernels_.by_trees;
}

void GpuPathTracer::connect_with(const VirtualLights& lights) {
  constexpr const char* kWhat = "virtual lights";
  static_assert(sizeof(VirtualLights::Candidate) == 8 * sizeof(float));
  static_assert(sizeof(SurfaceParts::Triangle) == 3 * sizeof(std::uint32_t));
  std::vector<gpu::VirtualLight> records;
  records.reserve(lights.size());
  for (const VirtualLights::Light& light : lights.lights()) {
    records.push_back(
        {light.normal, light.to_light, light.irradiance, 0, scene_->surface_of(light.bsdf)});
  }
  GpuBytes bytes;
  job_.candidates = bytes.add(lights.candidates());
  job_.virtual_lights = bytes.add(records);
  job_.part_starts = bytes.add(lights.parts().starts());
  job_.part_densities = bytes.add(lights.densities());
  virtual_lights_.grow(device_, bytes.bytes().size(), VulkanBuffer::Place::Device, kWhat);
  for (gpu::Address* address :
       {&job_.candidates, &job_.virtual_lights, &job_.part_starts, &job_.part_densities}) {
    *address += virtual_lights_.address();
  }
  device_.upload(bytes.bytes(), virtual_lights_, 0);
  if (!connects()) {
    const auto triangles = std::as_bytes(lights.parts().triangles());
    parts_.grow(device_, triangles.size(), VulkanBuffer::Place::Device, kWhat);
    device_.upload(triangles, parts_, 0);
    job_.part_triangles = parts_.address();
  }
  job_.virtual_light_count = std::uint32_t(lights.size());
}

void GpuPathTracer::add(const TraceJob& job, std::uint32_t begin, std::uint32_t end,
                        Pass& pass) const {
  gpu::SampleSlot slot;
  slot.x = std::uint32_t(job.x_begin);
  slot.y = std::uint32_t(job.y_begin);
  slot.columns = std::uint32_t(job.x_end - job.x_begin);
  slot.rows = std::uint32_t(job.y_end - job.y_begin);
  pass.ranges.push_back({std::uint32_t(pass.slots.size()), end - begin});
  // Keys change where another sequence begins.
  const std::uint32_t mask = (1u << job.order.sample_bits()) - 1u;
  for (std::uint32_t sample = begin; sample < end; ++sample) {
    if (sample == begin || (sample & mask) == 0) {
      slot.key = job.order.place(job.x_begin, job.y_begin, sample).key;
    }
    slot.sample_index = sample;
    pass.slots.push_back(slot);
    if (job_.has_camera_rays != 0) pass.orders.push_back(job.order);
  }
}

GpuPathTracer::Counts GpuPathTracer::trace(std::span<const TraceJob> jobs) {
  Counts counts;
  if (jobs.empty()) return counts;
  job_.sample_bits = std::uint32_t(jobs[0].order.sample_bits());
  std::uint64_t all = 0;
  for (const TraceJob& job : jobs) all += job.sample_end - job.sample_begin;
  // Rays that the processor makes wait in its memory, too.
  constexpr std::uint32_t kMostWithRays = 4096;
  const std::uint32_t most_slots =
      job_.has_camera_rays != 0 ? std::min(most_slots_, kMostWithRays) : most_slots_;
  // Passes of about the same size.
  const std::uint64_t passes = (all + most_slots - 1) / most_slots;
  const auto most = std::uint32_t((all + passes - 1) / passes);
  make_room(most);
  Pass pass;
  const auto finish_pass = [&] {
    host_.stop_if_asked();
    const Counts own = trace(pass);
    counts.rays += own.rays;
    counts.shadow_rays += own.shadow_rays;
    pass = Pass();
  };
  for (const TraceJob& job : jobs) {
    for (std::uint32_t begin = job.sample_begin; begin < job.sample_end;) {
      const auto room = std::uint32_t(most - pass.slots.size());
      const std::uint32_t end =
          begin + std::min({job.sample_end - begin, room, kMostSamplesPerRange});
      add(job, begin, end, pass);
      begin = end;
      if (pass.slots.size() == most) finish_pass();
    }
  }
  if (!pass.slots.empty()) finish_pass();
  return counts;
}

/// Through lenses that kernels do not know, and open shutters.
void GpuPathTracer::make_camera_rays(const Pass& pass) {
  struct Ray {
    std::array<float, 4> origin{};     // and where it begins
    std::array<float, 4> direction{};  // and where it ends
    std::array<float, 4> sample{};     // time, and the sampler's dimension
  };
  static_assert(sizeof(Ray) == gpu::kCameraRaySize);
  std::vector<Ray> rays(pass.slots.size() * gpu::kGroup);
  host_.parallel_for(pass.slots.size(), [&](std::size_t k) {
    const gpu::SampleSlot& slot = pass.slots[k];
    for (std::uint32_t i = 0; i < gpu::kGroup; ++i) {
      const std::uint32_t column = i % 8;
      const std::uint32_t row = i / 8;
      if (column >= slot.columns || row >= slot.rows) continue;
      const int x = int(slot.x + column);
      const int y = int(slot.y + row);
      PathSampler sampler(pass.orders[k].place(x, y, slot.sample_index));
      const Vec2f within = sampler.next();
      const Vec2f aperture = sampler.next();
      CameraRay ray = view_->sample_ray(Vec2f(float(x), float(y)) + within,
                                        view_->has_aperture() ? aperture : Vec2f(Vec2f::Zero()));
      std::uint32_t dimension = 3;
      float time = 0.5f;
      if (view_->has_shutter()) {
        const double seconds = view_->seconds(y, double(sampler.next().x()));
        ++dimension;
        time = float(0.5 + seconds / window_);
        ray = view_->moved(ray, seconds);
      }
      const Vec3f& o = ray.origin;
      const Vec3f& d = ray.direction;
      rays[k * gpu::kGroup + i] = {{o.x(), o.y(), o.z(), ray.t_min},
                                   {d.x(), d.y(), d.z(), std::min(ray.t_max, gpu::kInfinite)},
                                   {time, std::bit_cast<float>(dimension), 0.0f, 0.0f}};
    }
  });
  device_.upload(std::as_bytes(std::span(rays)), camera_rays_, 0);
}

void GpuPathTracer::write_inputs(const Pass& pass) {
  const std::size_t slots = pass.slots.size() * sizeof(gpu::SampleSlot);
  job_.slot_count = std::uint32_t(pass.slots.size());
  job_.slots = inputs_.address() + kJobRoom;
  job_.ranges = job_.slots + slots;
  push_.job = inputs_.address();
  std::byte* to = inputs_from_host_.data();
  std::memcpy(to, static_cast<const void*>(&job_), sizeof(job_));
  std::memcpy(to + kJobRoom, pass.slots.data(), slots);
  std::memcpy(to + kJobRoom + slots, pass.ranges.data(),
              pass.ranges.size() * sizeof(gpu::SlotRange));
}

GpuPathTracer::Counts GpuPathTracer::trace(const Pass& pass) {
  // Beyond these steps paths only pass straight through something.
  constexpr std::uint32_t kFurtherSteps = 8;
  write_inputs(pass);
  if (job_.has_camera_rays != 0) make_camera_rays(pass);

  std::uint32_t queue = 0;
  const auto dispatch = [&](VulkanCommands& commands, Work work, const auto&... what) {
    push_.queue = queue;
    commands.constants(push_);
    commands.dispatch(what...);
    commands.barrier();
    commands.mark(work);
  };
  const auto steps = [&](VulkanCommands& commands, std::uint32_t count) {
    constexpr std::size_t kPaths = offsetof(gpu::Counters, paths_groups);
    constexpr std::size_t kShadows = offsetof(gpu::Counters, shadow_groups);
    constexpr std::size_t kVirtual = offsetof(gpu::Counters, connection_groups);
    const VulkanKernel& shade = connects() ? kernels_.shade_with_virtual_lights : kernels_.shade;
    for (std::uint32_t i = 0; i < count; ++i) {
      dispatch(commands, kRays, rays_->intersect, counters_, kPaths);
      dispatch(commands, kSurfaces, shade, counters_, kPaths);
      dispatch(commands, kSurfaces, kernels_.arrange, 1u);
      dispatch(commands, kShadowRays, rays_->shadow, counters_, kShadows);
      if (connects()) {
        push_.connects = 1;
        dispatch(commands, kConnections, rays_->shadow, counters_, kVirtual);
        push_.connects = 0;
      }
      queue = 1 - queue;
    }
    // Does nothing while paths are under way.
    if (!learns()) {
      dispatch(commands, kSums, kernels_.gather, std::uint32_t(pass.ranges.size()));
    }
    commands.copy(counters_, 0, results_for_host_, 0, sizeof(gpu::Counters));
    commands.mark(kTransfers);
  };
  const auto first_steps = [&](VulkanCommands& commands) {
    commands.copy(inputs_from_host_, 0, inputs_, 0,
                  kJobRoom + pass.slots.size() * sizeof(gpu::SampleSlot) +
                      pass.ranges.size() * sizeof(gpu::SlotRange));
    if (!has_sums_) commands.zero(sums_, job_.pixel_count * sizeof(gpu::PixelSum));
    commands.zero(counters_, sizeof(gpu::Counters));
    commands.barrier();
    commands.mark(kTransfers);
    dispatch(commands, kBegin, kernels_.start, job_.slot_count);
    dispatch(commands, kBegin, kernels_.arrange, 1u);
    steps(commands, std::uint32_t(job_.max_bounces) + 2);
  };
  gpu::Counters counters;
  const auto read_counters = [&] {
    std::memcpy(&counters, results_for_host_.data(), sizeof(counters));
    if (counters.is_over_limit != 0) {
      throw Error(ErrorKind::Plugin,
                  "the driver of " + device_.info().name + " ends loops after " +
                      std::to_string(kernels_.iteration_limit) +
                      " rounds, and a ray of this scene needs more; use a newer driver, or the "
                      "renderer embree");
    }
  };
  device_.run(first_steps, seconds_);
  has_sums_ = true;
  for (read_counters(); counters.path_count > 0; read_counters()) {
    host_.stop_if_asked();
    device_.run([&](VulkanCommands& commands) { steps(commands, kFurtherSteps); }, seconds_);
  }
  if (learns()) read_learning_paths(pass);
  return {counters.rays, counters.shadow_rays};
}

void GpuPathTracer::read_learning_paths(const Pass& pass) {
  const std::size_t paths = pass.slots.size() * gpu::kGroup;
  std::vector<gpu::Finding> found(paths);
  device_.download(device_findings_, 0, std::as_writable_bytes(std::span(found)));
  using Column = std::vector<Eigen::Vector4f>;
  std::array<Column, gpu::kResultColumns> results;
  for (std::size_t k = 0; k < results.size(); ++k) {
    results[k].resize(paths);
    const std::size_t column = k * std::size_t(job_.capacity) * gpu::kColumnSize;
    device_.download(columns_, job_.results - columns_.address() + column,
                     std::as_writable_bytes(std::span(results[k])));
  }
  const auto& [seen, scattered, normal, position] = results;
  for (std::size_t i = 0; i < paths; ++i) {
    const gpu::SampleSlot& slot = pass.slots[i / gpu::kGroup];
    const auto column = std::uint32_t(i % 8);
    const auto row = std::uint32_t(i % gpu::kGroup / 8);
    if (column >= slot.columns || row >= slot.rows) continue;
    LearningPaths::Path path{int(slot.x + column), int(slot.y + row)};
    path.sample.seen = seen[i].head<3>();
    path.sample.scattered = scattered[i].head<3>();
    path.sample.has_surface = seen[i].w() != 0.0f && seen[i].w() != gpu::kChance;
    path.sample.by_chance = seen[i].w() >= gpu::kChance;
    if (path.sample.has_surface) {
      path.sample.albedo = {scattered[i].w(), normal[i].w(), position[i].w()};
      path.sample.normal = normal[i].head<3>();
      path.sample.position = position[i].head<3>();
    }
    const gpu::Finding& f = found[i];
    path.has_finding = f.is_there != 0.0f;
    path.clamp = f.clamp;
    learning_.part(0).add(path, {f.position, f.normal, f.reach, f.weight, f.light});
  }
}

gpu::Address GpuPathTracer::record_film(VulkanCommands& commands) const {
  commands.constants(push_);
  commands.dispatch(kernels_.resolve, std::min((job_.pixel_count + gpu::kGroup - 1) / gpu::kGroup,
                                               device_.info().most_groups));
  commands.barrier();
  return film_.address();
}

Film GpuPathTracer::film() {
  const std::size_t size = job_.pixel_count * sizeof(FilmPixel);
  results_for_host_.grow(device_, kCountersRoom + size, VulkanBuffer::Place::ToHost, "a picture");
  const auto record = [&](VulkanCommands& commands) {
    record_film(commands);
    commands.mark(kSums);
    commands.copy(film_, 0, results_for_host_, kCountersRoom, size);
    commands.mark(kTransfers);
  };
  device_.run(record, seconds_);
  Film film(width(), height());
  const std::byte* from = results_for_host_.data() + kCountersRoom;
  const std::size_t row_size = std::size_t(width()) * sizeof(FilmPixel);
  host_.parallel_for(std::size_t(height()), [&](std::size_t row) {
    std::memcpy(static_cast<void*>(&film.at(0, int(row))), from + row * row_size, row_size);
  });
  return film;
}

Image<PixelSum> GpuPathTracer::sums() {
  Image<PixelSum> result(width(), height(), PixelSum());
  std::vector<gpu::PixelSum> sums(result.pixels().size());
  device_.download(sums_, 0, std::as_writable_bytes(std::span(sums)));
  const auto row_width = std::size_t(result.width());
  host_.parallel_for(std::size_t(result.height()), [&](std::size_t row) {
    for (std::size_t i = row * row_width; i < (row + 1) * row_width; ++i) {
      const gpu::PixelSum& sum = sums[i];
      FilmPixel pixel;
      pixel.seen = sum.seen;
      pixel.scattered = sum.scattered;
      pixel.albedo = sum.albedo;
      pixel.normal = sum.normal;
      pixel.position = sum.position;
      pixel.brightest = sum.brightest;
      const double mean = double(sum.mean);
      const double count = double(sum.count);
      result.pixels()[i] =
          PixelSum::of(pixel, mean * count, double(sum.squares) + mean * mean * count,
                       int(sum.count), int(sum.surfaces), int(sum.chances));
    }
  });
  return result;
}

}  // namespace diorama
