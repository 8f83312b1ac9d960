// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/capture_plan.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <map>
#include <set>

#include "diorama/error.h"
#include "framework/config/clean_text.h"
#include "jobs.h"
#include "support/catch.h"

using namespace diorama;
using namespace diorama::test;

namespace {

const std::vector<std::string> kFood{"/ycb/011_banana.usd", "/ycb/003_cracker_box.usd",
                                     "/ycb/024_bowl.usd", "/ycb/025_mug.usd"};

CapturePlan plan_of(const Job& job) {
  std::vector<std::vector<std::string>> assets(job.objects.size(), kFood);
  return plan_captures(job, {{"/rooms/a.usd", 0}, {"/rooms/b.usd", 0}}, assets);
}

long resident_kb() {
  long all = 0;
  long resident = 0;
  std::ifstream("/proc/self/statm") >> all >> resident;
  return resident * (sysconf(_SC_PAGESIZE) / 1024);
}

std::vector<std::string> choices(const CapturePlan& plan, std::size_t group) {
  std::vector<std::string> result;
  for (const PlannedObject& object : plan.objects) {
    if (object.group == group) result.push_back(object.asset + (object.floats ? " up" : " down"));
  }
  return result;
}

}  // namespace

TEST_CASE("Each object has a variant of each set, the same in every shard", "[plan]") {
  const std::string variants =
      "variants: {lookVariant: [red, green, blue], size: [big, small], fixed: plain}, ";
  const std::string text =
      with(good_job(), "name: targets,", "name: targets, pick: per_visit, " + variants);
  const Job job = job_from(text);
  const std::vector<std::vector<std::string>> assets{{"/a/01_mug.usd", "/a/02_cup.usdz"},
                                                     {"shape:cube"}};
  std::map<std::string, int> count;
  for (int visit = 0; visit < 20; ++visit) {
    const auto objects = plan_objects(job, assets, visit);
    const auto plain = plan_objects(
        job_from(with(good_job(), "name: targets,", "name: targets, pick: per_visit,")), assets,
        visit);
    for (std::size_t i = 0; i < objects.size(); ++i) {
      // All else stays as it is without variants.
      CHECK(objects[i].name == plain[i].name);
      CHECK(objects[i].asset.starts_with(plain[i].asset));
      if (i < 20) ++count[objects[i].asset.substr(plain[i].asset.size())];
    }
    CHECK(objects[3].asset == plan_objects(job, assets, visit)[3].asset);
  }
  CHECK(count.size() == 6);
  for (const auto& [suffix, times] : count) {
    CHECK(suffix.ends_with("{fixed=plain}"));
    CHECK(std::abs(times - 400 / 6) < 34);  // binomial, four standard deviations
  }
}

TEST_CASE("Environments are cycled until all captures are planned", "[plan]") {
  const CapturePlan plan = plan_of(job_from(good_job()));
  REQUIRE(plan.visit_count() == 3);
  CHECK(plan.capture_count() == 7);
  CHECK(plan.visit(0).environment == 0);
  CHECK(plan.visit(1).environment == 1);
  CHECK(plan.visit(2).environment == 0);

  // 3 captures per visit; the last visit is cut short.
  CHECK(plan.visit(1).first_capture == 3);
  CHECK(plan.visit(1).capture_count == 3);
  CHECK(plan.capture(4).index == 4);
  CHECK(plan.capture(4).phase == "floating");
  CHECK(plan.capture(4).number == 1);
  CHECK(plan.capture(5).phase == "dropped");
  CHECK(plan.capture(5).number == 0);
  CHECK(plan.visit(2).first_capture == 6);
  CHECK(plan.visit(2).capture_count == 1);
  CHECK(plan.series(plan.visit(1)).size() == 2);
  CHECK(plan.series(plan.visit(1))[1].phase == "dropped");
  REQUIRE(plan.series(plan.visit(2)).size() == 1);
  CHECK(plan.series(plan.visit(2))[0].count == 1);
}

TEST_CASE("No captures wanted, no visits planned", "[plan]") {
  const CapturePlan plan =
      plan_of(job_from(with(good_job(), "total_captures: 7", "total_captures: 0")));
  CHECK(plan.visit_count() == 0);
  CHECK(plan.capture_count() == 0);
}

