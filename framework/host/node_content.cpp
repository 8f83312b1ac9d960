// SPDX-License-Identifier: Apache-2.0
#include "framework/host/node_content.h"

#include <utility>

#include "framework/config/clean_text.h"

namespace diorama {

void copy_content(const Node& from, Node& to) {
  to.is_visible = from.is_visible;
  to.labels = from.labels;
  to.keypoints = from.keypoints;
  to.mesh = from.mesh;
  to.materials = from.materials;
  to.light = from.light;
  to.camera = from.camera;
  to.collider = from.collider;
  to.rigid_body = from.rigid_body;
  to.joint = from.joint;
  to.animation = from.animation;
}

std::string first_unclean_word(const Scene& scene, NodeId top) {
  for (const NodeId id : scene.subtree(top)) {
    const Node& node = scene[id];
    if (!is_clean_name(node.name)) return node.name;
    for (const auto& [taxonomy, label] : node.labels) {
      for (const std::string& word : {taxonomy, label}) {
        if (!is_clean_name(word)) return word;
      }
    }
  }
  return {};
}

void clean_labels(Node& node) {
  Labels clean;
  for (const auto& [taxonomy, label] : node.labels) {
    clean.emplace(clean_name(taxonomy), clean_name(label));
  }
  node.labels = std::move(clean);
}

}  // namespace diorama
