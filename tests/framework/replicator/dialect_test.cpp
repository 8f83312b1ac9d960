// SPDX-License-Identifier: Apache-2.0
#include "framework/replicator/dialect.h"

#include "diorama/error.h"
#include "framework/config/value_text.h"
#include "framework/config/yaml_config.h"
#include "framework/pipeline/job.h"
#include "replicator_diagnostics.h"
#include "support/catch.h"

using namespace diorama;
using diorama::test::complaints_about;

namespace {

Job native_job(const std::string& yaml) {
  Diagnostics diagnostics;
  const ReplicatorTranslation translation =
      translate_replicator_job(parse_yaml(yaml, "job.yaml"), diagnostics);
  Job job = read_job(translation.job, diagnostics);
  diagnostics.raise();
  return job;
}

std::string text_of(const Value& value) { return to_json(value, 0); }

}  // namespace

TEST_CASE("The dialects are told apart by their keys", "[replicator]") {
  const auto is_replicator = [](const char* yaml) {
    return is_replicator_job(parse_yaml(yaml, "job.yaml"));
  };
  CHECK(is_replicator("capture: {}"));
  CHECK(is_replicator("debug_mode: true"));
  CHECK(is_replicator("environments: {folders: []}"));
  CHECK(is_replicator("writers: [{type: BasicWriter, kwargs: {rgb: true}}]"));
  CHECK(is_replicator("physics: {gpu_heap_capacity: 1}"));
  CHECK_FALSE(is_replicator("environments: [{type: files}]"));
  CHECK_FALSE(is_replicator("writers: [{type: BasicWriter, rgb: true}]"));
  CHECK_FALSE(is_replicator("physics: {type: bullet}"));
}

TEST_CASE("The built-in job has the tutorial's defaults", "[replicator]") {
  const Job job = native_job(builtin_replicator_job());
  CHECK(job.seed == 12);
  CHECK(job.debug);
  CHECK(job.total_captures == 9);
  REQUIRE(job.objects.size() == 5);
  CHECK(job.objects[0].count == 6);
  CHECK(job.objects[0].label_pattern == "^\\d+_");
  CHECK(job.objects[0].under == "/Assets");
  CHECK(job.objects[1].label == "pudding_box");
  CHECK(job.objects[2].label == "mustard_bottle");
  CHECK(job.objects[2].count == 2);
  CHECK(job.objects[3].count == 20);
  CHECK(job.objects[3].label == std::nullopt);
  CHECK(job.objects[4].count == 8);
  for (const ObjectGroup& group : job.objects) {
    CHECK(group.gravity_disabled_chance == 0.25);
    CHECK(group.mass_kg == 1.0);
    CHECK(group.collider == "convex_hull");
  }
  CHECK(job.lights[0].count == 3);
  CHECK(job.cameras[0].count == 2);
  CHECK(job.cameras[0].width == 720);
  CHECK(job.cameras[0].height == 480);
  CHECK(job.cameras[0].near_m == 0.25);
  CHECK(job.cameras[0].far_m == 1000.0);
  REQUIRE(job.timeline.size() == 4);
  CHECK(job.timeline[0].steps == 4);
  CHECK(job.timeline[1].count == 2);
  CHECK(job.timeline[2].until_rest);
  CHECK(job.timeline[2].at_least == 200);
  CHECK(job.timeline[2].steps == 800);
  CHECK(job.timeline[3].count == 2);
  REQUIRE(job.writers.size() == 1);
  CHECK(job.writers[0].type == "PoseWriter");
  CHECK(job.writers[0].output_dir == "_out_infinigen_posewriter");
  CHECK(job.output.folder == ".");
  CHECK(job.output.records == "_out_infinigen_posewriter");
  CHECK(job.environment.working_area == "TableDining");
}

