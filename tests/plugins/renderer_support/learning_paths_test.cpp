// SPDX-License-Identifier: Apache-2.0
#include "renderer_support/learning_paths.h"

#include <vector>

#include "renderer_support/sample_plan.h"
#include "support/catch.h"
#include "support/render_host/render_host.h"

namespace diorama {
namespace {

using Finding = RadianceCache::Finding;
using Path = LearningPaths::Path;

/// One that brought (1, 2, 3) before its finding.
Path path_at(int x, int y, bool has_finding, float clamp = 0.0f) {
  Path path{x, y, has_finding, clamp};
  path.sample.scattered = {1.0f, 2.0f, 3.0f};
  return path;
}

const Vec3f kFrom(1.0f, -2.0f, 0.5f);

/// `light` is what it found by itself; the weight is a half.
Finding finding_at(const Vec3f& position, float light) {
  return {position, Vec3f::UnitZ(), 100.0f, Vec3f::Constant(0.5f), Vec3f::Constant(light)};
}

std::vector<Vec3f> scattered(const LearningPaths& paths) {
  std::vector<Vec3f> result;
  paths.for_each([&](const Path& path) { result.push_back(path.sample.scattered); });
  return result;
}

}  // namespace

TEST_CASE("a path that learns ends in the cache, or with what it found", "[radiance_cache]") {
  const Vec3f known = kFrom + Vec3f(3.01f, 0.02f, -1.03f);
  const Vec3f unknown = kFrom + Vec3f(-30.0f, 9.0f, 0.0f);
  LearningPaths paths(3);
  // A hundred dark findings there and a bright one.
  paths.part(0).add(path_at(0, 0, true), finding_at(known, 4.0f));
  paths.part(0).add(path_at(1, 0, false), {});
  for (int i = 0; i < 98; ++i) {
    paths.part(1).add(path_at(8 + i % 8, i / 8, true), finding_at(known, 0.0f));
  }
  paths.part(2).add(path_at(16, 1, true), finding_at(unknown, 7.0f));
  paths.part(2).add(path_at(17, 1, true, 0.01f), finding_at(known, 0.0f));
  paths.part(2).add(path_at(18, 1, true, 0.5f), finding_at(known, 0.0f));
  const RadianceCache cache = paths.cache(kFrom);
  test::RenderHost host(2);
  paths.end_in(cache, host);
  const std::vector<Vec3f> found = scattered(paths);
  REQUIRE(found.size() == 103);
  const Vec3f own(1.0f, 2.0f, 3.0f);
  const float mean = 4.0f / 101.0f;
  CHECK(found[0].isApprox(own + Vec3f::Constant(mean)));
  CHECK(found[1] == own);
  for (std::size_t i = 2; i < 100; ++i) CHECK(found[i].isApprox(own + Vec3f::Constant(mean)));
  CHECK(found[100].isApprox(own + Vec3f::Constant(7.0f)));
  CHECK(found[101].isApprox(own + Vec3f::Constant(0.01f)));
  CHECK(found[102].isApprox(own + Vec3f::Constant(mean)));
}

TEST_CASE("each job of a picture gets the paths that learnt in it", "[radiance_cache]") {
  // So many pixels that one block of several learns.
  constexpr int kWidth = 1203;
  constexpr int kHeight = 805;
  SamplePlan plan(kWidth, kHeight, {1}, 4);
  const std::vector<TraceJob> learning = plan.learning_jobs();
  const std::vector<TraceJob> jobs = plan.next_round({}, 0.0);
  REQUIRE(learning.size() > 100);
  REQUIRE(learning.size() < jobs.size() / 2);
  LearningPaths paths(learning.size());
  for (std::size_t i = 0; i < learning.size(); ++i) {
    const TraceJob& job = learning[i];
    paths.part(i).add(path_at(job.x_end - 1, job.y_begin, false), {});
    paths.part(i).add(path_at(job.x_begin, job.y_end - 1, false), {});
  }
  std::size_t found = 0;
  const auto by_job = paths.of(jobs);
  REQUIRE(by_job.size() == jobs.size());
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    found += by_job[i].size();
    for (const Path& path : by_job[i]) {
      CHECK(path.x >= jobs[i].x_begin);
      CHECK(path.x < jobs[i].x_end);
      CHECK(path.y >= jobs[i].y_begin);
      CHECK(path.y < jobs[i].y_end);
    }
  }
  CHECK(found == 2 * learning.size());
  CHECK(LearningPaths().of(jobs).size() == jobs.size());
}

}  // namespace diorama
