// SPDX-License-Identifier: Apache-2.0
#include "framework/replicator/object_based.h"

#include <algorithm>

#include "diorama/error.h"
#include "framework/config/value_text.h"
#include "framework/config/yaml_config.h"
#include "framework/pipeline/job.h"
#include "replicator_diagnostics.h"
#include "support/catch.h"

using namespace diorama;
using diorama::test::complaints_about;

namespace {

struct Translated {
  Job job;
  Value native;
  std::string without_effect;
};

Translated translated(const std::string& yaml) {
  Diagnostics diagnostics;
  ReplicatorTranslation translation =
      translate_replicator_job(parse_yaml(yaml, "job.yaml"), diagnostics);
  Translated result;
  result.job = read_job(translation.job, diagnostics);
  diagnostics.raise();
  result.native = std::move(translation.job);
  for (const std::string& key : translation.without_effect) result.without_effect += key + "\n";
  return result;
}

const RandomizerEntry& randomizer(const Job& job, const std::string& name) {
  for (const RandomizerEntry& entry : job.randomizers) {
    if (entry.name == name) return entry;
  }
  FAIL("no randomizer is called " << name);
  return job.randomizers.front();
}

std::string key_of(const Job& job, const std::string& name, const char* key) {
  const Value* value = randomizer(job, name).component.map.find(key);
  std::string text = value ? to_json(*value, 0) : "";
  std::erase(text, ' ');
  return text;
}

/// The timeline as it happens, in short.
std::string happening(const Job& job) {
  std::string text;
  for_each_step(job.timeline, [&](const TimelineStep& step) {
    if (step.kind == TimelineStep::Kind::Simulate) {
      text += std::to_string(step.steps) + (step.camera_radius_m > 0 ? "push " : " ");
    } else {
      text += step.name + " ";
    }
    return true;
  });
  return text;
}

}  // namespace

TEST_CASE("Any key of object-based jobs tells their dialect", "[replicator]") {
  const auto is_object_based = [](const char* yaml) {
    return is_object_based_job(parse_yaml(yaml, "job.yaml"));
  };
  CHECK(is_object_based("writer_type: PoseWriter"));
  CHECK(is_object_based("labeled_assets_and_properties: []"));
  CHECK(is_object_based("{num_frames: 3, seed: 4}"));
  CHECK_FALSE(is_object_based("labeled_assets: {}"));
  CHECK_FALSE(is_object_based("writers: [{type: BasicWriter}]"));
  CHECK(is_replicator_section("mesh_distractors_num"));
  CHECK_FALSE(is_replicator_section("renderer"));
}

TEST_CASE("The built-in object-based job has the example's defaults", "[replicator]") {
  const Job job = translated(builtin_object_based_job()).job;
  CHECK(job.seed == 42);
  CHECK(job.total_captures == 4);
  CHECK(job.environments[0].type == "empty");
  CHECK(job.environment.walls == std::vector<double>{4, 4, 3});
  CHECK(job.environment.colliders == "none");
  REQUIRE(job.objects.size() == 4);
  CHECK(job.objects[0].label == "pudding_box");
  CHECK(job.objects[0].count == 5);
  CHECK(job.objects[0].under == "/Assets/pudding_box");
  CHECK(job.objects[0].gravity_disabled_chance == 1.0);
  CHECK(job.objects[1].count == 7);
  CHECK(job.objects[2].count == 350);
  CHECK(job.objects[2].label == std::nullopt);
  CHECK(job.objects[2].gravity_disabled_chance == 0.5);
  CHECK(job.objects[3].count == 75);
  REQUIRE(job.cameras.size() == 1);
  CHECK(job.cameras[0].count == 2);
  CHECK(job.cameras[0].near_m == 0.01);
  CHECK(job.cameras[0].far_m == 10000);
  CHECK(job.settle.policy == "keep");
  CHECK(job.writers[0].type == "PoseWriter");
  CHECK(job.writers[0].output_dir == "_out_obj_based_sdg_pose_writer");
  CHECK(happening(job) == "1 cameras 4push frame 2 3 frame 3 frame 3 cameras 4push frame 3 ");
  REQUIRE(job.lights.size() == 3);
  CHECK(job.lights[2].type == "distant");
  CHECK(key_of(job, "pudding_box_poses", "scale") == "[0.85,1.25]");
  CHECK(key_of(job, "shape_distractor_poses", "scale") == "[0.015,0.15]");
  CHECK(key_of(job, "camera_poses", "distance") == "[0.25,0.75]");
  CHECK(key_of(job, "camera_poses", "look_at_offset") == "[-0.15,0.15]");
  CHECK(randomizer(job, "sphere_lights").every == 5);
  CHECK(randomizer(job, "shape_distractor_colors").every == 15);
  CHECK(randomizer(job, "dome_background").every == 25);
  CHECK(randomizer(job, "drift").every == 17);
  CHECK(randomizer(job, "pull_targets").every == 10);
  CHECK(randomizer(job, "bounce").on == std::vector<std::string>{"bounce"});
}

