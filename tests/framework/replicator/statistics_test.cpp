// SPDX-License-Identifier: Apache-2.0
// What the tutorial's built-in job draws, over 500 seeds, from its keys to the poses in the scene:
// every quantity fills its range and no more. The seeds are fixed, the level of each test is 0.001.
#include <cmath>
#include <map>

#include "diorama/error.h"
#include "dome_light.h"
#include "framework/config/yaml_config.h"
#include "framework/pipeline/capture_plan.h"
#include "framework/pipeline/fake_host.h"
#include "framework/pipeline/scene_setup.h"
#include "framework/replicator/dialect.h"
#include "orbit_cameras.h"
#include "random_colors.h"
#include "scatter_lights.h"
#include "scatter_poses.h"
#include "support/catch.h"
#include "support/statistics.h"

using namespace diorama;
using namespace diorama::test;

namespace {

const Vec3 kTable(3.0, -2.0, 0.8);
const std::vector<std::string> kProps{"box.usd", "cone.usd", "sign.usd", "bag.usd"};

/// The built-in job with one target, so that it is known which one a camera was placed round.
Job tutorial_job() {
  Value value = parse_yaml(builtin_replicator_job(), "built-in");
  value.find("labeled_assets")->find("auto_label")->set("num", Value::integer(1));
  value.find("labeled_assets")->set("manual_label", Value::make_list());
  Diagnostics diagnostics;
  const ReplicatorTranslation translation = translate_replicator_job(value, diagnostics);
  Job job = read_job(translation.job, diagnostics);
  diagnostics.raise();
  return job;
}

CapturePlan plan_of(const Job& job) {
  std::vector<std::vector<std::string>> assets(job.objects.size(), kProps);
  assets[1].clear();
  for (const char* shape : {"capsule", "cone", "cylinder", "sphere", "cube"}) {
    assets[1].push_back(std::string("shape:") + shape);
  }
  return plan_captures(job, {{"room.usdc", 0}}, assets);
}

template <class T>
std::unique_ptr<Randomizer> make(const ComponentConfig& config, Host& host) {
  Diagnostics diagnostics;
  ParamReader reader(config.map, config.path, diagnostics);
  typename T::Params params;
  params.visit(reader);
  reader.finish(host_keys("randomizers"));
  diagnostics.raise();
  return std::make_unique<T>(params, host);
}

std::unique_ptr<Randomizer> make_randomizer(const ComponentConfig& config, Host& host) {
  if (config.type == "scatter_poses") return make<ScatterPoses>(config, host);
  if (config.type == "scatter_lights") return make<ScatterLights>(config, host);
  if (config.type == "dome_light") return make<DomeLight>(config, host);
  if (config.type == "random_colors") return make<RandomColors>(config, host);
  if (config.type == "orbit_cameras") return make<OrbitCameras>(config, host);
  throw Error(ErrorKind::Internal, "the test does not know " + config.type);
}

/// A visit's scene without a room; every asset is a box whose centre is not its origin.
Scene scene_of(const Job& job, const CapturePlan& plan, FakeHost& host) {
  Mesh mesh = make_box(Vec3(0.1, 0.2, 0.3));
  for (Vec3f& position : mesh.positions) position.z() += 0.4f;
  const auto shared = std::make_shared<const Mesh>(mesh);
  const auto build = [&](Scene& scene, NodeId root) { scene.edit(root).mesh = shared; };
  for (const PlannedObject& object : plan.objects) host.assets[object.asset] = build;
  Scene scene;
  spawn_objects(plan.objects, job, scene, host);
  create_lights(job.lights, scene, host);
  create_cameras(job.cameras, scene);
  return scene;
}

class Tutorial {
 public:
  explicit Tutorial(std::uint64_t seed) {
    job.seed = seed;
    // What is drawn is in question here, not what has no room and is drawn again.
    for (RandomizerEntry& entry : job.randomizers) {
      if (entry.type == "scatter_lights") {
        entry.component.map.set("clearance_m", Value::number(0.0));
      }
    }
    plan = plan_of(job);
    scene = scene_of(job, plan, host);
  }
  void randomize(const std::string& moment) {
    RandomizeContext context;
    context.moment = moment;
    context.working_area_world = kTable;
    for (const RandomizerEntry& entry : job.randomizers) {
      if (entry.on.front() != moment) continue;
      make_randomizer(entry.component, host)
          ->randomize(scene, context, JobStreams(job.seed).randomizer(entry.name, 0, moment, 0));
    }
  }
  std::vector<Affine> poses(const char* pattern) const {
    std::vector<Affine> poses;
    for (const NodeId node : scene.match(pattern)) poses.push_back(scene.world_from_node(node));
    return poses;
  }

