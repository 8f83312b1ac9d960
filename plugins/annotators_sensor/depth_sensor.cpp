// SPDX-License-Identifier: Apache-2.0
#include "depth_sensor.h"

#include <cmath>

#include "diorama/error.h"
#include "diorama/rng.h"
#include "stereo_matching.h"
#include "stored_lens.h"

namespace diorama {

void DepthSensor::Params::visit(ParamVisitor& v) {
  v.param("baseline_m", baseline_m,
          {"Distance of the second camera or projector, to the right.", "m", 1e-4, 100});
  v.param("disparity_noise_px", disparity_noise_px,
          {"Standard deviation of the measured disparity; that of depth grows with its square.",
           "px", 0, 100});
  v.param("disparity_step_px", disparity_step_px,
          {"Disparities are whole multiples of this; 0: any.", "px", 0, 10});
  v.param("min_m", min_m, {"Least depth that is measured.", "m", 0, 1e4});
  v.param("max_m", max_m, {"Largest depth that is measured.", "m", 0, 1e6});
  v.param(
      "max_incidence_deg", max_incidence_deg,
      {"Surfaces that turn away from the view by more than this are not measured.", "deg", 0, 90});
  v.param(
      "edge_step_px", edge_step_px,
      {"Neighbours whose disparities differ by more lie on different surfaces.", "px", 0.01, 1000});
  v.param("edge_radius_px", edge_radius_px,
          {"Pixels this near to another surface are not measured; 0: all are.", "px", 0, 64});
  v.param("shadows", shadows,
          {"What the second camera or projector does not reach is not measured."});
  v.param("dropout", dropout, {"Share of the other pixels that are not measured.", "", 0, 1});
}

DepthSensor::DepthSensor(Params params, Host& host) : params_(params), host_(host) {
  if (params_.max_m < params_.min_m) {
    throw Error(ErrorKind::Config, "max_m: must not be less than min_m");
  }
}

NameSet DepthSensor::needs() const { return {std::string(kDistanceToImagePlane.name)}; }

NameSet DepthSensor::provides() const { return {std::string(kSensorDepth.name)}; }

void DepthSensor::do_annotate(const Scene&, Frame& frame) const {
  const Camera camera = stored_lens(frame.camera);
  frame.set(kSensorDepth, measured(frame.get(kDistanceToImagePlane), camera, frame.seed));
}

Image<float> DepthSensor::measured(const Image<float>& depth, const Camera& camera,
                                   std::uint64_t seed) const {
  const double depth_times_disparity = camera.fx * params_.baseline_m;
  Image<float> disparity(depth.width(), depth.height(), 0.0f);
  for (std::size_t i = 0; i < disparity.pixels().size(); ++i) {
    const double z = double(depth.pixels()[i]);
    if (z > 0.0 && std::isfinite(z)) disparity.pixels()[i] = float(depth_times_disparity / z);
  }
  const StereoMatching matching{params_.edge_step_px, params_.edge_radius_px,
                                params_.max_incidence_deg * kPi / 180.0};
  const PixelMask whole = far_from_edges(disparity, matching);
  const PixelMask steep = seen_steeply(depth, camera, matching);
  const PixelMask lit = params_.shadows ? seen_by_both(disparity, matching)
                                        : PixelMask(depth.width(), depth.height(), 1);

  const Rng rng = Rng(seed).fork("depth_sensor");
  Image<float> result(depth.width(), depth.height(), 0.0f);
  host_.parallel_for(std::size_t(depth.height()), [&](std::size_t row) {
    Rng row_rng = rng.fork(std::uint64_t(row));
    const int y = int(row);
    for (int x = 0; x < depth.width(); ++x) {
      const double noise = params_.disparity_noise_px * row_rng.normal();
      const bool is_dropped = row_rng.chance(params_.dropout);
      const float exact = disparity.at(x, y);
      const bool is_matched = exact > 0.0f && whole.at(x, y) && steep.at(x, y) && lit.at(x, y);
      if (!is_matched || is_dropped) continue;
      double found = double(exact) + noise;
      const double step = params_.disparity_step_px;
      if (step > 0.0) found = std::round(found / step) * step;
      if (found <= 0.0) continue;
      const double z = depth_times_disparity / found;
      if (z >= params_.min_m && z <= params_.max_m) result.at(x, y) = float(z);
    }
  });
  return result;
}

}  // namespace diorama
