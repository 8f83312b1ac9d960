// SPDX-License-Identifier: Apache-2.0
#include "vulkan_renderer.h"

#include <charconv>
#include <string>
#include <system_error>
#include <utility>

#include "diorama/error.h"
#include "embree_support/virtual_light_tracer.h"
#include "gpu_picture.h"
#include "renderer_support/stopwatch.h"

namespace diorama {

void VulkanRenderer::Params::visit(ParamVisitor& v) {
  v.param("device", device,
          {"Which of the machine's Vulkan devices, counted from 0 as the driver lists them.", "", 0,
           1023});
  v.param("devices", devices,
          {"Several devices among which visits are shared, as a list such as [0, 1], or all: every "
           "GPU; in place of device."});
  v.param(
      "ray_query", ray_query,
      {"Whether the device's own ray queries find what rays meet, instead of kernels over trees "
       "of this program: where a device has cores for that, paths take less time. Pictures are "
       "the same but for rounding."});
  PictureParams::visit(v);
}

std::vector<int> VulkanRenderer::Params::device_numbers() const {
  constexpr int kHighest = 1023;
  if (devices.kind == Value::Kind::Null) return {device};
  if (devices.kind == Value::Kind::Scalar && devices.scalar == "all") {
    return VulkanInstance::of_process().able_devices();
  }
  const auto complain = [&](const Value& value) {
    const std::string place = value.place.text();
    throw Error(ErrorKind::Config, (place.empty() ? "" : place + ": ") +
                                       "devices: expected a list of device numbers such as [0, 1], "
                                       "or all, found " +
                                       value.describe());
  };
  if (devices.kind != Value::Kind::List || devices.list.empty()) complain(devices);
  std::vector<int> numbers;
  for (const Value& value : devices.list) {
    const std::string& text = value.scalar;
    int number = -1;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    const bool is_whole = error == std::errc() && end == text.data() + text.size();
    if (value.kind != Value::Kind::Scalar || !is_whole || number < 0 || number > kHighest) {
      complain(value);
    }
    numbers.push_back(number);
  }
  return numbers;
}

VulkanRenderer::VulkanRenderer(const Params& params, Host& host,
                               std::shared_ptr<const PathDevice> device)
    : PathRenderer(params, host),
      device_(std::move(device)),
      scene_(*device_, host),
      tracer_(*device_, host),
      filter_(*device_, host) {
  host.log(LogLevel::Info, "paths are traced by Vulkan device " +
                               std::to_string(device_->device.number()) + " of " +
                               device_->device.instance().list_of_devices());
}

void VulkanRenderer::prepare_paths() { scene_.take(meshes().render_scene()); }

std::size_t VulkanRenderer::traced_bytes(std::size_t pixels) const {
  return pixels * sizeof(FilmPixel) +
         (has_virtual_lights() ? VirtualLightSets::most_bytes(meshes().instances()) : 0);
}

void VulkanRenderer::trace_paths(const View& view, const PathSettings& settings, SamplePlan& plan) {
  PictureCounts own;
  trace_picture(tracer_, scene_, meshes(), view, settings, isa(), plan, host(), own);
  counts().paths += own.paths;
  counts().rays += own.rays.rays;
  counts().shadow_rays += own.rays.shadow_rays;
}

Film VulkanRenderer::trace(const View& view, const PathSettings& settings, SamplePlan& plan) {
  trace_paths(view, settings, plan);
  Film film = tracer_.film();
  counts().device_s = tracer_.device_seconds();
  return film;
}

Image<Vec3f> VulkanRenderer::trace_quickly(const View& view, const PathSettings& settings,
                                           SamplePlan& plan, double firefly_limit) {
  {
    const Stopwatch watch(counts().trace_s);
    trace_paths(view, settings, plan);
  }
  const Stopwatch watch(counts().denoise_s);
  Image<Vec3f> image = filter_.filtered(tracer_, view.position(), firefly_limit);
  counts().device_s = tracer_.device_seconds();
  if (!counts().device_s.empty())
    counts().device_s.emplace_back("filter", filter_.device_seconds());
  return image;
}

}  // namespace diorama
