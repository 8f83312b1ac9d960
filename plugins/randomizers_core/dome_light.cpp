// SPDX-License-Identifier: Apache-2.0
#include "dome_light.h"

#include "sampling.h"

namespace diorama {

void DomeLight::Params::visit(ParamVisitor& v) {
  v.param("nodes", nodes, {"Dome lights to change."});
  v.param("textures", textures,
          {"Equirectangular images to choose from; none: the light keeps what it has."});
  v.param("intensity", intensity, {"Factor of the image, or radiance without one.", "", 0, 1e9});
  v.param("rotation_deg", rotation_deg, {"Turn about the vertical.", "deg", -360, 360});
}

DomeLight::DomeLight(Params params, Host& host)
    : params_(std::move(params)), host_(host), read_(params_.textures.size()) {
  for (const std::string& name : params_.textures) (void)host_.resolve(name);
}

std::shared_ptr<const Texture> DomeLight::texture(std::size_t index) {
  if (auto known = read_[index].lock()) return known;
  auto made = host_.read_texture(host_.resolve(params_.textures[index]));
  read_[index] = made;
  return made;
}

void DomeLight::randomize(Scene& scene, const RandomizeContext&, const Rng& rng) {
  for (const NodeId node : scene.match(params_.nodes)) {
    const auto& known = scene[node].light;
    if (!known || known->kind != LightKind::Dome) continue;
    Rng draws = rng.fork(scene.path(node));
    const double angle = draw_in(params_.rotation_deg, draws) * kPi / 180.0;
    const double intensity = draw_in(params_.intensity, draws);
    Affine pose = Affine(Eigen::AngleAxisd(angle, Vec3::UnitZ()));
    pose.translation() = scene.world_from_node(node).translation();
    set_world_pose(scene, node, pose);
    Light& light = *scene.edit(node).light;
    light.color = Vec3f::Constant(float(intensity));
    if (!params_.textures.empty()) light.texture = texture(draws.index(params_.textures.size()));
  }
}

}  // namespace diorama
