// SPDX-License-Identifier: Apache-2.0
#include "loader_assimp/mesh_translator.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "diorama/error.h"
#include "diorama/image.h"
#include "loader_assimp/file_space.h"
#include "loader_assimp/material_translator.h"

namespace diorama::loader_assimp {
namespace {

constexpr std::size_t kMaxSlots = 0xFFFF;

Affine root_from(const aiNode& node) {
  Affine result = to_affine(node.mTransformation);
  for (const aiNode* at = node.mParent; at; at = at->mParent) {
    result = to_affine(at->mTransformation) * result;
  }
  return result;
}

// Where bones move the points of a mesh, they take the places that the bones have.
class Skin {
 public:
  Skin(const aiMesh& mesh, const aiNode& node, const aiNode& scene_root)
      : maps_(mesh.mNumVertices, Mat4::Zero()), weights_(mesh.mNumVertices, 0.0) {
    const Affine node_from_root = root_from(node).inverse();
    for (unsigned b = 0; b < mesh.mNumBones; ++b) {
      const aiBone& bone = *mesh.mBones[b];
      const aiNode* joint = scene_root.FindNode(bone.mName);
      if (!joint) continue;
      const Mat4 map =
          (node_from_root * root_from(*joint) * to_affine(bone.mOffsetMatrix)).matrix();
      for (unsigned w = 0; w < bone.mNumWeights; ++w) {
        const aiVertexWeight& weight = bone.mWeights[w];
        if (weight.mVertexId >= maps_.size() || !(weight.mWeight > 0.0f)) continue;
        maps_[weight.mVertexId] += double(weight.mWeight) * map;
        weights_[weight.mVertexId] += double(weight.mWeight);
      }
    }
  }

  Affine map(std::size_t vertex) const {
    Affine result = Affine::Identity();
    if (weights_[vertex] > 0.0) result.matrix() = maps_[vertex] / weights_[vertex];
    return result;
  }

 private:
  std::vector<Mat4> maps_;
  std::vector<double> weights_;
};

// What the weights of morph targets make of a mesh, in glTF alone: other importers leave weights
// of their own behind.
class MorphTargets {
 public:
  MorphTargets(const aiMesh& mesh, Format format) : mesh_(mesh) {
    for (unsigned i = 0; i < mesh.mNumAnimMeshes; ++i) {
      const aiAnimMesh& target = *mesh.mAnimMeshes[i];
      const bool counts = format == Format::Gltf && std::isfinite(target.mWeight) &&
                          target.mWeight != 0.0f && target.mNumVertices == mesh.mNumVertices;
      if (counts) targets_.push_back(&target);
    }
  }
  Vec3 position(std::size_t vertex) const {
    Vec3 result = to_vec3(mesh_.mVertices[vertex]);
    for (const aiAnimMesh* target : targets_) {
      if (!target->mVertices) continue;
      result +=
          double(target->mWeight) * to_vec3(target->mVertices[vertex] - mesh_.mVertices[vertex]);
    }
    return result;
  }
  Vec3 normal(std::size_t vertex) const {
    Vec3 result = to_vec3(mesh_.mNormals[vertex]);
    for (const aiAnimMesh* target : targets_) {
      if (!target->mNormals) continue;
      result +=
          double(target->mWeight) * to_vec3(target->mNormals[vertex] - mesh_.mNormals[vertex]);
    }
    return result;
  }

