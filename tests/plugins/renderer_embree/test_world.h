// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "diorama/scene.h"
#include "renderer_support/film.h"

namespace diorama::test {

/// A scene built in a few lines. Everything hangs below one node that is turned and shifted, so
/// that no test works only for identity poses; positions given here are in that node's space.
struct TestWorld {
  Scene scene;
  NodeId base;

  TestWorld() {
    base = scene.create(scene.root(), "base");
    Transform pose;
    pose.translation = Vec3(0.7, -1.3, 0.4);
    pose.rotation = Quat(Eigen::AngleAxisd(0.8, Vec3(0.3, -0.5, 0.9).normalized()));
    scene.set_pose(base, pose);
  }

  NodeId add(const std::string& name, Mesh mesh, Material material,
             const Affine& pose = Affine::Identity()) {
    const NodeId node = scene.create(base, name);
    scene.edit(node).mesh = std::make_shared<const Mesh>(std::move(mesh));
    scene.edit(node).materials = {std::make_shared<const Material>(std::move(material))};
    scene.set_pose(node, pose);
    return node;
  }
  NodeId add(Light light, const Affine& pose = Affine::Identity()) {
    const NodeId node = scene.create(base, "light");
    scene.edit(node).light = std::move(light);
    scene.set_pose(node, pose);
    return node;
  }
  /// Looks from one point to another; `fx` in pixels.
  NodeId add_camera(int width, int height, double fx, const Vec3& from, const Vec3& to) {
    Camera camera;
    camera.width = width;
    camera.height = height;
    camera.fx = fx;
    camera.fy = 1.1 * fx;
    camera.cx = 0.45 * width;
    camera.cy = 0.55 * height;
    camera.near_m = 0.01;
    const NodeId node = scene.create(base, "camera");
    scene.edit(node).camera = camera;
    Transform pose;
    pose.translation = from;
    pose.rotation = look_rotation(to - from);
    scene.set_pose(node, pose);
    return node;
  }
};

/// A closed mesh as a room around what is in it.
inline Mesh inside_out(Mesh mesh) {
  for (Vec3f& n : mesh.normals) n = -n;
  for (auto& t : mesh.triangles) std::swap(t[1], t[2]);
  return mesh;
}

inline Affine at(double x, double y, double z) { return Affine(Eigen::Translation3d(x, y, z)); }

inline Material matte(float grey) {
  Material material;
  material.base_color = Vec3f::Constant(grey);
  material.specular = 0.0f;
  material.roughness = 1.0f;
  return material;
}

inline Light dome(float radiance) {
  Light light;
  light.kind = LightKind::Dome;
  light.color = Vec3f::Constant(radiance);
  return light;
}

/// A lamp in an open shade of metal, whose inside lights the room, and panes and veils on the way.
inline TestWorld room_with_shade() {
  TestWorld world;
  world.add("room", inside_out(make_box(Vec3(4, 4, 3))), matte(0.6f));
  Material metal;
  metal.base_color = Vec3f(0.9f, 0.7f, 0.4f);
  metal.metallic = 1.0f;
  metal.roughness = 0.5f;
  world.add("wall", make_box(Vec3(0.02, 0.3, 0.3)), metal, at(0.85, 0.9, 0.7));
  world.add("floor", make_box(Vec3(0.3, 0.3, 0.02)), metal, at(0.99, 0.9, 0.55));
  Material lacquer;
  lacquer.base_color = Vec3f(0.2f, 0.4f, 0.7f);
  lacquer.roughness = 0.25f;
  world.add("table", make_box(Vec3(1.2, 0.9, 0.1)), lacquer, at(-0.4, 0.3, -0.9));
  Affine mirrored = at(0.6, -0.4, -1.1);
  mirrored.linear().col(0) *= -1.0;
  world.add("ball", make_sphere(0.3), matte(0.5f), mirrored);
  Material pane;
  pane.base_color = Vec3f(0.9f, 1.0f, 0.9f);
  pane.transmission = 1.0f;
  pane.is_thin_walled = true;
  pane.roughness = 0.0f;
  world.add("pane", make_box(Vec3(0.9, 0.01, 0.9)), pane, at(1.2, 0.3, 0.4));
  Material veil = matte(0.5f);
  veil.opacity = 0.4f;
  world.add("veil", make_box(Vec3(0.01, 0.8, 0.8)), veil, at(-1.2, 0.9, 0.2));
  Light lamp;
  lamp.radius_m = 0.03;
  lamp.color = Vec3f(900.0f, 800.0f, 600.0f);
  world.add(lamp, at(0.95, 0.9, 0.65));
  return world;
}

// No whole number of the groups that paths of neighbouring pixels form.
inline constexpr int kShadeWidth = 44;
inline constexpr int kShadeHeight = 36;

inline NodeId camera_into_shade(TestWorld& world) {
  return world.add_camera(kShadeWidth, kShadeHeight, 26.0, Vec3(-0.9, -1.8, 0.7),
                          Vec3(0.1, 0.6, -0.2));
}

/// Of what is scattered, in 11 x 12 pixels each.
inline std::vector<double> means_of_blocks(const Film& film) {
  constexpr int kBlockWidth = 11;
  constexpr int kBlockHeight = 12;
  constexpr int kColumns = kShadeWidth / kBlockWidth;
  std::vector<double> means(std::size_t(kColumns * (kShadeHeight / kBlockHeight)), 0.0);
  for (int y = 0; y < kShadeHeight; ++y) {
    for (int x = 0; x < kShadeWidth; ++x) {
      means[std::size_t(y / kBlockHeight * kColumns + x / kBlockWidth)] +=
          double(film.at(x, y).scattered.mean()) / double(kBlockWidth * kBlockHeight);
    }
  }
  return means;
}

/// Mean square of the pixels' differences, each relative to what is seen there.
inline double relative_error(const Film& film, const Film& truth) {
  double sum = 0.0;
  for (std::size_t i = 0; i < film.pixels().size(); ++i) {
    const Vec3f& t = truth.pixels()[i].scattered;
    sum += double((film.pixels()[i].scattered - t).squaredNorm() / (t.squaredNorm() + 1e-4f));
  }
  return sum / double(film.pixels().size());
}

}  // namespace diorama::test
