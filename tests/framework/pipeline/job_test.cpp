// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/job.h"

#include "framework/config/value_text.h"
#include "jobs.h"
#include "support/catch.h"

using namespace diorama;
using namespace diorama::test;

TEST_CASE("A right job is read without diagnostics", "[job]") {
  const Job job = job_from(good_job());
  CHECK(job.seed == 5);
  CHECK(job.total_captures == 7);
  CHECK(job.objects[0].label_pattern == "^\\d+_");
  CHECK(job.objects[1].label_pattern == std::nullopt);
  CHECK(job.camera_names() == std::vector<std::string>{"cam_0", "cam_1"});
  CHECK(job.series() == std::vector<std::string>{"floating", "dropped"});
  CHECK(job.physics.type == "bullet");
  CHECK(job.renderer.type == "embree");
  CHECK(job.writers[0].output_dir == std::nullopt);
}

TEST_CASE("Without a timeline a visit does what the tutorial does", "[job]") {
  const Job job = job_from(with(good_job(),
                                "timeline: [{simulate: 4}, {capture: floating, count: "
                                "2}, {simulate: 200}, {capture: dropped, count: 1}]\n",
                                ""));
  REQUIRE(job.timeline.size() == 4);
  CHECK(job.timeline[0].steps == 4);
  CHECK(job.timeline[1].name == "floating");
  CHECK(job.timeline[1].count == 2);
  CHECK(job.timeline[2].until_rest);
  CHECK(job.timeline[2].at_least == 200);
  CHECK(job.timeline[2].steps == 800);
  CHECK(job.timeline[3].name == "dropped");
}

TEST_CASE("All diagnostics about a job come in one go, with places and near names", "[job]") {
  std::string yaml = with(good_job(), "total_captures: 7", "total_captures: -7");
  yaml = with(yaml, "timeline:", "timelime:");
  yaml = with(yaml, "width: 64", "widht: 64");
  yaml = with(yaml, "count: 20", "count: lots");
  const std::string text = complaints_about(yaml);
  CHECK_THAT(text, ContainsSubstring("job.yaml:2:17") && ContainsSubstring("total_captures") &&
                       ContainsSubstring("-7"));
  CHECK_THAT(text, ContainsSubstring("unknown key 'timelime'; did you mean 'timeline'?"));
  CHECK_THAT(text, ContainsSubstring("widht") && ContainsSubstring("width"));
  CHECK_THAT(text, ContainsSubstring("objects[0].count") && ContainsSubstring("lots"));
}

