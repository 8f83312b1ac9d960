// SPDX-License-Identifier: Apache-2.0
#include "diorama/joints.h"

#include <algorithm>
#include <filesystem>

#include "plugins/loader_usd/loaded_stage.h"
#include "support/catch.h"
#include "support/shared_data.h"
#include "support/temporary_folder.h"

namespace diorama::loader_usd {

using test::LoadedStage;
using test::TemporaryFolder;

namespace {

/// A lid on a box in centimetres and y up, hinged 10 cm above the box's middle.
std::string lid(const std::string& words) {
  return R"(#usda 1.0
(
    metersPerUnit = 0.01
    upAxis = "Y"
)
def Xform "Chest"
{
    double3 xformOp:translate = (30, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def Xform "box" ( prepend apiSchemas = ["PhysicsRigidBodyAPI"] )
    {
        double3 xformOp:translate = (0, 5, 0)
        double3 xformOp:scale = (20, 10, 4)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
        def Cube "shape"
        {
            double size = 1
        }
    }
    def Xform "lid" ( prepend apiSchemas = ["PhysicsRigidBodyAPI"] )
    {
        double3 xformOp:translate = (10, 16, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
        def Cube "shape"
        {
            double size = 2
        }
    }
    def PhysicsRevoluteJoint "hinge"
    {
        uniform token physics:axis = "Z"
        rel physics:body0 = </Chest/box>
        rel physics:body1 = </Chest/lid/shape>
        point3f physics:localPos0 = (0, 1.1, 0)
        point3f physics:localPos1 = (-10, 0, 0)
)" + words +
         "    }\n}\n";
}

std::string warnings(LoadedStage& loaded) {
  std::string all;
  for (const std::string& line : loaded.host.warnings) all += line + "\n";
  return all;
}

}  // namespace

TEST_CASE("a UsdPhysics joint turns its child where it says, in metres and z up", "[loader_usd]") {
  const TemporaryFolder folder;
  LoadedStage loaded(folder.write(
      "a.usda", lid("float physics:lowerLimit = -30\nfloat physics:upperLimit = 90\n")));
  const NodeId hinge = loaded.scene.require("/asset/Chest/hinge");
  const Joint& joint = *loaded.scene[hinge].joint;
  CHECK(joint.kind == JointKind::Revolute);
  CHECK(loaded.scene.path(joint.parent_body) == "/asset/Chest/box");
  // The shape belongs to the body above it.
  CHECK(loaded.scene.path(joint.child_body) == "/asset/Chest/lid");
  CHECK(joint.lower == Approx(-kPi / 6.0));
  CHECK(joint.upper == Approx(kPi / 2.0));
  CHECK(joint_position(loaded.scene, hinge) == Approx(0.0).margin(1e-12));
  // Up by 10 cm where it was 10 cm beside the hinge: stage z is the world's -y, stage y its z.
  pose_joints(loaded.scene, std::vector<JointTarget>{{hinge, 0.5 * kPi}});
  const Vec3 place =
      loaded.scene.world_from_node(loaded.scene.require("/asset/Chest/lid")).translation();
  CHECK((place - Vec3(0.30, 0.0, 0.26)).norm() < 1e-7);
  CHECK(joint_position(loaded.scene, hinge) == Approx(0.5 * kPi));
  CHECK(warnings(loaded).empty());
}

TEST_CASE("joints with words that cannot be hold nothing or have no limit", "[loader_usd]") {
  const TemporaryFolder folder;
  const auto load = [&](const std::string& words, bool is_held, const std::string& warning) {
    INFO(words);
    LoadedStage loaded(folder.write("a.usda", lid(words)));
    const auto& joint = loaded.node("Chest/hinge").joint;
    CHECK(joint.has_value() == is_held);
    CHECK(warnings(loaded).find(warning) != std::string::npos);
    if (!joint) return;
    CHECK(joint->lower == -kInfinity);
    CHECK(joint->upper == kInfinity);
    CHECK(joint->parent_from_joint.matrix().allFinite());
  };
  load("float physics:lowerLimit = nan\n", true, "a limit that is no number");
  load("float physics:lowerLimit = 5\nfloat physics:upperLimit = 4\n", true,
       "limits that are no interval");
  load("quatf physics:localRot0 = (nan, 0, 0, 0)\n", true, "whose place is no number");
  load("quatf physics:localRot1 = (0, 0, 0, 0)\n", true, "whose place is no number");
  load("bool physics:jointEnabled = 0\n", false, "");
}

TEST_CASE("joints of bodies that are not there are one warning", "[loader_usd]") {
  const TemporaryFolder folder;
  LoadedStage loaded(folder.write("a.usda", R"(#usda 1.0
def Xform "A" ( prepend apiSchemas = ["PhysicsRigidBodyAPI"] )
{
}
def PhysicsFixedJoint "lost"
{
    rel physics:body0 = </A>
    rel physics:body1 = </B>
}
def PhysicsFixedJoint "self"
{
    rel physics:body0 = </A>
    rel physics:body1 = </A>
}
def PhysicsFixedJoint "none"
{
}
def PhysicsFixedJoint "held"
{
    rel physics:body0 = </A>
}
def PhysicsDistanceJoint "rope"
{
    rel physics:body0 = </A>
}
)"));
  for (const char* name : {"lost", "self", "none"}) CHECK_FALSE(loaded.node(name).joint);
  CHECK(loaded.scene.path(loaded.node("held").joint->parent_body) == "/asset/world");
  const std::string all = warnings(loaded);
  CHECK(all.find("<lost> is a joint of a body that is not there") == std::string::npos);
  CHECK(all.find("</lost> is a joint of a body that is not there, and holds nothing (</B>)") !=
        std::string::npos);
  CHECK(all.find("is a joint of a body with itself, and holds nothing, like 1 more of them") !=
        std::string::npos);
  CHECK(all.find("is of type PhysicsDistanceJoint, which does not hold bodies together") !=
        std::string::npos);
}

TEST_CASE("joints of any freedom are what is left of it", "[loader_usd]") {
  const auto limits = [](const std::string& free) {
    std::string text;
    for (const char* word : {"transX", "transY", "transZ", "rotX", "rotY", "rotZ"}) {
      if (free.find(word) != std::string::npos) continue;
      text += "    float limit:" + std::string(word) +
              ":physics:low = 1\n    float limit:" + std::string(word) + ":physics:high = -1\n";
    }
    return text;
  };
  const std::string bodies = "    rel physics:body0 = </A>\n    rel physics:body1 = </B>\n";
  const TemporaryFolder folder;
  LoadedStage loaded(folder.write(
      "a.usda",
      "#usda 1.0\n"
      "def Cube \"A\" (prepend apiSchemas = [\"PhysicsRigidBodyAPI\"])\n{\n}\n"
      "def Cube \"B\" (prepend apiSchemas = [\"PhysicsRigidBodyAPI\"])\n{\n}\n"
      "def PhysicsJoint \"turn\"\n{\n" +
          bodies + limits("rotY") +
          "    float limit:rotY:physics:low = -30\n    float limit:rotY:physics:high = 90\n}\n"
          "def PhysicsJoint \"slide\"\n{\n" +
          bodies + limits("transZ") +
          "}\n"
          "def PhysicsJoint \"none\"\n{\n" +
          bodies + limits("") +
          "}\n"
          "def PhysicsJoint \"hip\"\n{\n" +
          bodies + limits("rotX rotY rotZ") +
          "    float limit:rotX:physics:low = -10\n    float limit:rotX:physics:high = 20\n"
          "    float limit:rotY:physics:low = -110\n    float limit:rotY:physics:high = 5\n"
          "    float limit:rotZ:physics:low = -30\n    float limit:rotZ:physics:high = 30\n}\n"
          "def PhysicsSphericalJoint \"ball\"\n{\n" +
          bodies +
          "    uniform token physics:axis = \"Y\"\n    float physics:coneAngle0Limit = 60\n}\n"
          "def PhysicsJoint \"loose\"\n{\n" +
          bodies + "}\n"));
  const Joint& turn = *loaded.node("turn").joint;
  CHECK(turn.kind == JointKind::Revolute);
  CHECK(turn.axis == Vec3::UnitY());
  CHECK(turn.lower == Approx(-kPi / 6.0));
  CHECK(turn.upper == Approx(kPi / 2.0));
  CHECK(loaded.node("slide").joint->kind == JointKind::Prismatic);
  CHECK(loaded.node("slide").joint->axis == Vec3::UnitZ());
  CHECK(loaded.node("slide").joint->upper == kInfinity);
  CHECK(loaded.node("none").joint->kind == JointKind::Fixed);
  // Of several: a chain, from the parent to the child. What turns most is not in the middle.
  const auto chain = [&](const std::string& name) {
    std::string all;
    CHECK_FALSE(loaded.node(name).joint);
    for (const NodeId id : loaded.node(name).children) all += loaded.scene[id].name + " ";
    return all;
  };
  CHECK(chain("hip") == "rotY rotX rotZ ");
  CHECK(chain("ball") == "rotX rotZ rotY ");
  CHECK(chain("loose") == "transX transY transZ rotX rotY rotZ ");
  CHECK(compound_joints(loaded.scene).size() == 3);
  const Joint& first = *loaded.node("hip/rotY").joint;
  CHECK(loaded.scene.path(first.parent_body) == "/asset/A");
  CHECK(loaded.scene.path(first.child_body) == "/asset/hip/rotY");
  CHECK(first.lower == Approx(-110.0 * kPi / 180.0));
  const Joint& last = *loaded.node("hip/rotZ").joint;
  CHECK(loaded.scene.path(last.parent_body) == "/asset/hip/rotX");
  CHECK(loaded.scene.path(last.child_body) == "/asset/B");
  // Both tilts at their most are within the cone.
  CHECK(loaded.node("ball/rotZ").joint->upper == Approx(std::sqrt(0.5) * kPi / 3.0));
  CHECK(loaded.node("ball/rotX").joint->upper == kInfinity);
  CHECK(loaded.node("ball/rotY").joint->upper == kInfinity);
  CHECK(loaded.node("loose/transX").joint->upper == kInfinity);
  CHECK(warnings(loaded).empty());
}

TEST_CASE("a joint of several axes that ends in the world begins there", "[loader_usd]") {
  const TemporaryFolder folder;
  LoadedStage loaded(folder.write("a.usda", R"(#usda 1.0
def Xform "A" ( prepend apiSchemas = ["PhysicsRigidBodyAPI"] )
{
}
def PhysicsSphericalJoint "hip"
{
    rel physics:body0 = </A>
    float physics:coneAngle0Limit = 60
    float physics:coneAngle1Limit = 60
}
def PhysicsJoint "both"
{
    rel physics:body0 = </A>
}
)"));
  std::string names;
  for (const NodeId id : loaded.node("hip").children) names += loaded.scene[id].name + " ";
  CHECK(names == "rotX rotZ rotY ");
  const Joint& first = *loaded.node("hip/rotX").joint;
  CHECK(loaded.scene.path(first.parent_body) == "/asset/world");
  CHECK(first.axis == Vec3(-Vec3::UnitX()));
  CHECK(loaded.scene.path(loaded.node("hip/rotY").joint->child_body) == "/asset/A");
  CHECK(compound_joints(loaded.scene).size() == 1);
  CHECK(loaded.node("both").children.empty());
  CHECK(warnings(loaded).find("</both> is a joint to the world that slides and turns") !=
        std::string::npos);
}

TEST_CASE("a joint of several axes in a prim without a size holds nothing", "[loader_usd]") {
  const TemporaryFolder folder;
  LoadedStage loaded(folder.write("a.usda", R"(#usda 1.0
def Xform "A" ( prepend apiSchemas = ["PhysicsRigidBodyAPI"] )
{
}
def Xform "B" ( prepend apiSchemas = ["PhysicsRigidBodyAPI"] )
{
}
def Xform "flat"
{
    float3 xformOp:scale = (0, 1, 1)
    uniform token[] xformOpOrder = ["xformOp:scale"]
    def PhysicsJoint "hip"
    {
        rel physics:body0 = </A>
        rel physics:body1 = </B>
    }
}
)"));
  CHECK(joints_of(loaded.scene).empty());
  CHECK(warnings(loaded).find("in a prim without a size, and holds nothing") != std::string::npos);
}

TEST_CASE("bodies that stand turned at a joint of several axes begin so", "[loader_usd]") {
  const TemporaryFolder folder;
  LoadedStage loaded(folder.write("a.usda", R"(#usda 1.0
(
    metersPerUnit = 1
    upAxis = "Z"
)
def Xform "A" ( prepend apiSchemas = ["PhysicsRigidBodyAPI"] )
{
    float3 xformOp:scale = (2, 2, 2)
    uniform token[] xformOpOrder = ["xformOp:scale"]
}
def Xform "B" ( prepend apiSchemas = ["PhysicsRigidBodyAPI"] )
{
    double3 xformOp:translate = (0, 0, 0.5)
    float3 xformOp:rotateXYZ = (10, 20, 30)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
}
def PhysicsJoint "hip"
{
    rel physics:body0 = </A>
    rel physics:body1 = </B>
    float limit:transX:physics:low = 1
    float limit:transX:physics:high = -1
    float limit:transY:physics:low = 1
    float limit:transY:physics:high = -1
    float limit:rotZ:physics:low = -90
    float limit:rotZ:physics:high = 90
}
)"));
  const auto at = [&](const std::string& name) {
    return joint_position(loaded.scene, loaded.scene.require("/asset/hip/" + name));
  };
  CHECK(at("transZ") == Approx(0.5));
  // R = Rz(30) Ry(20) Rx(10) as turns about x, z, which alone has limits, and y in this order.
  const Mat3 turned =
      (Eigen::AngleAxisd(at("rotX"), Vec3::UnitX()) * Eigen::AngleAxisd(at("rotZ"), Vec3::UnitZ()) *
       Eigen::AngleAxisd(at("rotY"), Vec3::UnitY()))
          .toRotationMatrix();
  const double degree = kPi / 180.0;
  const Mat3 said = (Eigen::AngleAxisd(30 * degree, Vec3::UnitZ()) *
                     Eigen::AngleAxisd(20 * degree, Vec3::UnitY()) *
                     Eigen::AngleAxisd(10 * degree, Vec3::UnitX()))
                        .toRotationMatrix();
  CHECK(turned.isApprox(said, 1e-6));
}

TEST_CASE("foreign articulations are read and can be posed within their limits",
          "[loader_usd][shared]") {
  const auto shared = test::shared_folder();
  if (!shared) {
    WARN("the shared files are not there");
    return;
  }
  const std::filesystem::path folder = *shared / "data/usd/newton/newton";
  struct Known {
    const char* file;
    std::size_t joints;
  };
  for (const auto& [file, count] :
       {Known{"examples/assets/cartpole.usda", 4}, Known{"examples/assets/boxes_fourbar.usda", 4},
        Known{"tests/assets/revolute_articulation.usda", 2}, Known{"examples/assets/ant.usda", 8},
        // 21 axes, which 7 of its joints have two or three of, and 3 fixed ones.
        Known{"examples/assets/humanoid.usda", 24}}) {
    INFO(file);
    LoadedStage loaded((folder / file).string());
    const std::vector<NodeId> joints = joints_of(loaded.scene);
    CHECK(joints.size() == count);
    std::vector<JointTarget> targets;
    for (const NodeId id : joints) {
      const Joint& joint = *loaded.scene[id].joint;
      if (joint.kind == JointKind::Fixed) continue;
      targets.push_back(
          {id, std::clamp(0.7 * std::clamp(joint.upper, -1.0, 1.0), joint.lower, joint.upper)});
    }
    pose_joints(loaded.scene, targets);
    if (std::string(file).find("fourbar") != std::string::npos) continue;
    // No part stays behind: hinges and what is fixed meet where they are joined.
    for (const NodeId id : joints) {
      const Joint& joint = *loaded.scene[id].joint;
      if (joint.kind == JointKind::Prismatic) continue;
      INFO(loaded.scene.path(id));
      const Vec3 one =
          (loaded.scene.world_from_node(joint.parent_body) * joint.parent_from_joint).translation();
      const Vec3 other =
          (loaded.scene.world_from_node(joint.child_body) * joint.child_from_joint).translation();
      CHECK((one - other).norm() < 1e-4);
    }
  }
}

}  // namespace diorama::loader_usd