TEST_CASE("Shards are disjoint and together make the whole", "[plan]") {
  const CapturePlan plan =
      plan_of(job_from(with(good_job(), "total_captures: 7", "total_captures: 100")));
  for (const int shards : {1, 2, 3, 7, 50}) {
    std::multiset<int> indices;
    for (int shard = 0; shard < shards; ++shard) {
      for (int i = 0; i < plan.visit_count(); ++i) {
        if (!is_in_shard(i, shard, shards)) continue;
        const PlannedVisit visit = plan.visit(i);
        for (int k = 0; k < visit.capture_count; ++k) indices.insert(visit.first_capture + k);
      }
    }
    CHECK(indices.size() == 100);
    CHECK(*indices.begin() == 0);
    CHECK(*indices.rbegin() == 99);
    CHECK(std::set<int>(indices.begin(), indices.end()).size() == 100);
  }
}

TEST_CASE("Objects get labels by pattern, names by label and gravity by chance", "[plan]") {
  const CapturePlan plan = plan_of(job_from(good_job()));
  REQUIRE(plan.objects.size() == 28);
  std::set<std::string> paths;
  for (const PlannedObject& object : plan.objects) {
    CHECK(paths.insert(object.path).second);
    const std::string prefix = object.floats ? "floating_" : "falling_";
    CHECK(object.name.starts_with(prefix));
    if (object.group == 1) {
      CHECK(object.labels.empty());
      CHECK(object.name.starts_with(prefix + asset_stem(object.asset)));
      CHECK(object.path == "/Distractors/" + object.name);
      continue;
    }
    const std::string label = asset_stem(object.asset).substr(4);
    CHECK(object.labels == Labels{{"class", label}});
    CHECK(object.name.starts_with(prefix + label));
    CHECK(object.path == "/Assets/" + object.name);
  }
}

TEST_CASE("A repeated name is numbered like the scene does it", "[plan]") {
  std::string yaml = with(good_job(), "count: 20", "count: 3");
  yaml = with(yaml, "gravity_disabled_chance: 0.25", "gravity_disabled_chance: 0, label: mug");
  const CapturePlan plan = plan_of(job_from(yaml));
  Scene scene;
  const NodeId assets = scene.create(scene.root(), "Assets");
  for (int i = 0; i < 3; ++i) {
    const NodeId node = scene.create(assets, "falling_mug");
    CHECK(scene.path(node) == plan.objects[std::size_t(i)].path);
  }
}

TEST_CASE("What is chosen for one group does not depend on other groups", "[plan]") {
  const CapturePlan plan = plan_of(job_from(good_job()));
  const CapturePlan longer = plan_of(
      job_from(with(good_job(), "objects:\n",
                    "objects:\n  - {type: files, name: first, under: /Assets, count: 3}\n")));
  CHECK(choices(plan, 0) == choices(longer, 1));
  CHECK(choices(plan, 1) == choices(longer, 2));
  // More objects in a group leave the first ones as they were.
  const CapturePlan more = plan_of(job_from(with(good_job(), "count: 20", "count: 21")));
  auto first = choices(more, 0);
  first.pop_back();
  CHECK(choices(plan, 0) == first);
  const CapturePlan other_seed = plan_of(job_from(with(good_job(), "seed: 5", "seed: 6")));
  CHECK(choices(plan, 0) != choices(other_seed, 0));
}

TEST_CASE("Over many seeds picks are uniform and gravity keeps its chance", "[plan]") {
  constexpr int kSeeds = 500;
  constexpr int kObjects = 20;
  std::map<std::string, int> picks;
  int floating = 0;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    Job job = job_from(good_job());
    job.seed = std::uint64_t(seed);
    const CapturePlan plan = plan_of(job);
    for (const PlannedObject& object : plan.objects) {
      if (object.group != 0) continue;
      ++picks[object.asset];
      floating += object.floats ? 1 : 0;
    }
  }
  const double all = kSeeds * kObjects;
  double chi_square = 0.0;
  for (const std::string& asset : kFood) {
    const double expected = all / 4.0;
    chi_square += (picks[asset] - expected) * (picks[asset] - expected) / expected;
  }
  CHECK(chi_square < 16.27);  // 3 degrees of freedom, level 0.001
  const double deviation = std::sqrt(all * 0.25 * 0.75);
  CHECK(std::abs(floating - all * 0.25) < 3.29 * deviation);  // level 0.001
}

