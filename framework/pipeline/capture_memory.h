// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "diorama/camera.h"
#include "diorama/renderer.h"

namespace diorama {

/// What one capture needs beside the scene, in bytes.
struct CaptureMemory {
  std::size_t capture = 0;  ///< The channels of all its cameras; for as long as it waits.
  std::size_t picture = 0;  ///< More, while its largest picture is rendered.
};

/// `channels`: those that the renderer and the annotators make; other names count for nothing.
CaptureMemory capture_memory(const std::vector<Camera>& cameras, const NameSet& channels,
                             const Renderer& renderer);

/// How many visits keep that many threads busy, as far as their memory is there: each needs its
/// scene, the engines' views of it and its captures. At most half of the memory is counted on.
int default_visits_in_flight(int threads, std::uint64_t available_bytes,
                             const CaptureMemory& memory);

/// Memory for captures that wait to be written: enough for all threads to go on with later visits
/// while one takes long, as far as a quarter of the memory allows, and never below 256 MiB.
std::size_t default_queue_bytes(int threads, std::uint64_t available_bytes,
                                const CaptureMemory& memory);

/// One line for the dry run.
std::string memory_text(const CaptureMemory& memory);

}  // namespace diorama
