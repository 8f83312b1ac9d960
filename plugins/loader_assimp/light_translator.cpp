// SPDX-License-Identifier: Apache-2.0
#include "loader_assimp/light_translator.h"

#include <algorithm>
#include <cmath>

#include "loader_assimp/file_space.h"

namespace diorama::loader_assimp {
namespace {

constexpr float kLumensPerWatt = 683.0f;
constexpr double kPointRadius = 0.05;

Vec3f color_of(const aiColor3D& color) {
  const Vec3f rgb(color.r, color.g, color.b);
  return rgb.allFinite() ? Vec3f(rgb.cwiseMax(0.0f)) : Vec3f::Zero();
}

// Turns -z to where the light shines.
Affine node_from_light(const aiLight& source) {
  const Vec3 forward = to_vec3(source.mDirection);
  if (!forward.allFinite() || forward.norm() < 1e-9) return Affine::Identity();
  const Vec3 up = to_vec3(source.mUp);
  const bool has_up = up.allFinite() && up.norm() > 1e-9;
  return Affine(look_rotation(forward, has_up ? up : Vec3::UnitY()));
}

double edge(float length) { return length > 0.0f && std::isfinite(length) ? double(length) : 1.0; }

void make_cone(const aiLight& source, Format format, Light& light) {
  // glTF states angles from the axis, the others from edge to edge.
  const double share = format == Format::Gltf ? 1.0 : 0.5;
  const double outer = share * double(source.mAngleOuterCone);
  const double inner = share * double(source.mAngleInnerCone);
  if (!(outer > 0.0) || outer >= kPi) return;
  light.cone_angle_rad = outer;
  light.cone_softness = std::clamp(1.0 - inner / outer, 0.0, 1.0);
}

}  // namespace

std::optional<TranslatedLight> translate_light(const aiLight& source, Format format,
                                               double metres_per_unit) {
  TranslatedLight result;
  Light& light = result.light;
  light.color = color_of(source.mColorDiffuse);
  if (format == Format::Gltf) light.color /= kLumensPerWatt;
  switch (source.mType) {
    case aiLightSource_DIRECTIONAL:
      light.kind = LightKind::Distant;
      result.node_from_light = node_from_light(source);
      break;
    case aiLightSource_SPOT:
      make_cone(source, format, light);
      result.node_from_light = node_from_light(source);
      [[fallthrough]];
    case aiLightSource_POINT:
      // A sphere that looks evenly bright shows a disc of that radius.
      light.kind = LightKind::Sphere;
      light.radius_m = kPointRadius;
      light.color /= static_cast<float>(kPi * kPointRadius * kPointRadius);
      break;
    case aiLightSource_AREA:
      light.kind = LightKind::Rect;
      light.width_m = edge(source.mSize.x) * metres_per_unit;
      light.height_m = edge(source.mSize.y) * metres_per_unit;
      result.node_from_light = node_from_light(source);
      break;
    case aiLightSource_AMBIENT:
      light.kind = LightKind::Dome;
      light.color = color_of(source.mColorAmbient);
      break;
    default:
      return std::nullopt;
  }
  if (light.color.isZero()) return std::nullopt;
  // glTF's lights stand at their node.
  const Vec3 position = to_vec3(source.mPosition);
  if (format != Format::Gltf && position.allFinite()) {
    result.node_from_light.pretranslate(position);
  }
  return result;
}

}  // namespace diorama::loader_assimp