TEST_CASE("Objects picked per visit differ between visits and are planned one visit at a time",
          "[plan]") {
  const Job job = job_from(with(with(good_job(), "count: 20,", "count: 20, pick: per_visit,"),
                                "total_captures: 7", "total_captures: 30"));
  const CapturePlan plan = plan_of(job);
  REQUIRE(plan.visit_count() == 10);
  const auto names = [&](int visit, std::size_t group) {
    std::vector<std::string> assets;
    for (const PlannedObject& object : plan_objects(job, plan.object_assets, visit)) {
      if (object.group == group) assets.push_back(object.asset);
    }
    return assets;
  };
  CHECK(names(3, 0) == names(3, 0));
  CHECK(names(3, 0) != names(4, 0));
  CHECK(names(3, 1) == names(4, 1));  // per job
  CHECK(names(0, 0) != names(1, 0));
}

TEST_CASE("Balanced picks use every asset equally often, over visits too", "[plan]") {
  // Four assets, seven objects per visit.
  Job job =
      job_from(with(with(good_job(), "count: 20,", "count: 7, balance: true, pick: per_visit,"),
                    "total_captures: 7", "total_captures: 24"));
  const CapturePlan plan = plan_of(job);
  std::map<std::string, int> uses;
  for (int visit = 0; visit < 8; ++visit) {
    for (const PlannedObject& object : plan_objects(job, plan.object_assets, visit)) {
      if (object.group == 0) ++uses[object.asset];
    }
    int least = 1000, most = 0;
    for (const std::string& asset : kFood) {
      least = std::min(least, uses[asset]);
      most = std::max(most, uses[asset]);
    }
    CHECK(most - least <= 1);
  }
  CHECK(uses[kFood[0]] == 14);
  // Once per job: none twice before all were picked.
  job = job_from(with(good_job(), "count: 20,", "count: 4, balance: true,"));
  std::set<std::string> once;
  for (const PlannedObject& object : plan_of(job).objects) {
    if (object.group == 0) once.insert(object.asset);
  }
  CHECK(once.size() == 4);
  const auto order = choices(plan_of(job), 0);
  job.seed = 77;
  CHECK(order != choices(plan_of(job), 0));
}

TEST_CASE("Visits may have fewer objects, every number as likely", "[plan]") {
  const Job job = job_from(with(good_job(), "count: 20,", "count: 5, fewer: 3, pick: per_visit,"));
  const Job all = job_from(with(good_job(), "count: 20,", "count: 5, pick: per_visit,"));
  const CapturePlan plan = plan_of(job);
  std::map<std::size_t, int> counts;
  for (int visit = 0; visit < 400; ++visit) {
    const auto objects = plan_objects(job, plan.object_assets, visit);
    const auto full = plan_objects(all, plan.object_assets, visit);
    const auto of_first = [](const PlannedObject& object) { return object.group == 0; };
    const auto count = std::size_t(std::ranges::count_if(objects, of_first));
    ++counts[count];
    for (std::size_t i = 0; i < count; ++i) CHECK(objects[i].asset == full[i].asset);
    CHECK(objects.size() == count + 8);  // the other group has all of its own
  }
  CHECK(counts.size() == 4);
  for (const auto& [count, visits] : counts) {
    CHECK((count >= 2 && count <= 5));
    CHECK(std::abs(visits - 100) < 3.29 * std::sqrt(400 * 0.25 * 0.75));  // level 0.001
  }
}

TEST_CASE("Assets that no visit uses are known", "[plan]") {
  const Job job = job_from(with(good_job(), "count: 20,", "count: 1,"));
  CHECK(unused_assets(job, plan_of(job))[0].size() == 3);
  const Job all = job_from(with(good_job(), "count: 20,", "count: 4, balance: true,"));
  CHECK(unused_assets(all, plan_of(all))[0].empty());
  const Job over_visits =
      job_from(with(with(good_job(), "count: 20,", "count: 1, balance: true, pick: per_visit,"),
                    "total_captures: 7", "total_captures: 12"));
  REQUIRE(plan_of(over_visits).visit_count() == 4);
  CHECK(unused_assets(over_visits, plan_of(over_visits))[0].empty());
}

TEST_CASE("A group without assets is an error that names the place", "[plan]") {
  const Job job = job_from(good_job());
  CHECK_THROWS_WITH(
      plan_captures(job, {{"a", 0}}, {{}, kFood}),
      ContainsSubstring("job.yaml:5:5: objects[0]: names no assets, but 20 objects are wanted"));
}

