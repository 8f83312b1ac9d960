// SPDX-License-Identifier: Apache-2.0
#include "framework/datasets/frame_copy.h"

#include <string>
#include <variant>

namespace diorama {

Frame copy_of(const Frame& frame, const NameSet& channels) {
  Frame copy;
  copy.camera_name = frame.camera_name;
  copy.camera_path = frame.camera_path;
  copy.camera = frame.camera;
  copy.world_from_camera = frame.world_from_camera;
  copy.instances = frame.instances;
  copy.occlusions = frame.occlusions;
  copy.joints = frame.joints;
  copy.leaf_paths = frame.leaf_paths;
  copy.exposure = frame.exposure;
  copy.seed = frame.seed;
  for (const std::string& name : frame.channels()) {
    if (!channels.contains(name)) continue;
    std::visit(
        [&]<class Pixel>(const Image<Pixel>& image) { copy.set(Channel<Pixel>{name}, image); },
        frame.image_named(name));
  }
  return copy;
}

Frame copy_of(const Frame& frame) { return copy_of(frame, frame.channels()); }

}  // namespace diorama
