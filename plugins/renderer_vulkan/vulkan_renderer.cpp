// SPDX-License-Identifier: Apache-2.0
#include "vulkan_renderer.h"

#include <chrono>
#include <string>
#include <utility>

#include "diorama/error.h"

namespace diorama {

void VulkanRenderer::Params::visit(ParamVisitor& v) {
  v.param("device", device,
          {"Which of the machine's Vulkan devices, counted from 0 as the driver lists them.", "", 0,
           1023});
  PictureParams::visit(v);
}

VulkanRenderer::VulkanRenderer(const Params& params, Host& host,
                               std::shared_ptr<const PathDevice> device)
    : PathRenderer(params, host),
      device_(std::move(device)),
      scene_(*device_, host),
      tracer_(*device_, host) {
  host.log(LogLevel::Info, "paths are traced by Vulkan device " + std::to_string(params.device) +
                               " of " + device_->device.instance().list_of_devices());
}

void VulkanRenderer::prepare_paths() { scene_.take(meshes().render_scene()); }

Film VulkanRenderer::trace(const View& view, const PathSettings& settings, SamplePlan& plan) {
  using Clock = std::chrono::steady_clock;
  if (view.has_shutter()) {
    throw Error(ErrorKind::Config,
                "a camera has exposure_time_s or readout_time_s, and the renderer vulkan shows no "
                "motion as yet: use the renderer embree, or set both to 0");
  }
  const auto start = Clock::now();
  tracer_.begin(view, settings, scene_.world(), meshes().window());
  Image<PixelSum> sums;
  while (true) {
    const double elapsed = std::chrono::duration<double>(Clock::now() - start).count();
    const std::vector<TraceJob> jobs = plan.next_round(sums, elapsed);
    if (jobs.empty()) break;
    const GpuPathTracer::Counts own = tracer_.trace(jobs);
    counts().rays += own.rays;
    counts().shadow_rays += own.shadow_rays;
    for (const TraceJob& job : jobs) counts().paths += job.path_count();
    if (plan.has_one_round()) break;
    sums = tracer_.sums();
  }
  Film film = tracer_.film();
  counts().device_s = tracer_.device_seconds();
  return film;
}

}  // namespace diorama