TEST_CASE("Random streams depend on what they are for and on nothing else", "[plan]") {
  const JobStreams streams(9);
  const auto draw = [](Rng rng) { return rng.bits(); };
  std::set<std::uint64_t> draws;
  for (const std::string name : {"a", "b"}) {
    for (int visit = 0; visit < 3; ++visit) {
      for (const std::string moment : {"environment", "floating"}) {
        for (int occurrence = 0; occurrence < 3; ++occurrence) {
          draws.insert(draw(streams.randomizer(name, visit, moment, occurrence)));
        }
      }
    }
  }
  CHECK(draws.size() == 2 * 3 * 2 * 3);
  CHECK(draw(streams.randomizer("a", 1, "floating", 2)) ==
        draw(JobStreams(9).randomizer("a", 1, "floating", 2)));
  CHECK(streams.render_seed(1, "cam_0") != streams.render_seed(1, "cam_1"));
  CHECK(streams.render_seed(1, "cam_0") != streams.render_seed(2, "cam_0"));
}

TEST_CASE("A randomizer acts at its moments, at every so many of them", "[plan]") {
  const Job job = job_from(with(good_job(), "{capture: floating, count: 2}, {simulate: 200}",
                                "{capture: floating, count: 5}, {event: shuffle}"));
  RandomizerEntry entry;
  entry.on = {"floating", "environment", "shuffle"};
  entry.every = 2;
  CHECK_FALSE(randomizer_call(job, entry, "dropped", 0, 0));
  // Captures 0, 2 and 4 of a visit: three calls per visit.
  CHECK(randomizer_call(job, entry, "floating", 0, 0)->occurrence == 0);
  CHECK_FALSE(randomizer_call(job, entry, "floating", 0, 1));
  CHECK(randomizer_call(job, entry, "floating", 0, 2)->occurrence == 1);
  CHECK(randomizer_call(job, entry, "floating", 2, 4)->occurrence == 8);
  CHECK(randomizer_call(job, entry, "floating", 2, 4)->visit == 2);
  CHECK(randomizer_call(job, entry, "shuffle", 7, 0)->occurrence == 7);
}

TEST_CASE("Steps and captures of rounds are moments, however many", "[plan]") {
  const auto occurrence = [](const std::string& step, const std::string& moment, int visit,
                             int number) {
    const Job job = job_from(with(good_job(), "{simulate: 200}", step));
    RandomizerEntry entry;
    entry.on = {moment};
    return randomizer_call(job, entry, moment, visit, number)->occurrence;
  };
  // Rounds 0, 2 and 4 of 5, four steps each; one step before them.
  const std::string rounds =
      "{simulate: 1, each_step: bounce}, {repeat: 5, steps: [{simulate: 4, each_step: bounce, "
      "every: 2}, {repeat: 2, steps: [{capture: round}]}, {record: {fps: 2, name: pan}, every: "
      "4}]}";
  CHECK(occurrence(rounds, "bounce", 2, 5) == 2 * 13 + 5);
  CHECK(occurrence(rounds, "round", 1, 3) == 10 + 3);
  CHECK(occurrence(rounds, "pan", 3, 1) == 3 * 2 + 1);
  const std::string many =
      "{repeat: 1000, steps: [{simulate: 10000000, each_step: bounce}]}";  // 10^10 steps
  CHECK(occurrence(many, "bounce", 3, 5) == std::numeric_limits<int>::max());
}

TEST_CASE("Between its turns a randomizer repeats what it drew for the visit", "[plan]") {
  const Job job = job_from(good_job());
  RandomizerEntry entry;
  entry.on = {"environment"};
  entry.every = 3;
  std::vector<int> visits, occurrences;
  for (int visit = 0; visit < 7; ++visit) {
    const auto call = randomizer_call(job, entry, "environment", visit, 0);
    REQUIRE(call);
    visits.push_back(call->visit);
    occurrences.push_back(call->occurrence);
  }
  CHECK(visits == std::vector<int>{0, 0, 0, 3, 3, 3, 6});
  CHECK(occurrences == std::vector<int>{0, 0, 0, 1, 1, 1, 2});
}

TEST_CASE("The stem of an asset is its name without folders, scheme and ending", "[plan]") {
  CHECK(asset_stem("/a.b/011_banana.usd") == "011_banana");
  CHECK(asset_stem("sample:banana") == "banana");
  CHECK(asset_stem("shape:cube") == "cube");
  CHECK(asset_stem("dining_room:7") == "7");
  CHECK(asset_stem(".hidden") == ".hidden");
}

