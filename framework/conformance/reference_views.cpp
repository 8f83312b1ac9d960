// SPDX-License-Identifier: Apache-2.0
#include "framework/conformance/reference_views.h"

#include <algorithm>

namespace diorama::conformance {
namespace {

NodeId add_box(Scene& scene, NodeId parent, const char* name, const Vec3& size,
               const Transform& pose, const Vec3f& color, const char* label = nullptr) {
  const NodeId id = scene.create(parent, name);
  scene.set_pose(id, pose);
  auto material = std::make_shared<Material>();
  material->name = name;
  material->base_color = color;
  Node& node = scene.edit(id);
  node.mesh = std::make_shared<const Mesh>(make_box(size));
  node.materials = {std::move(material)};
  if (label) node.labels = {{"class", label}};
  return id;
}

Transform at(double x, double y, double z, double turn_rad = 0.0, const Vec3& axis = Vec3::UnitZ(),
             const Vec3& scale = Vec3::Ones()) {
  return {Vec3(x, y, z), Quat(Eigen::AngleAxisd(turn_rad, axis.normalized())), scale};
}

/// `place` and `target` are in world space, whatever the camera stands on.
NodeId add_camera(Scene& scene, NodeId parent, const Vec3& place, const Vec3& target,
                  double roll_rad, const Camera& camera) {
  const NodeId id = scene.create(parent, "camera");
  Transform pose;
  pose.translation = place;
  pose.rotation = look_rotation(target - place) * Quat(Eigen::AngleAxisd(roll_rad, Vec3::UnitZ()));
  scene.set_pose(id, Affine(scene.world_from_node(parent).inverse() * pose.affine()));
  scene.edit(id).camera = camera;
  const NodeId sky = scene.create(scene.root(), "sky");
  Light& dome = scene.edit(sky).light.emplace();
  dome.kind = LightKind::Dome;
  dome.color = Vec3f(600.0f, 650.0f, 700.0f);
  return id;
}

Camera pinhole(int width, int height, double focal_px, double cx, double cy) {
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.fx = camera.fy = focal_px;
  camera.cx = cx;
  camera.cy = cy;
  camera.near_m = 0.05;
  return camera;
}

/// One texel, so that however texels are mixed its colour is that one.
TextureInput one_texel(std::uint8_t red, std::uint8_t green, std::uint8_t blue) {
  auto texture = std::make_shared<Texture>();
  texture->name = "one texel";
  texture->width = texture->height = 1;
  texture->channels = 3;
  texture->color_space = ColorSpace::Srgb;
  texture->bytes = {red, green, blue};
  TextureInput input;
  input.texture = std::move(texture);
  return input;
}

/// Every other face is made of a second material.
void paint_faces(Node& node, const Vec3f& color) {
  auto mesh = std::make_shared<Mesh>(*node.mesh);
  for (std::size_t i = 0; i < mesh->triangles.size(); ++i) {
    mesh->material_slots.push_back(std::uint16_t(i / 2 % 2));
  }
  node.mesh = std::move(mesh);
  auto other = std::make_shared<Material>();
  other->name = "other faces";
  other->base_color = color;
  node.materials.push_back(std::move(other));
}

void paint_corners(Node& node, const Vec3f& color) {
  auto mesh = std::make_shared<Mesh>(*node.mesh);
  mesh->colors.assign(mesh->positions.size(), color);
  node.mesh = std::move(mesh);
}

/// A sheet without thickness, which turns its back to who looks along its normal.
NodeId add_sheet(Scene& scene, NodeId parent, const Transform& pose, const Vec3f& color) {
  const NodeId id = add_box(scene, parent, "sheet", Vec3::Ones(), pose, color);
  Mesh sheet = make_plane(0.5, 0.4);
  sheet.is_double_sided = false;  // which concerns nothing but the light that it emits
  scene.edit(id).mesh = std::make_shared<const Mesh>(std::move(sheet));
  return id;
}

ReferenceView off_centre() {
  ReferenceView view{"the camera whose principal point is off the centre", {}, {}};
  Scene& scene = view.scene;
  const NodeId assets = scene.create(scene.root(), "Assets");
  add_box(scene, assets, "tall", {0.3, 0.4, 1.3}, at(-0.7, 0.6, 0.5, 0.4), {0.85f, 0.1f, 0.08f},
          "tall");
  add_box(scene, assets, "low", {0.9, 0.5, 0.25}, at(0.2, -0.4, 0.1, -0.3), {0.1f, 0.7f, 0.15f},
          "low");
  const NodeId far =
      add_box(scene, assets, "far", {0.5, 0.5, 0.5}, at(-1.6, -0.9, 0.9, 0.9), {0.2f, 0.3f, 0.9f});
  auto printed = std::make_shared<Material>(*scene[far].materials.front());
  printed->base_color_texture = one_texel(188, 150, 240);
  scene.edit(far).materials = {std::move(printed)};
  paint_faces(scene.edit(scene.require("/Assets/tall")), {0.1f, 0.2f, 0.85f});
  // Its front looks away from the camera.
  add_sheet(scene, scene.root(), at(0.4, 0.6, 0.7, -1.2, Vec3::UnitY()), {0.7f, 0.65f, 0.1f});
  // Reaches beyond the image.
  add_box(scene, scene.root(), "floor", {1.5, 2.5, 0.1}, at(-0.6, 0.5, -0.2), {0.6f, 0.6f, 0.55f},
          "floor");
  Camera camera = pinhole(44, 31, 40.0, 24.7, 13.2);
  camera.fy = 33.0;
  view.camera = add_camera(scene, scene.root(), {2.4, 0.3, 1.0}, {0.0, 0.1, 0.35}, 0.0, camera);
  return view;
}

ReferenceView rolled() {
  ReferenceView view{"the rolled camera", {}, {}};
  Scene& scene = view.scene;
  const NodeId group = scene.create(scene.root(), "group");
  scene.set_pose(group, at(0.2, 0.1, 0.3, 0.7, {1, 2, 3}, {1.4, 0.7, 1.1}));
  scene.edit(group).labels = {{"class", "group"}};
  add_box(scene, group, "inner", {0.5, 0.6, 0.4}, at(0.1, 0.2, 0.0, 0.5, {3, 1, 1}),
          {0.8f, 0.6f, 0.1f});
  const NodeId own = add_box(scene, group, "own", {0.3, 0.3, 0.9},
                             at(-0.5, 0.4, 0.3, 1.1, {0, 1, 1}), {0.1f, 0.5f, 0.7f}, "own");
  const NodeId cap =
      add_box(scene, own, "cap", {0.5, 0.2, 0.15}, at(0.05, 0.0, 0.5), {0.9f, 0.9f, 0.9f});
  paint_corners(scene.edit(cap), {0.9f, 0.5f, 0.2f});
  const NodeId hidden = scene.create(scene.root(), "hidden");
  scene.edit(hidden).is_visible = false;
  add_box(scene, hidden, "wall", {0.1, 3.0, 3.0}, at(0.8, 0.0, 0.0), {0.5f, 0.1f, 0.5f}, "wall");
  const NodeId stand = scene.create(scene.root(), "stand");
  scene.set_pose(stand, at(0.7, -0.4, 0.5, 0.8, {2, -1, 3}));
  view.camera = add_camera(scene, stand, {1.6, -1.5, 1.4}, {0.1, 0.2, 0.3}, 0.6,
                           pinhole(33, 45, 42.0, 16.5, 22.5));
  return view;
}

ReferenceView distorted() {
  ReferenceView view{"the distorted lens", {}, {}};
  Scene& scene = view.scene;
  for (int i = 0; i < 4; ++i) {
    const std::string name = "post_" + std::to_string(i);
    add_box(scene, scene.root(), name.c_str(), {0.2, 0.2, 1.0 + 0.3 * i},
            at(0.4 * i - 0.8, 1.6 + 0.2 * i, 0.2 * i - 0.4, 0.2 * i),
            {0.2f + 0.2f * float(i), 0.8f - 0.2f * float(i), 0.3f}, i == 2 ? "post" : nullptr);
  }
  // Nearer than anything that is seen.
  add_box(scene, scene.root(), "finger", {0.08, 0.05, 0.1}, at(0.05, 0.0, 0.2, 0.3),
          {0.9f, 0.5f, 0.4f}, "finger");
  Camera camera = pinhole(47, 29, 24.0, 22.1, 15.4);
  camera.near_m = 0.8;
  camera.lens = LensModel::OpencvPinhole;
  camera.distortion = {-0.12, 0.02, 0.003, -0.002, 0.0, 0.0, 0.0, 0.0};
  view.camera = add_camera(scene, scene.root(), {0.1, -0.3, 0.2}, {0.0, 1.7, 0.1}, -0.15, camera);
  return view;
}

/// Of a triangle of one colour.
Vec3f albedo_of(const Node& node, std::size_t triangle) {
  const Mesh& mesh = *node.mesh;
  const std::size_t slot = mesh.material_slots.empty() ? 0 : mesh.material_slots[triangle];
  if (slot >= node.materials.size()) return Material().base_color;
  const Material& material = *node.materials[slot];
  Vec3f albedo = material.base_color;
  if (const auto& texture = material.base_color_texture.texture) {
    for (int i = 0; i < 3; ++i) {
      albedo[i] *= linear_from_srgb(float(texture->bytes[std::size_t(i)]) / 255.0f);
    }
  }
  if (!mesh.colors.empty()) albedo = albedo.cwiseProduct(mesh.colors[mesh.triangles[triangle][0]]);
  return albedo;
}

}  // namespace

std::vector<ReferenceView> reference_views() {
  std::vector<ReferenceView> views;
  views.push_back(off_centre());
  views.push_back(rolled());
  views.push_back(distorted());
  return views;
}

ReferenceEye::ReferenceEye(const Scene& scene, NodeId camera, const std::vector<NodeId>* leaves)
    : camera_(*scene[camera].camera), world_from_camera_(scene.world_from_node(camera)) {
  for (const NodeId leaf : scene.subtree(scene.root())) {
    const Node& node = scene[leaf];
    if (!node.mesh || !scene.is_visible(leaf)) continue;
    if (leaves && std::ranges::find(*leaves, leaf) == leaves->end()) continue;
    const Affine world_from_node = scene.world_from_node(leaf);
    for (std::size_t number = 0; number < node.mesh->triangles.size(); ++number) {
      const auto& triangle = node.mesh->triangles[number];
      Face face;
      face.leaf = leaf;
      face.albedo = albedo_of(node, number);
      for (int i = 0; i < 3; ++i) {
        const std::size_t corner = triangle[std::size_t(i)];
        face.corners[i] = world_from_node * node.mesh->positions[corner].cast<double>();
        face.uvs[i] = node.mesh->uvs[corner].cast<double>();
      }
      face.normal =
          (face.corners[1] - face.corners[0]).cross(face.corners[2] - face.corners[0]).normalized();
      faces_.push_back(face);
    }
  }
}

// Moeller and Trumbore, "Fast, minimum storage ray/triangle intersection", 1997.
ReferenceEye::Hit ReferenceEye::meet(const Vec2& pixel) const {
  Hit nearest;
  const auto in_camera = ray_direction(camera_, pixel);
  if (!in_camera) return nearest;
  const Vec3 origin = world_from_camera_.translation();
  const Vec3 direction = world_from_camera_.linear() * *in_camera;
  const double slant = std::max(-in_camera->z(), 1e-6);
  for (const Face& face : faces_) {
    const Vec3 side = face.corners[1] - face.corners[0];
    const Vec3 other = face.corners[2] - face.corners[0];
    const Vec3 p = direction.cross(other);
    const double determinant = side.dot(p);
    if (determinant == 0.0) continue;
    const Vec3 from = origin - face.corners[0];
    const double u = from.dot(p) / determinant;
    const Vec3 q = from.cross(side);
    const double v = direction.dot(q) / determinant;
    const double distance = other.dot(q) / determinant;
    if (u < 0.0 || v < 0.0 || u + v > 1.0 || distance < camera_.near_m / slant) continue;
    if (distance < nearest.distance) nearest = {&face, distance, u, v};
  }
  return nearest;
}

ReferencePixel ReferenceEye::look(int x, int y) const {
  constexpr double kAside = 0.02;
  const Vec2 centre(x + 0.5, y + 0.5);
  const Hit hit = meet(centre);
  ReferencePixel pixel;
  pixel.is_decided = true;
  for (const Vec2& aside : {Vec2(kAside, kAside), Vec2(-kAside, kAside), Vec2(kAside, -kAside),
                            Vec2(-kAside, -kAside)}) {
    const Hit near = meet(centre + aside);
    const bool is_same_plane =
        near.face == hit.face || (near.face && hit.face && near.face->leaf == hit.face->leaf &&
                                  near.face->normal.dot(hit.face->normal) > 0.9999);
    if (!is_same_plane) pixel.is_decided = false;
  }
  if (!hit.face) return pixel;
  const Face& face = *hit.face;
  const Vec3 weights(1.0 - hit.u - hit.v, hit.u, hit.v);
  pixel.leaf = face.leaf;
  pixel.distance = hit.distance;
  for (int i = 0; i < 3; ++i) {
    pixel.position += weights[i] * face.corners[i];
    pixel.uv += weights[i] * face.uvs[i];
  }
  const Vec3 view = pixel.position - world_from_camera_.translation();
  pixel.depth = view.dot(-world_from_camera_.linear().col(2));
  pixel.normal = face.normal.dot(view) > 0.0 ? Vec3(-face.normal) : face.normal;
  pixel.albedo = face.albedo;
  return pixel;
}

}  // namespace diorama::conformance
