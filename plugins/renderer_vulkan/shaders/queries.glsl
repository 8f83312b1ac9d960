// SPDX-License-Identifier: Apache-2.0
// What a ray query of the device tells of triangles; they are those of trees.glsl, in their order.
#extension GL_EXT_ray_query : require

// Of a candidate, or (is_committed, known when compiled) of what was found in the end.
#define HIT_OF(query, is_committed)                                                             \
  Hit(rayQueryGetIntersectionTEXT(query, is_committed),                                         \
      rayQueryGetIntersectionBarycentricsEXT(query, is_committed).x,                            \
      rayQueryGetIntersectionBarycentricsEXT(query, is_committed).y,                            \
      uint(rayQueryGetIntersectionInstanceIdEXT(query, is_committed)),                          \
      uint(rayQueryGetIntersectionPrimitiveIndexEXT(query, is_committed)))

uint number_of(Hit hit) {
  return floatBitsToUint(world.instances.v[hit.instance].triangles.v[3u * hit.triangle].w);
}
