// SPDX-License-Identifier: Apache-2.0
#include "loader_assimp/scene_translator.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "diorama/error.h"
#include "loader_assimp/camera_translator.h"
#include "loader_assimp/light_translator.h"

namespace diorama::loader_assimp {
namespace {

constexpr int kMaxDepth = 1000;

std::string node_name(const aiNode& node) {
  std::string name = node.mName.C_Str();
  std::replace(name.begin(), name.end(), '/', '_');
  if (!name.empty()) return name;
  return node.mNumMeshes > 0 ? "mesh" : "node";
}

Affine without_scale(const Affine& affine) {
  Affine rigid = Affine::Identity();
  rigid.linear() = Transform::from_affine(affine).rotation.toRotationMatrix();
  rigid.translation() = affine.translation();
  return rigid;
}

double scale_of(const Affine& affine) { return std::cbrt(std::abs(affine.linear().determinant())); }

// Nodes by name, in order; what has no meshes comes first, because lights and cameras are told by
// name and a mesh may have the same one.
std::multimap<std::string, const aiNode*> nodes_by_name(const aiNode& root) {
  std::vector<const aiNode*> nodes{&root};
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const aiNode& node = *nodes[i];
    nodes.insert(nodes.end(), node.mChildren, node.mChildren + node.mNumChildren);
  }
  std::stable_partition(nodes.begin(), nodes.end(),
                        [](const aiNode* node) { return node->mNumMeshes == 0; });
  std::multimap<std::string, const aiNode*> by_name;
  for (const aiNode* node : nodes) by_name.emplace(node->mName.C_Str(), node);
  return by_name;
}

std::set<unsigned> used_materials(const aiScene& scene) {
  std::set<unsigned> used;
  for (unsigned i = 0; i < scene.mNumMeshes; ++i) used.insert(scene.mMeshes[i]->mMaterialIndex);
  return used;
}

}  // namespace

SceneTranslator::SceneTranslator(const SceneFile& file, const UnstatedSpace& unstated, Host& host,
                                 Scene& scene)
    : file_(file),
      scene_(scene),
      meshes_(file),
      materials_(file, host),
      root_from_top_(metres_from_file(file, unstated)) {}

void SceneTranslator::translate(NodeId root) {
  materials_.read_textures(used_materials(file_.scene()));
  find_fittings();
  const aiNode& top = *file_.scene().mRootNode;
  const Place place{root, Affine::Identity()};
  if (top.mNumMeshes > 0 || fittings_.contains(&top)) {
    translate_node(top, place, root_from_top_, 0);
  } else {
    translate_children(top, place, root_from_top_, 0);
  }
}

// Two lights of one name belong to two nodes of that name.
void SceneTranslator::find_fittings() {
  const aiScene& scene = file_.scene();
  const auto by_name = nodes_by_name(*scene.mRootNode);
  const auto attach = [&](const aiString& name, auto Fittings::*member, const auto* thing) {
    const auto [first, last] = by_name.equal_range(name.C_Str());
    for (auto it = first; it != last; ++it) {
      if (fittings_[it->second].*member) continue;
      fittings_[it->second].*member = thing;
      return;
    }
  };
  for (unsigned i = 0; i < scene.mNumLights; ++i) {
    const aiLight* light = scene.mLights[i];
    attach(light->mName, &Fittings::light, light);
  }
  for (unsigned i = 0; i < scene.mNumCameras; ++i) {
    const aiCamera* camera = scene.mCameras[i];
    attach(camera->mName, &Fittings::camera, camera);
  }
}

void SceneTranslator::translate_children(const aiNode& source, const Place& place,
                                         const Affine& place_from_node, int depth) {
  for (unsigned i = 0; i < source.mNumChildren; ++i) {
    const aiNode& child = *source.mChildren[i];
    translate_node(child, place, place_from_node * to_affine(child.mTransformation), depth + 1);
  }
}

void SceneTranslator::translate_node(const aiNode& source, const Place& parent,
                                     const Affine& parent_from_node, int depth) {
  if (depth > kMaxDepth) {
    throw Error(ErrorKind::Asset, file_.name() + ": nodes are nested more than " +
                                      std::to_string(kMaxDepth) + " deep");
  }
  Place place;
  place.node = scene_.create(parent.node, node_name(source));
  place.root_from_node = parent.root_from_node * parent_from_node;
  if (!place.root_from_node.matrix().allFinite()) {
    throw Error(ErrorKind::Asset,
                file_.name() + ": the pose of node '" + node_name(source) + "' is not finite");
  }
  scene_.set_pose(place.node, parent_from_node);
  add_shape(source, place.node);
  add_fittings(source, parent, place);
  translate_children(source, place, Affine::Identity(), depth);
}

void SceneTranslator::add_shape(const aiNode& source, NodeId node) {
  std::shared_ptr<const Mesh> mesh = meshes_.translate(source);
  if (!mesh) return;
  std::vector<std::shared_ptr<const Material>> materials;
  for (const unsigned slot : meshes_.slots(source)) materials.push_back(materials_.translate(slot));
  Node& content = scene_.edit(node);
  content.mesh = std::move(mesh);
  content.materials = std::move(materials);
}

void SceneTranslator::add_fittings(const aiNode& source, const Place& parent, const Place& place) {
  const auto found = fittings_.find(&source);
  if (found == fittings_.end()) return;
  const auto [light, camera] = found->second;
  const bool is_alone = source.mNumMeshes == 0 && source.mNumChildren == 0 && !(light && camera);
  const double metres_per_unit = scale_of(place.root_from_node);
  if (camera) {
    const TranslatedCamera made = translate_camera(*camera, file_.format(), metres_per_unit);
    const NodeId node = stand(made.node_from_camera, "camera", is_alone, parent, place);
    scene_.edit(node).camera = made.camera;
  }
  if (!light) return;
  if (auto made = translate_light(*light, file_.format(), metres_per_unit)) {
    const NodeId node = stand(made->node_from_light, "light", is_alone, parent, place);
    scene_.edit(node).light = std::move(made->light);
  }
}

// Lights and cameras have sizes in metres, so units must not stand in their poses. Where there is
// nothing else at their node, it takes their pose; otherwise they get a node of their own below it.
NodeId SceneTranslator::stand(const Affine& node_from_thing, const char* name, bool is_alone,
                              const Place& parent, const Place& place) {
  const NodeId node = is_alone ? place.node : scene_.create(place.node, name);
  const Affine root_from_parent = is_alone ? parent.root_from_node : place.root_from_node;
  const Affine pose =
      root_from_parent.inverse() * without_scale(place.root_from_node * node_from_thing);
  if (pose.matrix().allFinite()) scene_.set_pose(node, pose);
  return node;
}

}  // namespace diorama::loader_assimp
