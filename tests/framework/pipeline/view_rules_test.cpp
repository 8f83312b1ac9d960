// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/view_rules.h"

#include <cmath>
#include <map>

#include "diorama/error.h"
#include "framework/config/value_text.h"
#include "framework/pipeline/capture_plan.h"
#include "framework/pipeline/view_check.h"
#include "framework/pipeline/view_report.h"
#include "framework/pipeline/view_search.h"
#include "jobs.h"
#include "support/catch.h"

using namespace diorama;
using namespace diorama::test;

namespace {

std::string job_with_views(const std::string& entry) {
  return good_job() + "views: [" + entry + "]\n";
}

/// A near and a far thing before a camera, and the rectangles of the picture where they are seen.
struct Shown {
  struct Rectangle {
    int x, y, width, height;
  };
  Shown() {
    near_thing = add("near", 1.0);
    far_thing = add("far", 3.0);
    camera = scene.create(scene.root(), "cam");
    scene.edit(camera).camera = Camera{};
    scene.edit(camera).camera->width = 160;
    scene.edit(camera).camera->height = 120;
    scene.edit(camera).camera->fx = scene.edit(camera).camera->fy = 100.0;
    scene.edit(camera).camera->cx = 80.0;
    scene.edit(camera).camera->cy = 60.0;
  }
  NodeId add(const std::string& name, double distance_m) {
    const NodeId node = scene.create(scene.root(), name);
    scene.edit(node).mesh = std::make_shared<const Mesh>(make_box(Vec3(0.2, 0.2, 0.2)));
    scene.edit(node).labels["class"] = name;
    scene.set_pose(node, Affine(Eigen::Translation3d(0, 0, -distance_m)));
    return node;
  }
  /// The first condition that fails by every step-th pixel; empty: none.
  std::string failed(const std::string& entry, int step, const Rectangle& near_one,
                     const Rectangle& far_one = {0, 0, 0, 0}) const {
    const Job job = job_from(job_with_views("{name: seen, targets: \"/**\", " + entry + "}"));
    const ViewRule& rule = job.views.front();
    const ViewCheck check(scene, {&rule});
    WantedView wanted{&rule, std::vector<std::optional<std::size_t>>(rule.quotas.size(), 0)};
    ViewCheck::Labels labels;
    labels.step = step;
    labels.render = [&] {
      const int first = step / 4;
      Image<std::uint32_t> ids(160 / step, 120 / step, 0);
      for (int y = 0; y < ids.height(); ++y) {
        for (int x = 0; x < ids.width(); ++x) {
          const auto lies_in = [&](const Rectangle& r) {
            const int across = x * step + first - r.x;
            const int down = y * step + first - r.y;
            return across >= 0 && across < r.width && down >= 0 && down < r.height;
          };
          if (lies_in(far_one)) ids.at(x, y) = far_thing.index;
          if (lies_in(near_one)) ids.at(x, y) = near_thing.index;
        }
      }
      return ids;
    };
    // Nothing is covered, nothing is outside.
    labels.cover = [&](std::span<const LabelledInstance> instances) {
      std::vector<CoverageMask> masks;
      for (const LabelledInstance& instance : instances) {
        const Rectangle& r = instance.node == near_thing ? near_one : far_one;
        CoverageMask mask;
        mask.box = {r.x / step, r.y / step, (r.x + r.width) / step, (r.y + r.height) / step};
        mask.bits.assign(std::size_t(mask.box.width()) * std::size_t(mask.box.height()), 1);
        masks.push_back(std::move(mask));
      }
      covered += int(instances.size());
      return masks;
    };
    const ViewVerdict verdict = check.by_labels(scene, camera, {wanted}, labels);
    return verdict.holds() ? "" : verdict.failed.front();
  }
  /// The first condition that fails by place alone; empty: none.
  std::string failed_by_place(const std::string& entry) const {
    const Job job = job_from(job_with_views("{name: seen, targets: \"/**\", " + entry + "}"));
    const ViewRule& rule = job.views.front();
    const ViewVerdict verdict = ViewCheck(scene, {&rule}).by_place(scene, camera, {&rule, {}});
    return verdict.holds() ? "" : verdict.failed.front();
  }