TEST_CASE("Each key of an object-based file has its effect", "[replicator]") {
  const Job job = translated(R"(
launch_config: {renderer: PathTracing}
env_url: /Isaac/Environments/Office/office.usd
working_area_size: [2, 6, 1]
rt_subframes: 5
num_frames: 3
num_cameras: 3
camera_collider_radius: 0
simulation_duration_between_captures: 0.12
resolution: [320, 200]
camera_properties_kwargs: {focalLength: 35, fStop: 2.8, focusDistance: 0.5, clippingRange: [0.2, 50], horizontal_aperture: 30}
camera_look_at_target_offset: 0.4
camera_distance_to_target_min_max: [1, 2]
writer_type: BasicWriter
writer_kwargs: {output_dir: out, rgb: true, use_common_output_dir: true}
labeled_assets_and_properties:
  - {url: a.usd, label: cup, count: 2, floating: false, scale_min_max: [2, 3]}
  - {url: b.usd, label: cup, randomize_scale: [4, 5], scale_min_max: [2, 3]}
  - {url: c.usd}
shape_distractors_types: [cube]
shape_distractors_scale_min_max: [0.1, 0.2]
shape_distractors_num: 6
mesh_distractors_urls: [d.usd, e.usd]
mesh_distractors_scale_min_max: [0.3, 0.4]
mesh_distractors_num: 7
)")
                      .job;
  CHECK(job.environments[0].type == "files");
  CHECK(to_json(*job.environments[0].map.find("files"), 0) ==
        "[\"/Isaac/Environments/Office/office.usd\"]");
  CHECK(key_of(job, "no_labels", "nodes") == "\"/Environment/**\"");
  CHECK(job.lights.size() == 2);
  CHECK(job.environment.walls == std::vector<double>{2, 6, 1});
  CHECK(key_of(job, "cup_poses", "offset") == "[[-1,1],[-3,3],[-0.5,0.5]]");
  CHECK(key_of(job, "bounce", "box_min") == "[-0.99,-2.97,-0.4995]");
  CHECK(key_of(job, "bounce", "box_max") == "[0.99,2.97,-0.4005]");
  CHECK(to_json(*job.renderer.map.find("samples"), 0) == "15");
  CHECK(to_json(*job.renderer.map.find("mode"), 0) == "\"path_traced\"");
  CHECK(happening(job) == "1 cameras frame 2 8 frame 8 frame 8 ");
  const CameraGroup& camera = job.cameras[0];
  CHECK(camera.count == 3);
  CHECK(camera.width == 320);
  CHECK(camera.height == 200);
  CHECK(camera.focal_length_mm == 35);
  CHECK(camera.horizontal_aperture_mm == 30);
  CHECK(camera.f_stop == 2.8);
  CHECK(camera.focus_distance_m == 0.5);
  CHECK(camera.near_m == 0.2);
  CHECK(camera.far_m == 50);
  CHECK(key_of(job, "camera_poses", "distance") == "[1,2]");
  CHECK(key_of(job, "camera_poses", "look_at_offset") == "[-0.4,0.4]");
  CHECK(key_of(job, "motion_blur", "exposure_time_s") ==
        "{\"sequence\":{\"items\":[0.025,0.025,0.025,0,0,0,0,0,0,0,0,0,0,0,0]}}");
  CHECK(job.writers[0].type == "BasicWriter");
  CHECK(job.writers[0].component.map.find("use_common_output_dir")->scalar == "true");
  CHECK(job.output.records == "out");
  REQUIRE(job.objects.size() == 5);
  CHECK(job.objects[0].count == 2);
  CHECK(job.objects[0].gravity_disabled_chance == 0.0);
  CHECK(job.objects[1].name == "cup_2");
  CHECK(job.objects[1].label == "cup");
  CHECK(job.objects[1].count == 1);
  CHECK(job.objects[2].label == "unknown");
  CHECK(job.objects[3].count == 6);
  CHECK(job.objects[4].count == 7);
  CHECK(key_of(job, "cup_poses", "scale") == "[2,3]");
  CHECK(key_of(job, "cup_2_poses", "scale") == "[4,5]");
  CHECK(key_of(job, "unknown_poses", "scale") == "[1,1]");
  CHECK(key_of(job, "mesh_distractor_poses", "scale") == "[0.3,0.4]");
}

