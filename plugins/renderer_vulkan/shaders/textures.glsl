// SPDX-License-Identifier: Apache-2.0
// See mip_texture.h of renderer_support.
#extension GL_EXT_control_flow_attributes : require
const uint kRepeat = 0u;
const uint kClamp = 1u;
const uint kMirror = 2u;
const uint kBlack = 3u;

int wrapped(int i, int size, uint wrap) {
  if (i >= 0 && i < size) return i;
  if (wrap == kBlack) return -1;
  if (wrap == kClamp) return clamp(i, 0, size - 1);
  if (wrap == kMirror) {
    const int twice = 2 * size;
    int k = i % twice;
    if (k < 0) k += twice;
    return k < size ? k : twice - 1 - k;
  }
  return i < 0 ? i + size : i - size;
}

vec4 texel(uint texture, uint level_offset, int level_width, int x, int y) {
  if (x < 0 || y < 0) return vec4(0.0);
  Uints texels = world.textures.v[texture].texels;
  const uint kind = world.textures.v[texture].kind;
  const uint at = level_offset + uint(y * level_width + x);
  if (kind == kFloats) {
    const uint first = kMostLevels + 4u * at;
    return vec4(uintBitsToFloat(texels.v[first]), uintBitsToFloat(texels.v[first + 1u]),
                uintBitsToFloat(texels.v[first + 2u]), uintBitsToFloat(texels.v[first + 3u]));
  }
  const uint packed = texels.v[kMostLevels + at];
  if (kind == kLinearBytes) return unpackUnorm4x8(packed);
  return vec4(world.linear_from_srgb.v[packed & 255u],
              world.linear_from_srgb.v[packed >> 8 & 255u],
              world.linear_from_srgb.v[packed >> 16 & 255u], float(packed >> 24) / 255.0);
}

vec4 bilinear(uint texture, uint level, vec2 uv, uint wrap_u, uint wrap_v) {
  const int width = max(1, world.textures.v[texture].width >> level);
  const int height = max(1, world.textures.v[texture].height >> level);
  const uint offset = world.textures.v[texture].texels.v[level];
  const float kLimit = 1e8;
  float x = clamp(uv.x, -kLimit, kLimit);
  float y = clamp(1.0 - uv.y, -kLimit, kLimit);
  if (wrap_u == kRepeat) x -= floor(x);
  if (wrap_v == kRepeat) y -= floor(y);
  x = clamp(x * float(width) - 0.5, -kLimit, kLimit);
  y = clamp(y * float(height) - 0.5, -kLimit, kLimit);
  const int left = int(floor(x));
  const int above = int(floor(y));
  const float fx = x - float(left);
  const float fy = y - float(above);
  const int x0 = wrapped(left, width, wrap_u);
  const int x1 = wrapped(left + 1, width, wrap_u);
  const int y0 = wrapped(above, height, wrap_v);
  const int y1 = wrapped(above + 1, height, wrap_v);
  // Loops, as kernels hold many lookups: code that does not fit caches costs more than rounds.
  vec4 sum = vec4(0.0);
  [[dont_unroll]] for (int row = 0; row < 2; ++row) {
    vec4 line = vec4(0.0);
    [[dont_unroll]] for (int column = 0; column < 2; ++column) {
      line += texel(texture, offset, width, column == 0 ? x0 : x1, row == 0 ? y0 : y1) *
              (column == 0 ? 1.0 - fx : fx);
    }
    sum += line * (row == 0 ? 1.0 - fy : fy);
  }
  return sum;
}

vec4 lookup(uint texture, vec2 uv, float footprint, uint wrap_u, uint wrap_v) {
  const float texels =
      footprint * float(max(world.textures.v[texture].width, world.textures.v[texture].height));
  const bool is_fine = !(texels > 1.0);
  const float level =
      is_fine ? 0.0 : min(log2(texels), float(world.textures.v[texture].level_count - 1u));
  const uint low = uint(level);
  const float rest = level - float(low);
  vec4 sum = vec4(0.0);
  const uint count = rest == 0.0 ? 1u : 2u;
  [[dont_unroll]] for (uint i = 0u; i < count; ++i) {
    sum += bilinear(texture, low + i, uv, wrap_u, wrap_v) * (i == 0u ? 1.0 - rest : rest);
  }
  return sum;
}

bool has_texture(uint material, uint slot) {
  return world.materials.v[material].slots[slot].texture != kNone;
}

vec4 slot_at(uint material, uint slot, vec2 mesh_uv, float footprint) {
  const Slot s = world.materials.v[material].slots[slot];
  const vec2 uv =
      vec2(dot(s.map_u, vec3(mesh_uv, 1.0)), dot(s.map_v, vec3(mesh_uv, 1.0)));
  const float scale = sqrt(abs(s.map_u.x * s.map_v.y - s.map_u.y * s.map_v.x));
  return lookup(s.texture, uv, footprint * scale, s.wrap_u, s.wrap_v) * s.scale + s.bias;
}

float scalar_at(uint material, uint slot, vec2 mesh_uv, float footprint) {
  return slot_at(material, slot, mesh_uv, footprint)[world.materials.v[material].slots[slot].channel];
}

float opacity_at(uint material, vec2 uv) {
  if (!has_texture(material, kOpacitySlot)) return world.materials.v[material].opacity;
  return scalar_at(material, kOpacitySlot, uv, 0.0);
}

vec3 emission_at(uint material, vec2 uv, float footprint) {
  const vec3 emission = world.materials.v[material].emission;
  if (!has_texture(material, kEmissionSlot)) return emission;
  return emission * max(slot_at(material, kEmissionSlot, uv, footprint).xyz, vec3(0.0));
}
