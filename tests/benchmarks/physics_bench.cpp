// SPDX-License-Identifier: Apache-2.0

/// The physics of a visit beside Bullet's own world with the same bodies: where the time goes.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdint>
#include <iostream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "diorama/rng.h"
#include "framework/host/machine_limits.h"
#include "framework/pipeline/scene_setup.h"
#include "framework/pipeline/settling.h"
#include "loader_dining_room/dining_room.h"
#include "physics_bullet/body_builder.h"
#include "physics_bullet/bullet_backend.h"
#include "support/plain_host.h"
#include "support/sample_meshes.h"

using namespace diorama;

namespace {

constexpr int kSteps = 204;
constexpr int kStepsAtOnce = 5;  // as the pipeline takes them

/// A furnished room of the sample pack with things above its table, as in the default job.
struct Visit {
  Visit(std::uint64_t seed, int count, const std::vector<std::shared_ptr<const Mesh>>& meshes,
        test::PlainHost& host) {
    environment = scene.create(scene.root(), "Environment");
    dining_room::build_dining_room(seed, host, scene, environment);
    EnvironmentRules rules;
    rules.box_colliders = {"TableDining"};
    rules.working_area = "TableDining";
    const Vec3 middle = apply_environment_rules(rules, false, environment, scene, host);
    const Aabb above{Vec3(-0.9, -0.9, 1.0), Vec3(0.9, 0.9, 1.6)};
    Rng rng(seed);
    for (int i = 0; i < count; ++i) {
      const NodeId id = scene.create(scene.root(), "thing_" + std::to_string(i));
      Node& node = scene.edit(id);
      node.mesh = meshes[rng.index(meshes.size())];
      node.collider = Collider{};
      node.collider->shape = ColliderShape::ConvexHull;
      node.rigid_body = RigidBody{};
      Transform pose;
      pose.translation = middle + rng.uniform_in(above);
      pose.rotation = rng.uniform_rotation();
      pose.scale = Vec3::Constant(rng.uniform(0.3, 1.15));
      things.push_back(id);
      starts.push_back(pose.affine());
    }
  }

  /// Puts the things where they fall from.
  void lift() {
    for (std::size_t i = 0; i < things.size(); ++i) scene.set_pose(things[i], starts[i]);
  }

  Scene scene;
  NodeId environment;
  std::vector<NodeId> things;
  std::vector<Affine> starts;
};

using Times = std::map<std::string, double>;

/// Bullet's own world, with the bodies and the settings of the backend.
void run_raw(const Visit& visit, const BulletBackend::Params& params, ShapeCache& cache,
             Times& times) {
  Bodies bodies = build_bodies(visit.scene, params, cache);
  btDefaultCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher(&configuration);
  btDbvtBroadphase broadphase;
  btSequentialImpulseConstraintSolver solver;
  btDiscreteDynamicsWorld world(&dispatcher, &broadphase, &solver, &configuration);
  world.setGravity(btVector3(params.gravity.x(), params.gravity.y(), params.gravity.z()));
  world.getSolverInfo().m_numIterations = params.solver_iterations;
  world.getSolverInfo().m_splitImpulse = true;
  for (const StaticObject& fixed : bodies.statics) {
    world.addCollisionObject(fixed.object.get(), btBroadphaseProxy::StaticFilter,
                             btBroadphaseProxy::AllFilter ^ btBroadphaseProxy::StaticFilter);
  }
  for (const MovingBody& moving : bodies.moving) world.addRigidBody(moving.body.get());
  const double start = cpu_seconds();
  for (int i = 0; i < kSteps * params.sub_steps; ++i) {
    world.stepSimulation(params.step_seconds / params.sub_steps, 0);
  }
  times["raw steps"] += cpu_seconds() - start;
  for (const MovingBody& moving : bodies.moving) world.removeRigidBody(moving.body.get());
  for (const StaticObject& fixed : bodies.statics) world.removeCollisionObject(fixed.object.get());
}

void run_backend(Visit& visit, BulletBackend& physics, double rest_speed, Times& times) {
  double start = cpu_seconds();
  const auto lap = [&](const char* phase) {
    const double now = cpu_seconds();
    times[phase] += now - start;
    start = now;
  };
  physics.reset(visit.scene);
  lap("reset, shapes known");
  const Room room(visit.scene, visit.environment);
  lap("room");
  for (int taken = 0; taken < kSteps;) {
    const int now = std::min(kStepsAtOnce, kSteps - taken);
    physics.advance(visit.scene, now - 1);
    const BodyPoses before = body_poses(visit.scene);
    physics.advance(visit.scene, 1);
    lap("steps and poses");
    static_cast<void>(fastest_falling(visit.scene, room, visit.things,
                                      {before, physics.step_seconds()}) > rest_speed);
    lap("who still moves");
    taken += now;
  }
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Physics of visits beside Bullet's own world with the same bodies");
  int things = 26;
  int rooms = 5;
  int rounds = 3;
  app.add_option("--things", things, "Falling things in each room")->capture_default_str();
  app.add_option("--rooms", rooms, "Rooms of the sample pack")->capture_default_str();
  app.add_option("--rounds", rounds, "Times that all is done, by turns")->capture_default_str();
  CLI11_PARSE(app, argc, argv);

  test::PlainHost host;
  const BulletBackend::Params params;
  const auto meshes = test::sample_meshes(host);
  Times times;
  for (int room = 1; room <= rooms; ++room) {
    BulletBackend physics(params, host);
    ShapeCache cache(std::size_t(params.hull_vertices), params.margin_m);
    Visit visit(std::uint64_t(room), things, meshes, host);
    visit.lift();
    const double start = cpu_seconds();
    physics.reset(visit.scene);
    times["reset, shapes new"] += (cpu_seconds() - start) * rounds;
    static_cast<void>(build_bodies(visit.scene, params, cache));
    for (int round = 0; round < rounds; ++round) {
      visit.lift();
      run_raw(visit, params, cache, times);
      run_backend(visit, physics, 0.05, times);
    }
  }
  const double visits = double(rooms) * rounds;
  nlohmann::ordered_json result;
  result["things"] = things;
  for (const auto& [phase, seconds] : times) result["cpu_s_per_visit"][phase] = seconds / visits;
  result["steps_over_raw"] = times["steps and poses"] / times["raw steps"];
  const double all = times["reset, shapes known"] + times["room"] + times["steps and poses"] +
                     times["who still moves"];
  result["visit_over_raw"] = all / times["raw steps"];
  std::cout << result.dump(2) << "\n";
  return 0;
}
