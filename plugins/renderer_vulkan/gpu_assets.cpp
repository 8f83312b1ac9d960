// SPDX-License-Identifier: Apache-2.0
#include "gpu_assets.h"

#include <algorithm>
#include <array>
#include <set>
#include <utility>

#include "gpu_bytes.h"

namespace diorama {
namespace {

/// All of a mesh that kernels read, in parts that begin at multiples of 16 bytes.
struct MeshBytes {
  BoxTree tree;
  std::vector<TriangleColumns> triangles;
  std::vector<std::array<float, 6>> uvs;
  std::vector<std::array<float, 9>> colors;
};

MeshBytes bytes_of(const ShadingMesh& mesh) {
  const Mesh& source = mesh.source();
  std::vector<TreeBox> boxes(mesh.number_end());
  for (std::uint32_t t = 0; t < mesh.number_end(); ++t) {
    if (mesh.is_repeated(t)) continue;
    for (const std::uint32_t corner : mesh.corners(t)) boxes[t].add(source.positions[corner]);
  }
  MeshBytes bytes;
  bytes.tree = tree_of_runs(boxes);
  bytes.triangles.reserve(bytes.tree.order.size());
  for (const std::uint32_t t : bytes.tree.order) {
    const auto corners = mesh.corners(t);
    const Vec3f& a = source.positions[corners[0]];
    bytes.triangles.push_back(
        columns_of(a, t, source.positions[corners[1]] - a, 0.0f, source.positions[corners[2]] - a));
  }
  for (std::uint32_t t = 0; mesh.has_uvs() && t < mesh.number_end(); ++t) {
    const auto uvs = mesh.uvs(t);
    bytes.uvs.push_back({uvs[0].x(), uvs[0].y(), uvs[1].x(), uvs[1].y(), uvs[2].x(), uvs[2].y()});
  }
  for (std::uint32_t t = 0; !source.colors.empty() && t < mesh.number_end(); ++t) {
    auto& corners = bytes.colors.emplace_back();
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3f& color = source.colors[mesh.corners(t)[k]];
      std::copy_n(color.data(), 3, &corners[3 * k]);
    }
  }
  return bytes;
}

/// Levels' offsets, then their texels.
std::vector<std::uint32_t> words_of(const MipTexture& texture) {
  std::vector<std::uint32_t> words(gpu::kMostLevels, 0);
  std::uint32_t texels = 0;
  const int levels = std::min(texture.level_count(), int(gpu::kMostLevels));
  const bool has_bytes = !texture.bytes(0).empty();
  for (int level = 0; level < levels; ++level) {
    const int width = texture.level_width(level);
    const int height = texture.level_height(level);
    words[std::size_t(level)] = texels;
    texels += std::uint32_t(width) * std::uint32_t(height);
    if (!has_bytes) {
      for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
          const Rgba texel = texture.texel(level, x, y);
          add_floats(words, {texel.data(), 4});
        }
      }
      continue;
    }
    const auto channels = std::size_t(texture.channels());
    const std::span<const std::uint8_t> bytes = texture.bytes(level);
    for (std::size_t at = 0; at < bytes.size(); at += channels) {
      // Grey is repeated, alpha is 1; see MipTexture::texel().
      const std::uint32_t red = bytes[at];
      const std::uint32_t green = channels < 3 ? red : bytes[at + 1];
      const std::uint32_t blue = channels < 3 ? red : bytes[at + 2];
      const std::uint32_t alpha =
          channels == 2 ? bytes[at + 1] : (channels == 4 ? bytes[at + 3] : 255u);
      words.push_back(red | green << 8 | blue << 16 | alpha << 24);
    }
  }
  return words;
}

}  // namespace

template <class OnDevice>
void GpuAssets::drop_unowned(Entries<OnDevice>& entries) {
  std::erase_if(entries, [](const auto& entry) { return entry.second.owner.expired(); });
}

