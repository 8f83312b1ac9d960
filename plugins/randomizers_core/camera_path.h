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

/// Draws a path for each camera (or rig) when a clip begins, and moves it along this path from
/// frame to frame. At other moments it places the cameras where their paths begin.
class CameraPath final : public Randomizer {
 public:
  struct Key {
    double time_s = 0.0;
    Distribution position = Vec3(Vec3::Zero());
    Distribution look_at = Vec3(Vec3::Zero());

    void visit(ParamVisitor& v);
  };
  struct Params {
    std::string nodes = "/Cameras/*";
    std::string kind = "orbit";
    std::string targets = "/Assets/*";
    std::vector<Key> keys;
    Distribution distance = Range{1.5, 2.5};
    Distribution polar_angle_deg = Range{45.0, 75.0};
    Distribution azimuth_deg = Range{0.0, 360.0};
    Distribution turn_deg_s = Range{15.0, 30.0};
    Distribution look_at_offset = Vec3(Vec3::Zero());
    Distribution offset = Distribution::between(Vec3(-1.5, -1.5, 0.5), Vec3(1.5, 1.5, 1.0));
    double lag_s = 0.3;
    Distribution area = Distribution::between(Vec3(-1.5, -1.5, 1.2), Vec3(1.5, 1.5, 1.6));
    Distribution speed = Range{0.5, 1.0};
    std::string look = "targets";
    double clearance_m = 0.3;
    int max_tries = 500;
    double jitter_m = 0.0;
    double jitter_deg = 0.0;
    double jitter_hz = 3.0;

    void visit(ParamVisitor& v);
  };

  CameraPath(Params params, Host& host);
  ~CameraPath() override;
  void randomize(Scene& scene, const RandomizeContext& context, const Rng& rng) override;
  void play(Scene& scene, const ClipFrame& frame) override;

 private:
  struct Path;
  struct Keys;
  struct Orbit;
  struct Follow;
  struct Walk;
  struct Moving;
  std::unique_ptr<Path> draw_path(const Scene& scene, NodeId node, const RandomizeContext& context,
                                  double shake_m, NodeDraws& draws) const;
  std::unique_ptr<Path> draw_walk(const Scene& scene, NodeId node, const RandomizeContext& context,
                                  double shake_m, NodeDraws& draws) const;

  Params params_;
  Host& host_;
  std::vector<Moving> moving_;
};

}  // namespace diorama
