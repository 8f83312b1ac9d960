#version 460
// SPDX-License-Identifier: Apache-2.0
// Between kernels: what was filled becomes what is worked on.
#extension GL_GOOGLE_include_directive : require
layout(local_size_x = 1) in;
#include "world.glsl"
#include "job.glsl"

void main() {
  const uint paths = job.counters.next_count;
  const uint shadows = job.counters.shadow_count;
  job.counters.path_count = paths;
  job.counters.next_count = 0u;
  job.counters.ready_shadow_count = shadows;
  job.counters.shadow_count = 0u;
  const uint connections = job.counters.connection_count;
  job.counters.ready_connection_count = connections;
  job.counters.connection_count = 0u;
  job.counters.paths_groups[0] = (paths + kGroup - 1u) / kGroup;
  job.counters.paths_groups[1] = 1u;
  job.counters.paths_groups[2] = 1u;
  job.counters.shadow_groups[0] = (shadows + kGroup - 1u) / kGroup;
  job.counters.shadow_groups[1] = 1u;
  job.counters.shadow_groups[2] = 1u;
  job.counters.connection_groups[0] = (connections + kGroup - 1u) / kGroup;
  job.counters.connection_groups[1] = 1u;
  job.counters.connection_groups[2] = 1u;
  job.counters.rays += paths;
  job.counters.shadow_rays += shadows + connections;
}
