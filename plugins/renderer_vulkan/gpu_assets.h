// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include "box_tree.h"
#include "diorama/host.h"
#include "gpu_world.h"
#include "ray_structure.h"
#include "renderer_support/mip_texture.h"
#include "renderer_support/shading_mesh.h"
#include "vulkan_arena.h"
#include "vulkan_device.h"

namespace diorama {

/// A mesh with its tree in a device's memory.
struct MeshOnDevice {
  VulkanRange memory;
  MeshStructure structure;                ///< Where the device traces by ray queries.
  std::size_t triangle_count = 0;         ///< That rays may meet.
  gpu::Instance parts;                    ///< Addresses and flags of the mesh.
  std::map<std::uint32_t, TreeNode> top;  ///< Of its tree.
};

struct TextureOnDevice {
  VulkanRange memory;
  gpu::Texture record;
};

/// Meshes and textures in a device's memory, each once for all scenes. They stay as long as a scene
/// uses them, or anybody, a scene or a cache of assets, keeps what they were made of. From any
/// thread.
class GpuAssets {
 public:
  explicit GpuAssets(const VulkanDevice& device) : device_(device), arena_(device) {}

  /// In the order of `meshes`.
  std::vector<std::shared_ptr<const MeshOnDevice>> take(
      std::span<const std::shared_ptr<const ShadingMesh>> meshes, Host& host);
  struct OwnedTexture {
    std::shared_ptr<const void> owner;  ///< Of the image that the texture was made of.
    const MipTexture* texture = nullptr;
  };
  /// In the order of `textures`.
  std::vector<std::shared_ptr<const TextureOnDevice>> take(std::span<const OwnedTexture> textures,
                                                           Host& host);
  /// Memory for what else a scene has.
  VulkanRange upload(std::span<const std::byte> bytes, const char* what);

  /// Counts of what is kept.
  struct Kept {
    std::size_t meshes = 0;
    std::size_t textures = 0;
  };
  Kept kept() const;

 private:
  template <class OnDevice>
  struct Entry {
    std::weak_ptr<const void> owner;
    std::shared_ptr<const OnDevice> on_device;  ///< Null while a thread makes it.
  };
  /// By the address of what they were made of, which is valid while the owner lives.
  template <class OnDevice>
  using Entries = std::map<const void*, Entry<OnDevice>>;
  /// Adds them to `placed`.
  void upload(std::span<const MipTexture* const> textures, Host& host,
              std::vector<std::shared_ptr<const TextureOnDevice>>& placed);
  /// In the order of `owners`. make(missing) makes, in their order, those of the owners with these
  /// places that nobody has made or is making; what others are making is waited for.
  template <class OnDevice, class Make>
  std::vector<std::shared_ptr<const OnDevice>> take(
      Entries<OnDevice>& entries, std::span<const std::shared_ptr<const void>> owners,
      const Make& make);

  const VulkanDevice& device_;
  VulkanArena arena_;
  mutable std::mutex mutex_;  ///< Of all below; not held while something is made.
  std::condition_variable has_made_;
  Entries<MeshOnDevice> meshes_;
  Entries<TextureOnDevice> textures_;
};

}  // namespace diorama
