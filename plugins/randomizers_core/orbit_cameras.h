// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "diorama/distribution.h"
#include "diorama/host.h"
#include "diorama/randomizer.h"

namespace diorama {

struct NodeDraws;

/// Places each camera (or light) on a sphere round a random target (the centre of its box) and
/// turns it to a point beside that centre. Distance and polar angle are those seen from the target
/// itself, not from the point looked at. Without targets the working area takes their place.
///
/// A camera behind a wall sees nothing. With `avoid_obstacles` a view is drawn again, target
/// included, while an obstacle stands between camera and target, the camera stands inside something
/// solid, or anything visible is close to it, which its near plane would cut open. When no draw
/// within `max_tries` is free, the farthest from everything among those with a free line of sight
/// is taken, else the first. A rig of cameras is placed as one, and each of them has to be free.
class OrbitCameras final : public Randomizer {
 public:
  struct Params {
    std::string nodes = "/Cameras/*";
    std::string targets = "/Assets/*";
    Distribution distance = Range{1.05, 1.25};
    Distribution polar_angle_deg = Range{0.0, 75.0};
    std::optional<Distribution> cos_polar_angle;
    Distribution azimuth_deg = Range{0.0, 360.0};
    Distribution look_at_offset = Range{-0.1, 0.1};
    std::string roll = "level";
    bool avoid_obstacles = true;
    std::string obstacles = "/Environment/**";
    double clearance_m = 0.3;
    int max_tries = 200;

    void visit(ParamVisitor& v);
  };

  OrbitCameras(Params params, Host& host);
  ~OrbitCameras() override;
  void randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) override;

 private:
  struct View {
    Vec3 target;
    Vec3 position;
    Vec3 look_at;
  };
  struct Surroundings;
  void look_around(const Scene& scene);
  View draw_view(const std::vector<Vec3>& targets, NodeDraws draws) const;
  View draw_free_view(const std::vector<Vec3>& targets, const std::vector<Vec3>& cameras,
                      const NodeDraws& draws) const;
  double clearance_of(const View& view, const std::vector<Vec3>& cameras) const;
  Affine pose_of(const View& view) const;

  Params params_;
  std::unique_ptr<Surroundings> surroundings_;  ///< Of the last scene.
};

}  // namespace diorama
