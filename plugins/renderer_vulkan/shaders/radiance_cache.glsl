// SPDX-License-Identifier: Apache-2.0
// Light of surfaces that a path meets second; see radiance_cache.cpp of renderer_support.
const float kCacheCellSize = 0.04;
const int kCacheLevels = 5;

// What a weight brings there; false: too little is known.
bool find_cached(vec3 position, vec3 normal, float reach, out vec3 light) {
  const vec3 from_eye = position - job.cache_eye;
  const float distance = max(sqrt(dot(from_eye, from_eye)), 1e-6);
  int exponent = int(floatBitsToUint(1.41421356 * kCacheCellSize * distance) >> 23) - 127;
  const float cells_per_metre = uintBitsToFloat(uint(127 - exponent) << 23);
  ivec3 cell = ivec3(clamp(floor(position * cells_per_metre), -1e9, 1e9));
  const vec3 size = abs(normal);
  uint axis = size.y > size.x ? 1u : 0u;
  if (size.z > size[axis]) axis = 2u;
  const uint side = 2u * axis + (normal[axis] < 0.0 ? 1u : 0u);
  light = vec3(0.0);
  const int reached = int(floatBitsToUint(max(reach, 1e-6)) >> 23) - 127;
  const int widest = min(exponent + kCacheLevels - 1, reached);
  [[dont_unroll]] for (; exponent <= widest; ++exponent) {
    uint wanted = hashed(uint(exponent) * 8u + side);
    wanted = hashed(wanted + uint(cell.x));
    wanted = hashed(wanted + uint(cell.y));
    wanted = hashed(wanted + uint(cell.z)) | 1u;
    uint place = (wanted >> 1) & job.cache_mask;
    [[dont_unroll]] for (uint tried = 0u; tried <= job.cache_mask; ++tried) {
      const vec4 entry = job.cache.v[place];
      const uint key = floatBitsToUint(entry.w);
      if (key == 0u) break;
      if (key == wanted) {
        light = entry.xyz;
        return true;
      }
      place = (place + 1u) & job.cache_mask;
    }
    cell >>= 1;
  }
  return false;
}