TEST_CASE("One series in several steps of a visit counts on", "[plan]") {
  const CapturePlan plan = plan_of(
      job_from(with(good_job(), "{simulate: 200}",
                    "{capture: rest, count: 0}, {capture: mid}, {capture: floating, count: 3}")));
  std::string text;
  for (int i = 0; i < plan.capture_count(); ++i) {
    text += plan.capture(i).phase.substr(0, 1) + std::to_string(plan.capture(i).number) + " ";
  }
  CHECK(text == "f0 f1 m0 f2 f3 f4 d0 ");
  CHECK(plan.series(plan.visit(0)).size() == 4);
}

TEST_CASE("Clips are numbered over the job, their frames count, and the last one may be short",
          "[plan]") {
  std::string yaml = with(good_job(), "{simulate: 200}",
                          "{record: {fps: 10, seconds: 0.2, name: pan}}, "
                          "{record: {fps: 20, seconds: 0.1, name: pan}}");
  const CapturePlan plan = plan_of(job_from(with(yaml, "total_captures: 7", "total_captures: 12")));
  CHECK_FALSE(plan.capture(1).clip);
  CHECK(plan.capture(3).clip == ClipFrame{0, 1, 2, 10.0});
  CHECK(plan.capture(3).number == 0);
  CHECK(plan.capture(5).clip == ClipFrame{1, 1, 2, 20.0});
  CHECK(plan.capture(5).number == 1);
  CHECK_FALSE(plan.capture(6).clip);
  CHECK(plan.capture(9).clip == ClipFrame{2, 0, 2, 10.0});
  CHECK(plan.capture(11).clip == ClipFrame{3, 0, 1, 20.0});
  std::string text;
  for (const DatasetClip& clip : plan.clips()) {
    text += std::to_string(clip.first) + "+" + std::to_string(clip.count) + " ";
  }
  CHECK(text == "2+2 4+2 9+2 11+1 ");
  for (int i = 0; i < 12; ++i) CHECK(clip_frame(plan.clips(), i) == plan.capture(i).clip);
}

TEST_CASE("A plan of a hundred million captures is small, and each can be asked for", "[plan]") {
  const long before = resident_kb();
  const CapturePlan plan =
      plan_of(job_from(with(good_job(), "total_captures: 7", "total_captures: 100000000")));
  CHECK(plan.capture_count() == 100'000'000);
  CHECK(plan.visit_count() == 33'333'334);
  CHECK(plan.visit(33'333'333).first_capture == 99'999'999);
  CHECK(plan.visit(33'333'333).capture_count == 1);
  CHECK(plan.visit(33'333'333).environment == 1);
  CHECK(plan.capture(99'999'998).phase == "dropped");
  CHECK(resident_kb() - before < 4096);
}

TEST_CASE("A hundred thousand objects of one name are planned by as many steps", "[plan]") {
  std::string yaml = with(good_job(), "count: 20", "count: 100000");
  yaml = with(yaml, "gravity_disabled_chance: 0.25", "gravity_disabled_chance: 0, label: mug");
  const CapturePlan plan = plan_of(job_from(yaml));
  REQUIRE(plan.objects.size() == 100'008);
  CHECK(plan.objects[99].path == "/Assets/falling_mug_99");
  CHECK(plan.objects[99'999].path == "/Assets/falling_mug_99999");
}

TEST_CASE("Names of files that are no UTF-8 become labels that are, and stay different", "[plan]") {
  const Job job = job_from(with(good_job(), "count: 20", "count: 40"));
  const CapturePlan plan = plan_captures(
      job, {{"/rooms/a.usd", 0}}, {{"/x/001_caf\xE9.usd", "/x/002_caf\xE8.usd"}, {"/x/a\nb.usd"}});
  std::set<std::string> labels;
  for (const PlannedObject& object : plan.objects) {
    if (object.group == 0) labels.insert(object.labels.at("class"));
    CHECK(is_clean_name(object.path));
  }
  CHECK(labels == std::set<std::string>{"caf\\xE8", "caf\\xE9"});
}

TEST_CASE("Captures of rounds are numbered through", "[plan]") {
  const CapturePlan plan =
      plan_of(job_from(with(with(good_job(), "{simulate: 200}",
                                 "{repeat: 3, steps: [{simulate: 1}, {capture: round, count: 2}]}"),
                            "total_captures: 7", "total_captures: 12")));
  // Per visit 2 floating, 6 of rounds, 1 dropped.
  CHECK(plan.visit_count() == 2);
  CHECK(plan.capture(2).phase == "round");
  CHECK(plan.capture(2).number == 0);
  CHECK(plan.capture(7).number == 5);
  CHECK(plan.capture(8).phase == "dropped");
  CHECK(plan.capture(11).phase == "round");
  CHECK(plan.capture(11).number == 0);
}
