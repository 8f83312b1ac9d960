// SPDX-License-Identifier: Apache-2.0
#include "plugins/writer_support/sample_dataset.h"

#include <algorithm>
#include <stdexcept>

#include "writer_support/python_json.h"

namespace diorama::test {

const std::vector<Capture>& sample_captures() {
  static const std::vector<Capture> captures = [] {
    std::vector<Capture> result;
    SampleScene sample(72, 48, 2);
    const NodeId crate = sample.scene.require("/Assets/crate");
    for (int i = 0; i < 3; ++i) {
      Affine pose = sample.scene[crate].parent_from_node;
      pose.translation().y() += 0.05 * i;
      sample.scene.set_pose(crate, pose);
      result.push_back(ray_cast_capture(sample, i));
    }
    return result;
  }();
  return captures;
}

std::string split_of(const MemoryFiles& files, int capture) {
  const Json split = Json::parse(files.text("dataset.json")).at("split");
  for (const auto& [name, captures] : split.items()) {
    for (const Json& index : captures) {
      if (index.get<int>() == capture) return name;
    }
  }
  throw std::logic_error("capture in no split");
}

const Instance& instance_at(const Frame& frame, const std::string& path) {
  const auto found = std::ranges::find(frame.instances, path, &Instance::node_path);
  if (found == frame.instances.end()) throw std::logic_error(path + ": no such instance");
  return *found;
}

std::int64_t visible_count(const Frame& frame, const Instance& instance) {
  return std::ranges::count(frame.get(kInstanceId).pixels(), instance.id);
}

}  // namespace diorama::test
