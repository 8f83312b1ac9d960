// SPDX-License-Identifier: Apache-2.0
// Moves cameras as a hand would that tries to hold them still: a few millimetres of sway and a
// degree or so of turn, with the horizon better kept than the aim.
//! [includes]
#include <diorama/plugin.h>
#include <diorama/randomizer.h>
//! [includes]

namespace {

using diorama::Vec3;

//! [params]
struct ShakeParams {
  std::string nodes = "/Cameras/*";
  double sway_m = 0.005;
  double aim_deg = 1.0;
  double roll_deg = 0.3;
  void visit(diorama::ParamVisitor& v) {
    v.param("nodes", nodes, {"Pattern of the cameras to shake."});
    v.param("sway_m", sway_m, {"Standard deviation of the place, per axis.", "m", 0.0, 10.0});
    v.param("aim_deg", aim_deg, {"Standard deviation of pan and tilt.", "deg", 0.0, 45.0});
    v.param("roll_deg", roll_deg, {"Standard deviation of the roll.", "deg", 0.0, 45.0});
  }
};
//! [params]

//! [class]
class CameraShake final : public diorama::Randomizer {
 public:
  using Params = ShakeParams;
  CameraShake(Params params, diorama::Host& host) : params_(std::move(params)), host_(host) {}

  void randomize(diorama::Scene& scene, const diorama::RandomizeContext& context,
                 const diorama::Rng& rng) override {
    const std::vector<diorama::NodeId> nodes = scene.match(params_.nodes);
    if (nodes.empty()) {
      host_.log(diorama::LogLevel::Warning,
                "camera_shake: no node matches '" + params_.nodes + "' at " + context.moment);
    }
    for (const diorama::NodeId node : nodes) {
      // A stream per node: another camera leaves the shakes of this one as they were.
      scene.set_pose(node, scene[node].parent_from_node * shake(rng.fork(scene.path(node))));
    }
  }

 private:
  /// In camera space: x right, y up, looking along -z.
  diorama::Affine shake(diorama::Rng rng) const {
    const double sway = params_.sway_m;
    const double aim = params_.aim_deg * diorama::kPi / 180.0;
    const double roll = params_.roll_deg * diorama::kPi / 180.0;
    // Statements, since the order in which arguments are evaluated is the compiler's.
    const double x = sway * rng.normal();
    const double y = sway * rng.normal();
    const double z = sway * rng.normal();
    const Eigen::AngleAxisd pan(aim * rng.normal(), Vec3::UnitY());
    const Eigen::AngleAxisd tilt(aim * rng.normal(), Vec3::UnitX());
    const Eigen::AngleAxisd turn(roll * rng.normal(), Vec3::UnitZ());
    return Eigen::Translation3d(x, y, z) * diorama::Affine(pan * tilt * turn);
  }

  Params params_;
  diorama::Host& host_;
};
//! [class]

}  // namespace

//! [plugin]
DIORAMA_PLUGIN("camera_shake", "1.0.0", "Apache-2.0") {
  DIORAMA_ADD(CameraShake, "camera_shake", "Shakes cameras like a hand.");
}
//! [plugin]
