// SPDX-License-Identifier: Apache-2.0
// The sum of value_of() over the pixels of a block, by all of a group in the same order each time.
vec4 value_of(uint pixel);

shared vec4 parts[64];

// For the first of the group.
vec4 block_sum(uint block) {
  const uint x_begin = block % block_columns() * uint(kBlock);
  const uint y_begin = block / block_columns() * uint(kBlock);
  const uint x = x_begin + gl_LocalInvocationIndex % 16u;
  vec4 sum = vec4(0.0);
  for (uint row = gl_LocalInvocationIndex / 16u; row < uint(kBlock); row += 4u) {
    const uint y = y_begin + row;
    if (x < width && y < height) sum += value_of(y * width + x);
  }
  barrier();
  parts[gl_LocalInvocationIndex] = sum;
  for (uint half_count = 32u; half_count > 0u; half_count /= 2u) {
    barrier();
    if (gl_LocalInvocationIndex < half_count) {
      parts[gl_LocalInvocationIndex] += parts[gl_LocalInvocationIndex + half_count];
    }
  }
  barrier();
  return parts[0];
}
