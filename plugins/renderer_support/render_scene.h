// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "diorama/host.h"
#include "diorama/scene.h"
#include "light_table.h"
#include "mesh_instance.h"
#include "shading_material.h"
#include "shading_mesh.h"

namespace diorama {

/// A scene as path tracers need it, whatever traces their rays: meshes, each once, instances of
/// them with poses, materials with textures and tables, lights. take() is called for every change
/// and makes anew only what changed; tables keep their addresses as long as they are in use.
/// Reading is for any thread; take() and light() may not run beside it.
class RenderScene {
 public:
  struct Options {
    bool has_disk_lamps = false;  ///< See LightTable.
    bool stacks_lobes = false;    ///< See SurfaceBsdf.
  };
  RenderScene(Host& host, const Options& options);

  /// Takes in meshes, materials and poses; false: nothing has changed. Lights are as before until
  /// light().
  bool take(const Scene& scene);
  /// Makes the tables of lights, if anything they depend on has changed. `sees` asks for the rays
  /// of CellGrid among what is not movable.
  void light(const Scene& scene, const CellGrid::Sees& sees);
  /// Whether light() has nothing to do.
  bool is_lit() const { return !needs_light_; }

  /// Those of the scene that was taken in; see Scene::pose_revision.
  std::uint64_t pose_revision() const { return pose_revision_; }
  std::uint64_t shape_revision() const { return shape_revision_; }

  /// A mesh that is in use.
  struct UsedMesh {
    std::shared_ptr<const ShadingMesh> shading;
    std::uint32_t instance_count = 0;
  };
  /// In the order of their first instances.
  const std::vector<UsedMesh>& meshes() const { return meshes_; }
  /// In the order of the scene's tree.
  const std::vector<MeshInstance>& instances() const { return instances_; }
  const LightTable& lights() const { return lights_; }
  bool stacks_lobes() const { return options_.stacks_lobes; }
  /// Seconds around the moment of the poses that RayHit::time runs through; see shutter_window().
  double window() const { return window_; }

  /// Counts of what is kept for scenes to come.
  struct Kept {
    std::size_t meshes = 0;
    std::size_t materials = 0;
    std::size_t textures = 0;
    std::size_t skies = 0;
    std::size_t albedo_rows = 0;
  };
  Kept kept() const;

 private:
  /// A mesh or light of the scene's tree.
  struct Placed {
    NodeId node;
    bool is_movable = false;
    Affine world_from_node;
  };
  /// What decides which parts of sky and sun can be seen: all that follows neither a rigid body nor
  /// an animation.
  struct Surroundings {
    struct Pose {
      Eigen::Matrix3f linear;
      Vec3f translation;
      bool operator==(const Pose& other) const {
        return linear == other.linear && translation == other.translation;
      }
    };
    std::vector<std::shared_ptr<const Mesh>> meshes;
    std::vector<Pose> poses;
    std::vector<std::shared_ptr<const Material>> clear_materials;  ///< That let light pass.
    Aabb bounds;
    bool operator==(const Surroundings& other) const {
      return meshes == other.meshes && poses == other.poses &&
             clear_materials == other.clear_materials;
    }
  };
  /// By what it shows of a sky or a distant light.
  template <class Key, class Grid>
  struct CachedGrid {
    Key key;
    std::shared_ptr<const Grid> grid;
  };
  /// The dome and world_from_dome.
  using CachedSky =
      CachedGrid<std::pair<std::shared_ptr<const DomeTexture>, Eigen::Matrix3f>, SkyGrid>;
  /// The direction towards it and one_minus_cos.
  using CachedSun = CachedGrid<std::pair<Vec3f, float>, SunGrid>;

  void collect(const Scene& scene, NodeId node, const Affine& world_from_parent, bool is_movable,
               std::vector<Placed>& meshes);
  void assign_meshes(const Scene& scene, const std::vector<Placed>& placed);
  void assign_materials(const Scene& scene);
  void pack_uvs();
  void assign_poses(const std::vector<Placed>& placed, const std::vector<MeshInstance>& previous);
  void assign_motions(const Scene& scene, const std::vector<Placed>& placed);
  void add_lights(const Scene& scene);
  void add_emitters();
  void add_emitters(std::uint32_t instance, std::size_t slot,
                    std::span<std::uint32_t> triangle_lights);
  void learn_surroundings(const CellGrid::Sees& sees);
  Surroundings surroundings() const;

  Host& host_;
  Options options_;
  std::uint64_t pose_revision_ = 0;
  std::uint64_t shape_revision_ = 0;
  bool needs_light_ = true;
  double window_ = 0.0;
  MaterialLibrary materials_;
  std::map<const Mesh*, std::shared_ptr<ShadingMesh>> shading_meshes_;
  /// That a movable node left for another one: it may come back soon.
  struct BentMesh {
    std::shared_ptr<ShadingMesh> shading;
    std::uint64_t left_at = 0;
  };
  std::map<const Mesh*, BentMesh> bent_;
  std::uint64_t takes_ = 0;
  std::shared_ptr<DomeCache> domes_ = DomeCache::shared();
  std::shared_ptr<const Material> default_material_;
  std::shared_ptr<const Texture> white_sky_;  ///< Of domes without an image.
  std::vector<UsedMesh> meshes_;
  std::vector<MeshInstance> instances_;
  // What instances point into.
  std::vector<const ShadingMaterial*> slot_materials_;
  std::vector<std::uint32_t> triangle_lights_;
  std::vector<ShutterMotion> motions_;
  std::vector<Placed> placed_meshes_;  ///< In the order of instances_.
  std::vector<Placed> placed_lights_;
  LightTable lights_;
  Surroundings surroundings_;
  std::vector<CachedSky> sky_grids_;
  std::vector<CachedSun> sun_grids_;  ///< Valid for surroundings_.
};

}  // namespace diorama
