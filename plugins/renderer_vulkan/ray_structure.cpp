// SPDX-License-Identifier: Apache-2.0
#include "ray_structure.h"

#include <cstring>
#include <utility>

namespace diorama {
namespace {

using BuildInfo = VkAccelerationStructureBuildGeometryInfoKHR;
using Geometry = VkAccelerationStructureGeometryKHR;

Geometry geometry_of(VkGeometryTypeKHR type) {
  auto geometry = vulkan_info<Geometry>(VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR);
  geometry.geometryType = type;
  return geometry;
}

BuildInfo build_info(VkAccelerationStructureTypeKHR type, const Geometry& geometry) {
  auto info =
      vulkan_info<BuildInfo>(VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_GEOMETRY_INFO_KHR);
  info.type = type;
  info.flags = VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR;
  info.mode = VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR;
  info.geometryCount = 1;
  info.pGeometries = &geometry;
  return info;
}

VkAccelerationStructureBuildSizesInfoKHR sizes_of(const VulkanDevice& device, const BuildInfo& info,
                                                  std::uint32_t count) {
  auto sizes = vulkan_info<VkAccelerationStructureBuildSizesInfoKHR>(
      VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_SIZES_INFO_KHR);
  device.functions().vkGetAccelerationStructureBuildSizesKHR(
      device.handle(), VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &info, &count, &sizes);
  return sizes;
}

void build(const VulkanDevice& device, BuildInfo info, const RayStructure& structure,
           std::size_t scratch_size, std::uint32_t count, VulkanBuffer& scratch) {
  const std::size_t step = device.info().scratch_alignment;
  scratch.grow(device, scratch_size + step, VulkanBuffer::Place::Device,
               "what ray queries go through");
  info.dstAccelerationStructure = structure.handle();
  info.scratchData.deviceAddress = (scratch.address() + step - 1) / step * step;
  device.run([&](VulkanCommands& commands) { commands.build(info, count); });
}

}  // namespace

RayStructure::RayStructure(const VulkanDevice& device, VkAccelerationStructureTypeKHR type,
                           const VulkanBuffer& memory, std::size_t offset, std::size_t size)
    : device_(&device) {
  const VulkanDeviceFunctions& vk = device.functions();
  auto info = vulkan_info<VkAccelerationStructureCreateInfoKHR>(
      VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_CREATE_INFO_KHR);
  info.buffer = memory.handle();
  info.offset = offset;
  info.size = size;
  info.type = type;
  device.check(vk.vkCreateAccelerationStructureKHR(device.handle(), &info, nullptr, &handle_),
               "make what ray queries go through");
  auto place = vulkan_info<VkAccelerationStructureDeviceAddressInfoKHR>(
      VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_DEVICE_ADDRESS_INFO_KHR);
  place.accelerationStructure = handle_;
  address_ = vk.vkGetAccelerationStructureDeviceAddressKHR(device.handle(), &place);
}

RayStructure::~RayStructure() {
  if (!device_) return;
  device_->functions().vkDestroyAccelerationStructureKHR(device_->handle(), handle_, nullptr);
}

RayStructure::RayStructure(RayStructure&& other) noexcept { *this = std::move(other); }

RayStructure& RayStructure::operator=(RayStructure&& other) noexcept {
  std::swap(device_, other.device_);
  std::swap(handle_, other.handle_);
  std::swap(address_, other.address_);
  return *this;
}

MeshStructure MeshStructureBuilder::build(std::span<const Vec3f> corners) {
  constexpr auto kType = VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR;
  const std::size_t triangles = corners.size() / 3;
  if (triangles == 0 || triangles > device_.info().most_query_triangles) return {};
  corners_.grow(device_, corners.size_bytes(), VulkanBuffer::Place::Device, "a mesh");
  device_.upload(std::as_bytes(corners), corners_, 0);
  Geometry geometry = geometry_of(VK_GEOMETRY_TYPE_TRIANGLES_KHR);
  // Shadow rays multiply what they pass.
  geometry.flags = VK_GEOMETRY_NO_DUPLICATE_ANY_HIT_INVOCATION_BIT_KHR;
  auto& source = geometry.geometry.triangles;
  source = vulkan_info<VkAccelerationStructureGeometryTrianglesDataKHR>(
      VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_TRIANGLES_DATA_KHR);
  source.vertexFormat = VK_FORMAT_R32G32B32_SFLOAT;
  source.vertexData.deviceAddress = corners_.address();
  source.vertexStride = sizeof(Vec3f);
  source.maxVertex = std::uint32_t(corners.size() - 1);
  source.indexType = VK_INDEX_TYPE_NONE_KHR;
  const auto count = std::uint32_t(triangles);
  const BuildInfo info = build_info(kType, geometry);
  const auto sizes = sizes_of(device_, info, count);
  MeshStructure made;
  made.memory = arena_.take(sizes.accelerationStructureSize, "what ray queries go through");
  made.structure = RayStructure(device_, kType, made.memory.buffer(), made.memory.offset(),
                                sizes.accelerationStructureSize);
  diorama::build(device_, info, made.structure, sizes.buildScratchSize, count, scratch_);
  return made;
}

gpu::Address SceneStructure::build(std::span<const Instance> instances) {
  constexpr auto kType = VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR;
  if (instances.empty() || instances.size() > device_.info().most_query_instances) return 0;
  std::vector<VkAccelerationStructureInstanceKHR> records;
  for (const Instance& instance : instances) {
    VkAccelerationStructureInstanceKHR& record = records.emplace_back();
    static_assert(sizeof(record.transform) == sizeof(gpu::Rows));
    std::memcpy(&record.transform, &instance.world_from_mesh, sizeof(gpu::Rows));
    record.mask = 0xFF;
    record.flags = VK_GEOMETRY_INSTANCE_TRIANGLE_FACING_CULL_DISABLE_BIT_KHR |
                   (instance.is_opaque ? VK_GEOMETRY_INSTANCE_FORCE_OPAQUE_BIT_KHR
                                       : VK_GEOMETRY_INSTANCE_FORCE_NO_OPAQUE_BIT_KHR);
    record.accelerationStructureReference = instance.mesh;
  }
  const auto bytes = std::as_bytes(std::span(records));
  constexpr const char* kWhat = "what ray queries go through";
  instances_.grow(device_, bytes.size(), VulkanBuffer::Place::Device, kWhat);
  device_.upload(bytes, instances_, 0);
  Geometry geometry = geometry_of(VK_GEOMETRY_TYPE_INSTANCES_KHR);
  auto& source = geometry.geometry.instances;
  source = vulkan_info<VkAccelerationStructureGeometryInstancesDataKHR>(
      VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_INSTANCES_DATA_KHR);
  source.data.deviceAddress = instances_.address();
  const auto count = std::uint32_t(instances.size());
  const BuildInfo info = build_info(kType, geometry);
  const auto sizes = sizes_of(device_, info, count);
  structure_ = RayStructure();  // before its memory
  memory_.grow(device_, sizes.accelerationStructureSize, VulkanBuffer::Place::Device, kWhat);
  structure_ = RayStructure(device_, kType, memory_, 0, sizes.accelerationStructureSize);
  diorama::build(device_, info, structure_, sizes.buildScratchSize, count, scratch_);
  return structure_.address();
}

}  // namespace diorama
