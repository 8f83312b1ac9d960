#version 460
// SPDX-License-Identifier: Apache-2.0
// A round: every pixel becomes the mean of the neighbours at the round's reach that are like it.
#extension GL_GOOGLE_include_directive : require
#include "planes.glsl"

const float kOwnShare = 6.0 / 14.0;  // of the kernel along one axis
const float kOtherShare = 4.0 / 14.0;
const float kTurn = 10.0 / 16.0;     // how much turned normals count
const float kPlaneSlack = 0.016;     // of the distance from the camera

// exp(-16 x) for x >= 0, from 1 - x, to 2 %.
float exp16(float one_less) {
  const float base = max(0.0, one_less);
  const float b2 = base * base;
  const float b4 = b2 * b2;
  const float b8 = b4 * b4;
  return b8 * b8;
}

void main() {
  for (uint i = gl_GlobalInvocationID.x; i < pixel_count(); i += invocation_count()) {
    const int x = int(i % width);
    const int y = int(i / width);
    const vec4 own_normal = NORMAL(i);
    const vec4 own_position = POSITION(i);
    const vec4 own_light = LIGHT(from, i);
    const float own_certainty = CERTAINTY(i);
    const vec3 n = kTurn * own_normal.xyz;
    const float plane = dot(n, own_position.xyz);
    const float slack = (1.0 / (16.0 * kTurn)) / (kPlaneSlack * length(own_position.xyz) + 1e-6);
    vec3 irradiance = vec3(0.0);
    float variance = 0.0;
    float weights = 0.0;
    for (int v = -1; v <= 1; ++v) {
      for (int u = -1; u <= 1; ++u) {
        const int other_x = x + u * int(reach);
        const int other_y = y + v * int(reach);
        if (other_x < 0 || other_x >= int(width) || other_y < 0 || other_y >= int(height)) continue;
        const uint other = uint(other_y) * width + uint(other_x);
        const vec4 normal = NORMAL(other);
        const vec4 position = POSITION(other);
        const vec4 light = LIGHT(from, other);
        const float share = (u == 0 ? kOwnShare : kOtherShare) * (v == 0 ? kOwnShare : kOtherShare);
        const float unlike =
            slack * abs(dot(n, position.xyz) - plane) + kTurn - dot(n, normal.xyz);
        const float brighter = abs(light.w - own_light.w);
        const float alike = (1.0 - unlike * max(own_normal.w, normal.w)) -
                            brighter * (own_certainty + CERTAINTY(other));
        const float w = share * exp16(alike);
        irradiance += w * light.xyz;
        variance += w * w * VARIANCE(from, other);
        weights += w;
      }
    }
    // Pixels without a surface have no weight and stay black.
    const float scale = is_surface(own_normal) ? 1.0 / max(weights, 1e-12) : 0.0;
    LIGHT(1u - from, i) = with_luminance(irradiance * scale);
    VARIANCE(1u - from, i) = variance * scale * scale;
    const float kOwn = kOwnShare * kOwnShare;
    if (reach == 1u) support.v[i] = (weights - kOwn) * (1.0 / (1.0 - kOwn));
  }
}
