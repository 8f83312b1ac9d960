// SPDX-License-Identifier: Apache-2.0
#include "loader_assimp/posing.h"

#include <assimp/anim.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "diorama/config.h"
#include "diorama/error.h"

namespace diorama::loader_assimp {
namespace {

// Of names in an error.
constexpr std::size_t kNamesListed = 20;

double ticks_per_second(const aiAnimation& animation) {
  const double ticks = animation.mTicksPerSecond;
  return ticks > 0.0 && std::isfinite(ticks) ? ticks : 25.0;
}

/// The two keys about a time, and where between them it is.
struct Between {
  unsigned before = 0;
  unsigned after = 0;
  double share = 0.0;
};

template <class Key>
Between keys_about(const Key* keys, unsigned count, double time) {
  const Key* later = std::upper_bound(keys, keys + count, time,
                                      [](double t, const Key& key) { return t < key.mTime; });
  Between result;
  result.after = std::min(static_cast<unsigned>(later - keys), count - 1);
  result.before = later == keys ? 0 : static_cast<unsigned>(later - keys) - 1;
  const double length = keys[result.after].mTime - keys[result.before].mTime;
  if (length > 0.0) {
    result.share = std::clamp((time - keys[result.before].mTime) / length, 0.0, 1.0);
  }
  return result;
}

aiVector3D vector_at(const aiVectorKey* keys, unsigned count, double time) {
  const Between at = keys_about(keys, count, time);
  const aiVector3D& a = keys[at.before].mValue;
  return a + (keys[at.after].mValue - a) * static_cast<ai_real>(at.share);
}

aiQuaternion turn_at(const aiQuatKey* keys, unsigned count, double time) {
  const Between at = keys_about(keys, count, time);
  aiQuaternion turn;
  aiQuaternion::Interpolate(turn, keys[at.before].mValue, keys[at.after].mValue,
                            static_cast<ai_real>(at.share));
  return turn.Normalize();
}

bool is_finite(const aiMatrix4x4& matrix) {
  for (unsigned row = 0; row < 4; ++row) {
    for (unsigned column = 0; column < 4; ++column) {
      if (!std::isfinite(matrix[row][column])) return false;
    }
  }
  return true;
}

void pose_node(aiNode& node, const aiNodeAnim& channel, double time) {
  aiVector3D size, place;
  aiQuaternion turn;
  node.mTransformation.Decompose(size, turn, place);
  if (channel.mNumPositionKeys > 0) {
    place = vector_at(channel.mPositionKeys, channel.mNumPositionKeys, time);
  }
  if (channel.mNumScalingKeys > 0) {
    size = vector_at(channel.mScalingKeys, channel.mNumScalingKeys, time);
  }
  if (channel.mNumRotationKeys > 0) {
    turn = turn_at(channel.mRotationKeys, channel.mNumRotationKeys, time);
  }
  const aiMatrix4x4 pose(size, turn, place);
  if (is_finite(pose)) node.mTransformation = pose;
}

using FirstNodes = std::unordered_map<std::string_view, aiNode*>;

std::string_view text_of(const aiString& name) { return {name.data, name.length}; }

/// Of a name the node that aiNode::FindNode() finds, which looks at all of them each time.
FirstNodes first_nodes_by_name(aiNode& root) {
  FirstNodes nodes;
  std::vector<aiNode*> waiting{&root};
  while (!waiting.empty()) {
    aiNode* const node = waiting.back();
    waiting.pop_back();
    nodes.emplace(text_of(node->mName), node);
    for (unsigned i = node->mNumChildren; i > 0; --i) waiting.push_back(node->mChildren[i - 1]);
  }
  return nodes;
}

void weigh_targets(aiScene& scene, const aiNode& node, const aiMeshMorphAnim& channel,
                   double time) {
  if (channel.mNumKeys == 0) return;
  const Between at = keys_about(channel.mKeys, channel.mNumKeys, time);
  for (unsigned m = 0; m < node.mNumMeshes; ++m) {
    if (node.mMeshes[m] >= scene.mNumMeshes) continue;
    aiMesh& mesh = *scene.mMeshes[node.mMeshes[m]];
    for (unsigned i = 0; i < mesh.mNumAnimMeshes; ++i) mesh.mAnimMeshes[i]->mWeight = 0.0f;
    const auto add = [&](const aiMeshMorphKey& key, double share) {
      for (unsigned i = 0; i < key.mNumValuesAndWeights; ++i) {
        const double weight = share * key.mWeights[i];
        if (key.mValues[i] < mesh.mNumAnimMeshes && std::isfinite(weight)) {
          mesh.mAnimMeshes[key.mValues[i]]->mWeight += static_cast<float>(weight);
        }
      }
    };
    add(channel.mKeys[at.before], 1.0 - at.share);
    add(channel.mKeys[at.after], at.share);
  }
}

}  // namespace

unsigned find_animation(const aiScene& scene, const std::string& word, const std::string& asset) {
  std::vector<std::string> names;
  for (unsigned i = 0; i < scene.mNumAnimations; ++i) {
    names.emplace_back(text_of(scene.mAnimations[i]->mName));
    if (names.back() == word) return i;
  }
  unsigned number = 0;
  const auto parsed = std::from_chars(word.data(), word.data() + word.size(), number);
  const bool is_number = parsed.ec == std::errc() && parsed.ptr == word.data() + word.size();
  if (is_number && number < names.size()) return number;
  std::string text = asset + ": found the animation '" + word + "', expected ";
  if (names.empty()) throw Error(ErrorKind::Asset, text + "none, as the file has none");
  for (std::size_t i = 0; i < std::min(names.size(), kNamesListed); ++i) {
    text += (i == 0                  ? ""
             : i + 1 == names.size() ? " or "
                                     : ", ") +
            std::to_string(i) + " '" + names[i] + "'";
  }
  if (names.size() > kNamesListed) text += " ... " + std::to_string(names.size() - 1);
  const std::string near = is_number ? std::string() : nearest_name(word, names);
  throw Error(ErrorKind::Asset, text + (near.empty() ? "" : "; did you mean '" + near + "'?"));
}

double animation_seconds(const aiScene& scene, unsigned number) {
  if (number >= scene.mNumAnimations) return 0.0;
  const aiAnimation& animation = *scene.mAnimations[number];
  const double seconds = animation.mDuration / ticks_per_second(animation);
  const bool moves = animation.mNumChannels > 0 || animation.mNumMorphMeshChannels > 0;
  return moves && seconds > 0.0 && std::isfinite(seconds) ? seconds : 0.0;
}

std::string describe_animation(const aiScene& scene, unsigned number) {
  std::array<char, 64> digits{};
  std::snprintf(digits.data(), digits.size(), "%.4g", animation_seconds(scene, number));
  return "animation " + std::to_string(number) + " '" +
         std::string(text_of(scene.mAnimations[number]->mName)) + "' lasts " + digits.data() + " s";
}

void pose_at(aiScene& scene, unsigned number, double seconds) {
  if (number >= scene.mNumAnimations) return;
  const aiAnimation& animation = *scene.mAnimations[number];
  const double time = seconds * ticks_per_second(animation);
  const FirstNodes nodes = first_nodes_by_name(*scene.mRootNode);
  for (unsigned i = 0; i < animation.mNumChannels; ++i) {
    const aiNodeAnim& channel = *animation.mChannels[i];
    const auto node = nodes.find(text_of(channel.mNodeName));
    if (node != nodes.end()) pose_node(*node->second, channel, time);
  }
  for (unsigned i = 0; i < animation.mNumMorphMeshChannels; ++i) {
    const aiMeshMorphAnim& channel = *animation.mMorphMeshChannels[i];
    const auto node = nodes.find(text_of(channel.mName));
    if (node != nodes.end()) weigh_targets(scene, *node->second, channel, time);
  }
}

}  // namespace diorama::loader_assimp
