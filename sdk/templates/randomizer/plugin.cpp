// SPDX-License-Identifier: @LICENCE@
// Turns nodes about their own vertical axis and scales them, each by its own chance.
#include <diorama/node_pattern.h>
#include <diorama/plugin.h>
#include <diorama/randomizer.h>

namespace {

class @CLASS@ final : public diorama::Randomizer {
 public:
  // Defaults are the field initialisers. visit() is the one list from which the program reads and
  // checks a job, describes the plugin and makes the JSON Schema.
  struct Params {
    std::string nodes = "/Assets/*";
    diorama::Range angle_deg{-180.0, 180.0};
    diorama::Range scale{1.0, 1.0};
    void visit(diorama::ParamVisitor& v) {
      v.param("nodes", nodes, {"Pattern of the nodes to turn.", diorama::kNodePattern});
      v.param("angle_deg", angle_deg, {"Turn about the world's z axis.", "deg", -360.0, 360.0});
      v.param("scale", scale, {"Factor of the size.", "", 0.01, 100.0});
    }
  };
  @CLASS@(Params params, diorama::Host&) : params_(std::move(params)) {}

  void randomize(diorama::Scene& scene, const diorama::RandomizeContext&,
                 const diorama::Rng& rng) override {
    for (const diorama::NodeId node : scene.match(params_.nodes)) {
      // A stream per node: one more node leaves the turns of the others as they were.
      diorama::Rng own = rng.fork(scene.path(node));
      const double angle =
          own.uniform(params_.angle_deg.lo, params_.angle_deg.hi) * diorama::kPi / 180.0;
      const double scale = own.uniform(params_.scale.lo, params_.scale.hi);

      diorama::Affine world_from_node = scene.world_from_node(node);
      const Eigen::AngleAxisd turn(angle, diorama::Vec3::UnitZ());
      world_from_node.linear() = scale * turn.toRotationMatrix() * world_from_node.linear();
      const diorama::Affine world_from_parent = scene.world_from_node(scene[node].parent);
      scene.set_pose(node, world_from_parent.inverse() * world_from_node);
    }
  }

 private:
  Params params_;
};

}  // namespace

DIORAMA_PLUGIN("@NAME@", "0.1.0", "@LICENCE@") {
  DIORAMA_ADD(@CLASS@, "@NAME@", "Turns and scales nodes at random.");
}
