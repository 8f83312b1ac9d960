// SPDX-License-Identifier: Apache-2.0
#include "reader_support/frame_reading.h"

#include <utility>

namespace diorama {

FrameReading::FrameReading(const std::filesystem::path& folder, const Host& host,
                           const StoredInfo& info, int capture, const std::string& camera,
                           const NameSet& wanted, ReadLog& log)
    : wanted_(wanted), files_(folder, host, log, capture, camera), held_(info.holds) {
  frame_.camera_name = camera;
  frame_.camera_path = "/Cameras/" + camera;
}

void FrameReading::set_size(const StoredPicture& picture) {
  frame_.camera.width = picture.width();
  frame_.camera.height = picture.height();
}

Instance FrameReading::next_instance(const std::string& label) const {
  Instance instance;
  instance.id = std::uint32_t(frame_.instances.size()) + 1;
  instance.node_path = "/Assets/" + std::to_string(instance.id);
  if (!label.empty()) instance.labels["class"] = label;
  return instance;
}

Instance& FrameReading::add_instance(const std::string& label) {
  return frame_.instances.emplace_back(next_instance(label));
}

}  // namespace diorama