  Job job = tutorial_job();
  CapturePlan plan;
  FakeHost host;
  Scene scene;
};

/// Numbers by what they are of.
using Samples = std::map<std::string, std::vector<double>>;

void add_place(Samples& samples, const std::string& what, const Affine& pose) {
  const Vec3 offset = pose.translation() - kTable;
  samples[what + " x"].push_back(offset.x());
  samples[what + " y"].push_back(offset.y());
  samples[what + " z"].push_back(offset.z());
}

void add_objects(Samples& samples, const Tutorial& tutorial) {
  const std::pair<const char*, const char*> groups[] = {{"target", "/Assets/*"},
                                                        {"mesh", "/Distractors/Meshes/*"},
                                                        {"shape", "/Distractors/Shapes/*"}};
  for (const auto& [what, pattern] : groups) {
    for (const Affine& pose : tutorial.poses(pattern)) {
      add_place(samples, what, pose);
      samples[std::string(what) + " scale"].push_back(std::cbrt(pose.linear().determinant()));
      // Uniform on SO(3): any axis is uniform on the sphere, so its height is uniform.
      const Mat3 rotation = Transform::from_affine(pose).rotation.toRotationMatrix();
      for (int axis = 0; axis < 3; ++axis) {
        samples[std::string(what) + " axis"].push_back(rotation(2, axis));
      }
    }
  }
}

void add_lights(Samples& samples, const Tutorial& tutorial) {
  for (const NodeId node : tutorial.scene.match("/Lights/SphereLight_scene_*")) {
    add_place(samples, "light", tutorial.scene.world_from_node(node));
    // Colour and strength are drawn apart and kept multiplied.
    for (int channel = 0; channel < 3; ++channel) {
      samples["light color"].push_back(tutorial.scene[node].light->color[channel]);
    }
  }
  for (const NodeId node : tutorial.scene.match("/Distractors/Shapes/**")) {
    if (!tutorial.scene[node].mesh) continue;
    const Vec3f color = tutorial.scene[node].materials.front()->base_color;
    for (int channel = 0; channel < 3; ++channel) samples["shape color"].push_back(color[channel]);
  }
}

void add_cameras(Samples& samples, const Tutorial& tutorial, const std::string& series) {
  const Vec3 target =
      tutorial.scene.world_bounds(tutorial.scene.match("/Assets/*").front()).centre();
  for (const Affine& pose : tutorial.poses("/Cameras/*")) {
    const Vec3 away = pose.translation() - target;
    samples[series + " distance"].push_back(away.norm());
    samples[series + " polar"].push_back(std::acos(away.z() / away.norm()) * 180.0 / kPi);
    samples[series + " azimuth"].push_back(std::atan2(away.y(), away.x()));
    // How far the axis of view passes the target: the offset without its part along the axis.
    samples[series + " miss"].push_back(pose.linear().col(2).cross(away).norm());
  }
}

const Samples& samples() {
  static const Samples all = [] {
    Samples made;
    for (int seed = 0; seed < kSeeds; ++seed) {
      Tutorial tutorial{std::uint64_t(seed)};
      tutorial.randomize("environment");
      add_objects(made, tutorial);
      add_lights(made, tutorial);
      for (const char* series : {"floating", "dropped"}) {
        tutorial.randomize(series);
        add_cameras(made, tutorial, series);
      }
    }
    return made;
  }();
  return all;
}

bool fills_range(const std::string& what, double lo, double hi) {
  const std::vector<double>& numbers = samples().at(what);
  const Extent extent = extent_of(numbers);
  INFO(what << ": " << numbers.size() << " from " << extent.lo << " to " << extent.hi
            << ", chi-square " << chi_square(numbers, lo, hi));
  const bool does = fills(numbers, lo, hi);
  CHECK(does);
  return does;
}

/// Level 0.001, for degrees of freedom up to 8.
double chi_square_limit(std::size_t degrees) {
  constexpr double kLimits[] = {0, 10.83, 13.82, 16.27, 18.47, 20.52, 22.46, 24.32, 26.12};
  return kLimits[degrees];
}

void check_even(const std::map<std::string, int>& count, std::size_t kinds) {
  REQUIRE(count.size() == kinds);
  double all = 0.0;
  for (const auto& [name, times] : count) all += times;
  const double expected = all / double(kinds);
  double sum = 0.0;
  for (const auto& [name, times] : count) sum += (times - expected) * (times - expected) / expected;
  CHECK(sum < chi_square_limit(kinds - 1));
}

}  // namespace

