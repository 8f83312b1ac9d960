// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>

#include "diorama/math.h"

// The structures of world.glsl and job.glsl as the processor writes them: the same members in the
// same order. Addresses are the device's.
namespace diorama::gpu {

using Address = std::uint64_t;
using Rows = std::array<std::array<float, 4>, 3>;

inline constexpr std::uint32_t kNone = 0xFFFFFFFFu;
inline constexpr float kInfinite = 3e38f;

struct Slot {
  std::array<float, 4> scale;
  std::array<float, 4> bias;
  std::array<float, 3> map_u;
  std::array<float, 3> map_v;
  std::uint32_t texture = kNone;
  std::uint32_t wrap_u = 0;
  std::uint32_t wrap_v = 0;
  std::uint32_t channel = 0;
};
static_assert(sizeof(Slot) == 72);

struct Surface {
  Address layer = 0;
  Address glass = 0;
  std::uint32_t layer_rows = 0;
  std::uint32_t glass_rows = 0;
  Vec3f base;
  float metallic = 0.0f;
  float transmission = 0.0f;
  float alpha = 0.0f;
  float f0 = 0.0f;
  float specular = 0.0f;
  float coat = 0.0f;
  float coat_alpha = 0.0f;
  float eta = 1.0f;
  std::uint32_t has_glass = 0;
};
static_assert(sizeof(Surface) == 72);

enum MaterialFlags : std::uint32_t {
  kThinGlass = 1,
  kBlended = 2,
  kReadsUv = 4,
  kTextured = 8,
  kCutOut = 16,
  kDimsShadows = 32,
  kEmits = 64,
  kSpecial = 128,
  kThinWalled = 256,
};

struct Material {
  std::array<Surface, 2> surfaces;
  std::array<Slot, 6> slots;
  Vec3f base_color;
  Vec3f emission;
  float opacity = 1.0f;
  float opacity_threshold = 0.0f;
  float ior = 1.5f;
  float transmission = 0.0f;
  float metallic = 0.0f;
  std::uint32_t flags = 0;
};
static_assert(sizeof(Material) == 624);

enum InstanceFlags : std::uint32_t {
  kMirrored = 1,
  kHasNormals = 2,
  kHasUvs = 4,
  kHasColors = 8,
  kDoubleSided = 16,
  kCutsOut = 32,
  kDims = 64,
  kHasLights = 128,
  kMoves = 256,
};

struct Instance {
  Address nodes = 0;
  Address triangles = 0;
  Address shading = 0;
  Address uvs = 0;
  Address colors = 0;
  Address triangle_lights = 0;
  Rows world_from_node;
  Rows node_from_world;
  std::array<Vec3f, 3> normal_from_node;
  std::uint32_t first_material = 0;
  std::uint32_t material_count = 0;
  std::uint32_t flags = 0;
  Vec3f centre = Vec3f::Zero();
  Vec3f linear = Vec3f::Zero();
  Vec3f axis = Vec3f::UnitZ();
  float turns_per_s = 0.0f;
  std::uint32_t pad = 0;
};
static_assert(sizeof(Instance) == 240);

enum TexelKind : std::uint32_t { kLinearBytes, kSrgbBytes, kFloats };
inline constexpr std::uint32_t kMostLevels = 16;

struct Texture {
  Address texels = 0;
  std::int32_t width = 0;
  std::int32_t height = 0;
  std::uint32_t level_count = 0;
  std::uint32_t kind = 0;
};
static_assert(sizeof(Texture) == 24);

enum LightFlags : std::uint32_t {
  kLightMirrored = 1,
  kLightDoubleSided = 2,
  kLightVisible = 4,
};

struct Light {
  Address triangles = 0;
  Address patches = 0;
  Address grid = 0;
  Vec3f position;
  Vec3f axis_x;
  Vec3f axis_y;
  Vec3f direction;
  Vec3f radiance;
  std::array<Vec3f, 3> dome_from_world;
  float radius = 0.0f;
  float area = 0.0f;
  float power = 0.0f;
  float one_minus_cos = 0.0f;
  float cos_outer = 0.0f;
  float cos_inner = 0.0f;
  std::uint32_t shape = 0;
  std::uint32_t flags = 0;
  std::uint32_t texture = kNone;
  std::uint32_t instance = 0;
  std::uint32_t triangle_count = 0;
  std::uint32_t pad = 0;
};
static_assert(sizeof(Light) == 168);

/// A part of an instance's tree, as leaves of the tree over the instances name them.
struct Reference {
  std::uint32_t instance = 0;
  std::uint32_t child = 0;  ///< As in TreeNode.
};

struct World {
  Address tree = 0;
  Address structure = 0;
  Address references = 0;
  Address instances = 0;
  Address slot_materials = 0;
  Address materials = 0;
  Address textures = 0;
  Address linear_from_srgb = 0;
  Address lights = 0;
  Address light_blocks = 0;
  Address light_places = 0;
  Address light_bodies = 0;
  Address light_order = 0;
  Address surroundings = 0;
  Address entry_lights = 0;
  Address light_shapes = 0;
  std::uint32_t instance_count = 0;
  std::uint32_t light_count = 0;
  std::uint32_t root_count = 0;
  std::uint32_t entry_count = 0;
  std::uint32_t shape_count = 0;
  std::uint32_t surroundings_count = 0;
  std::uint32_t block_count = 0;
  std::uint32_t stacks_lobes = 0;
  float window = 0.0f;
  std::uint32_t pad = 0;
};

struct SampleSlot {
  std::uint32_t x = 0;
  std::uint32_t y = 0;
  std::uint32_t columns = 0;
  std::uint32_t rows = 0;
  std::uint32_t key = 0;
  std::uint32_t sample_index = 0;
};

struct SlotRange {
  std::uint32_t first = 0;
  std::uint32_t count = 0;
};

struct PixelSum {
  Vec3f seen = Vec3f::Zero();
  Vec3f scattered = Vec3f::Zero();
  Vec3f albedo = Vec3f::Zero();
  Vec3f normal = Vec3f::Zero();
  Vec3f position = Vec3f::Zero();
  float mean = 0.0f;
  float squares = 0.0f;
  float brightest = 0.0f;
  std::uint32_t count = 0;
  std::uint32_t surfaces = 0;
  std::uint32_t chances = 0;
};
static_assert(sizeof(PixelSum) == 84);

enum CacheUse : std::uint32_t { kNoCache, kCacheLearns, kCacheEnds };

/// What a path that learns for a cache finds; see RadianceCache::Finding and LearningPaths::Path.
struct Finding {
  Vec3f position;
  float is_there;
  Vec3f normal;
  float reach;
  Vec3f weight;
  float clamp;
  Vec3f light;
  float pad_light;
};
static_assert(sizeof(Finding) == 64);

/// What kernels read of VirtualLights::Light beside its Candidate.
struct VirtualLight {
  Vec3f normal;
  Vec3f to_light;
  Vec3f irradiance;
  std::uint32_t pad = 0;
  Surface surface;
};
static_assert(sizeof(VirtualLight) == 112);

struct Counters {
  std::array<std::uint32_t, 3> paths_groups{};
  std::array<std::uint32_t, 3> shadow_groups{};
  std::array<std::uint32_t, 3> connection_groups{};
  std::uint32_t path_count = 0;
  std::uint32_t next_count = 0;
  std::uint32_t shadow_count = 0;
  std::uint32_t ready_shadow_count = 0;
  std::uint32_t connection_count = 0;
  std::uint32_t ready_connection_count = 0;
  std::uint32_t is_over_limit = 0;
  std::uint32_t rays = 0;
  std::uint32_t shadow_rays = 0;
};

struct Job {
  Address counters = 0;
  Address slots = 0;
  Address ranges = 0;
  Address state = 0;
  Address results = 0;
  Address hits = 0;
  Address hit_triangles = 0;
  Address shadows = 0;
  Address connections = 0;
  std::array<Address, 2> queues{};
  Address camera_rays = 0;
  Address sums = 0;
  Address film = 0;
  Address cache = 0;
  Address findings = 0;
  Address candidates = 0;
  Address virtual_lights = 0;
  Address part_starts = 0;
  Address part_triangles = 0;
  Address part_densities = 0;
  std::uint32_t virtual_light_count = 0;
  std::uint32_t cache_mask = 0;
  std::uint32_t cache_use = 0;
  std::uint32_t capacity = 0;
  std::uint32_t width = 0;
  std::uint32_t sample_bits = 0;
  std::uint32_t slot_count = 0;
  std::uint32_t pixel_count = 0;
  std::uint32_t has_camera_rays = 0;
  std::uint32_t starts_at_centres = 0;
  std::uint32_t iteration_limit = 0;
  std::int32_t max_bounces = 0;
  float clamp_to = 0.0f;
  std::uint32_t has_caustics = 0;
  float indirect_share = 1.0f;
  float continuation = 1.0f;
  float most_spread = 0.0f;
  float pixel_angle = 0.0f;
  Vec3f cache_eye = Vec3f::Zero();
  Vec3f camera = Vec3f::Zero();
  Vec3f towards = Vec3f::Zero();
  Vec3f per_column = Vec3f::Zero();
  Vec3f per_row = Vec3f::Zero();
  float near = 0.0f;
  float far = 0.0f;
};

struct Push {
  Address world = 0;
  Address job = 0;
  std::uint32_t queue = 0;
  std::uint32_t connects = 0;
};

/// Of the filter on planes: Push of planes.glsl.
struct PlanePush {
  Address film = 0;
  Address layers = 0;
  Address noise = 0;
  Address support = 0;
  Address blocks = 0;
  Address image = 0;
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::uint32_t from = 0;
  std::uint32_t reach = 0;
  Vec3f view_position = Vec3f::Zero();
  float brightest_path = 0.0f;
  Address averaged = 0;
};
static_assert(sizeof(PlanePush) == 88);

inline constexpr std::uint32_t kGroup = 64;
inline constexpr std::uint32_t kStateColumns = 8;
inline constexpr std::uint32_t kResultColumns = 4;
inline constexpr std::uint32_t kShadowColumns = 3;
inline constexpr std::uint32_t kColumnSize = 16;
inline constexpr std::uint32_t kCameraRaySize = 3 * kColumnSize;

/// Part of what a path's first result has beside the lights seen; see job.glsl.
inline constexpr float kChance = 2.0f;

}  // namespace diorama::gpu
