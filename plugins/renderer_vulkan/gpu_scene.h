// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <vector>

#include "box_tree.h"
#include "diorama/host.h"
#include "gpu_assets.h"
#include "gpu_world.h"
#include "path_device.h"
#include "renderer_support/render_scene.h"

namespace diorama {

/// Of all places that an instance comes to in the `window` seconds around the moment of its pose.
TreeBox box_over_time(const MeshInstance& instance, double window);

/// A scene in a device's memory. take() is called for every change and transfers what is new.
class GpuScene {
 public:
  GpuScene(const PathDevice& device, Host& host)
      : device_(device.device), assets_(*device.assets), host_(host), structure_(device.device) {}

  void take(const RenderScene& scene);

  gpu::Address world() const { return world_.address(); }
  /// One that has been finished, of a material of the scene.
  gpu::Surface surface_of(const SurfaceBsdf& surface) const;
  /// Whether the device's own ray queries find what rays meet: where it is opened for them, and
  /// nothing moves while the shutter is open.
  bool traces_by_query() const { return traces_by_query_; }

 private:
  struct TextureInScene {
    std::shared_ptr<const TextureOnDevice> on_device;
    std::uint32_t number = 0;  ///< In the table of this scene.
  };
  struct WordsOnDevice {
    std::shared_ptr<const void> source;
    VulkanRange memory;
  };
  /// What the tree over the instances holds.
  struct References {
    std::vector<gpu::Reference> parts;
    std::vector<TreeBox> boxes;
  };
  /// Where the tables of materials stand.
  struct MaterialTables {
    gpu::Address base = 0;
    std::map<const LayerTable*, std::size_t> layers;
    std::map<const GlassTable*, std::size_t> glasses;
  };

  void take_meshes(const RenderScene& scene);
  void take_textures(const RenderScene& scene);
  void take_skies(const LightTable& lights);
  /// To a buffer that is made anew only where it is too small.
  VulkanDevice::Transfer transfer_to(VulkanBuffer& buffer, std::span<const std::byte> bytes,
                                     const char* what) const;
  gpu::Slot slot_of(const TextureSlot& slot) const;
  gpu::Material material_of(const ShadingMaterial& material) const;
  gpu::Instance instance_of(const MeshInstance& instance, double window) const;
  gpu::Light light_of(const LightTable::Record& light) const;
  References references_of(const RenderScene& scene) const;
  void take_tables(const RenderScene& scene);
  gpu::Address take_structure(const RenderScene& scene, std::span<const gpu::Instance> instances);

  const VulkanDevice& device_;
  GpuAssets& assets_;
  Host& host_;
  std::uint64_t pose_revision_ = 0;
  std::uint64_t shape_revision_ = 0;
  std::map<const ShadingMesh*, std::shared_ptr<const MeshOnDevice>> meshes_;
  std::map<std::uint64_t, TextureInScene> textures_;  ///< By MipTexture::number().
  std::map<const void*, WordsOnDevice> skies_;        ///< Domes' patches and their grids.
  MaterialTables material_tables_;
  VulkanBuffer parts_;
  VulkanBuffer tables_;
  VulkanBuffer world_;
  SceneStructure structure_;
  bool traces_by_query_ = false;
};

}  // namespace diorama