TEST_CASE("The tutorial's objects fill their ranges above the table", "[replicator][statistics]") {
  constexpr double kSlack = 1e-9;  // of sums and cube roots
  for (const auto& [what, half, top] :
       {std::tuple{"target", 0.5, 1.5}, {"mesh", 1.0, 2.0}, {"shape", 1.5, 2.0}}) {
    const std::string name = what;
    fills_range(name + " x", -half - kSlack, half + kSlack);
    fills_range(name + " y", -half - kSlack, half + kSlack);
    fills_range(name + " z", 1.0 - kSlack, top + kSlack);
    fills_range(name + " axis", -1.0 - kSlack, 1.0 + kSlack);
  }
  fills_range("target scale", 0.95 - kSlack, 1.15 + kSlack);
  fills_range("mesh scale", 0.3 - kSlack, 1.0 + kSlack);
  fills_range("shape scale", 0.01 - kSlack, 0.1 + kSlack);
}

TEST_CASE("The tutorial's lights and colours fill their ranges", "[replicator][statistics]") {
  fills_range("light x", -2.0, 2.0);
  fills_range("light y", -2.0, 2.0);
  fills_range("light z", 1.0, 3.0);
  fills_range("shape color", 0.0, 1.0);
  // 500 to 2500 nits times 0.1 to 0.9.
  const Extent extent = extent_of(samples().at("light color"));
  CHECK(extent.lo >= 50.0);
  CHECK(extent.lo < 75.0);
  CHECK(extent.hi <= 2250.0);
  CHECK(extent.hi > 2150.0);
}

TEST_CASE("The tutorial's cameras keep to their ranges, seen from the target",
          "[replicator][statistics]") {
  constexpr double kSlack = 1e-6;
  for (const auto& [series, polar] : {std::pair{"floating", 75.0}, {"dropped", 45.0}}) {
    const std::string name = series;
    fills_range(name + " distance", 1.15 - kSlack, 1.45 + kSlack);
    fills_range(name + " polar", 0.0, polar + kSlack);
    fills_range(name + " azimuth", -kPi, kPi);
    // Off the target by at most the corner of the offset's cube.
    const Extent miss = extent_of(samples().at(name + " miss"));
    CHECK(miss.hi < 0.1 * std::sqrt(3.0) * 1.45 / 1.15);
    CHECK(miss.hi > 0.12);
  }
}

TEST_CASE("The tutorial's picks are even and gravity keeps its chance",
          "[replicator][statistics]") {
  std::map<std::string, int> shapes, meshes, skies;
  std::map<std::size_t, std::pair<int, int>> floating;  // group: floating, all
  for (int seed = 0; seed < kSeeds; ++seed) {
    Tutorial tutorial{std::uint64_t(seed)};
    tutorial.randomize("environment");
    const NodeId dome = tutorial.scene.match("/Lights/DomeLight_*").front();
    ++skies[tutorial.scene[dome].light->texture->name];
    for (const PlannedObject& object : tutorial.plan.objects) {
      if (object.group == 1) ++shapes[object.asset];
      if (object.group == 2) ++meshes[object.asset];
      floating[object.group].first += object.floats ? 1 : 0;
      ++floating[object.group].second;
    }
  }
  check_even(shapes, 5);
  check_even(meshes, kProps.size());
  check_even(skies, 9);
  for (const auto& [group, count] : floating) {
    const double expected = 0.25 * count.second;
    const double deviation = std::sqrt(0.25 * 0.75 * count.second);
    INFO("group " << group << ": " << count.first << " of " << count.second);
    CHECK(std::abs(count.first - expected) < 3.29 * deviation);
  }
}
