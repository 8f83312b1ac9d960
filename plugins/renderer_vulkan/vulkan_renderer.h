// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "embree_support/path_renderer.h"
#include "gpu_path_tracer.h"
#include "gpu_plane_filter.h"
#include "gpu_scene.h"
#include "path_device.h"

namespace diorama {

/// The project's path tracer on GPUs; see README.md beside this file.
class VulkanRenderer final : public PathRenderer {
 public:
  struct Params : PictureParams {
    int device = 0;
    Value devices;  ///< Null, `all` or a list of numbers.
    bool ray_query = false;

    void visit(ParamVisitor& v);
    /// Of the devices among which renderers are shared out. Throws Error(Config).
    std::vector<int> device_numbers() const;
  };

  VulkanRenderer(const Params& params, Host& host)
      : VulkanRenderer(params, host,
                       shared_path_device(params.device_numbers(), params.ray_query)) {}
  /// On a device that is open already.
  VulkanRenderer(const Params& params, Host& host, std::shared_ptr<const PathDevice> device);

 private:
  void prepare_paths() override;
  void trace_paths(const View& view, const PathSettings& settings, SamplePlan& plan);
  Film trace(const View& view, const PathSettings& settings, SamplePlan& plan) override;
  Image<Vec3f> trace_quickly(const View& view, const PathSettings& settings, SamplePlan& plan,
                             double firefly_limit) override;
  bool traces_elsewhere() const override { return true; }
  bool filters_elsewhere() const override { return true; }
  std::size_t traced_bytes(std::size_t pixels) const override;

  std::shared_ptr<const PathDevice> device_;
  GpuScene scene_;
  GpuPathTracer tracer_;
  GpuPlaneFilter filter_;
};

}  // namespace diorama
