// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "gpu_world.h"
#include "vulkan_arena.h"
#include "vulkan_device.h"

// What a device's own ray queries go through, for devices that are opened for them: see
// VulkanDevice::traces_by_query().
namespace diorama {

/// An acceleration structure of Vulkan. Belongs to a device, which outlives it, as the memory does
/// that it lies in.
class RayStructure {
 public:
  RayStructure() = default;
  /// `offset`: a multiple of 256.
  RayStructure(const VulkanDevice& device, VkAccelerationStructureTypeKHR type,
               const VulkanBuffer& memory, std::size_t offset, std::size_t size);
  ~RayStructure();
  RayStructure(RayStructure&& other) noexcept;
  RayStructure& operator=(RayStructure&& other) noexcept;

  VkAccelerationStructureKHR handle() const { return handle_; }
  gpu::Address address() const { return address_; }  ///< 0: there is none.

 private:
  const VulkanDevice* device_ = nullptr;
  VkAccelerationStructureKHR handle_ = VK_NULL_HANDLE;
  gpu::Address address_ = 0;
};

/// Of a mesh's triangles.
struct MeshStructure {
  VulkanRange memory;
  RayStructure structure;
};

/// Makes those of meshes, one after the other, in memory that it uses again.
class MeshStructureBuilder {
 public:
  MeshStructureBuilder(const VulkanDevice& device, VulkanArena& arena)
      : device_(device), arena_(arena) {}

  /// `corners`: three per triangle, in the mesh's space; rays name triangles by their places. There
  /// is no structure of no triangles, nor of more than the device can take.
  MeshStructure build(std::span<const Vec3f> corners);

 private:
  const VulkanDevice& device_;
  VulkanArena& arena_;
  VulkanBuffer corners_;
  VulkanBuffer scratch_;
};

/// Of the instances of a scene, which come and go and move.
class SceneStructure {
 public:
  explicit SceneStructure(const VulkanDevice& device) : device_(device) {}

  struct Instance {
    gpu::Rows world_from_mesh;
    gpu::Address mesh = 0;   ///< Its structure; 0: no ray meets it.
    bool is_opaque = false;  ///< Rays end there, whatever triangle they meet.
  };
  /// Rays name instances by their places. Returns its address; 0 where there are no instances, or
  /// more than the device can take.
  gpu::Address build(std::span<const Instance> instances);

 private:
  const VulkanDevice& device_;
  VulkanBuffer instances_;
  VulkanBuffer memory_;
  VulkanBuffer scratch_;
  RayStructure structure_;
};

}  // namespace diorama
