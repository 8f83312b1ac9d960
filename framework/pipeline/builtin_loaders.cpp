// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/builtin_loaders.h"

#include <algorithm>

#include "diorama/error.h"
#include "framework/host/asset_paths.h"

namespace diorama {
namespace {

struct Shape {
  Mesh mesh;
  PrimitiveShape primitive = PrimitiveShape::None;
};

const std::vector<std::string> kShapes{"capsule", "cone", "cylinder", "sphere", "cube"};

Shape make_shape(std::string_view name) {
  if (name == "capsule") return {make_capsule(0.5, 1.0), PrimitiveShape::Capsule};
  if (name == "cone") return {make_cone(1.0, 2.0), PrimitiveShape::Cone};
  if (name == "cylinder") return {make_cylinder(1.0, 2.0), PrimitiveShape::Cylinder};
  if (name == "sphere") return {make_sphere(1.0), PrimitiveShape::Sphere};
  return {make_box(Vec3::Constant(2.0)), PrimitiveShape::Box};
}

void check_shape(const std::string& name) {
  if (std::find(kShapes.begin(), kShapes.end(), name) != kShapes.end()) return;
  std::string known;
  for (const std::string& shape : kShapes) known += (known.empty() ? "" : ", ") + shape;
  const std::string near = nearest_name(name, kShapes);
  throw Error(ErrorKind::Config, "unknown shape '" + name + "'" +
                                     (near.empty() ? "" : "; did you mean '" + near + "'?") +
                                     " (known: " + known + ")");
}

/// "dining_room:7", but neither "file:///a" nor "omniverse://a".
bool is_generated(std::string_view asset) {
  const std::size_t colon = asset.find(':');
  return colon != std::string_view::npos && colon > 1 && !asset.substr(colon).starts_with("://") &&
         asset.find('/') > colon;
}

}  // namespace

void FilesLoader::Params::visit(ParamVisitor& v) {
  v.param("folders", folders, {"Folders whose files are taken, at any depth, sorted by path."});
  v.param("files", files, {"Single files; variants may follow: mug.usd{look=red}."});
  v.param("skip", skip, {"Leaves out files and folders whose name holds one of these, any case."});
}

FilesLoader::FilesLoader(Params params, Host& host) : params_(std::move(params)), host_(host) {}

std::vector<std::string> FilesLoader::claims() const { return {}; }

std::vector<std::string> FilesLoader::assets() const {
  std::vector<std::string> assets;
  for (const std::string& file : params_.files) {
    if (is_generated(file)) {
      assets.push_back(file);
      continue;
    }
    const auto [plain, variants] = split_variants(file);
    assets.push_back(host_.resolve(plain).string() + std::string(variants));
  }
  for (const std::string& folder : params_.folders) {
    for (const auto& file : host_.list_assets(folder, params_.skip)) {
      assets.push_back(file.string());
    }
  }
  return assets;
}

void FilesLoader::load(std::string_view asset, Scene&, NodeId) {
  throw Error(ErrorKind::Internal, std::string(asset) + ": 'files' only names files");
}

void ShapesLoader::Params::visit(ParamVisitor& v) {
  v.param("shapes", shapes, {"Of capsule, cone, cylinder, sphere, cube."});
}

ShapesLoader::ShapesLoader(Params params, Host&) : params_(std::move(params)) {
  for (const std::string& shape : params_.shapes) check_shape(shape);
}

std::vector<std::string> ShapesLoader::claims() const { return {"shape:"}; }

std::vector<std::string> ShapesLoader::assets() const {
  std::vector<std::string> assets;
  for (const std::string& shape : params_.shapes) assets.push_back("shape:" + shape);
  return assets;
}

void ShapesLoader::load(std::string_view asset, Scene& scene, NodeId root) {
  const std::string name(asset.substr(asset.find(':') + 1));
  check_shape(name);
  Shape shape = make_shape(name);
  Node& node = scene.edit(root);
  const Vec3 size = shape.mesh.bounds().size();
  node.mesh = std::make_shared<const Mesh>(std::move(shape.mesh));
  Collider collider;
  collider.primitive = shape.primitive;
  collider.shape = ColliderShape::Primitive;
  collider.primitive_size = size;
  node.collider = collider;
}

void register_builtin_loaders(Registrar& registrar) {
  add<FilesLoader>(registrar, "files", "Names files and folders of files.");
  add<EmptyLoader>(registrar, "empty", "Empty space, as an environment.");
  add<ShapesLoader>(registrar, "shapes", "Makes capsules, cones, cylinders, spheres and cubes.");
}

}  // namespace diorama
