// SPDX-License-Identifier: Apache-2.0
#include "gpu_path_tracer.h"

#include <kernels.h>  // made from shaders/

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>

#include "diorama/error.h"

namespace diorama {
namespace {

/// Groups that every device can begin at once.
constexpr std::uint32_t kMostGroups = 65535;
/// Bytes that a path takes, but for its ray where the processor makes it.
constexpr std::size_t kPathBytes =
    std::size_t(gpu::kColumnSize) *
        (gpu::kStateColumns + gpu::kResultColumns + gpu::kShadowColumns + 1) +
    3 * sizeof(std::uint32_t);
/// More samples of a block in one pass would make a loop of gather.comp long.
constexpr std::uint32_t kMostSamplesPerRange = 4096;

template <class Value>
std::span<const std::byte> bytes_of(const std::vector<Value>& values) {
  return std::as_bytes(std::span(values));
}

/// Lavapipe of Mesa 22.3 ends all loops of a kernel's run after 65,535 rounds, without an error.
std::uint32_t find_iteration_limit(const VulkanDevice& device) {
  constexpr std::uint32_t kWanted = 200'000;
  struct Constants {
    gpu::Address counted;
    std::uint32_t wanted = kWanted;
    std::uint32_t pad = 0;
  };
  const VulkanKernel kernel(device, kernels::kLimits);
  const VulkanBuffer counted(device, sizeof(std::uint32_t), VulkanBuffer::Place::Device, "a test");
  device.run([&](VulkanCommands& commands) {
    commands.constants(Constants{counted.address()});
    commands.dispatch(kernel, 1);
  });
  std::uint32_t found = 0;
  device.download(counted, 0, std::as_writable_bytes(std::span(&found, 1)));
  constexpr std::uint32_t kSpare = 512;  // of a kernel's other loops
  return found == kWanted ? 0xFFFFFFFFu : found - std::min(found, kSpare);
}

}  // namespace

PathKernels::PathKernels(const VulkanDevice& device)
    : start(device, kernels::kStart),
      arrange(device, kernels::kArrange),
      intersect(device, kernels::kIntersect),
      shade(device, kernels::kShade),
      shadow(device, kernels::kShadow),
      gather(device, kernels::kGather),
      iteration_limit(find_iteration_limit(device)) {}

GpuPathTracer::GpuPathTracer(const PathDevice& device, Host& host, std::uint32_t most_slots)
    : device_(device.device),
      kernels_(device.kernels),
      host_(host),
      most_slots_(most_slots > 0 ? std::min(most_slots, kMostGroups) : slots_for_device()),
      job_buffer_(device_, sizeof(gpu::Job), VulkanBuffer::Place::Device, "a picture"),
      counters_(device_, sizeof(gpu::Counters), VulkanBuffer::Place::Device, "a picture") {}

std::uint32_t GpuPathTracer::slots_for_device() const {
  // An eighth of the device; processors gain nothing from many paths.
  const std::uint64_t share =
      device_.info().is_processor ? std::uint64_t(64) << 20 : device_.info().memory / 8;
  const std::uint64_t paths = share / kPathBytes;
  return std::uint32_t(std::clamp<std::uint64_t>(paths / gpu::kGroup, 64, kMostGroups));
}

std::size_t GpuPathTracer::working_bytes() const {
  return columns_.size() + camera_rays_.size() + sums_.size() + slots_.size();
}

void GpuPathTracer::make_room(std::uint32_t slots) {
  const std::size_t paths = std::size_t(slots) * gpu::kGroup;
  const auto grow = [&](VulkanBuffer& buffer, std::size_t size, const char* what) {
    if (buffer.size() >= size) return;
    buffer = VulkanBuffer();
    buffer = VulkanBuffer(device_, size, VulkanBuffer::Place::Device, what);
  };
  grow(slots_, slots * sizeof(gpu::SampleSlot), "light paths");
  grow(ranges_, slots * sizeof(gpu::SlotRange), "light paths");
  if (job_.has_camera_rays != 0) {
    grow(camera_rays_, paths * gpu::kCameraRaySize, "light paths");
    job_.camera_rays = camera_rays_.address();
  }
  job_.slots = slots_.address();
  job_.ranges = ranges_.address();
  if (columns_.size() >= paths * kPathBytes && job_.capacity >= paths) return;
  grow(columns_, paths * kPathBytes, "light paths");
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

void GpuPathTracer::begin(const View& view, const PathSettings& settings, gpu::Address world,
                          double window) {
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
  job_.pixel_angle = view.pixel_angle();
  if (pinhole) {
    job_.camera = pinhole->origin;
    job_.towards = pinhole->towards;
    job_.per_column = pinhole->per_column;
    job_.per_row = pinhole->per_row;
    job_.near = pinhole->near;
    job_.far = std::min(pinhole->far, gpu::kInfinite);
  }
  const std::size_t size =
      sizeof(gpu::PixelSum) * std::size_t(view.camera().width) * std::size_t(view.camera().height);
  if (sums_.size() < size) {
    sums_ = VulkanBuffer();
    sums_ = VulkanBuffer(device_, size, VulkanBuffer::Place::Device, "the sums of a picture");
  }
  job_.sums = sums_.address();
  device_.run([&](VulkanCommands& commands) { commands.zero(sums_, size); });
  push_.world = world;
  push_.job = job_buffer_.address();
}

void GpuPathTracer::add(const TraceJob& job, std::uint32_t begin, std::uint32_t end,
                        Pass& pass) const {
  gpu::SampleSlot slot;
  slot.x = std::uint32_t(job.x_begin);
  slot.y = std::uint32_t(job.y_begin);
  slot.columns = std::uint32_t(job.x_end - job.x_begin);
  slot.rows = std::uint32_t(job.y_end - job.y_begin);
  pass.ranges.push_back({std::uint32_t(pass.slots.size()), end - begin});
  for (std::uint32_t sample = begin; sample < end; ++sample) {
    slot.key = job.order.place(job.x_begin, job.y_begin, sample).key;
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
  const auto most = std::uint32_t(std::min<std::uint64_t>(all, most_slots));
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
  device_.upload(bytes_of(rays), camera_rays_, 0);
}

GpuPathTracer::Counts GpuPathTracer::trace(const Pass& pass) {
  // Beyond these steps paths only pass straight through something.
  constexpr std::uint32_t kFurtherSteps = 8;
  job_.slot_count = std::uint32_t(pass.slots.size());
  device_.upload(bytes_of(pass.slots), slots_, 0);
  device_.upload(bytes_of(pass.ranges), ranges_, 0);
  device_.upload(std::as_bytes(std::span(&job_, 1)), job_buffer_, 0);
  if (job_.has_camera_rays != 0) make_camera_rays(pass);

  std::uint32_t queue = 0;
  const auto dispatch = [&](VulkanCommands& commands, const auto&... what) {
    push_.queue = queue;
    commands.constants(push_);
    commands.dispatch(what...);
    commands.barrier();
  };
  const auto steps = [&](VulkanCommands& commands, std::uint32_t count) {
    for (std::uint32_t i = 0; i < count; ++i) {
      dispatch(commands, kernels_.intersect, counters_, offsetof(gpu::Counters, paths_groups));
      dispatch(commands, kernels_.shade, counters_, offsetof(gpu::Counters, paths_groups));
      dispatch(commands, kernels_.arrange, 1u);
      dispatch(commands, kernels_.shadow, counters_, offsetof(gpu::Counters, shadow_groups));
      queue = 1 - queue;
    }
  };
  gpu::Counters counters;
  device_.run([&](VulkanCommands& commands) {
    commands.zero(counters_, sizeof(gpu::Counters));
    commands.barrier();
    dispatch(commands, kernels_.start, job_.slot_count);
    dispatch(commands, kernels_.arrange, 1u);
    steps(commands, std::uint32_t(job_.max_bounces) + 2);
  });
  const auto read_counters = [&] {
    device_.download(counters_, 0, std::as_writable_bytes(std::span(&counters, 1)));
    if (counters.is_over_limit != 0) {
      throw Error(ErrorKind::Plugin,
                  "the driver of " + device_.info().name + " ends loops after " +
                      std::to_string(kernels_.iteration_limit) +
                      " rounds, and a ray of this scene needs more; use a newer driver, or the "
                      "renderer embree");
    }
  };
  for (read_counters(); counters.path_count > 0; read_counters()) {
    host_.stop_if_asked();
    device_.run([&](VulkanCommands& commands) { steps(commands, kFurtherSteps); });
  }
  device_.run([&](VulkanCommands& commands) {
    dispatch(commands, kernels_.gather, std::uint32_t(pass.ranges.size()));
  });
  return {counters.rays, counters.shadow_rays};
}

Image<PixelSum> GpuPathTracer::sums() {
  Image<PixelSum> result(view_->camera().width, view_->camera().height, PixelSum());
  std::vector<gpu::PixelSum> sums(result.pixels().size());
  device_.download(sums_, 0, std::as_writable_bytes(std::span(sums)));
  const auto width = std::size_t(result.width());
  host_.parallel_for(std::size_t(result.height()), [&](std::size_t row) {
    for (std::size_t i = row * width; i < (row + 1) * width; ++i) {
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
                       int(sum.count), int(sum.surfaces));
    }
  });
  return result;
}

}  // namespace diorama
