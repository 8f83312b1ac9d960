// SPDX-License-Identifier: Apache-2.0
#include "bench_scene.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <array>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>
#include <span>

#include "diorama/error.h"
#include "framework/bench/scene_rig.h"

namespace diorama::bench {
namespace {

using Json = nlohmann::json;

/// A file's bytes where the system keeps them, without a copy.
class MappedFile {
 public:
  explicit MappedFile(const std::filesystem::path& file) : size_(std::filesystem::file_size(file)) {
    const int descriptor = open(file.c_str(), O_RDONLY | O_CLOEXEC);
    if (descriptor >= 0) {
      bytes_ = mmap(nullptr, size_, PROT_READ, MAP_PRIVATE | MAP_POPULATE, descriptor, 0);
      close(descriptor);
    }
    if (bytes_ == MAP_FAILED) throw Error(ErrorKind::Asset, file.string() + ": cannot be read");
  }
  ~MappedFile() { munmap(bytes_, size_); }
  MappedFile(const MappedFile&) = delete;
  MappedFile& operator=(const MappedFile&) = delete;

  const std::byte* data() const { return static_cast<const std::byte*>(bytes_); }

 private:
  std::size_t size_;
  void* bytes_ = MAP_FAILED;
};

/// A glTF binary: the JSON chunk and the buffer behind it.
class Glb {
 public:
  explicit Glb(const std::filesystem::path& file) : bytes_(file) {
    const std::uint32_t json_size = word(12);
    const auto* text = reinterpret_cast<const char*>(bytes_.data()) + 20;
    json = Json::parse(text, text + json_size);
    buffer_ = 20 + json_size + 8;
  }

  Json json;