TEST_CASE("Mistakes that make a job pointless are named", "[job]") {
  const std::string good = good_job();
  CHECK_THAT(complaints_about(with(good, "[{type: files, files: [a.usd, b.usd]}]", "[]")),
             ContainsSubstring("environments: the list is empty"));
  CHECK_THAT(
      complaints_about(with(with(good, "floating, count: 2", "floating, count: 0"),
                            "dropped, count: 1", "dropped, count: 0")),
      ContainsSubstring("job.yaml:11:11: timeline: the capture series have no captures in all, so "
                        "total_captures: 7 can never be reached"));
  CHECK_THAT(complaints_about(with(good, "name: cam, count: 2", "name: cam, count: 0")),
             ContainsSubstring("cameras: there are none"));
  const auto about_variants = [](const std::string& variants) {
    return complaints_about(
        with(good_job(), "name: targets,", "name: targets, variants: " + variants + ","));
  };
  CHECK(about_variants("{lookVariant: [red, blue]}").empty());
  CHECK_THAT(about_variants("[red]"),
             ContainsSubstring("objects[0].variants: expected variants by set, {lookVariant: [red, "
                               "blue]}, found"));
  CHECK_THAT(about_variants("{look: []}"),
             ContainsSubstring("objects[0].variants.look: the list is empty"));
  CHECK_THAT(about_variants("{look: ['a}']}"),
             ContainsSubstring("objects[0].variants.look: expected the name of a variant, found"));
  const std::string plain = "{type: pinhole, name: cam, count: 2, width: 64, height: 48}";
  CHECK_THAT(
      complaints_about(with(good_job(), plain, "{type: pinhole, rig: [{name: a}, {name: a}]}")),
      ContainsSubstring("cameras[0].rig[1]: another camera of the rig is called 'a'"));
  CHECK_THAT(
      complaints_about(with(good_job(), plain, "{type: pinhole, rig: [{position: [1, 0, 0]}]}")),
      ContainsSubstring("cameras[0].rig[0].name: is empty, expected one such as 'left'"));
  CHECK_THAT(complaints_about(with(
                 good_job(), plain,
                 "{type: pinhole, name: a, rig: [{name: b_0}]}, {type: pinhole, name: a_0_b}")),
             ContainsSubstring("cameras: two would be called 'a_0_b_0'"));
  CHECK_THAT(complaints_about(
                 with(good_job(), plain, "{type: pinhole, rig: [{name: a, postion: [1, 0, 0]}]}")),
             ContainsSubstring("did you mean 'position'?"));
  CHECK_THAT(
      complaints_about(with(good, "on: [floating, dropped]", "on: [floting]")),
      ContainsSubstring("randomizers[1].on: unknown moment 'floting'; did you mean 'floating'?"));
  // Which moments there are is not known then.
  CHECK_THAT(complaints_about(with(good, "capture: floating", "captur: floating")),
             ContainsSubstring("timeline") && !ContainsSubstring("unknown moment"));
  CHECK_THAT(complaints_about(with(good, "name: clutter", "name: targets")),
             ContainsSubstring("objects[1]: another entry is called 'targets'"));
  CHECK_THAT(complaints_about(with(good, "name: orbit", "name: poses")),
             ContainsSubstring("randomizers[1]: another entry is called 'poses'"));
  CHECK_THAT(complaints_about(with(good, "{type: shapes, name: clutter", "{name: clutter")),
             ContainsSubstring("objects[1]: 'type' is missing"));
  CHECK_THAT(complaints_about(with(good, "{simulate: 4}", "{simulate: 4, capture: x}")),
             ContainsSubstring("timeline[0]: expected one of"));
  CHECK_THAT(complaints_about(with(good, "\"^\\\\d+_\"", "\"(\"")),
             ContainsSubstring("objects[0].label_pattern: not a regular expression"));
  CHECK_THAT(complaints_about(with(good, "under: /Assets", "under: Assets")),
             ContainsSubstring("objects[0].under: expected a path like /Assets, found 'Assets'"));
  CHECK_THAT(complaints_about(with(good, "count: 20,", "count: 20, fewer: 21, pick: per_visit,")),
             ContainsSubstring("objects[0].fewer: expected at most the count, 20, found 21"));
  CHECK_THAT(complaints_about(with(good, "count: 20,", "count: 20, fewer: 2,")),
             ContainsSubstring("objects[0].fewer: visits can differ only with 'pick: per_visit'"));
  CHECK_THAT(complaints_about("[1, 2]"), ContainsSubstring("a job is a mapping of sections"));
}

TEST_CASE("A job may say how loaders read its files", "[job]") {
  const std::string loaders = "loaders: [{type: usd, missing_assets_are_errors: true}]\n";
  const Job job = job_from(good_job() + loaders);
  REQUIRE(job.loaders.size() == 1);
  CHECK(job.loaders[0].type == "usd");
  CHECK(job.loaders[0].map.find("missing_assets_are_errors"));
  CHECK_THAT(complaints_about(good_job() + "loaders: [{type: usd}, {name: b, type: usd}]\n"),
             ContainsSubstring("loaders[1]: another entry is of type 'usd'"));
}

TEST_CASE("The null renderer may be written without quotes", "[job]") {
  CHECK(job_from(good_job() + "renderer: {type: null}\n").renderer.type == "null");
  CHECK(job_from(good_job() + "renderer: {type: \"null\"}\n").renderer.type == "null");
}

TEST_CASE("The resolved job has every default and means the same", "[job]") {
  const DescribeComponent describe = [](ComponentKind kind, std::string_view type) {
    std::optional<std::vector<ParamSpec>> specs;
    if (kind == ComponentKind::Writer && type == "BasicWriter") {
      ParamSpec spec;
      spec.key = "depth";
      spec.type = ParamType::Bool;
      spec.default_value = Value::boolean(false);
      specs.emplace().push_back(spec);
    }
    return specs;
  };
  const Value resolved = resolved_job(job_value(good_job() + "renderer: {type: null}\n"), describe);
  const std::string text = to_yaml(resolved);
  CHECK_THAT(text, ContainsSubstring("depth: false"));
  CHECK_THAT(text, ContainsSubstring("near_m: 0.25"));
  CHECK_THAT(text, ContainsSubstring("mass_kg: 1"));

  const Job again = job_from(text);
  const Job first = job_from(good_job());
  CHECK(again.renderer.type == "null");
  CHECK(again.objects.size() == first.objects.size());
  CHECK(again.objects[0].label_pattern == first.objects[0].label_pattern);
  CHECK(again.objects[1].label == std::nullopt);
  CHECK(again.cameras[0].fx_px == std::nullopt);
  CHECK(again.writers[0].output_dir == "basic");
  CHECK(again.total_captures == first.total_captures);
  CHECK(to_yaml(resolved_job(job_value(text), describe)) == text);
}