std::vector<std::shared_ptr<const MeshOnDevice>> GpuAssets::take(
    std::span<const std::shared_ptr<const ShadingMesh>> meshes, Host& host) {
  const std::lock_guard lock(mutex_);
  drop_unowned(meshes_);
  std::set<const void*> seen;
  std::vector<const ShadingMesh*> missing;
  for (const auto& mesh : meshes) {
    const void* source = &mesh->source();
    if (!meshes_.contains(source) && seen.insert(source).second) missing.push_back(mesh.get());
  }
  std::vector<MeshBytes> made(missing.size());
  host.parallel_for(missing.size(), [&](std::size_t i) { made[i] = bytes_of(*missing[i]); });
  constexpr int kTopLevels = 7;
  std::vector<GpuBytes> blobs(missing.size());
  std::vector<std::shared_ptr<MeshOnDevice>> placed;
  std::vector<VulkanDevice::Transfer> transfers;
  for (std::size_t i = 0; i < missing.size(); ++i) {
    const ShadingMesh& mesh = *missing[i];
    const MeshBytes bytes = std::move(made[i]);
    GpuBytes& blob = blobs[i];
    const std::size_t nodes = blob.add(bytes.tree.nodes);
    const std::size_t triangles = blob.add(bytes.triangles);
    const std::size_t shading = blob.add(mesh.triangles());
    const std::size_t uvs = blob.add(bytes.uvs);
    const std::size_t colors = blob.add(bytes.colors);
    auto on_device = std::make_shared<MeshOnDevice>();
    on_device->memory = arena_.take(blob.bytes().size(), "a mesh and its tree");
    on_device->top = bytes.tree.top(kTopLevels);
    transfers.push_back({blob.bytes(), &on_device->memory.buffer(), on_device->memory.offset()});
    const gpu::Address base = on_device->memory.address();
    gpu::Instance& parts = on_device->parts;
    parts.nodes = base + nodes;
    parts.triangles = base + triangles;
    parts.shading = base + shading;
    parts.uvs = base + uvs;
    parts.colors = base + colors;
    parts.flags = (mesh.has_normals() ? gpu::kHasNormals : 0u) |
                  (bytes.uvs.empty() ? 0u : gpu::kHasUvs) |
                  (bytes.colors.empty() ? 0u : gpu::kHasColors) |
                  (mesh.source().is_double_sided ? gpu::kDoubleSided : 0u);
    placed.push_back(std::move(on_device));
  }
  device_.upload(transfers);
  for (std::size_t i = 0; i < missing.size(); ++i) {
    meshes_[&missing[i]->source()] = {missing[i]->shared_source(), std::move(placed[i])};
  }
  std::vector<std::shared_ptr<const MeshOnDevice>> result;
  for (const auto& mesh : meshes) result.push_back(meshes_.at(&mesh->source()).on_device);
  return result;
}

std::shared_ptr<const TextureOnDevice> GpuAssets::take(const std::shared_ptr<const void>& owner,
                                                       const MipTexture& texture) {
  const std::lock_guard lock(mutex_);
  drop_unowned(textures_);
  Entry<TextureOnDevice>& entry = textures_[owner.get()];
  if (entry.on_device) return entry.on_device;
  const std::vector<std::uint32_t> words = words_of(texture);
  auto on_device = std::make_shared<TextureOnDevice>();
  on_device->memory = upload(std::as_bytes(std::span(words)), "a texture");
  gpu::Texture& record = on_device->record;
  record.texels = on_device->memory.address();
  record.width = texture.width();
  record.height = texture.height();
  record.level_count = std::min(std::uint32_t(texture.level_count()), gpu::kMostLevels);
  record.kind = texture.bytes(0).empty() ? gpu::kFloats
                : texture.is_srgb()      ? gpu::kSrgbBytes
                                         : gpu::kLinearBytes;
  entry = {owner, std::move(on_device)};
  return entry.on_device;
}

VulkanRange GpuAssets::upload(std::span<const std::byte> bytes, const char* what) {
  VulkanRange range = arena_.take(bytes.size(), what);
  device_.upload(bytes, range.buffer(), range.offset());
  return range;
}

GpuAssets::Kept GpuAssets::kept() const {
  const std::lock_guard lock(mutex_);
  return {meshes_.size(), textures_.size()};
}

}  // namespace diorama
