// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "bsdf.h"
#include "diorama/host.h"
#include "diorama/scene.h"
#include "embree.h"
#include "lights.h"
#include "mip_texture.h"

namespace diorama {

/// A material with its textures found and its tables made. Textured scalars replace constants.
struct ShadingMaterial {
  std::shared_ptr<const Material> source;
  TextureSlot base_color;
  TextureSlot metallic;
  TextureSlot roughness;
  TextureSlot normal;
  TextureSlot opacity;
  TextureSlot emission;
  const GlassTables* glass = nullptr;  ///< Solid glass only.
  bool is_cut_out = false;             ///< Rays may pass where the opacity says so.
  bool dims_shadows = false;           ///< Shadow rays may pass, weakened.
  bool emits = false;

  float opacity_at(const Vec2f& uv, float footprint) const;
  Vec3f emission_at(const Vec2f& uv, float footprint) const;
};

/// One visible mesh node, in world space.
struct MeshInstance {
  static constexpr std::uint32_t kNoLight = 0xFFFFFFFFu;

  NodeId node;
  std::shared_ptr<const Mesh> mesh;
  Affine world_from_node = Affine::Identity();
  Eigen::Matrix3f normal_from_node = Eigen::Matrix3f::Identity();
  bool is_mirrored = false;                ///< The pose turns front sides into back sides.
  std::vector<float> world_positions;      ///< x, y, z per vertex and one float of padding.
  std::vector<std::uint32_t> materials;    ///< Per slot: index of a ShadingMaterial.
  std::vector<std::uint32_t> slot_lights;  ///< Per slot: number of its light or kNoLight.
  Aabb bounds;
  RTCGeometry geometry = nullptr;  ///< Owned by the RTCScene.
  const std::vector<ShadingMaterial>* all_materials = nullptr;

  std::size_t slot(std::uint32_t triangle) const;
  const ShadingMaterial& material(std::uint32_t triangle) const {
    return (*all_materials)[materials[slot(triangle)]];
  }
  Vec3f vertex(std::uint32_t index) const {
    return Eigen::Map<const Vec3f>(&world_positions[3 * std::size_t(index)]);
  }
  Vec2f uv(std::uint32_t triangle, float u, float v) const;
};

/// Where a ray met a mesh.
struct RayHit {
  const MeshInstance* instance = nullptr;  ///< Null: nothing.
  std::uint32_t geometry = 0;
  std::uint32_t triangle = 0;
  float u = 0.0f;
  float v = 0.0f;
  float distance = std::numeric_limits<float>::infinity();
  explicit operator bool() const { return instance != nullptr; }
};

/// The surface at a hit, without its material. World space.
struct SurfaceGeometry {
  Vec3f position;     ///< Exact on the triangle.
  Vec3f flat_normal;  ///< Unit, of the triangle, on the side of the ray's origin.
  Vec3f normal;       ///< Unit, interpolated, facing the ray's origin.
  Vec2f uv;
  bool is_back = false;       ///< The ray came from behind.
  float uv_per_metre = 0.0f;  ///< Density of the mesh's uv on the triangle.
};

/// A scene uploaded for ray queries. take() is called for every change and reuses what it can:
/// textures, meshes and their trees, shading tables. Queries come from any thread; take() may not
/// run beside them.
class RenderScene {
 public:
  RenderScene(Host& host, const std::string& isa);
  ~RenderScene();
  RenderScene(const RenderScene&) = delete;
  RenderScene& operator=(const RenderScene&) = delete;

  void take(const Scene& scene);

  const std::vector<std::unique_ptr<MeshInstance>>& instances() const { return instances_; }
  const Lights& lights() const { return lights_; }
  const AlbedoTables& albedo_tables() const { return albedo_tables_; }
  /// Of all meshes; empty without any.
  const Aabb& bounds() const { return bounds_; }

  /// The first surface not cut out. The direction is unit length.
  RayHit intersect(const Vec3f& origin, const Vec3f& direction, float t_min, float t_max) const;
  /// The light left between two points: 0 behind anything opaque, tinted behind glass and what is
  /// partly transparent. Solid glass counts as opaque unless `passes_glass`.
  Vec3f transmittance(const Vec3f& origin, const Vec3f& direction, float t_max,
                      bool passes_glass) const;
  /// Some instances of the scene with nothing else; valid until the next take().
  class Part {
   public:
    Part(const RenderScene& scene, const std::vector<std::uint32_t>& instances);
    ~Part();
    Part(const Part&) = delete;
    Part& operator=(const Part&) = delete;
    bool is_met(const Vec3f& origin, const Vec3f& direction, float t_min, float t_max) const;

   private:
    RTCScene scene_ = nullptr;
  };

  static SurfaceGeometry surface_at(const RayHit& hit, const Vec3f& direction);

 private:
  struct CachedTexture {
    std::weak_ptr<const Texture> owner;
    std::shared_ptr<const MipTexture> mips;
  };
  struct CachedDome {
    std::weak_ptr<const Texture> owner;
    std::shared_ptr<const DomeTexture> dome;
  };

  void collect(const Scene& scene, NodeId node, const Affine& world_from_parent);
  void load_textures(const Scene& scene);
  std::uint32_t material_index(const std::shared_ptr<const Material>& material);
  ShadingMaterial make_material(std::shared_ptr<const Material> source);
  TextureSlot slot(const TextureInput& input) const;
  void upload(const std::vector<std::unique_ptr<MeshInstance>>& previous);
  bool can_keep(const std::vector<std::unique_ptr<MeshInstance>>& previous) const;
  RTCGeometry make_geometry(MeshInstance& instance) const;
  void place(MeshInstance& instance) const;
  void add_lights(const Scene& scene);
  void add_emitters();
  void check_device(const char* action) const;

  Host& host_;
  RTCDevice device_ = nullptr;
  RTCScene scene_ = nullptr;
  AlbedoTables albedo_tables_;
  std::map<float, std::unique_ptr<GlassTables>> glass_tables_;
  std::map<const Texture*, CachedTexture> textures_;
  std::map<const Texture*, CachedDome> domes_;
  std::shared_ptr<const Material> default_material_;
  std::shared_ptr<const Texture> white_sky_;  ///< Of domes without an image.
  std::map<const Material*, std::uint32_t> material_indices_;
  std::vector<ShadingMaterial> materials_;
  std::vector<std::unique_ptr<MeshInstance>> instances_;
  std::vector<NodeId> light_nodes_;
  Lights lights_;
  Aabb bounds_;
};

}  // namespace diorama
