// SPDX-License-Identifier: Apache-2.0
#include "framework/bench/scene_rig.h"

#include <fstream>
#include <nlohmann/json.hpp>

#include "diorama/error.h"

namespace diorama::bench {
namespace {

using Json = nlohmann::json;

/// Runs `body` on the file's contents; what it misses there becomes an Error.
template <class Body>
void read_rig(const std::filesystem::path& rig, const Body& body) {
  std::ifstream in(rig);
  if (!in) throw Error(ErrorKind::Asset, rig.string() + ": cannot be read");
  try {
    body(Json::parse(in));
  } catch (const Json::exception& error) {
    throw Error(ErrorKind::Asset, rig.string() + ": " + error.what());
  }
}

Vec3 vector_of(const Json& list) {
  return {list.at(0).get<double>(), list.at(1).get<double>(), list.at(2).get<double>()};
}

void add_lamp(const Json& source, Scene& scene) {
  Light light;
  light.kind = LightKind::Sphere;
  light.radius_m = source.at("radius").get<double>();
  const double radiance =
      source.at("power_watt").get<double>() / (4.0 * kPi * kPi * light.radius_m * light.radius_m);
  light.color = (vector_of(source.at("color")) * radiance).cast<float>();
  light.is_visible_to_camera = false;
  const NodeId node = scene.create(scene.root(), "lamp");
  scene.edit(node).light = light;
  scene.set_pose(node, Affine(Eigen::Translation3d(vector_of(source.at("position_blender")))));
}

}  // namespace

void add_rig_lights(const std::filesystem::path& rig, Scene& scene, Host& host) {
  read_rig(rig, [&](const Json& json) {
    for (const Json& source : json.at("lights")) add_lamp(source, scene);
    if (!json.contains("world")) return;
    Light dome;
    dome.kind = LightKind::Dome;
    dome.texture =
        host.read_texture(rig.parent_path() / json["world"].at("file").get<std::string>());
    scene.edit(scene.create(scene.root(), "sky")).light = dome;
  });
}

NodeId add_rig_camera(const std::filesystem::path& rig, Scene& scene) {
  NodeId node;
  read_rig(rig, [&](const Json& json) {
    const Json& source = json.at("camera");
    Camera camera;
    camera.width = source.at("width").get<int>();
    camera.height = source.at("height").get<int>();
    camera.fx = source.at("fx").get<double>();
    camera.fy = source.at("fy").get<double>();
    camera.cx = source.at("cx").get<double>();
    camera.cy = source.at("cy").get<double>();
    camera.near_m = 0.01;
    Affine pose = Affine::Identity();
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 4; ++column) {
        pose.matrix()(row, column) = source.at("cam2world_blender")
                                         .at(std::size_t(row))
                                         .at(std::size_t(column))
                                         .get<double>();
      }
    }
    node = scene.create(scene.root(), "camera");
    scene.edit(node).camera = camera;
    scene.set_pose(node, pose);
  });
  return node;
}

}  // namespace diorama::bench
