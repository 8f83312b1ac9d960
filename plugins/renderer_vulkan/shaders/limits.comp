#version 460
// SPDX-License-Identifier: Apache-2.0
// Finds out how often a kernel may loop: some drivers end loops silently.
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 1) in;
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Counted { uint v[]; };
layout(push_constant, scalar) uniform Push {
  Counted counted;
  uint wanted;
};

void main() {
  uint state = wanted;
  uint count = 0u;
  // Not to be foreseen by a compiler: the state never becomes zero.
  while (state != 0u && count < wanted) {
    state = state * 747796405u + 2891336453u | 1u;
    ++count;
  }
  counted.v[0] = count;
}
