// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "plugins/writer_support/sample_capture.h"

namespace diorama::test {

/// The sample with keypoints on its crate, as cam_0 sees them: "seen" is the surface point behind
/// the middle of a pixel, "hidden" lies 5 cm behind it on the same ray, "outside" beside the
/// picture. The job also names "gone", which the crate has not got.
struct KeypointSample {
  SampleScene sample{48, 32, 2};
  DatasetInfo dataset;
  Capture capture;
  Vec2 pixel;  ///< Of "seen" and "hidden".

  KeypointSample() {
    const NodeId crate = sample.scene.require("/Assets/crate");
    const Frame frame = ray_cast(sample.scene, sample.cameras[0]);
    const auto& ids = frame.get(kInstanceId);
    const auto& positions = frame.get(kPosition);
    Vec3 seen = Vec3::Zero();
    for (int y = 0; y < ids.height(); ++y) {
      for (int x = 0; x < ids.width(); ++x) {
        if (ids.at(x, y) != crate.index) continue;
        seen = positions.at(x, y).cast<double>();
        pixel = {x + 0.5, y + 0.5};
      }
    }
    const Vec3 eye = frame.world_from_camera.translation();
    const Vec3 hidden = seen + 0.05 * (seen - eye).normalized();
    const Vec3 outside = eye + frame.world_from_camera.linear() * Vec3(9.0, 0.0, -1.0);
    const Affine crate_from_world = sample.scene.world_from_node(crate).inverse();
    sample.scene.edit(crate).keypoints = {{"hidden", crate_from_world * hidden},
                                          {"seen", crate_from_world * seen},
                                          {"outside", crate_from_world * outside}};
    capture = ray_cast_capture(sample, 0);
    dataset = sample_dataset(sample);
    const auto labels = std::ranges::find_if(dataset.labels, [](const Labels& each) {
      const auto label = each.find("class");
      return label != each.end() && label->second == "crate";
    });
    dataset.keypoints = {{*labels, {"outside", "seen", "gone", "hidden"}}};
  }
};

}  // namespace diorama::test