  std::span<const std::byte> view(std::size_t index) const {
    const Json& v = json["bufferViews"][index];
    return {bytes_.data() + buffer_ + v.value("byteOffset", std::size_t(0)),
            v["byteLength"].get<std::size_t>()};
  }
  /// Calls visit(i, bytes of element i).
  template <class Visit>
  void each(std::size_t accessor, Visit&& visit) const {
    static const std::map<std::string, std::size_t> parts{{"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}};
    const Json& a = json["accessors"][accessor];
    const Json& v = json["bufferViews"][a["bufferView"].get<std::size_t>()];
    const int type = a["componentType"];
    const std::size_t size = type == 5123 ? 2 : 4;
    const std::size_t packed = size * parts.at(a["type"]);
    const std::size_t stride = v.value("byteStride", packed);
    const std::byte* data = view(a["bufferView"]).data() + a.value("byteOffset", std::size_t(0));
    const auto count = a["count"].get<std::size_t>();
    for (std::size_t i = 0; i < count; ++i) visit(i, data + i * stride, size);
  }
  template <class V>
  std::vector<V> vectors(std::size_t accessor) const {
    std::vector<V> values;
    values.reserve(json["accessors"][accessor]["count"].get<std::size_t>());
    each(accessor, [&](std::size_t, const std::byte* p, std::size_t) {
      V value;
      std::memcpy(value.data(), p, sizeof(value));
      values.push_back(value);
    });
    return values;
  }

 private:
  std::uint32_t word(std::size_t at) const {
    std::uint32_t value;
    std::memcpy(&value, bytes_.data() + at, 4);
    return value;
  }
  MappedFile bytes_;
  std::size_t buffer_;
};

std::shared_ptr<const Mesh> read_mesh(const Glb& glb, const Json& primitive) {
  auto mesh = std::make_shared<Mesh>();
  const Json& attributes = primitive["attributes"];
  mesh->positions = glb.vectors<Vec3f>(attributes["POSITION"]);
  if (attributes.contains("NORMAL")) mesh->normals = glb.vectors<Vec3f>(attributes["NORMAL"]);
  if (attributes.contains("TEXCOORD_0")) {
    mesh->uvs = glb.vectors<Vec2f>(attributes["TEXCOORD_0"]);
    for (Vec2f& uv : mesh->uvs) uv.y() = 1.0f - uv.y();
  }
  const std::size_t accessor = primitive["indices"];
  mesh->triangles.resize(glb.json["accessors"][accessor]["count"].get<std::size_t>() / 3);
  glb.each(accessor, [&](std::size_t i, const std::byte* p, std::size_t size) {
    std::memcpy(&mesh->triangles[i / 3][i % 3], p, size);
  });
  return mesh;
}

std::shared_ptr<const Material> read_material(const Glb& glb, const Json& source, Host& host,
                                              bool is_diffuse) {
  auto material = std::make_shared<Material>();
  const Json& pbr = source["pbrMetallicRoughness"];
  if (pbr.contains("baseColorFactor")) {
    for (int k = 0; k < 3; ++k) material->base_color[k] = pbr["baseColorFactor"][std::size_t(k)];
  } else {
    material->base_color.setOnes();
  }
  if (pbr.contains("baseColorTexture")) {
    const std::size_t texture = pbr["baseColorTexture"]["index"];
    const std::size_t image = glb.json["textures"][texture]["source"];
    const std::size_t view = glb.json["images"][image]["bufferView"];
    material->base_color_texture.texture = host.decode_texture(glb.view(view), "wood.png");
  }
  material->metallic = pbr.value("metallicFactor", 1.0f);
  material->roughness = pbr.value("roughnessFactor", 1.0f);
  if (is_diffuse) {
    material->metallic = 0.0f;
    material->roughness = 1.0f;
    material->specular = 0.0f;
  }
  return material;
}

Affine node_pose(const Json& node) {
  Transform t;
  const auto number = [&](const char* key, std::size_t i) { return node[key][i].get<double>(); };
  if (node.contains("translation")) {
    for (std::size_t k = 0; k < 3; ++k) t.translation[Eigen::Index(k)] = number("translation", k);
  }
  if (node.contains("scale")) {
    for (std::size_t k = 0; k < 3; ++k) t.scale[Eigen::Index(k)] = number("scale", k);
  }
  if (node.contains("rotation")) {
    t.rotation = Quat(number("rotation", 3), number("rotation", 0), number("rotation", 1),
                      number("rotation", 2));
  }
  return t.affine();
}

}  // namespace

Scene load_bench_scene(const std::filesystem::path& folder, Host& host, bool is_diffuse) {
  const Glb glb(folder / "scene.glb");
  Scene scene;
  // glTF is y-up.
  const NodeId root = scene.create(scene.root(), "room");
  scene.set_pose(root, Affine(Eigen::AngleAxisd(0.5 * kPi, Vec3::UnitX())));
  std::vector<std::shared_ptr<const Material>> materials;
  for (const Json& m : glb.json["materials"]) {
    materials.push_back(read_material(glb, m, host, is_diffuse));
  }
  std::map<std::size_t, std::vector<std::pair<std::shared_ptr<const Mesh>, std::size_t>>> meshes;
  for (const Json& node : glb.json["nodes"]) {
    if (!node.contains("mesh")) continue;
    const std::size_t index = node["mesh"];
    if (!meshes.contains(index)) {
      for (const Json& primitive : glb.json["meshes"][index]["primitives"]) {
        meshes[index].emplace_back(read_mesh(glb, primitive),
                                   primitive.value("material", std::size_t(0)));
      }
    }
    for (const auto& [mesh, material] : meshes[index]) {
      const std::string name = node.value("name", "object");
      const NodeId id = scene.create(root, name);
      // The loose things: a renderer may prepare for their moving.
      if (name.starts_with("obj.") || name.starts_with("chair.")) {
        scene.edit(id).rigid_body = RigidBody();
      }
      scene.edit(id).mesh = mesh;
      scene.edit(id).materials = {materials[material]};
      scene.set_pose(id, node_pose(node));
    }
  }
  add_rig_lights(folder / "scene.json", scene, host);
  return scene;
}

NodeId add_bench_camera(const std::filesystem::path& folder, Scene& scene, int width, int height) {
  const NodeId node = add_rig_camera(folder / "scene.json", scene);
  Camera& camera = *scene.edit(node).camera;
  const double scale = double(width) / camera.width;
  camera.width = width;
  camera.height = height;
  camera.fx *= scale;
  camera.fy *= scale;
  camera.cx *= scale;
  camera.cy *= scale;
  return node;
}

}  // namespace diorama::bench