  Scene scene;
  NodeId near_thing, far_thing, camera;
  mutable int covered = 0;  ///< Things whose coverage was asked for.
};

}  // namespace

TEST_CASE("Few pixels refuse what misses a condition clearly, and leave the rest to all of them",
          "[views]") {
  const Shown shown;
  const std::string large = "visible_pixels: {min: 400}";
  CHECK(shown.failed(large, 4, {10, 10, 40, 30}) == "");
  CHECK(shown.failed(large, 4, {10, 10, 8, 8}) == "seen.visible_pixels");
  // Nobody knows by a sixteenth of its pixels.
  CHECK(shown.failed(large, 4, {10, 10, 19, 20}) == "");
  CHECK(shown.failed(large, 1, {10, 10, 19, 20}) == "seen.visible_pixels");
  // The grid passes it by.
  CHECK(shown.failed("visible_pixels: {min: 1}", 4, {10, 10, 3, 3}) == "");

  const std::string narrow = "visible_pixels: {min: 100}, size_px: {max: 50}";
  CHECK(shown.failed(narrow, 4, {10, 10, 52, 5}) == "");
  CHECK(shown.failed(narrow, 1, {10, 10, 52, 5}) == "seen.size_px");
  CHECK(shown.failed(narrow, 4, {10, 10, 90, 5}) == "seen.size_px");
}

TEST_CASE("By few pixels a quota is missed where no other target can be the main one", "[views]") {
  const Shown shown;
  const std::string near = "quotas: [{of: distance_m, edges: [0.5, 2, 4]}]";
  CHECK(shown.failed(near, 4, {10, 10, 20, 20}, {60, 10, 80, 80}) == "seen.quotas.distance_m");
  CHECK(shown.failed(near, 4, {10, 10, 80, 80}, {100, 10, 20, 20}) == "");
  for (const int width : {56, 64}) {  // of 60
    INFO(width);
    CHECK(shown.failed(near, 4, {0, 10, 60, 60}, {80, 10, width, 60}) == "");
  }
  CHECK(shown.failed(near, 1, {0, 10, 60, 60}, {80, 10, 64, 60}) == "seen.quotas.distance_m");
}

TEST_CASE("What its box is too small for fails without a ray", "[views]") {
  const Shown shown;
  // 100 pixels per metre and metre: the near thing's box is 22 pixels wide, the far one's 7.
  CHECK(shown.failed_by_place("visible_pixels: {min: 400}") == "");
  CHECK(shown.failed_by_place("visible_pixels: {min: 700}") == "seen.visible_pixels");
  CHECK(shown.failed_by_place("visible_pixels: {min: 100}, count: {min: 2}") ==
        "seen.visible_pixels");
  CHECK(shown.failed_by_place("size_px: {min: 20}") == "");
  CHECK(shown.failed_by_place("size_px: {min: 30}") == "seen.size_px");
  CHECK(shown.failed_by_place("size_share: {min: 0.3}") == "seen.size_share");
  // A lens that bends lines tells nothing of the kind.
  Shown bent;
  bent.scene.edit(bent.camera).camera->lens = LensModel::OpencvPinhole;
  CHECK(bent.failed_by_place("visible_pixels: {min: 700}") == "");
}

TEST_CASE("Coverage is asked for as long as it decides, the largest first", "[views]") {
  const auto asked = [](const std::string& entry, int step, const Shown::Rectangle& far_one) {
    const Shown shown;
    const std::string failed = shown.failed(entry, step, {16, 16, 32, 32}, far_one);
    return failed + " " + std::to_string(shown.covered);
  };
  const std::string open = "occlusion: {max: 0.9}";
  const std::string near = open + ", quotas: [{of: distance_m, edges: [0.5, 2, 4]}]";
  for (const int step : {1, 4}) {
    INFO(step);
    CHECK(asked(open, step, {80, 16, 16, 16}) == " 1");
    CHECK(asked(open + ", count: {min: 2}", step, {80, 16, 16, 16}) == " 2");
    CHECK(asked(open + ", count: {max: 3}", step, {80, 16, 16, 16}) == " 2");
    // The main target is the far one, which lies in another part of the quota.
    CHECK(asked(near, step, {64, 16, 80, 80}) == "seen.quotas.distance_m 1");
  }
  CHECK(asked(near, 1, {80, 16, 8, 8}) == " 1");
  // Nobody is where the quota wants the main target to be.
  const Shown shown;
  CHECK(shown.failed(near, 1, {0, 0, 0, 0}, {64, 16, 80, 80}) == "seen.quotas.distance_m");
  CHECK(shown.covered == 0);
}

