// SPDX-License-Identifier: Apache-2.0
#include "camera_lens.h"

#include "diorama/node_pattern.h"

#include "sampling.h"

namespace diorama {

void CameraLens::Params::visit(ParamVisitor& v) {
  v.param("nodes", nodes, {"Cameras to change.", kNodePattern});
  v.param("focal_length_mm", focal_length_mm, {"Focal length; null keeps it.", "mm", 0.01, 1e5});
  v.param("principal_point_px", principal_point_px,
          {"Shift of the principal point off the image centre along x and y; null keeps it. A "
           "vector's third number is not used.",
           "px"},
          3);
  v.param("f_stop", f_stop, {"Aperture; 0: everything is in focus; null keeps it.", "", 0, 1e3});
  v.param("focus_distance_m", focus_distance_m,
          {"Distance of the plane in focus; null keeps it.", "m", 1e-3, 1e6});
}

CameraLens::CameraLens(Params params, Host&) : params_(std::move(params)) {}

void CameraLens::randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) {
  const auto change = [&](NodeId node, NodeDraws& draws) {
    Camera& camera = *scene.edit(node).camera;
    if (params_.focal_length_mm) {
      // Pixels need not be square, so both focal lengths scale by what the lens does.
      const double focal_length_mm = draws.number(*params_.focal_length_mm);
      const double factor = focal_length_mm / camera.focal_length_mm;
      camera.focal_length_mm = focal_length_mm;
      camera.fx *= factor;
      camera.fy *= factor;
    }
    if (params_.principal_point_px) {
      const Vec3 shift = draws.vector(*params_.principal_point_px);
      camera.cx = 0.5 * camera.width + shift.x();
      camera.cy = 0.5 * camera.height + shift.y();
    }
    if (params_.f_stop) camera.f_stop = draws.number(*params_.f_stop);
    if (params_.focus_distance_m) camera.focus_distance_m = draws.number(*params_.focus_distance_m);
  };
  const auto is_camera = [](const Node& node) { return node.camera.has_value(); };
  draw_for_each(scene, match_if(scene, params_.nodes, is_camera), context, rng, change);
}

}  // namespace diorama