TEST_CASE("Writers stay below the output folder, and out of its bookkeeping", "[job]") {
  const auto diagnostics = [](const std::string& writer) {
    return complaints_about(with(good_job(), "name: basic", writer));
  };
  CHECK(diagnostics("name: ../../x") ==
        "job.yaml:12:37: writers[0].name: the folder '../../x' is not below the output folder "
        "'out'; name a folder below it, or choose one that holds both by '--output'\n");
  CHECK_THAT(diagnostics("name: basic, output_dir: /etc/x"),
             ContainsSubstring("job.yaml:12:56: writers[0].output_dir: the folder '/etc/x' is "
                               "not below the output folder 'out'"));
  for (const char* folder : {"..", "a/../..", "./../out2", ".diorama", "a/.diorama-stage/b",
                             "../out/.diorama/journal"}) {
    INFO(folder);
    CHECK_THAT(diagnostics("name: basic, output_dir: " + std::string(folder)),
               ContainsSubstring("is not below the output folder"));
  }
  for (const char* folder : {"a", "a/b/", "a/../b", "../out/c", "..."}) {
    INFO(folder);
    CHECK(diagnostics("name: basic, output_dir: " + std::string(folder)).empty());
  }
  CHECK(diagnostics("name: ../../x, output_dir: inside").empty());
  CHECK_THAT(complaints_about(with(good_job(), "{folder: out}", "{folder: out, records: ../y}")),
             ContainsSubstring("job.yaml:13:32: output.records: the folder '../y' is not below"));
  CHECK(complaints_about(with(with(good_job(), "{folder: out}", "{folder: /data}"), "name: basic",
                              "name: basic, output_dir: /data/basic"))
            .empty());
}

TEST_CASE("Names of groups hold nothing that a terminal would obey", "[job]") {
  CHECK_THAT(complaints_about(with(good_job(), "name: cam", "name: \"a\\e[2J\"")),
             ContainsSubstring("cameras[0].name: expected a name without '/' and control "
                               "characters, found 'a\\x1B[2J'"));
}

TEST_CASE("A simulation takes steps or goes on until rest", "[job]") {
  const std::string good = good_job();
  const Job job = job_from(
      with(good, "{simulate: 200}", "{simulate: {until: rest, at_least: 50, at_most: 300}}"));
  CHECK(job.timeline[2].until_rest);
  CHECK(job.timeline[2].at_least == 50);
  CHECK(job.timeline[2].steps == 300);
  CHECK_FALSE(job.timeline[0].until_rest);
  CHECK(job_from(with(good, "{simulate: 200}", "{simulate: {until: rest}}")).timeline[2].steps ==
        800);
  CHECK_THAT(complaints_about(with(good, "{simulate: 200}", "{simulate: {until: reset}}")),
             ContainsSubstring("timeline[2].simulate.until"));
  CHECK_THAT(
      complaints_about(with(good, "{simulate: 200}", "{simulate: {until: rest, at_least: 900}}")),
      ContainsSubstring("at_least: expected at_most (800) or less, found 900"));
  CHECK_THAT(complaints_about(with(good, "{simulate: 200}", "{simulate: 2.5}")),
             ContainsSubstring("timeline[2].simulate: expected a whole number"));
  CHECK_THAT(complaints_about(with(good, "{simulate: 200}", "{simulate: lots}")),
             ContainsSubstring("timeline[2].simulate"));
  CHECK_THAT(complaints_about(with(good, "{simulate: 200}", "{simulate: -1}")),
             ContainsSubstring("timeline[2].simulate"));
}

