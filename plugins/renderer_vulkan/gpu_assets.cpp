// SPDX-License-Identifier: Apache-2.0
#include "gpu_assets.h"

#include <algorithm>
#include <array>
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

/// Of the triangles that rays may meet, in the order of the tree's leaves.
std::vector<Vec3f> corners_of(const ShadingMesh& mesh, std::span<const std::uint32_t> order) {
  std::vector<Vec3f> corners;
  corners.reserve(3 * order.size());
  for (const std::uint32_t t : order) {
    for (const std::uint32_t corner : mesh.corners(t)) {
      corners.push_back(mesh.source().positions[corner]);
    }
  }
  return corners;
}

/// Of textures whose words wait to be sent together.
constexpr std::size_t kMostTexels = std::size_t(16) << 20;

std::size_t texel_count(const MipTexture& texture) {
  return std::size_t(texture.width()) * std::size_t(texture.height());
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

template <class OnDevice, class Make>
std::vector<std::shared_ptr<const OnDevice>> GpuAssets::take(
    Entries<OnDevice>& entries, std::span<const std::shared_ptr<const void>> owners,
    const Make& make) {
  std::unique_lock lock(mutex_);
  while (true) {
    std::erase_if(entries, [](const auto& entry) { return entry.second.owner.expired(); });
    std::vector<std::size_t> missing;
    for (std::size_t i = 0; i < owners.size(); ++i) {
      const bool is_new =
          entries.try_emplace(owners[i].get(), Entry<OnDevice>{owners[i], {}}).second;
      if (is_new) missing.push_back(i);
    }
    if (!missing.empty()) {
      lock.unlock();
      std::vector<std::shared_ptr<const OnDevice>> made;
      try {
        made = make(missing);
      } catch (...) {
        lock.lock();
        for (const std::size_t i : missing) entries.erase(owners[i].get());
        has_made_.notify_all();
        throw;
      }
      lock.lock();
      for (std::size_t k = 0; k < missing.size(); ++k) {
        entries.at(owners[missing[k]].get()).on_device = std::move(made[k]);
      }
      has_made_.notify_all();
    }
    // Where another thread has failed, its entry is gone, and is made here.
    const auto is_settled = [&](const std::shared_ptr<const void>& owner) {
      const auto entry = entries.find(owner.get());
      return entry == entries.end() || entry->second.on_device;
    };
    has_made_.wait(lock, [&] { return std::ranges::all_of(owners, is_settled); });
    std::vector<std::shared_ptr<const OnDevice>> result;
    for (const auto& owner : owners) {
      const auto entry = entries.find(owner.get());
      if (entry == entries.end()) break;
      result.push_back(entry->second.on_device);
    }
    if (result.size() == owners.size()) return result;
  }
}

std::vector<std::shared_ptr<const MeshOnDevice>> GpuAssets::take(
    std::span<const std::shared_ptr<const ShadingMesh>> meshes, Host& host) {
  std::vector<std::shared_ptr<const void>> owners;
  for (const auto& mesh : meshes) owners.push_back(mesh->shared_source());
  return take(meshes_, owners, [&](std::span<const std::size_t> missing) {
    std::vector<MeshBytes> made(missing.size());
    host.parallel_for(missing.size(),
                      [&](std::size_t k) { made[k] = bytes_of(*meshes[missing[k]]); });
    constexpr int kTopLevels = 7;
    std::vector<GpuBytes> blobs(missing.size());
    std::vector<std::vector<std::uint32_t>> orders(missing.size());
    std::vector<std::shared_ptr<MeshOnDevice>> placed;
    std::vector<VulkanDevice::Transfer> transfers;
    for (std::size_t k = 0; k < missing.size(); ++k) {
      const ShadingMesh& mesh = *meshes[missing[k]];
      MeshBytes bytes = std::move(made[k]);
      GpuBytes& blob = blobs[k];
      const std::size_t nodes = blob.add(bytes.tree.nodes);
      const std::size_t triangles = blob.add(bytes.triangles);
      const std::size_t shading = blob.add(mesh.triangles());
      const std::size_t uvs = blob.add(bytes.uvs);
      const std::size_t colors = blob.add(bytes.colors);
      auto on_device = std::make_shared<MeshOnDevice>();
      on_device->memory = arena_.take(blob.bytes().size(), "a mesh and its tree");
      on_device->triangle_count = bytes.triangles.size();
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
      orders[k] = std::move(bytes.tree.order);
      placed.push_back(std::move(on_device));
    }
    device_.upload(transfers);
    if (device_.traces_by_query()) {
      MeshStructureBuilder builder(device_, arena_);
      for (std::size_t k = 0; k < missing.size(); ++k) {
        placed[k]->structure = builder.build(corners_of(*meshes[missing[k]], orders[k]));
      }
    }
    return std::vector<std::shared_ptr<const MeshOnDevice>>(placed.begin(), placed.end());
  });
}

std::vector<std::shared_ptr<const TextureOnDevice>> GpuAssets::take(
    std::span<const OwnedTexture> textures, Host& host) {
  std::vector<std::shared_ptr<const void>> owners;
  for (const OwnedTexture& texture : textures) owners.push_back(texture.owner);
  return take(textures_, owners, [&](std::span<const std::size_t> missing) {
    std::vector<std::shared_ptr<const TextureOnDevice>> placed;
    while (placed.size() < missing.size()) {
      // As many as their words may wait for each other.
      std::vector<const MipTexture*> group;
      for (std::size_t texels = 0; texels < kMostTexels; texels += texel_count(*group.back())) {
        const std::size_t next = placed.size() + group.size();
        if (next == missing.size()) break;
        group.push_back(textures[missing[next]].texture);
      }
      upload(group, host, placed);
    }
    return placed;
  });
}

void GpuAssets::upload(std::span<const MipTexture* const> textures, Host& host,
                       std::vector<std::shared_ptr<const TextureOnDevice>>& placed) {
  std::vector<std::vector<std::uint32_t>> words(textures.size());
  host.parallel_for(textures.size(), [&](std::size_t i) { words[i] = words_of(*textures[i]); });
  std::vector<VulkanDevice::Transfer> transfers;
  for (std::size_t i = 0; i < textures.size(); ++i) {
    const MipTexture& texture = *textures[i];
    const auto bytes = std::as_bytes(std::span(words[i]));
    auto on_device = std::make_shared<TextureOnDevice>();
    on_device->memory = arena_.take(bytes.size(), "a texture");
    transfers.push_back({bytes, &on_device->memory.buffer(), on_device->memory.offset()});
    gpu::Texture& record = on_device->record;
    record.texels = on_device->memory.address();
    record.width = texture.width();
    record.height = texture.height();
    record.level_count = std::min(std::uint32_t(texture.level_count()), gpu::kMostLevels);
    record.kind = texture.bytes(0).empty() ? gpu::kFloats
                  : texture.is_srgb()      ? gpu::kSrgbBytes
                                           : gpu::kLinearBytes;
    placed.push_back(std::move(on_device));
  }
  device_.upload(transfers);
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
