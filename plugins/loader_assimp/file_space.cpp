// SPDX-License-Identifier: Apache-2.0
#include "loader_assimp/file_space.h"

#include <cmath>
#include <cstdint>
#include <optional>
#include <sstream>

namespace diorama::loader_assimp {
namespace {

// Rows of a rotation to Z up say which direction of the file becomes x, y and z.
Affine turn(const Vec3& x, const Vec3& y, const Vec3& z) {
  Affine result = Affine::Identity();
  result.linear().row(0) = x;
  result.linear().row(1) = y;
  result.linear().row(2) = z;
  return result;
}

Affine z_up_from(char axis) {
  if (axis == 'x') return turn(-Vec3::UnitZ(), Vec3::UnitY(), Vec3::UnitX());
  if (axis == 'y') return turn(Vec3::UnitX(), -Vec3::UnitZ(), Vec3::UnitY());
  return Affine::Identity();
}

Affine scaled(Affine map, double scale) {
  map.linear() *= scale;
  return map;
}

template <class T>
std::optional<T> metadata(const aiScene& scene, const char* key) {
  T value{};
  if (scene.mMetaData && scene.mMetaData->Get(key, value)) return value;
  return std::nullopt;
}

// The file's direction for "UpAxis" and its like: axis 0 to 2 and a sign.
std::optional<Vec3> fbx_direction(const aiScene& scene, const std::string& name) {
  const auto axis = metadata<std::int32_t>(scene, (name).c_str());
  const auto sign = metadata<std::int32_t>(scene, (name + "Sign").c_str());
  if (!axis || *axis < 0 || *axis > 2) return std::nullopt;
  return Vec3(Vec3::Unit(*axis) * (sign && *sign < 0 ? -1.0 : 1.0));
}

// FBX counts in centimetres times UnitScaleFactor; "front" looks at the viewer.
Affine metres_from_fbx(const aiScene& scene) {
  const auto right = fbx_direction(scene, "CoordAxis");
  const auto up = fbx_direction(scene, "UpAxis");
  const auto front = fbx_direction(scene, "FrontAxis");
  double centimetres = metadata<double>(scene, "UnitScaleFactor").value_or(1.0);
  if (const auto single = metadata<float>(scene, "UnitScaleFactor")) centimetres = *single;
  if (!(centimetres > 0.0) || !std::isfinite(centimetres)) centimetres = 1.0;
  Affine axes = z_up_from('y');
  if (right && up && front) {
    const Affine stated = turn(*right, -*front, *up);
    if (std::abs(stated.linear().determinant()) > 0.5) axes = stated;
  }
  return scaled(axes, 0.01 * centimetres);
}

// 3MF counts in millimetres unless it says otherwise.
double metres_per_3mf_unit(const aiScene& scene) {
  const auto unit = metadata<aiString>(scene, "unit");
  const std::string name = unit ? unit->C_Str() : "";
  if (name == "micron") return 1e-6;
  if (name == "centimeter") return 0.01;
  if (name == "inch") return 0.0254;
  if (name == "foot") return 0.3048;
  if (name == "meter") return 1.0;
  return 0.001;
}

}  // namespace

Affine to_affine(const aiMatrix4x4& matrix) {
  Affine affine = Affine::Identity();
  for (unsigned row = 0; row < 3; ++row) {
    for (unsigned column = 0; column < 4; ++column) affine(row, column) = matrix[row][column];
  }
  return affine.matrix().allFinite() ? affine : Affine::Identity();
}

Affine metres_from_file(const SceneFile& file, const UnstatedSpace& unstated) {
  const aiScene& scene = file.scene();
  // Newer versions of assimp put FBX's axes and units into the root node, which FBX itself does not
  // have: what the file says is read from the metadata instead.
  if (file.format() == Format::Fbx) return metres_from_fbx(scene);
  const Affine root = to_affine(scene.mRootNode->mTransformation);
  if (file.format() == Format::ThreeMf) {
    return scaled(Affine::Identity(), metres_per_3mf_unit(scene)) * root;
  }
  if (file.format() == Format::Plain) {
    return scaled(z_up_from(unstated.up_axis.front()), unstated.meters_per_unit) * root;
  }
  // Everything else comes in metres and Y up; assimp turns and scales COLLADA itself.
  return z_up_from('y') * root;
}

std::string describe_units(const SceneFile& file, const UnstatedSpace& unstated) {
  // Root nodes of these formats may have poses of their own, which are no units.
  const bool is_fixed = file.format() == Format::Gltf || file.format() == Format::Other;
  const Affine metres = is_fixed ? z_up_from('y') : metres_from_file(file, unstated);
  Vec3::Index axis = 0;
  metres.linear().row(2).cwiseAbs().maxCoeff(&axis);
  std::ostringstream text;
  text << "units: " << std::cbrt(std::abs(metres.linear().determinant())) << " m, "
       << (metres.linear()(2, axis) < 0.0 ? "-" : "") << "xyz"[axis] << " up";
  return text.str();
}

}  // namespace diorama::loader_assimp
