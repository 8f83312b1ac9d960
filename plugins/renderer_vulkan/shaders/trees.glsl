// SPDX-License-Identifier: Apache-2.0
// Trees of boxes with two children each, over the instances and within meshes. A child is a node, or
// a leaf: a part of an instance, or up to eight triangles in a row.
const uint kLeaf = 0x80000000u;
const uint kReturn = 0xFFFFFFFEu;  // from a mesh to the tree of the instances
const uint kEnd = 0xFFFFFFFFu;
const uint kStackSize = 96u;

vec3 inverse_of(vec3 d) {
  const float kLeast = 1e-20;
  return 1.0 / vec3(abs(d.x) < kLeast ? (d.x < 0.0 ? -kLeast : kLeast) : d.x,
                    abs(d.y) < kLeast ? (d.y < 0.0 ? -kLeast : kLeast) : d.y,
                    abs(d.z) < kLeast ? (d.z < 0.0 ? -kLeast : kLeast) : d.z);
}

// Where a ray enters a box; kInfinite: it does not.
float entry_of(vec3 low, vec3 high, vec3 origin, vec3 inverse, float t_min, float t_max) {
  const vec3 a = (low - origin) * inverse;
  const vec3 b = (high - origin) * inverse;
  const vec3 near = min(a, b);
  const vec3 far = max(a, b);
  const float enters = max(max(near.x, near.y), max(near.z, t_min));
  const float leaves = min(min(far.x, far.y), min(far.z, t_max)) * 1.0000004;
  return enters <= leaves ? enters : kInfinite;
}

#define TRAVERSE(ON_HIT)                                                                          \
  uint stack[kStackSize];                                                                         \
  uint top = 0u;                                                                                  \
  Vec4s nodes = world.tree;                                                                       \
  uint instance = kNone;                                                                          \
  uint flags = 0u;                                                                                \
  vec3 o = origin;                                                                                \
  vec3 d = direction;                                                                             \
  vec3 inverse = inverse_of(d);                                                                   \
  uint node = world.instance_count > 0u ? 0u : kEnd;                                              \
  const uint limit = job.iteration_limit;                                                         \
  uint iterations = 0u;                                                                           \
  while (node != kEnd) {                                                                          \
    while (node < kLeaf && iterations <= limit) {                                                 \
      ++iterations;                                                                               \
      const vec4 low_a = nodes.v[4u * node];                                                      \
      const vec4 high_a = nodes.v[4u * node + 1u];                                                \
      const vec4 low_b = nodes.v[4u * node + 2u];                                                 \
      const vec4 high_b = nodes.v[4u * node + 3u];                                                \
      const float a = entry_of(low_a.xyz, high_a.xyz, o, inverse, t_min, t_max);                  \
      const float b = entry_of(low_b.xyz, high_b.xyz, o, inverse, t_min, t_max);                  \
      const uint child_a = floatBitsToUint(low_a.w);                                              \
      const uint child_b = floatBitsToUint(low_b.w);                                              \
      if (a < kInfinite && b < kInfinite) {                                                       \
        node = a <= b ? child_a : child_b;                                                        \
        stack[top++] = a <= b ? child_b : child_a;                                                \
      } else if (a < kInfinite) {                                                                 \
        node = child_a;                                                                           \
      } else if (b < kInfinite) {                                                                 \
        node = child_b;                                                                           \
      } else {                                                                                    \
        node = top > 0u ? stack[--top] : kEnd;                                                    \
      }                                                                                           \
    }                                                                                             \
    if (++iterations > limit) {                                                                   \
      job.counters.is_over_limit = 1u;                                                            \
      break;                                                                                      \
    }                                                                                             \
    if (node == kReturn) {                                                                        \
      nodes = world.tree;                                                                         \
      instance = kNone;                                                                           \
      o = origin;                                                                                 \
      d = direction;                                                                              \
      inverse = inverse_of(d);                                                                    \
      node = top > 0u ? stack[--top] : kEnd;                                                      \
    } else if (node == kEnd) {                                                                    \
      break;                                                                                      \
    } else if (instance == kNone) {                                                               \
      const uint reference = 2u * (node & 0x7FFFFFFFu);                                           \
      instance = world.references.v[reference];                                                   \
      flags = world.instances.v[instance].flags;                                                  \
      nodes = world.instances.v[instance].nodes;                                                  \
      vec3 from = origin;                                                                         \
      vec3 towards = direction;                                                                   \
      if ((flags & kMoves) != 0u) {                                                               \
        const mat3 turn = turn_of(instance, time);                                                \
        const vec3 centre = world.instances.v[instance].centre;                                   \
        const float seconds = (time - 0.5) * world.window;                                        \
        from = (from - centre - world.instances.v[instance].linear * seconds) * turn + centre;    \
        towards = towards * turn;                                                                 \
      }                                                                                           \
      const vec4 r0 = world.instances.v[instance].node_from_world[0];                             \
      const vec4 r1 = world.instances.v[instance].node_from_world[1];                             \
      const vec4 r2 = world.instances.v[instance].node_from_world[2];                             \
      o = vec3(dot(r0, vec4(from, 1.0)), dot(r1, vec4(from, 1.0)), dot(r2, vec4(from, 1.0)));     \
      d = vec3(dot(r0.xyz, towards), dot(r1.xyz, towards), dot(r2.xyz, towards));                 \
      inverse = inverse_of(d);                                                                    \
      stack[top++] = kReturn;                                                                     \
      node = world.references.v[reference + 1u];                                                  \
    } else {                                                                                      \
      const uint first = (node & 0x7FFFFFFFu) >> 3;                                               \
      const uint end = first + (node & 7u) + 1u;                                                  \
      Vec4s triangles = world.instances.v[instance].triangles;                                    \
      for (uint triangle = first; triangle < end; ++triangle) {                                   \
        const vec4 corner = triangles.v[3u * triangle];                                           \
        const vec3 ab = triangles.v[3u * triangle + 1u].xyz;                                      \
        const vec3 ac = triangles.v[3u * triangle + 2u].xyz;                                      \
        const vec3 p = cross(d, ac);                                                              \
        const float det = dot(ab, p);                                                             \
        if (det == 0.0) continue;                                                                 \
        const float scale = 1.0 / det;                                                            \
        const vec3 s = o - corner.xyz;                                                            \
        const float u = dot(s, p) * scale;                                                        \
        const vec3 q = cross(s, ab);                                                              \
        const float v = dot(d, q) * scale;                                                        \
        const float t = dot(ac, q) * scale;                                                       \
        if (!(u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > t_min && t <= t_max)) continue;         \
        const uint number = floatBitsToUint(corner.w);                                            \
        ON_HIT                                                                                    \
      }                                                                                           \
      iterations += end - first;                                                                  \
      if (node != kEnd) node = top > 0u ? stack[--top] : kEnd;                                    \
    }                                                                                             \
  }
