// SPDX-License-Identifier: Apache-2.0
#include "loader_usd/mesh_translator.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "loader_usd/corner_data.h"
#include "loader_usd/mesh_assembly.h"
#include "loader_usd/points_and_curves.h"
#include "loader_usd/shapes.h"

namespace diorama::loader_usd {
namespace {

using usd::Prim;
using usd::Stage;

constexpr const char* kDisplayColor = "primvars:displayColor";
// About a megabyte of normals and uvs.
constexpr std::size_t kCornersBetweenReleases = 50'000;

// The primvar that textures are laid out by; empty when there is none.
std::string find_uv(const std::vector<usd::Primvar>& primvars,
                    const std::vector<std::string>& uv_names) {
  const auto has = [&](const std::string& name) {
    return std::any_of(primvars.begin(), primvars.end(),
                       [&](const usd::Primvar& primvar) { return primvar.name == name; });
  };
  for (const std::string& name : uv_names) {
    if (has(name)) return name;
  }
  for (const char* name : {"st", "UVMap"}) {
    if (has(name)) return name;
  }
  for (const char* type : {"texCoord2", "texCoord3", "float2", "half2", "double2"}) {
    for (const usd::Primvar& primvar : primvars) {
      // Old files have old names for the same types.
      const std::string canonical = usd::parse_value_type(primvar.type).canonical;
      if (canonical.starts_with(type)) return primvar.name;
    }
  }
  return {};
}

// The prim that authored a primvar; null where there is none.
const Prim* owner_of(const std::vector<usd::Primvar>& primvars, const std::string& name) {
  for (const usd::Primvar& primvar : primvars) {
    if (primvar.name == name) return primvar.owner;
  }
  return nullptr;
}

// The first two numbers of three lay a texture out, too.
std::optional<CornerData> read_uvs(const Stage& stage, const Prim* owner, const std::string& name) {
  if (!owner) return std::nullopt;
  auto uvs = read_corner_data(stage, *owner, name, 2, "constant");
  return uvs ? std::move(uvs) : read_corner_data(stage, *owner, name, 3, "constant");
}

std::optional<CornerData> read_colors(const Stage& stage, const Prim* owner) {
  if (!owner) return std::nullopt;
  return read_corner_data(stage, *owner, kDisplayColor, 3, "constant");
}

bool is_one_for_all(const CornerData& data) {
  return data.interpolation == Interpolation::Constant || data.count() <= 1;
}

// Colours that differ; a single one goes to the material.
std::optional<CornerData> read_varied_colors(const Stage& stage, const Prim* owner) {
  auto colors = read_colors(stage, owner);
  if (colors && is_one_for_all(*colors)) colors.reset();
  return colors;
}

// How many elements the data must have for this mesh.
std::size_t needed_elements(const CornerData& data, const MeshSources& mesh) {
  switch (data.interpolation) {
    case Interpolation::Uniform:
      return mesh.counts.span.size();
    case Interpolation::Vertex:
    case Interpolation::Varying:
      return mesh.points.span.size() / 3;
    case Interpolation::FaceVarying:
      return mesh.indices.span.size();
    default:
      return 1;
  }
}

bool has_sound_indices(const CornerData& data) {
  if (!data.indices) return true;
  const auto values = static_cast<std::uint32_t>(
      std::min<std::size_t>(data.values.span.size() / data.width, 0x7FFFFFFF));
  bool result = true;
  for (const std::int32_t index : data.indices->span) {
    result &= static_cast<std::uint32_t>(index) < values;
  }
  return result;
}

// Whether there is a value for all of the mesh.
bool check_values(const std::optional<CornerData>& data, const MeshSources& mesh,
                  const std::string& what, Losses& losses) {
  if (!data) return true;
  const std::size_t needed = needed_elements(*data, mesh);
  const std::size_t found = data->count();
  if (found > needed && data->interpolation != Interpolation::Constant) {
    losses.insert("has more " + what + " than their interpolation asks for, of which the first " +
                  "ones count");
  }
  if (found < needed) losses.insert("has fewer " + what + " than their interpolation asks for");
  const bool is_sound = has_sound_indices(*data);
  if (!is_sound) losses.insert("has indices of " + what + " that do not exist");
  return found >= needed && is_sound;
}

void check_values(MeshSources& mesh, Losses& losses) {
  // Normals that are missing would be wrong ones; those that the faces have are better.
  if (!check_values(mesh.normals, mesh, "normals", losses)) mesh.normals.reset();
  check_values(mesh.uvs, mesh, "uvs", losses);
  check_values(mesh.colors, mesh, "colors", losses);
}

// The slot of each face; empty when all faces are of slot 0.
std::vector<std::uint16_t> slots_of_faces(const Stage& stage, const MeshTranslator::Prims& subsets,
                                          std::size_t faces, Losses& losses) {
  std::vector<std::uint16_t> slots;
  if (subsets.empty()) return slots;
  slots.resize(faces);
  for (std::size_t i = 0; i < subsets.size(); ++i) {
    const auto indices = usd::numbers<std::int32_t>(stage.value(*subsets[i], "indices"), 1);
    if (!indices) continue;
    for (const std::int32_t face : indices->span) {
      if (face >= 0 && static_cast<std::size_t>(face) < slots.size()) {
        slots[static_cast<std::size_t>(face)] = static_cast<std::uint16_t>(i + 1);
      } else {
        losses.insert("has subsets of faces that do not exist");
      }
    }
  }
  return slots;
}

}  // namespace

void MeshTranslator::read_display_color(const Primvars& primvars, TranslatedMesh& result) const {
  const auto colors = read_colors(stage_, owner_of(primvars, "displayColor"));
  const float* color = colors && is_one_for_all(*colors) ? colors->element(0) : nullptr;
  if (color) result.display_color = Vec3f(color[0], color[1], color[2]);
  const Prim* owner = owner_of(primvars, "displayOpacity");
  if (!owner) return;
  const auto opacity = read_corner_data(stage_, *owner, "primvars:displayOpacity", 1, "constant");
  const float* share = opacity && is_one_for_all(*opacity) ? opacity->element(0) : nullptr;
  if (share && std::isfinite(*share)) result.display_opacity = *share;
}

// The specs that a primvar and its indices are read from.
void MeshTranslator::add_primvar(Key& key, const Prim* owner, const std::string& name) const {
  for (const std::string& part : {name, name + ":indices"}) {
    key.push_back(owner ? stage_.value_spec(*owner, part) : nullptr);
  }
}

TranslatedMesh MeshTranslator::translate(const Prim& prim, const Prims& subsets,
                                         const std::vector<std::string>& uv_names,
                                         bool with_colors) {
  const Primvars primvars = geometry_.primvars(prim);
  const Prim* color_owner = with_colors ? owner_of(primvars, "displayColor") : nullptr;
  const std::string& type = prim.type_name;
  TranslatedMesh result;
  if (type == "Mesh") {
    result = translate_mesh(prim, primvars, subsets, uv_names, color_owner);
  } else if (type == "Points" || type == "BasisCurves") {
    result = translate_thin(prim, primvars, color_owner);
  } else {
    result = translate_shape(prim);
  }
  read_display_color(primvars, result);
  return result;
}

TranslatedMesh MeshTranslator::translate_mesh(const Prim& prim, const Primvars& primvars,
                                              const Prims& subsets,
                                              const std::vector<std::string>& uv_names,
                                              const Prim* color_owner) {
  TranslatedMesh result;
  const std::string uv_name = find_uv(primvars, uv_names);
  for (const std::string& name : uv_names) {
    result.lacks_uvs |= name != uv_name && owner_of(primvars, name);
  }
  const Prim* uv_owner = uv_name.empty() ? nullptr : owner_of(primvars, uv_name);
  const Prim* primvar_normals = owner_of(primvars, "normals");
  const Prim* normal_owner = primvar_normals ? primvar_normals : &prim;
  const std::string normals = primvar_normals ? "primvars:normals" : "normals";
  const std::string uv = "primvars:" + uv_name;

  Key key;
  for (const char* name : {"points", "faceVertexCounts", "faceVertexIndices", "holeIndices",
                           "orientation", "subdivisionScheme", "doubleSided"}) {
    key.push_back(stage_.value_spec(prim, name));
  }
  add_primvar(key, normal_owner, normals);
  add_primvar(key, uv_owner, uv);
  add_primvar(key, color_owner, kDisplayColor);
  for (const Prim* subset : subsets) key.push_back(stage_.value_spec(*subset, "indices"));
  // What bends a mesh is not all in its own specs, but the same prim, seen through an instancer, is
  // bent the same.
  const bool is_bent = skinning_.applies_to(prim);
  Made& known = meshes_[{key, is_bent ? uv_name + " " + prim.path : uv_name}];
  if (known.mesh) {
    result.mesh = known.mesh;
    result.losses = known.losses;
    return result;
  }

  auto points = usd::numbers<float>(stage_.value(prim, "points"), 3);
  auto counts = usd::numbers<std::int32_t>(stage_.value(prim, "faceVertexCounts"), 1);
  auto indices = usd::numbers<std::int32_t>(stage_.value(prim, "faceVertexIndices"), 1);
  // A mesh that says nothing at all is a placeholder; one that says a part of it is broken.
  const bool is_said = (points && !points->span.empty()) || (counts && !counts->span.empty()) ||
                       (indices && !indices->span.empty());
  if (is_said) result.lacks = "without a face that can be drawn";
  if (!points || !counts || !indices) return result;
  MeshSources sources;
  sources.points = std::move(*points);
  sources.counts = std::move(*counts);
  sources.indices = std::move(*indices);
  sources.holes = usd::numbers<std::int32_t>(stage_.value(prim, "holeIndices"), 1);
  sources.normals =
      read_corner_data(stage_, *normal_owner, normals, 3, primvar_normals ? "constant" : "vertex");
  sources.uvs = read_uvs(stage_, uv_owner, uv);
  sources.colors = read_varied_colors(stage_, color_owner);
  sources.is_left_handed =
      usd::token_or(stage_, prim, "orientation", "rightHanded") == "leftHanded";
  sources.slot_of_face = slots_of_faces(stage_, subsets, sources.counts.span.size(), result.losses);
  sources.is_smooth = usd::token_or(stage_, prim, "subdivisionScheme", "catmullClark") != "none";
  check_values(sources, result.losses);
  if (is_bent) skinning_.apply(prim, sources, result.losses);
  corners_read_ += sources.indices.span.size();
  if (corners_read_ > kCornersBetweenReleases) {
    stage_.assets().release_pages();
    corners_read_ = 0;
  }
  AssembledMesh made =
      assemble_mesh(std::move(sources), [this] { stage_.assets().release_pages(); });
  result.losses.merge(made.losses);
  if (made.mesh.triangles.empty()) return result;
  result.lacks.clear();
  made.mesh.is_double_sided = usd::bool_or(stage_, prim, "doubleSided", false);
  known = {pool_.share(std::move(made.mesh)), result.losses};
  result.mesh = known.mesh;
  return result;
}

TranslatedMesh MeshTranslator::translate_shape(const Prim& prim) {
  Key key;
  for (const char* name : kShapeAttributes) key.push_back(stage_.value_spec(prim, name));
  Made& known = meshes_[{key, prim.type_name}];
  if (!known.mesh) {
    if (auto mesh = make_shape(stage_, prim)) known.mesh = pool_.share(std::move(*mesh));
  }
  TranslatedMesh result;
  result.mesh = known.mesh;
  return result;
}

TranslatedMesh MeshTranslator::translate_thin(const Prim& prim, const Primvars& primvars,
                                              const Prim* color_owner) {
  Key key;
  for (const char* name : {"points", "curveVertexCounts", "type", "basis", "wrap"}) {
    key.push_back(stage_.value_spec(prim, name));
  }
  const Prim* primvar_widths = owner_of(primvars, "widths");
  const Prim* width_owner = primvar_widths ? primvar_widths : &prim;
  const std::string width_name = primvar_widths ? "primvars:widths" : "widths";
  add_primvar(key, width_owner, width_name);
  add_primvar(key, color_owner, kDisplayColor);
  Made& known = meshes_[{key, prim.type_name}];
  TranslatedMesh result;
  if (!known.mesh) {
    const auto widths = read_corner_data(stage_, *width_owner, width_name, 1,
                                         primvar_widths ? "constant" : "vertex");
    const auto colors = read_varied_colors(stage_, color_owner);
    ThinMesh made =
        prim.type_name == "Points"
            ? mesh_of_points(stage_, prim, widths ? &*widths : nullptr, colors ? &*colors : nullptr)
            : mesh_of_curves(stage_, prim, widths ? &*widths : nullptr,
                             colors ? &*colors : nullptr);
    result.lacks = std::move(made.lacks);
    known.losses = std::move(made.losses);
    result.losses = known.losses;
    if (made.mesh.triangles.empty()) return result;
    made.mesh.validate(prim.path);
    known.mesh = pool_.share(std::move(made.mesh));
  }
  result.mesh = known.mesh;
  result.losses = known.losses;
  return result;
}

}  // namespace diorama::loader_usd
