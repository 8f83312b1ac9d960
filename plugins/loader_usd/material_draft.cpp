// SPDX-License-Identifier: Apache-2.0
#include "loader_usd/material_draft.h"

#include <algorithm>
#include <cmath>

namespace diorama::loader_usd {

bool MaterialDraft::connect(TextureInput Material::*input, const usd::FoundValue& asset,
                            TextureSpace space) {
  if (!textures_.announce(asset, material_->name)) return false;
  plans_.push_back({input, asset, space});
  return true;
}

bool MaterialDraft::is_textured(TextureInput Material::*input) const {
  return std::any_of(plans_.begin(), plans_.end(),
                     [&](const Plan& plan) { return plan.input == input; });
}

void MaterialDraft::finish() {
  for (const Plan& plan : plans_) {
    const FoundTexture found = textures_.read(plan.asset, plan.space, material_->name);
    TextureInput& input = (*material_).*plan.input;
    input.texture = found.texture;
    input.uv_from_mesh_uv = compose(found.texture_from_uv, input.uv_from_mesh_uv);
    if (found.texture) {
      input.channel = std::min(input.channel, std::max(found.texture->channels - 1, 0));
    } else if (plan.input == &Material::base_color_texture) {
      material_->base_color = Vec3f::Constant(0.5f);
    } else if (plan.input == &Material::emission_texture) {
      material_->emission.setZero();
    }
  }
  plans_.clear();
}

Eigen::Matrix<float, 2, 3> uv_map(const Vec2f& scale, float degrees, const Vec2f& offset) {
  const float angle = degrees * static_cast<float>(kPi / 180.0);
  Eigen::Matrix<float, 2, 3> map;
  map << scale.x() * std::cos(angle), -scale.y() * std::sin(angle), offset.x(),
      scale.x() * std::sin(angle), scale.y() * std::cos(angle), offset.y();
  return map;
}

Eigen::Matrix<float, 2, 3> compose(const Eigen::Matrix<float, 2, 3>& outer,
                                   const Eigen::Matrix<float, 2, 3>& inner) {
  Eigen::Matrix3f full = Eigen::Matrix3f::Identity();
  full.topRows<2>() = inner;
  return outer * full;
}

void unpack_normals(TextureInput& input, float strength) {
  input.scale = {2.0f * strength, 2.0f * strength, 2.0f, 1.0f};
  input.bias = {-strength, -strength, -1.0f, 0.0f};
}

}  // namespace diorama::loader_usd
