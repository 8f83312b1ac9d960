// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/lamps.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <utility>
#include <vector>

namespace diorama {
namespace {

/// As seen from the front, square metres.
double shining_area(const Light& light, const Mat3& linear) {
  switch (light.kind) {
    case LightKind::Sphere: {
      const double radius = light.radius_m * std::cbrt(std::abs(linear.determinant()));
      return kPi * radius * radius;
    }
    case LightKind::Rect:
      return (linear.col(0) * light.width_m).cross(linear.col(1) * light.height_m).norm();
    case LightKind::Disk:
      return kPi * light.radius_m * light.radius_m * linear.col(0).cross(linear.col(1)).norm();
    case LightKind::Distant:
    case LightKind::Dome:
      break;
  }
  return 0.0;
}

double nits_of(const Vec3f& color) {
  return std::max(0.0, Vec3(0.2126, 0.7152, 0.0722).dot(color.cast<double>()));
}

/// Lux of each of the node's materials. A closed surface shows a quarter of its area.
std::vector<double> glow_lux(const Node& node, const Mat3& linear) {
  std::vector<double> lux(node.materials.size(), 0.0);
  const auto glows = [](const auto& m) { return m && nits_of(m->emission) > 0.0; };
  if (!node.mesh || std::ranges::none_of(node.materials, glows)) return lux;
  const Mesh& mesh = *node.mesh;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const std::size_t slot = mesh.material_slots.empty() ? 0 : mesh.material_slots[t];
    if (slot >= lux.size() || !glows(node.materials[slot])) continue;
    const auto& [a, b, c] = mesh.triangles[t];
    const Vec3 ab = linear * (mesh.positions[b] - mesh.positions[a]).cast<double>();
    const Vec3 ac = linear * (mesh.positions[c] - mesh.positions[a]).cast<double>();
    lux[slot] += 0.5 * ab.cross(ac).norm() * 0.25;
  }
  for (std::size_t i = 0; i < lux.size(); ++i) {
    if (lux[i] > 0.0) lux[i] *= nits_of(node.materials[i]->emission) / std::pow(kLampDistance, 2);
  }
  return lux;
}

double light_lux(const Light& light, const Mat3& linear) {
  return nits_of(light.color) * shining_area(light, linear) / std::pow(kLampDistance, 2);
}

using DimmedMaterials =
    std::map<std::pair<const Material*, float>, std::shared_ptr<const Material>>;

void dim_visible(Scene& scene, NodeId id, double most_lux, DimmedMaterials& materials,
                 DimmedLamps& dimmed) {
  if (!scene[id].is_visible) return;
  const Mat3 linear = scene.world_from_node(id).linear();
  const auto factor_of = [&](double lux) {
    if (!(lux > most_lux)) return 1.0f;
    ++dimmed.count;
    dimmed.brightest_lux = std::max(dimmed.brightest_lux, lux);
    return float(most_lux / lux);
  };
  if (scene[id].light) {
    const float factor = factor_of(light_lux(*scene[id].light, linear));
    if (factor < 1.0f) scene.edit(id).light->color *= factor;
  }
  const std::vector<double> glow = glow_lux(scene[id], linear);
  for (std::size_t i = 0; i < glow.size(); ++i) {
    const float factor = factor_of(glow[i]);
    if (factor == 1.0f) continue;
    const std::shared_ptr<const Material> source = scene[id].materials[i];
    auto& made = materials[{source.get(), factor}];
    if (!made) {
      auto copy = std::make_shared<Material>(*source);
      copy->emission *= factor;
      made = std::move(copy);
    }
    scene.edit(id).materials[i] = made;
  }
  for (const NodeId child : std::vector<NodeId>(scene[id].children)) {
    dim_visible(scene, child, most_lux, materials, dimmed);
  }
}

}  // namespace

double lamp_lux(const Scene& scene, NodeId node) {
  const Mat3 linear = scene.world_from_node(node).linear();
  double lux = scene[node].light ? light_lux(*scene[node].light, linear) : 0.0;
  for (const double own : glow_lux(scene[node], linear)) lux += own;
  return lux;
}

DimmedLamps dim_lamps(Scene& scene, NodeId top, double most_lux) {
  DimmedMaterials materials;
  DimmedLamps dimmed;
  dim_visible(scene, top, most_lux, materials, dimmed);
  return dimmed;
}

}  // namespace diorama
