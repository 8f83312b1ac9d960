// SPDX-License-Identifier: Apache-2.0
// The scene as kernels read it, by addresses. gpu_world.h has the same structures for the CPU.
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require

layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer Vec4s { vec4 v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Floats { float v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Uints { uint v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer Ints { int v[]; };

const float kInfinite = 3e38;  // stands for infinity: drivers may take arithmetic with it lightly
const uint kNone = 0xFFFFFFFFu;

// An input of a material; see TextureSlot.
struct Slot {
  vec4 scale;
  vec4 bias;
  vec3 map_u;
  vec3 map_v;
  uint texture;
  uint wrap_u;
  uint wrap_v;
  uint channel;
};

// See SurfaceBsdf.
struct Surface {
  Vec4s layer;  // nodes, row by row, then a vec4 of means per row
  Floats glass;  // [side][row][node], then means
  uint layer_rows;
  uint glass_rows;
  vec3 base;
  float metallic;
  float transmission;
  float alpha;
  float f0;
  float specular;
  float coat;
  float coat_alpha;
  float eta;
  uint has_glass;
};

const uint kThinGlass = 1u;
const uint kBlended = 2u;
const uint kReadsUv = 4u;
const uint kTextured = 8u;
const uint kCutOut = 16u;
const uint kDimsShadows = 32u;
const uint kEmits = 64u;
const uint kSpecial = 128u;
const uint kThinWalled = 256u;

const uint kBaseColorSlot = 0u;
const uint kMetallicSlot = 1u;
const uint kRoughnessSlot = 2u;
const uint kNormalSlot = 3u;
const uint kOpacitySlot = 4u;
const uint kEmissionSlot = 5u;

struct Material {
  Surface surfaces[2];  // sharp, soft
  Slot slots[6];
  vec3 base_color;
  vec3 emission;
  float opacity;
  float opacity_threshold;
  float ior;
  float transmission;
  float metallic;
  uint flags;
};

const uint kMirrored = 1u;
const uint kHasNormals = 2u;
const uint kHasUvs = 4u;
const uint kHasColors = 8u;
const uint kDoubleSided = 16u;
const uint kCutsOut = 32u;     // some of its materials
const uint kDims = 64u;        // likewise
const uint kHasLights = 128u;
const uint kMoves = 256u;

struct Instance {
  Vec4s nodes;
  Vec4s triangles;  // three each: corner and number, two edges
  Uints shading;    // five words per number: normals and material slot
  Floats uvs;       // six per number
  Floats colors;    // nine per number
  Uints triangle_lights;
  vec4 world_from_node[3];
  vec4 node_from_world[3];
  vec3 normal_from_node[3];
  uint first_material;
  uint material_count;
  uint flags;
  vec3 centre;  // of its motion
  vec3 linear;
  vec3 axis;
  float turns_per_s;  // radians
  uint pad;
};

struct Texture {
  Uints texels;  // offsets of the levels, then texels: bytes packed, or four floats each
  int width;
  int height;
  uint level_count;
  uint kind;  // of the texels
};
const uint kLinearBytes = 0u;
const uint kSrgbBytes = 1u;
const uint kFloats = 2u;
const uint kMostLevels = 16u;

const uint kSphere = 0u;
const uint kTurningDisk = 1u;
const uint kRect = 2u;
const uint kDisk = 3u;
const uint kDistant = 4u;
const uint kDome = 5u;
const uint kTriangles = 6u;

const uint kLightMirrored = 1u;
const uint kLightDoubleSided = 2u;
const uint kLightVisible = 4u;

// See LightTable::Record.
struct Light {
  Vec4s triangles;  // three each: corner and number, edge and area up to its end, edge
  Uints patches;    // of a dome: see patch_sample()
  Uints grid;       // of a dome or distant light: see grid_cell()
  vec3 position;
  vec3 axis_x;
  vec3 axis_y;
  vec3 direction;
  vec3 radiance;
  vec3 dome_from_world[3];
  float radius;
  float area;
  float power;
  float one_minus_cos;
  float cos_outer;
  float cos_inner;
  uint shape;
  uint flags;
  uint texture;
  uint instance;
  uint triangle_count;
  uint pad;
};

layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer Instances { Instance v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer Materials { Material v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer Textures { Texture v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer Lights { Light v[]; };

layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer World {
  Vec4s tree;       // over parts of the instances
  uvec2 structure;  // address of what the device's own ray queries go through; 0: there is none
  Uints references;  // of its leaves: an instance and a child in its tree
  Instances instances;
  Uints slot_materials;
  Materials materials;
  Textures textures;
  Floats linear_from_srgb;
  Lights lights;
  Uints light_blocks;
  Uints light_places;
  Uints light_bodies;
  Uints light_order;
  Uints surroundings;
  Ints entry_lights;
  Uints light_shapes;
  uint instance_count;
  uint light_count;
  uint root_count;
  uint entry_count;
  uint shape_count;
  uint surroundings_count;
  uint block_count;
  uint stacks_lobes;
  float window;
};