TEST_CASE("A block that is given replaces the default as a whole, keys in it fall back",
          "[replicator]") {
  const Job job = native_job(R"(
capture: {total_captures: 3, num_floating_captures_per_env: 1, num_cameras: 1}
debug_mode: false
)");
  CHECK_FALSE(job.debug);
  CHECK(job.total_captures == 3);
  CHECK(job.timeline[3].count == 0);
  CHECK(job.cameras[0].width == 1280);
  CHECK(job.cameras[0].height == 720);
  CHECK(job.lights[0].count == 0);
  // Not given at all: the built-in ones.
  CHECK(job.objects[0].count == 6);
  CHECK(job.writers[0].type == "PoseWriter");
}

TEST_CASE("Keys that the reference drops work", "[replicator]") {
  Diagnostics diagnostics;
  const auto translation = translate_replicator_job(parse_yaml(R"(
capture: {total_captures: 1, num_floating_captures_per_env: 1, num_cameras: 1,
          camera_look_at_target_offset: 0.3, camera_distance_to_target_range: [0.75, 2]}
distractors: {shape_distractors: {num: 4, types: [cone]}}
)",
                                                               "job.yaml"),
                                                    diagnostics);
  REQUIRE(diagnostics.is_empty());
  CHECK_THAT(text_of(translation.job), ContainsSubstring(R"("shapes": ["cone"])"));
  CHECK_THAT(text_of(translation.job), ContainsSubstring(R"("look_at_offset": [-0.3, 0.3])"));
  CHECK_THAT(text_of(translation.job), ContainsSubstring(R"("distance": [0.75, 2])"));
}

TEST_CASE("Both spellings of the shapes are read, the program's own wins", "[replicator]") {
  const auto shapes = [](const char* keys) {
    Diagnostics diagnostics;
    const auto translation = translate_replicator_job(
        parse_yaml(std::string("distractors: {shape_distractors: {num: 1, ") + keys + "}}", "j"),
        diagnostics);
    return text_of(*translation.job.find("objects"));
  };
  CHECK_THAT(shapes("shape_types: [cube]"), ContainsSubstring(R"("shapes": ["cube"])"));
  CHECK_THAT(shapes("types: [cone], shape_types: [cube]"),
             ContainsSubstring(R"("shapes": ["cube"])"));
  CHECK_THAT(shapes(""), !ContainsSubstring("\"shapes\": ["));
}

TEST_CASE("Writers keep their arguments and relative folders", "[replicator]") {
  const Job job = native_job(R"(
writers:
  - {type: BasicWriter, kwargs: {output_dir: a/b, rgb: true, semantic_types: [class]}}
  - {type: BasicWriter, kwargs: {output_dir: c}}
  - {type: PoseWriter}
)");
  REQUIRE(job.writers.size() == 3);
  CHECK(job.writers[0].output_dir == "a/b");
  CHECK(job.writers[1].name == "BasicWriter_2");
  CHECK(job.writers[1].output_dir == "c");
  CHECK(job.writers[2].output_dir == "_out_PoseWriter");
  CHECK(job.output.records == "a/b");
  CHECK(job.writers[0].component.map.find("rgb")->scalar == "true");
  CHECK(job.writers[0].component.map.find("kwargs") == nullptr);
}

TEST_CASE("JSON jobs mean the same, tabs and escapes included", "[replicator]") {
  const Job job = native_job(
      "{\n\t\"capture\": {\n\t\t\"total_captures\": 3, \"num_floating_captures_per_env\": 1,\n"
      "\t\t\"num_cameras\": 1, \"path_tracing\": true, \"resolution\": [64, 48]\n\t},\n"
      "\t\"writers\": [{\"type\": \"BasicWriter\", \"kwargs\": {\"output_dir\": \"out\\/a\"}}],\n"
      "\t\"labeled_assets\": {\"auto_label\": {\"num\": 1, \"files\": [\"a.usd\"],\n"
      "\t\t\"regex_replace_pattern\": \"^\\\\d+_\"}}\n}\n");
  CHECK(job.total_captures == 3);
  CHECK(job.cameras[0].width == 64);
  CHECK(job.writers[0].output_dir == "out/a");
  CHECK(job.objects[0].label_pattern == "^\\d+_");
}