TEST_CASE("Steps are repeated, some of them in every so-manieth round only", "[job]") {
  const std::string good = good_job();
  const Job job = job_from(
      with(good, "{simulate: 200}",
           "{repeat: 5, steps: [{event: shake, every: 3}, {simulate: 2, each_step: bounce, "
           "camera_radius_m: 0.5}, {capture: dropped}]}"));
  std::string text;
  for_each_step(job.timeline, [&](const TimelineStep& step) {
    if (step.kind == TimelineStep::Kind::Simulate) {
      text += std::to_string(step.steps) + step.each_step + " ";
    } else {
      text += step.name + " ";
    }
    return true;
  });
  CHECK(text ==
        "4 floating shake 2bounce dropped 2bounce dropped 2bounce dropped shake 2bounce dropped "
        "2bounce dropped dropped ");
  CHECK(job.timeline[2].steps_of_round[1].camera_radius_m == 0.5);
  int seen = 0;
  for_each_step(job.timeline, [&](const TimelineStep&) { return ++seen < 4; });
  CHECK(seen == 4);
  CHECK(job.series() == std::vector<std::string>{"floating", "dropped"});
}

TEST_CASE("A clip has the frames that begin within its time", "[job]") {
  const auto frames = [](const std::string& record) {
    const Job job = job_from(with(good_job(), "{simulate: 200}", "{record: " + record + "}"));
    CHECK(job.timeline[2].name == "clip");
    return job.timeline[2].count;
  };
  CHECK(frames("{fps: 30, seconds: 2}") == 60);
  CHECK(frames("{fps: 29.97, seconds: 2}") == 60);
  CHECK(frames("{fps: 23.976, seconds: 1.7}") == 41);
  CHECK(frames("{fps: 24, seconds: 0.25}") == 6);
  CHECK(frames("{fps: 24, seconds: 0.26}") == 7);
  // Whole but for rounding.
  CHECK(frames("{fps: 10, seconds: 0.3}") == 3);
  CHECK(frames("{fps: 60, seconds: 1.1}") == 66);
  CHECK(frames("{fps: 7, seconds: 0.1}") == 1);
}

TEST_CASE("What stands beside a step of the timeline must belong to it", "[job]") {
  const auto complaint = [](const std::string& step) {
    return complaints_about(with(good_job(), "{simulate: 200}", step));
  };
  CHECK_THAT(complaint("{event: e, each_step: bounce}"),
             ContainsSubstring("timeline[2].each_step: has a meaning only beside 'simulate'"));
  CHECK_THAT(complaint("{capture: c, camera_radius_m: 1}"),
             ContainsSubstring("camera_radius_m: has a meaning only beside 'simulate'"));
  CHECK_THAT(complaint("{simulate: 1, every: 2}"),
             ContainsSubstring("every: has a meaning only within the 'steps' of a 'repeat'"));
  CHECK_THAT(complaint("{simulate: 1, steps: []}"),
             ContainsSubstring("steps: has a meaning only beside 'repeat'"));
  CHECK_THAT(complaint("{simulate: 1, each_step: environment}"),
             ContainsSubstring("a moment needs a name of its own, found 'environment'"));
  CHECK_THAT(complaint("{repeat: 2, steps: [{simulate: 1, evry: 2}]}"),
             ContainsSubstring("timeline[2].steps[0]") &&
                 ContainsSubstring("unknown key 'evry', did you mean 'every'?"));
  CHECK_THAT(complaint("{repeat: 2, simulate: 1}"), ContainsSubstring("expected one of"));
  CHECK_THAT(complaint("{repeat: 1.5, steps: []}"), ContainsSubstring("expected a whole number"));
  CHECK_THAT(complaint("{repeat: 2}"), ContainsSubstring("timeline[2]: 'steps' is missing"));
  CHECK_THAT(complaint("{simulate: 1, each_step: pan}, {record: {name: pan}}"),
             ContainsSubstring("'pan' is the name of clips and of another moment"));
  for (const char* steps : {"[{simulate: 1}]", "[]"}) {
    INFO(steps);
    CHECK_THAT(
        complaint("{repeat: 1000000, steps: [{repeat: 1000000, steps: " + std::string(steps) +
                  "}]}"),
        ContainsSubstring("timeline: expected at most 10000000 steps per visit in all rounds"));
  }
}

TEST_CASE("Walls have three sizes or none", "[job]") {
  const std::string walls = "environment: {walls: [4, 5, 3]}\nobjects:";
  CHECK(job_from(with(good_job(), "objects:", walls)).environment.walls ==
        std::vector<double>{4, 5, 3});
  CHECK_THAT(
      complaints_about(with(good_job(), "objects:", "environment: {walls: [4, 5]}\nobjects:")),
      ContainsSubstring("environment.walls: expected [width, depth, height] in metres"));
}
