// SPDX-License-Identifier: Apache-2.0
// What triangles know; see mesh_instance.h and shading_mesh.h of renderer_support.
float half_word(uint word, uint half_index) {
  return float(int(word << (16u - 16u * half_index)) >> 16);
}

// Interpolated, in node space, not unit length.
vec3 node_normal(uint instance, uint number, float u, float v) {
  Uints words = world.instances.v[instance].shading;
  const uint first = 5u * number;
  const uint w0 = words.v[first];
  const uint w1 = words.v[first + 1u];
  const uint w2 = words.v[first + 2u];
  const uint w3 = words.v[first + 3u];
  const uint w4 = words.v[first + 4u];
  const vec3 a = vec3(half_word(w0, 0u), half_word(w0, 1u), half_word(w1, 0u));
  const vec3 b = vec3(half_word(w1, 1u), half_word(w2, 0u), half_word(w2, 1u));
  const vec3 c = vec3(half_word(w3, 0u), half_word(w3, 1u), half_word(w4, 0u));
  return (1.0 - u - v) * a + u * b + v * c;
}

uint material_of(uint instance, uint number) {
  const uint count = world.instances.v[instance].material_count;
  uint slot = 0u;
  if (count > 1u) {
    slot = min(world.instances.v[instance].shading.v[5u * number + 4u] >> 16, count - 1u);
  }
  return world.slot_materials.v[world.instances.v[instance].first_material + slot];
}

struct CornerUvs {
  vec2 a, b, c;
};
CornerUvs corner_uvs(uint instance, uint number) {
  Floats uvs = world.instances.v[instance].uvs;
  const uint k = 6u * number;
  return CornerUvs(vec2(uvs.v[k], uvs.v[k + 1u]), vec2(uvs.v[k + 2u], uvs.v[k + 3u]),
                   vec2(uvs.v[k + 4u], uvs.v[k + 5u]));
}

vec2 uv_at(uint instance, uint number, float u, float v) {
  if ((world.instances.v[instance].flags & kHasUvs) == 0u) return vec2(0.0);
  const CornerUvs uvs = corner_uvs(instance, number);
  return uvs.a * (1.0 - u - v) + uvs.b * u + uvs.c * v;
}

vec3 color_at(uint instance, uint number, float u, float v) {
  Floats c = world.instances.v[instance].colors;
  const uint k = 9u * number;
  return vec3(c.v[k], c.v[k + 1u], c.v[k + 2u]) * (1.0 - u - v) +
         vec3(c.v[k + 3u], c.v[k + 4u], c.v[k + 5u]) * u +
         vec3(c.v[k + 6u], c.v[k + 7u], c.v[k + 8u]) * v;
}

// From where something is at the moment of the poses to where it is at another share of the window.
mat3 turn_by(vec3 axis, float angle) {
  const float c = cos(angle);
  const float s = sin(angle);
  const vec3 a = axis * (1.0 - c);
  return mat3(a.x * axis.x + c, a.x * axis.y + s * axis.z, a.x * axis.z - s * axis.y,
              a.y * axis.x - s * axis.z, a.y * axis.y + c, a.y * axis.z + s * axis.x,
              a.z * axis.x + s * axis.y, a.z * axis.y - s * axis.x, a.z * axis.z + c);
}
mat3 turn_of(uint instance, float time) {
  const float seconds = (time - 0.5) * world.window;
  return turn_by(world.instances.v[instance].axis,
                 world.instances.v[instance].turns_per_s * seconds);
}

vec3 turned_vector(uint instance, uint flags, vec3 v, float time) {
  return (flags & kMoves) != 0u ? turn_of(instance, time) * v : v;
}

vec3 linear_part(uint instance, vec3 v) {
  return vec3(dot(world.instances.v[instance].world_from_node[0].xyz, v),
              dot(world.instances.v[instance].world_from_node[1].xyz, v),
              dot(world.instances.v[instance].world_from_node[2].xyz, v));
}

// Of a normal as long as twice its triangle's area.
vec3 normal_in_world(uint instance, vec3 n) {
  const vec3 r0 = world.instances.v[instance].world_from_node[0].xyz;
  const vec3 r1 = world.instances.v[instance].world_from_node[1].xyz;
  const vec3 r2 = world.instances.v[instance].world_from_node[2].xyz;
  const vec3 c0 = vec3(r0.x, r1.x, r2.x);
  const vec3 c1 = vec3(r0.y, r1.y, r2.y);
  const vec3 c2 = vec3(r0.z, r1.z, r2.z);
  return cross(c1, c2) * n.x + cross(c2, c0) * n.y + cross(c0, c1) * n.z;
}

float step_length(vec3 position) { return 2e-5 * (1.0 + largest(abs(position))); }
vec3 leave(vec3 position, vec3 flat_normal, vec3 towards) {
  const vec3 off = step_length(position) * flat_normal;
  return position + (dot(towards, flat_normal) < 0.0 ? -off : off);
}

float fresnel_dielectric(float cos_i, float eta) {
  const float sin2_t = max(0.0, 1.0 - cos_i * cos_i) / (eta * eta);
  const float cos_t = sqrt(max(0.0, 1.0 - sin2_t));
  const float parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
  const float perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
  const float reflected = 0.5 * (parallel * parallel + perpendicular * perpendicular);
  return sin2_t < 1.0 ? reflected : 1.0;
}