TEST_CASE("Without distractors nothing is randomized about them", "[replicator]") {
  const Job job = translated("{shape_distractors_num: 0, mesh_distractors_num: 0}").job;
  CHECK(job.objects.size() == 2);
  for (const RandomizerEntry& entry : job.randomizers) {
    const Value* nodes = entry.component.map.find("nodes");
    CHECK_FALSE((nodes && nodes->scalar.starts_with("/Distractors")));
  }
}

TEST_CASE("What has no effect is named, what is unknown is refused", "[replicator]") {
  const std::string names = translated(
                                "{launch_config: {headless: true, width: 5}, "
                                "disable_render_products_between_captures: true, "
                                "camera_properties_kwargs: {verticalAperture: 15}}")
                                .without_effect;
  CHECK_THAT(names, ContainsSubstring("launch_config.headless (there is no window"));
  CHECK_THAT(names, ContainsSubstring("launch_config.width"));
  CHECK_THAT(names, ContainsSubstring("disable_render_products_between_captures (nothing"));
  CHECK_THAT(names, ContainsSubstring("camera_properties_kwargs.verticalAperture (pixels are"));

  CHECK_THAT(complaints_about("{num_frames: 3, num_camera: 2}"),
             ContainsSubstring("unknown key 'num_camera'; did you mean 'num_cameras'?"));
  CHECK_THAT(complaints_about("launch_config: {headles: true}"),
             ContainsSubstring("unknown key 'headles'; did you mean 'headless'?"));
  CHECK_THAT(complaints_about("launch_config: {renderer: PathTracng}"),
             ContainsSubstring("found 'PathTracng'; did you mean 'PathTracing'?"));
  CHECK_THAT(complaints_about("camera_properties_kwargs: {focal_lenght: 3}"),
             ContainsSubstring("focal_lenght"));
  CHECK_THAT(complaints_about("labeled_assets_and_properties: [{label: cup}]"),
             ContainsSubstring("labeled_assets_and_properties[0]: 'url' is missing"));
  CHECK_THAT(complaints_about("labeled_assets_and_properties: [{url: a, scale_minmax: [1, 2]}]"),
             ContainsSubstring("did you mean 'scale_min_max'?"));
  CHECK_THAT(complaints_about("labeled_assets_and_properties: {url: a}"),
             ContainsSubstring("expected a list of mappings"));
  CHECK_THAT(complaints_about("working_area_size: [4, 4]"),
             ContainsSubstring("working_area_size: expected [width, depth, height] in metres"));
  CHECK_THAT(complaints_about("resolution: [640.5, 480]"),
             ContainsSubstring("resolution: expected [width, height] in whole pixels"));
  CHECK_THAT(complaints_about("num_frames: many"), ContainsSubstring("num_frames"));
  // One mistake, one complaint.
  for (const char* text :
       {"working_area_size: [4, -4, 3]", "working_area_size: 4", "resolution: 640",
        "resolution: [0, 480]", "shape_distractors_types: cube"}) {
    const std::string complaints = complaints_about(text);
    INFO(complaints);
    CHECK(std::ranges::count(complaints, '\n') == 1);
    CHECK_THAT(complaints, ContainsSubstring("found"));
  }
  CHECK_THAT(complaints_about("writer_type: [a]"),
             ContainsSubstring("writer_type: expected a name"));
  CHECK_THAT(complaints_about("{num_frames: 3, capture: {}}"),
             ContainsSubstring("unknown key 'capture'"));
}

TEST_CASE("Numbers that leave nothing to photograph are told by the keys of the file",
          "[replicator]") {
  const auto only = [](const std::string& yaml, const std::string& expected) {
    CAPTURE(yaml);
    const std::string text = complaints_about(yaml);
    CHECK_THAT(text, ContainsSubstring(expected));
    // One fault, one line.
    CHECK(text.find('\n') == text.size() - 1);
  };
  only("num_frames: 0", "num_frames: expected an integer in [1, ");
  only("num_cameras: 0", "num_cameras: expected an integer in [1, ");
  only("labeled_assets_and_properties: []", "there is no object for cameras to look at");
  only("labeled_assets_and_properties: [{url: a.usd, count: 0}]",
       "there is no object for cameras to look at");
  only("{shape_distractors_num: 3, shape_distractors_types: []}",
       "shape_distractors_types: there are none, but shape_distractors_num is 3");
  only("mesh_distractors_urls: []",
       "mesh_distractors_urls: there are none, but mesh_distractors_num is 75");
}

TEST_CASE("Shapes are called as the example takes them, in any case", "[replicator]") {
  const Job job = translated("shape_distractors_types: [Cube, SPHERE, cone]").job;
  CHECK(to_json(*job.objects[2].loader.map.find("shapes"), 0) ==
        "[\"cube\", \"sphere\", \"cone\"]");
}
