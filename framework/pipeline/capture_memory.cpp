// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/capture_memory.h"

#include <algorithm>
#include <cstdio>

#include "diorama/frame.h"

namespace diorama {
namespace {

std::size_t bytes_per_pixel(const NameSet& channels) {
  std::size_t bytes = 0;
  const auto add = [&]<class Pixel>(Channel<Pixel> channel) {
    if (channels.contains(channel.name)) bytes += sizeof(Pixel);
  };
  add(kColor);
  add(kColorHdr);
  add(kDistanceToCamera);
  add(kDistanceToImagePlane);
  add(kNormals);
  add(kLeafId);
  add(kInstanceId);
  add(kPosition);
  add(kUv);
  add(kAlbedo);
  add(kObjectCoordinates);
  add(kMotion);
  add(kSensorDepth);
  return bytes;
}

std::string mib_text(std::size_t bytes) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f MiB", double(bytes) / double(1 << 20));
  return text;
}

}  // namespace

CaptureMemory capture_memory(const std::vector<Camera>& cameras, const NameSet& channels,
                             const Renderer& renderer) {
  CaptureMemory memory;
  for (const Camera& camera : cameras) {
    memory.capture +=
        bytes_per_pixel(channels) * std::size_t(camera.width) * std::size_t(camera.height);
    memory.picture = std::max(memory.picture, renderer.working_bytes(camera, channels));
  }
  return memory;
}

std::string memory_text(const CaptureMemory& memory) {
  return "memory beside the scene: " + mib_text(memory.capture) + " for each capture, " +
         mib_text(memory.picture) + " more while a picture is rendered\n";
}

}  // namespace diorama