TEST_CASE("Of every block of views each part of a quota gets its share exactly", "[views]") {
  Quota quota;
  quota.labels = {"banana", "mug", "can"};
  quota.shares = {1, 3, 2};
  const Rng rng = JobStreams(5).views("seen", 0);
  std::map<std::size_t, int> counts;
  std::string order;
  for (std::uint64_t view = 0; view < 600; ++view) {
    const std::size_t bin = quota_bin(quota, rng, view);
    ++counts[bin];
    order += char('0' + bin);
    if (view % 6 != 5) continue;
    CHECK(counts[0] * 3 == counts[1]);
    CHECK(counts[0] * 2 == counts[2]);
  }
  CHECK(order.substr(0, 6) != order.substr(6, 6));  // no pattern that anything else may share
  CHECK(quota_bin(quota, rng, 123) == std::size_t(order[123] - '0'));
}

TEST_CASE("Views of a rule are counted without gaps over captures, series and cameras", "[views]") {
  // Per visit two floating captures and a dropped one.
  const Job job =
      job_from(job_with_views("{name: a, on: [floating]}, {name: b, on: [dropped]}, "
                              "{name: c}"));
  const auto numbers = [&](std::size_t rule, const std::vector<int>& captures) {
    std::vector<std::uint64_t> list;
    for (const int capture : captures) {
      for (std::size_t camera = 0; camera < 2; ++camera) {
        list.push_back(view_number(job, job.views[rule], capture, camera, 2));
      }
    }
    return list;
  };
  using Numbers = std::vector<std::uint64_t>;
  CHECK(numbers(0, {0, 1, 3, 4}) == Numbers{0, 1, 2, 3, 4, 5, 6, 7});
  CHECK(numbers(1, {2, 5}) == Numbers{0, 1, 2, 3});
  CHECK(numbers(2, {0, 1, 2, 3}) == Numbers{0, 1, 2, 3, 4, 5, 6, 7});
}

TEST_CASE("Directions fall into cells of equal area within the rule's limits", "[views]") {
  ViewRule rule;
  rule.azimuth_deg.min = -90.0;
  rule.azimuth_deg.max = 90.0;
  rule.elevation_deg.min = 0.0;
  Quota quota;
  quota.of = "direction";
  quota.columns = 3;
  quota.rows = 2;
  std::map<std::size_t, int> counts;
  Rng rng(3);
  int inside = 0;
  for (int i = 0; i < 60000; ++i) {
    const Vec3 direction = rng.unit_vector();
    const auto bin =
        rule.direction_bin(quota, std::atan2(direction.y(), direction.x()) * 180.0 / kPi,
                           std::asin(direction.z()) * 180.0 / kPi);
    CHECK(bin.has_value() == (direction.x() >= 0.0 && direction.z() >= 0.0));
    if (!bin) continue;
    ++inside;
    ++counts[*bin];
  }
  REQUIRE(counts.size() == 6);
  for (const auto& [bin, count] : counts) CHECK(std::abs(count - inside / 6) < 250);
  CHECK(rule.direction_bin(quota, -89.0, 1.0) == 0u);
  CHECK(rule.direction_bin(quota, 271.0, 1.0) == 0u);
  CHECK(rule.direction_bin(quota, 89.0, 89.0) == 5u);
}

