// SPDX-License-Identifier: Apache-2.0
#include "framework/host/asset_cache.h"

#include <set>
#include <utility>

#include "framework/config/clean_text.h"
#include "framework/host/node_content.h"

namespace diorama {
namespace {

template <class T>
std::size_t vector_bytes(const std::vector<T>& list) {
  return list.capacity() * sizeof(T);
}

std::size_t mesh_bytes(const Mesh& mesh) {
  return sizeof mesh + vector_bytes(mesh.positions) + vector_bytes(mesh.triangles) +
         vector_bytes(mesh.normals) + vector_bytes(mesh.uvs) + vector_bytes(mesh.colors) +
         vector_bytes(mesh.material_slots);
}

/// Adds up what is reached by shared pointers, each thing once.
class ByteCount {
 public:
  void add(const Node& node) {
    bytes_ += sizeof node;
    if (node.mesh && seen_.insert(node.mesh.get()).second) bytes_ += mesh_bytes(*node.mesh);
    for (const auto& material : node.materials) add(material.get());
    if (node.light) add(node.light->texture.get());
  }
  std::size_t bytes() const { return bytes_; }

 private:
  void add(const Material* material) {
    if (!material || !seen_.insert(material).second) return;
    bytes_ += sizeof *material;
    for (const TextureInput* input :
         {&material->base_color_texture, &material->metallic_texture, &material->roughness_texture,
          &material->normal_texture, &material->opacity_texture, &material->emission_texture}) {
      add(input->texture.get());
    }
  }
  void add(const Texture* texture) {
    if (!texture || !seen_.insert(texture).second) return;
    bytes_ += sizeof *texture + vector_bytes(texture->bytes) + vector_bytes(texture->floats);
  }

  std::set<const void*> seen_;
  std::size_t bytes_ = 0;
};

}  // namespace

AssetCache::AssetCache(std::size_t budget_bytes) : budget_bytes_(budget_bytes) {}

std::shared_ptr<const Scene> AssetCache::get(const std::string& key,
                                             const std::function<void(Scene&)>& load) {
  const auto found = entries_.find(key);
  if (found != entries_.end()) {
    by_age_.splice(by_age_.end(), by_age_, found->second.age);
    return found->second.scene;
  }
  auto scene = std::make_shared<Scene>();
  load(*scene);
  Entry entry{scene, scene_bytes(*scene), {}};
  if (entry.bytes > budget_bytes_) return scene;
  bytes_ += entry.bytes;
  entry.age = by_age_.insert(by_age_.end(), key);
  entries_.emplace(key, std::move(entry));
  make_room();
  return scene;
}

void AssetCache::make_room() {
  while (bytes_ > budget_bytes_) {
    const auto oldest = entries_.find(by_age_.front());
    bytes_ -= oldest->second.bytes;
    entries_.erase(oldest);
    by_age_.pop_front();
  }
}

std::size_t scene_bytes(const Scene& scene) {
  ByteCount count;
  for (const NodeId node : scene.subtree(scene.root())) count.add(scene[node]);
  return count.bytes();
}

NodeId instantiate(const Scene& from, NodeId source, Scene& to, NodeId parent,
                   std::string_view stem) {
  const NodeId top = to.create(parent, clean_name(stem));
  std::map<NodeId, NodeId> copies;
  for (const NodeId node : from.subtree(source)) {
    const Node& original = from[node];
    const NodeId copy =
        node == source ? top : to.create(copies.at(original.parent), clean_name(original.name));
    copies[node] = copy;
    to.set_pose(copy, original.parent_from_node);
    copy_content(original, to.edit(copy));
    if (!original.labels.empty()) clean_labels(to.edit(copy));
  }
  // Joints hold the copies of what they held.
  for (const auto& [node, copy] : copies) {
    if (!from[node].joint) continue;
    Joint joint = *from[node].joint;
    const auto parent_body = copies.find(joint.parent_body);
    const auto child_body = copies.find(joint.child_body);
    if (parent_body == copies.end() || child_body == copies.end()) {
      to.edit(copy).joint.reset();
      continue;
    }
    joint.parent_body = parent_body->second;
    joint.child_body = child_body->second;
    if (joint.mimic) {
      const auto leader = copies.find(joint.mimic->joint);
      if (leader == copies.end()) {
        joint.mimic.reset();
      } else {
        joint.mimic->joint = leader->second;
      }
    }
    to.edit(copy).joint = joint;
  }
  return top;
}

}  // namespace diorama
