// SPDX-License-Identifier: Apache-2.0
#include "learning_paths.h"

#include <algorithm>

#include "sampling.h"

namespace diorama {

void LearningPaths::Part::reserve(std::size_t paths) {
  paths_.reserve(paths);
  findings_.reserve(paths);
}

void LearningPaths::Part::add(const Path& path, const RadianceCache::Finding& finding) {
  paths_.push_back(path);
  if (path.has_finding) findings_.push_back(finding);
}

RadianceCache LearningPaths::cache(const Vec3f& eye) const {
  std::vector<std::span<const RadianceCache::Finding>> findings;
  findings.reserve(parts_.size());
  for (const Part& part : parts_) findings.emplace_back(part.findings_);
  return {eye, findings};
}

void LearningPaths::end_in(const RadianceCache& cache, Host& host) {
  host.parallel_for(parts_.size(), [&](std::size_t i) {
    Part& part = parts_[i];
    auto finding = part.findings_.cbegin();
    for (Path& path : part.paths_) {
      if (!path.has_finding) continue;
      Vec3f light;
      if (cache.find(finding->position, finding->normal, finding->reach, light)) {
        light = light.cwiseProduct(finding->weight);
        if (path.clamp > 0.0f) light *= path.clamp / std::max(path.clamp, luminance(light));
      } else {
        light = finding->light;
      }
      path.sample.scattered += light;
      ++finding;
    }
    part.findings_ = {};
  });
}

std::vector<std::span<const LearningPaths::Path>> LearningPaths::of(
    std::span<const TraceJob> jobs) const {
  std::vector<std::span<const Path>> result(jobs.size());
  auto part = parts_.begin();
  for (std::size_t i = 0; i < jobs.size() && part != parts_.end(); ++i) {
    const Path& first = part->paths_.front();
    const TraceJob& job = jobs[i];
    if (first.x < job.x_begin || first.x >= job.x_end) continue;
    if (first.y < job.y_begin || first.y >= job.y_end) continue;
    result[i] = part->paths_;
    ++part;
  }
  return result;
}

}  // namespace diorama