TEST_CASE("Mistakes in views are named with the nearest key", "[views]") {
  const auto diagnostics = [](const std::string& entry) {
    return complaints_about(job_with_views(entry));
  };
  CHECK_THAT(diagnostics("{truncaton: {max: 0.1}}"),
             ContainsSubstring("views[0]") && ContainsSubstring("truncaton") &&
                 ContainsSubstring("did you mean 'truncation'?"));
  CHECK_THAT(diagnostics("{truncation: {mx: 0.1}}"), ContainsSubstring("did you mean 'max'?"));
  CHECK_THAT(diagnostics("{truncation: {max: 2}}"), ContainsSubstring("views[0].truncation.max"));
  CHECK_THAT(diagnostics("{distance_m: {min: 2, max: 1}}"),
             ContainsSubstring("views[0].distance_m: min (2) is greater than max (1)"));
  CHECK_THAT(diagnostics("{on: [droped]}"),
             ContainsSubstring("unknown capture series 'droped'; did you mean 'dropped'?"));
  CHECK_THAT(diagnostics("{on: [environment]}"), ContainsSubstring("unknown capture series"));
  CHECK_THAT(diagnostics("{at_limit: keep}"), ContainsSubstring("keep_best"));
  CHECK_THAT(diagnostics("{quotas: [{of: distance}]}"), ContainsSubstring("distance_m"));
  CHECK_THAT(diagnostics("{quotas: [{of: label, labels: [a]}]}"),
             ContainsSubstring("views[0].quotas[0].labels: expected two or more different labels"));
  CHECK_THAT(diagnostics("{quotas: [{of: distance_m, edges: [1, 2, 2]}]}"),
             ContainsSubstring("views[0].quotas[0].edges: expected three or more rising numbers"));
  CHECK_THAT(diagnostics("{quotas: [{of: distance_m, edges: [1, 2, 3], shares: [1]}]}"),
             ContainsSubstring("views[0].quotas[0].shares: expected 2 numbers"));
  CHECK_THAT(diagnostics("{quotas: [{of: distance_m, edges: [1, 2, 3], shares: [0.5, 1]}]}"),
             ContainsSubstring("expected whole numbers"));
  CHECK_THAT(diagnostics("{name: a}, {name: a}"),
             ContainsSubstring("views[1]: another entry is called 'a'"));
  CHECK(diagnostics("{truncation: {max: 0.1}}").empty());
}

TEST_CASE("The resolved job has the views with all defaults and means the same", "[views]") {
  const std::string yaml = job_with_views(
      "{truncation: {max: 0.1}, quotas: [{of: distance_m, edges: [1, 2, 3], shares: [1, 2]}]}");
  const auto nothing = [](ComponentKind, std::string_view) {
    return std::optional<std::vector<ParamSpec>>();
  };
  const std::string text = to_yaml(resolved_job(job_value(yaml), nothing));
  const Job again = job_from(text);
  REQUIRE(again.views.size() == 1);
  CHECK(again.views[0].name == "views_0");
  CHECK(again.views[0].truncation.max == 0.1);
  CHECK_FALSE(again.views[0].truncation.min);
  CHECK(again.views[0].count.min == 1.0);
  CHECK(again.views[0].quotas[0].shares == std::vector<double>{1, 2});
  CHECK(to_yaml(resolved_job(job_value(text), nothing)) == text);
}

TEST_CASE("How views came about survives the journal and is added up", "[views]") {
  const std::vector<ViewOutcome> first{
      {"cam_0", 5, {{"seen.truncation", 3}, {"seen.count", 1}}, {}, {{"seen.label", "mug"}}}};
  const std::vector<ViewOutcome> second{
      {"cam_0", 2, {{"seen.truncation", 1}}, {"seen.truncation"}, {{"seen.label", "can"}}}};
  ViewCounts counts;
  counts.add(0, outcomes_from_json(outcomes_json(first)));
  counts.add(1, outcomes_from_json(outcomes_json(second)));
  const std::string text = views_text(views_json(counts));
  CHECK(text == views_text(counts));
  CHECK_THAT(text, ContainsSubstring("views: 2 of 7 draws; 5 refused: seen.truncation 4, "
                                     "seen.count 1"));
  CHECK_THAT(text, ContainsSubstring("quota seen.label: mug: 1"));
  CHECK_THAT(text, !ContainsSubstring("can: 1"));
  CHECK_THAT(text, ContainsSubstring("capture 1, cam_0: seen.truncation"));
  CHECK(views_text("[1]").empty());
  CHECK(views_text("no json").empty());
  CHECK_THROWS_AS(outcomes_from_json("{"), Error);
}
