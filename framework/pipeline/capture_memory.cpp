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
  add(kFlowForward);
  add(kFlowForwardState);
  add(kFlowBackward);
  add(kFlowBackwardState);
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

int default_visits_in_flight(int threads, std::uint64_t available_bytes,
                             const CaptureMemory& memory) {
  // Measured with furnished rooms: trees of the renderer and the physics, textures, work space.
  constexpr std::uint64_t kVisitBytes = std::uint64_t(256) << 20;
  // One that simulates keeps one thread busy, and most of a job may be that.
  const std::uint64_t each = kVisitBytes + memory.capture + memory.picture;
  return int(std::clamp<std::uint64_t>(available_bytes / 2 / each, 1, std::uint64_t(threads)));
}

std::size_t default_queue_bytes(int threads, std::uint64_t available_bytes,
                                const CaptureMemory& memory) {
  constexpr std::uint64_t kLeast = std::uint64_t(256) << 20;
  // Turns that are not let through yet share half of the queue (see WriterQueue), most of it
  // encoded: a quarter or less. One visit in fifty takes as long as all threads need for that.
  const std::uint64_t wanted = 16 * std::uint64_t(threads) * memory.capture;
  return std::size_t(std::max(kLeast, std::min(wanted, available_bytes / 4)));
}

std::string memory_text(const CaptureMemory& memory) {
  return "memory beside the scene: " + mib_text(memory.capture) + " for each capture, " +
         mib_text(memory.picture) + " more while a picture is rendered\n";
}

}  // namespace diorama
