// SPDX-License-Identifier: Apache-2.0
#include "plugins/loader_usd/loaded_stage.h"
#include "support/catch.h"
#include "support/temporary_folder.h"

namespace diorama::loader_usd {

using test::LoadedStage;
using test::TemporaryFolder;

namespace {

std::string physics_stage(const std::string& units, const std::string& body) {
  return "#usda 1.0\n(\n" + units + "    upAxis = \"Z\"\n)\n" + body;
}

const std::string kWoodenCube = R"(
def Xform "Body" (
    prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"]
)
{
    float physics:density = 500
    def Cube "Shape" (
        prepend apiSchemas = ["PhysicsCollisionAPI"]
    )
    {
        double size = 2
        double3 xformOp:scale = (1, 1, 0.5)
        uniform token[] xformOpOrder = ["xformOp:scale"]
    }
}
)";

}  // namespace

TEST_CASE("density and volume make a mass in kilograms", "[loader_usd]") {
  const TemporaryFolder folder;
  LoadedStage metres(folder.write("a.usda", physics_stage("    metersPerUnit = 1\n", kWoodenCube)));
  CHECK(metres.node("Body").rigid_body->mass_kg == Approx(500.0 * 4.0));
  // The same numbers in centimetres: as much per cubic centimetre.
  LoadedStage centimetres(
      folder.write("b.usda", physics_stage("    metersPerUnit = 0.01\n", kWoodenCube)));
  CHECK(centimetres.node("Body").rigid_body->mass_kg == Approx(500.0 * 4.0));
  LoadedStage grams(folder.write(
      "c.usda",
      physics_stage("    metersPerUnit = 0.01\n    kilogramsPerUnit = 0.001\n", kWoodenCube)));
  CHECK(grams.node("Body").rigid_body->mass_kg == Approx(2.0));
}

TEST_CASE("the density may stand in the physics material", "[loader_usd]") {
  const TemporaryFolder folder;
  LoadedStage loaded(folder.write("a.usda", physics_stage("    metersPerUnit = 1\n", R"(
def Cube "Body" (
    prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsCollisionAPI"]
)
{
    double size = 1
    rel material:binding:physics = </Stone>
}
def Material "Stone" (
    prepend apiSchemas = ["PhysicsMaterialAPI"]
)
{
    float physics:density = 2500
    float physics:dynamicFriction = 0.8
}
)")));
  CHECK(loaded.node("Body").rigid_body->mass_kg == Approx(2500.0));
  CHECK(loaded.node("Body").collider->friction == Approx(0.8));
}

TEST_CASE("a body weighs what its parts say", "[loader_usd]") {
  const TemporaryFolder folder;
  const std::string parts = R"(
    float physics:density = 100
    def Cube "Heavy" ( prepend apiSchemas = ["PhysicsCollisionAPI", "PhysicsMassAPI"] )
    {
        double size = 1
        float physics:mass = 7
    }
    def Cube "Dense" ( prepend apiSchemas = ["PhysicsCollisionAPI", "PhysicsMassAPI"] )
    {
        double size = 1
        float physics:density = 30
    }
    def Cube "Plain" ( prepend apiSchemas = ["PhysicsCollisionAPI"] )
    {
        double size = 1
    }
    def Cube "Own" ( prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"] )
    {
        double size = 1
        float physics:mass = 1000
    }
)";
  const auto body = [&](const std::string& more) {
    return physics_stage("    metersPerUnit = 1\n", R"(
def Xform "Body" ( prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"] )
{)" + parts + more + "}\n");
  };
  // The part with a mass counts by it, the next one by its own density, the third by the body's.
  LoadedStage summed(folder.write("a.usda", body("")));
  CHECK(summed.node("Body").rigid_body->mass_kg == Approx(7.0 + 30.0 + 100.0));
  LoadedStage stated(folder.write("b.usda", body("    float physics:mass = 3\n")));
  CHECK(stated.node("Body").rigid_body->mass_kg == Approx(3.0));
}

TEST_CASE("velocities become metres and radians per second of the world", "[loader_usd]") {
  const TemporaryFolder folder;
  LoadedStage loaded(folder.write("a.usda", R"(#usda 1.0
(
    metersPerUnit = 0.01
    upAxis = "Y"
)
def Cube "Body" ( prepend apiSchemas = ["PhysicsRigidBodyAPI"] )
{
    vector3f physics:velocity = (100, 200, 300)
    vector3f physics:angularVelocity = (0, 180, 0)
}
)"));
  const RigidBody& body = *loaded.node("Body").rigid_body;
  CHECK(body.linear_velocity.isApprox(Vec3(1.0, -3.0, 2.0), 1e-6));
  CHECK(body.angular_velocity.isApprox(Vec3(0.0, 0.0, kPi), 1e-6));
}

}  // namespace diorama::loader_usd
