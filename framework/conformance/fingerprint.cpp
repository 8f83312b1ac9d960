// SPDX-License-Identifier: Apache-2.0
#include "framework/conformance/fingerprint.h"

#include <type_traits>
#include <variant>

#include "framework/conformance/check_run.h"

namespace diorama::conformance {
namespace {

/// Writes values one after the other, lengths of lists included.
class Bytes {
 public:
  std::string text;

  template <class T>
  requires(std::is_arithmetic_v<T> || std::is_enum_v<T>) void add(const T& value) {
    text.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  template <class... T>
  void add_all(const T&... values) {
    (add(values), ...);
  }
  void add(std::string_view value) {
    add(value.size());
    text += value;
  }
  void add(const std::string& value) { add(std::string_view(value)); }
  template <class T, int Rows, int Columns>
  void add(const Eigen::Matrix<T, Rows, Columns>& value) {
    for (const T& number : value.reshaped()) add(number);
  }
  void add(const Affine& value) { add(Mat4(value.matrix())); }
  template <class T, std::size_t N>
  void add(const std::array<T, N>& values) {
    for (const T& value : values) add(value);
  }
  template <class T>
  void add(const std::vector<T>& values) {
    add(values.size());
    for (const T& value : values) add(value);
  }
  template <class T>
  void add(const std::optional<T>& value) {
    add(value.has_value());
    if (value) add(*value);
  }
  template <class T>
  void add(const std::shared_ptr<const T>& value) {
    add(value != nullptr);
    if (value) add(*value);
  }
  template <class Key, class T, class Less>
  void add(const std::map<Key, T, Less>& values) {
    add(values.size());
    for (const auto& [key, value] : values) add_all(key, value);
  }

  void add(const Mesh& mesh) {
    add_all(mesh.positions, mesh.triangles, mesh.normals, mesh.uvs, mesh.colors,
            mesh.material_slots, mesh.is_double_sided);
  }
  void add(const Texture& texture) {
    add_all(texture.width, texture.height, texture.channels, texture.color_space, texture.bytes,
            texture.floats);
  }
  void add(const TextureInput& input) {
    add_all(input.texture, input.wrap_u, input.wrap_v, input.channel, input.scale, input.bias,
            input.uv_from_mesh_uv);
  }
  void add(const Material& material) {
    add_all(material.name, material.base_color, material.base_color_texture, material.metallic,
            material.metallic_texture, material.roughness, material.roughness_texture,
            material.normal_texture, material.ior, material.specular, material.clearcoat,
            material.clearcoat_roughness, material.transmission, material.is_thin_walled,
            material.opacity, material.opacity_texture, material.opacity_threshold,
            material.emission, material.emission_texture);
  }
  void add(const Light& light) {
    add_all(light.kind, light.color, light.radius_m, light.width_m, light.height_m, light.angle_rad,
            light.texture, light.cone_angle_rad, light.cone_softness, light.is_visible_to_camera);
  }
  void add(const Camera& camera) {
    add_all(camera.width, camera.height, camera.lens, camera.fx, camera.fy, camera.cx, camera.cy,
            camera.distortion, camera.fisheye_polynomial, camera.fisheye_max_angle_rad,
            camera.near_m, camera.far_m, camera.focal_length_mm, camera.horizontal_aperture_mm,
            camera.focus_distance_m, camera.f_stop, camera.exposure_time_s, camera.readout_time_s,
            camera.linear_velocity, camera.angular_velocity);
  }
  void add(const Collider& collider) {
    add_all(collider.shape, collider.primitive, collider.primitive_size, collider.friction,
            collider.restitution);
  }
  void add(const RigidBody& body) {
    add_all(body.mass_kg, body.has_gravity, body.linear_velocity, body.angular_velocity);
  }
  void add(const Joint& joint) {
    add_all(joint.kind, joint.parent_body.index, joint.child_body.index, joint.parent_from_joint,
            joint.child_from_joint, joint.axis, joint.lower, joint.upper, joint.mimic.has_value());
    if (joint.mimic) {
      add_all(joint.mimic->joint.index, joint.mimic->multiplier, joint.mimic->offset);
    }
  }
  void add(const Animation& animation) {
    add_all(animation.asset, animation.start_s, animation.end_s);
  }
  void add(const JointState& state) {
    add_all(state.path, state.kind, state.parent_path, state.child_path, state.position,
            state.lower, state.upper);
  }
  void add(const Node& node) {
    add_all(node.parent_from_node, node.is_visible, node.labels, node.mesh, node.materials,
            node.light, node.camera, node.collider, node.rigid_body, node.joint, node.animation);
  }

  void add(const PixelBox& box) { add_all(box.x_min, box.y_min, box.x_max, box.y_max); }
  void add(const Visibility& visibility) {
    add_all(visibility.visible_pixels, visibility.amodal_pixels, visibility.outside_pixels,
            visibility.amodal_box, visibility.whole_box, visibility.amodal_mask.box,
            visibility.amodal_mask.bits);
  }
  void add(const Occlusion& occlusion) {
    add_all(occlusion.front, occlusion.behind, occlusion.pixels);
  }
  void add(const Instance& instance) {
    add_all(instance.id, instance.node_path, instance.labels, instance.world_from_node,
            instance.bounds_node.min, instance.bounds_node.max, instance.tight_box,
            instance.visibility);
    for (const Keypoint& point : instance.keypoints) add_all(point.name, point.position);
    if (instance.velocity) add_all(instance.velocity->linear, instance.velocity->angular);
  }
  void add(const AnyImage& any) {
    std::visit(
        [this](const auto& image) {
          add_all(image.width(), image.height());
          for (const auto& pixel : image.pixels()) add(pixel);
        },
        any);
  }
};

}  // namespace

std::string fingerprint(const Scene& scene) {
  Bytes bytes;
  for (const NodeId node : scene.subtree(scene.root())) {
    bytes.add_all(node.index, scene.path(node), scene[node]);
  }
  return bytes.text;
}

std::string fingerprint(const Node& node) {
  Bytes bytes;
  bytes.add(node);
  return bytes.text;
}

std::string fingerprint(const Frame& frame) {
  Bytes bytes;
  bytes.add_all(frame.camera_name, frame.camera_path, frame.camera, frame.world_from_camera,
                frame.instances, frame.occlusions, frame.joints, frame.leaf_paths, frame.exposure);
  for (const std::string& channel : frame.channels()) {
    bytes.add_all(channel, frame.image_named(channel));
  }
  return bytes.text;
}

std::string fingerprint(const Capture& capture) {
  Bytes bytes;
  bytes.add_all(capture.index, capture.visit, capture.phase, capture.environment);
  if (capture.clip) {
    bytes.add_all(capture.clip->clip, capture.clip->frame, capture.clip->frame_count,
                  capture.clip->fps);
  }
  for (const Frame& frame : capture.frames) bytes.add(fingerprint(frame));
  return bytes.text;
}

std::vector<std::string> changed_nodes(const Scene& before, const Scene& after) {
  const std::vector<NodeId> nodes = before.subtree(before.root());
  if (nodes != after.subtree(after.root())) return {"the tree of nodes"};
  std::vector<std::string> paths;
  for (const NodeId node : nodes) {
    Bytes one, other;
    one.add_all(before.path(node), before[node]);
    other.add_all(after.path(node), after[node]);
    if (one.text != other.text) paths.push_back(before.path(node));
  }
  return paths;
}

void require_same(const Scene& before, const Scene& after, const std::string& failure) {
  std::string paths;
  for (const std::string& path : changed_nodes(before, after)) {
    paths += (paths.empty() ? "" : ", ") + path;
  }
  require(paths.empty(), failure + ": " + paths);
}

}  // namespace diorama::conformance