TEST_CASE("Keys without effect are named", "[replicator]") {
  Diagnostics diagnostics;
  const auto translation = translate_replicator_job(parse_yaml(R"(
capture: {disable_render_products: true}
physics: {gpu_collision_stack_size: 314572800, gpu_found_lost_pairs_capacity: 1,
  gpu_found_lost_aggregate_pairs_capacity: 2, gpu_total_aggregate_pairs_capacity: 3,
  gpu_max_rigid_contact_count: 4, gpu_max_rigid_patch_count: 5, gpu_heap_capacity: 6,
  gpu_temp_buffer_capacity: 7}
)",
                                                               "job.yaml"),
                                                    diagnostics);
  CHECK(diagnostics.is_empty());
  CHECK(translation.without_effect.size() == 9);
}

TEST_CASE("Python's replacement syntax is understood", "[replicator]") {
  const auto replacement = [](const char* python) {
    const Job job =
        native_job(std::string("labeled_assets: {auto_label: {num: 1, files: [a.usd], "
                               "regex_replace_pattern: '(\\d+)_', regex_replace_repl: '") +
                   python + "'}}");
    return job.objects[0].label_replacement;
  };
  CHECK(replacement("") == "");
  CHECK(replacement("\\1-") == "$1-");
  CHECK(replacement("\\g<1>0") == "${1}0");
  CHECK(replacement("a$b") == "a$$b");
}

TEST_CASE("auto_label may be one mapping or a list of them", "[replicator]") {
  const Job job = native_job(R"(
labeled_assets: {auto_label: [{num: 1, files: [a.usd]}, {num: 2, files: [b.usd]}]}
)");
  REQUIRE(job.objects.size() >= 2);
  CHECK(job.objects[0].name == "auto_label");
  CHECK(job.objects[1].name == "auto_label_2");
  CHECK(job.objects[1].count == 2);
}

TEST_CASE("Mistakes are reported all at once with place and near name", "[replicator]") {
  const std::string text = complaints_about(R"(
capture:
  total_captures: -1
  num_camera: 2
  resolution: [640]
labeled_assets:
  auto_labels: {}
  manual_label: [{label: x}]
distractors: {shape_distractors: {num: 1, gravity_disabled_chance: 1.5}}
physic: {}
writers: [{kwargs: {}}]
)");
  CHECK_THAT(text, ContainsSubstring("job.yaml:3:19") && ContainsSubstring("-1"));
  CHECK_THAT(text, ContainsSubstring("num_camera") && ContainsSubstring("num_cameras"));
  CHECK_THAT(text, ContainsSubstring("capture.resolution: expected [width, height]"));
  CHECK_THAT(text, ContainsSubstring("unknown key 'auto_labels'; did you mean 'auto_label'?"));
  CHECK_THAT(text, ContainsSubstring("labeled_assets.manual_label[0]: 'url' is missing"));
  CHECK_THAT(text, ContainsSubstring("gravity_disabled_chance") && ContainsSubstring("1.5"));
  CHECK_THAT(text, ContainsSubstring("unknown key 'physic'; did you mean 'physics'?"));
  CHECK_THAT(text, ContainsSubstring("writers[0]: 'type' is missing"));
}

TEST_CASE("Empty environments and counts that lead nowhere are diagnostics", "[replicator]") {
  CHECK_THAT(complaints_about("environments: {folders: [], files: []}"),
             ContainsSubstring("environments: the list is empty"));
  CHECK_THAT(complaints_about("capture: {total_captures: 5, num_cameras: 1}"),
             ContainsSubstring("can never be reached"));
  CHECK_THAT(complaints_about("capture: {total_captures: 5, num_floating_captures_per_env: 1}"),
             ContainsSubstring("cameras: there are none"));
}