 private:
  const aiMesh& mesh_;
  std::vector<const aiAnimMesh*> targets_;
};

Vec3f direction(const Vec3& v) {
  const double length = v.norm();
  return length > 0.0 && std::isfinite(length) ? Vec3f((v / length).cast<float>()) : Vec3f::UnitZ();
}

// Fills up the lists that earlier parts of the mesh have or this one brings, so that all lists are
// empty or have one entry per position.
template <class T>
void pad(std::vector<T>& list, bool is_used, std::size_t count, const T& value) {
  if (is_used || !list.empty()) list.resize(count, value);
}

}  // namespace

std::vector<const aiMesh*> MeshTranslator::meshes_of(const aiNode& node) const {
  const aiScene& scene = file_.scene();
  std::vector<const aiMesh*> meshes;
  for (unsigned i = 0; i < node.mNumMeshes && meshes.size() < kMaxSlots; ++i) {
    if (node.mMeshes[i] < scene.mNumMeshes && scene.mMeshes[node.mMeshes[i]]->mNumFaces > 0) {
      meshes.push_back(scene.mMeshes[node.mMeshes[i]]);
    }
  }
  return meshes;
}

std::vector<unsigned> MeshTranslator::slots(const aiNode& node) const {
  std::vector<unsigned> slots;
  for (const aiMesh* mesh : meshes_of(node)) {
    const auto known = std::find(slots.begin(), slots.end(), mesh->mMaterialIndex);
    if (known == slots.end()) slots.push_back(mesh->mMaterialIndex);
  }
  return slots;
}

// Vertex colours are part of glTF's materials. Elsewhere they often are leftovers of modelling, so
// they count only where nothing else says what a surface looks like.
bool MeshTranslator::multiplies_by_vertex_colors(const aiMesh& source) const {
  if (!source.HasVertexColors(0)) return false;
  if (file_.format() == Format::Gltf) return true;
  const aiScene& scene = file_.scene();
  return source.mMaterialIndex >= scene.mNumMaterials ||
         scene.mMaterials[source.mMaterialIndex]->GetTextureCount(aiTextureType_DIFFUSE) == 0;
}

void MeshTranslator::append(const aiMesh& source, const aiNode& node, std::uint16_t slot,
                            Mesh& mesh) const {
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  const std::size_t count = source.mNumVertices;
  const unsigned uv_set = uv_set_of(file_, source.mMaterialIndex);
  const bool has_uvs = source.HasTextureCoords(uv_set);
  const bool has_colors = multiplies_by_vertex_colors(source);
  pad(mesh.normals, source.HasNormals(), first, Vec3f(Vec3f::UnitZ()));
  pad(mesh.uvs, has_uvs, first, Vec2f(Vec2f::Zero()));
  pad(mesh.colors, has_colors, first, Vec3f(Vec3f::Ones()));

  std::optional<Skin> skin;
  if (source.HasBones()) skin.emplace(source, node, *file_.scene().mRootNode);
  const MorphTargets targets(source, file_.format());
  const bool is_encoded = file_.format() != Format::Gltf;
  mesh.positions.reserve(first + count);
  for (std::size_t i = 0; i < count; ++i) {
    const Affine map = skin ? skin->map(i) : Affine::Identity();
    const Vec3f position = (map * targets.position(i)).cast<float>();
    mesh.positions.push_back(position.allFinite() ? position : Vec3f::Zero());
    if (source.HasNormals()) {
      mesh.normals.push_back(direction(map.linear() * targets.normal(i)));
    }
    if (has_uvs) {
      const aiVector3D& uv = source.mTextureCoords[uv_set][i];
      const Vec2f pair(uv.x, uv.y);
      mesh.uvs.push_back(pair.allFinite() ? pair : Vec2f::Zero());
    }
    if (has_colors) {
      const aiColor4D& color = source.mColors[0][i];
      Vec3f rgb(color.r, color.g, color.b);
      if (is_encoded) rgb = rgb.unaryExpr(&linear_from_srgb);
      mesh.colors.push_back(rgb.allFinite() ? Vec3f(rgb.cwiseMax(0.0f)) : Vec3f::Ones());
    }
  }
  pad(mesh.normals, false, first + count, Vec3f(Vec3f::UnitZ()));
  pad(mesh.uvs, false, first + count, Vec2f(Vec2f::Zero()));
  pad(mesh.colors, false, first + count, Vec3f(Vec3f::Ones()));

  for (unsigned f = 0; f < source.mNumFaces; ++f) {
    const aiFace& face = source.mFaces[f];
    if (face.mNumIndices != 3) continue;
    const unsigned* corner = face.mIndices;
    if (corner[0] >= count || corner[1] >= count || corner[2] >= count) continue;
    mesh.triangles.push_back({first + corner[0], first + corner[1], first + corner[2]});
    mesh.material_slots.push_back(slot);
  }
}

std::shared_ptr<const Mesh> MeshTranslator::translate(const aiNode& node) {
  const std::vector<const aiMesh*> sources = meshes_of(node);
  if (sources.empty()) return nullptr;
  const bool has_bones =
      std::any_of(sources.begin(), sources.end(), [](const aiMesh* m) { return m->HasBones(); });
  auto [entry, is_new] = meshes_.try_emplace({sources, has_bones ? &node : nullptr});
  if (!is_new) return entry->second;

  const std::vector<unsigned> slots = this->slots(node);
  Mesh mesh;
  mesh.is_double_sided = false;
  for (const aiMesh* source : sources) {
    const auto slot = std::find(slots.begin(), slots.end(), source->mMaterialIndex);
    append(*source, node, static_cast<std::uint16_t>(slot - slots.begin()), mesh);
    mesh.is_double_sided |= is_two_sided(file_, source->mMaterialIndex);
  }
  if (slots.size() == 1) mesh.material_slots.clear();
  if (mesh.triangles.empty()) return nullptr;
  const bool some_lack_normals =
      std::any_of(sources.begin(), sources.end(), [](const aiMesh* m) { return !m->HasNormals(); });
  // One list serves all parts, so where only some have normals, all get smooth ones.
  if (some_lack_normals && !mesh.normals.empty()) mesh.normals = smooth_normals(mesh);
  mesh.validate(file_.name() + ": " + node.mName.C_Str());
  return entry->second = pool_.share(std::move(mesh));
}

}  // namespace diorama::loader_assimp
