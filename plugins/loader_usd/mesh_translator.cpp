// SPDX-License-Identifier: Apache-2.0
#include "loader_usd/mesh_translator.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <optional>
#include <span>

#include "diorama/error.h"
#include "loader_usd/corner_data.h"
#include "loader_usd/points_and_curves.h"
#include "loader_usd/polygon.h"
#include "loader_usd/shapes.h"

namespace diorama::loader_usd {
namespace {

using usd::Prim;
using usd::Stage;

constexpr const char* kDisplayColor = "primvars:displayColor";

struct Sources {
  usd::Numbers<float> points;
  usd::Numbers<std::int32_t> counts;
  usd::Numbers<std::int32_t> indices;
  std::optional<usd::Numbers<std::int32_t>> holes;
  std::optional<CornerData> normals;
  std::optional<CornerData> uvs;
  std::optional<CornerData> colors;
  bool is_left_handed = false;
};

std::size_t bytes_of(const Sources& sources) {
  std::size_t bytes = sources.points.span.size_bytes() + sources.counts.span.size_bytes() +
                      sources.indices.span.size_bytes();
  for (const auto* data : {&sources.normals, &sources.uvs, &sources.colors}) {
    if (*data) bytes += (*data)->values.span.size_bytes();
    if (*data && (*data)->indices) bytes += (*data)->indices->span.size_bytes();
  }
  return bytes;
}

bool all_finite(std::span<const float> numbers) {
  constexpr std::uint32_t kExponent = 0x7F800000;
  bool result = true;
  // Without a branch the loop takes many at once.
  for (const float number : numbers) {
    result &= (std::bit_cast<std::uint32_t>(number) & kExponent) != kExponent;
  }
  return result;
}

// An eighth more than there is may be kept free.
constexpr std::size_t kSpareShare = 8;

// The mesh stays, so it should not keep much room that it does not need; a little is not worth a
// copy of the list.
template <class T>
void give_back_room(std::vector<T>& list) {
  if (list.capacity() - list.size() > list.size() / kSpareShare) list.shrink_to_fit();
}

bool is_per_point(const std::optional<CornerData>& data) {
  if (!data) return true;
  return data->interpolation == Interpolation::Vertex ||
         data->interpolation == Interpolation::Varying ||
         data->interpolation == Interpolation::Constant;
}

// Builds the triangles. Corners with the same point and the same attributes share a vertex: each
// point keeps a chain of the vertices that were made of it.
class MeshAssembly {
 public:
  MeshAssembly(const Sources& sources, std::span<const std::uint16_t> slot_of_face)
      : sources_(sources),
        slot_of_face_(slot_of_face),
        are_points_finite_(all_finite(sources.points.span)),
        has_one_vertex_per_point_(is_per_point(sources.normals) && is_per_point(sources.uvs) &&
                                  is_per_point(sources.colors)),
        first_(sources.points.span.size() / 3, kNone) {}

  Mesh build();

 private:
  static constexpr std::uint32_t kNone = 0xFFFFFFFF;
  // A point that all faces share must not cost the square of their number.
  static constexpr int kMaxTries = 64;

  // Values of one corner; null where the mesh has none or they are too few.
  struct Corner {
    const float* normal = nullptr;
    const float* uv = nullptr;
    const float* color = nullptr;
  };
  Corner values_of(std::size_t face, std::size_t point, std::size_t corner) const;
  std::uint32_t vertex(std::size_t face, std::size_t point, std::size_t corner);
  std::uint32_t add_vertex(std::size_t point, const Corner& values);
  bool is_same(std::uint32_t vertex, const Corner& values) const;
  bool has_usable_points(std::span<const std::int32_t> indices) const;
  bool is_plain() const;
  void add_plain_faces();
  void add_faces();
  void add_face(std::size_t face, std::size_t corner, std::size_t count);
  void add_triangle(std::size_t face, std::uint32_t a, std::uint32_t b, std::uint32_t c);

  const Sources& sources_;
  std::span<const std::uint16_t> slot_of_face_;
  bool are_points_finite_;
  bool has_one_vertex_per_point_;
  Mesh mesh_;
  std::vector<std::uint32_t> first_;
  std::vector<std::uint32_t> next_;
  std::vector<std::uint32_t> ring_;
  std::vector<Vec3f> ring_points_;
  std::vector<std::array<std::uint32_t, 3>> split_;
};

bool MeshAssembly::is_same(std::uint32_t vertex, const Corner& values) const {
  const auto fits = [&](const float* wanted, const auto& list, int width) {
    if (!wanted) return true;
    const float* made = list[vertex].data();
    for (int i = 0; i < width; ++i) {
      if (made[i] != wanted[i]) return false;
    }
    return true;
  };
  return fits(values.normal, mesh_.normals, 3) && fits(values.uv, mesh_.uvs, 2) &&
         fits(values.color, mesh_.colors, 3);
}

std::uint32_t MeshAssembly::add_vertex(std::size_t point, const Corner& values) {
  const auto added = static_cast<std::uint32_t>(mesh_.positions.size());
  const float* p = sources_.points.span.data() + point * 3;
  mesh_.positions.emplace_back(p[0], p[1], p[2]);
  if (sources_.normals) {
    const float* n = values.normal;
    mesh_.normals.push_back(n ? Vec3f(n[0], n[1], n[2]) : Vec3f::UnitZ());
  }
  if (sources_.uvs) {
    mesh_.uvs.push_back(values.uv ? Vec2f(values.uv[0], values.uv[1]) : Vec2f::Zero());
  }
  if (sources_.colors) {
    const float* c = values.color;
    mesh_.colors.push_back(c ? Vec3f(c[0], c[1], c[2]) : Vec3f::Ones());
  }
  next_.push_back(first_[point]);
  first_[point] = added;
  return added;
}

MeshAssembly::Corner MeshAssembly::values_of(std::size_t face, std::size_t point,
                                             std::size_t corner) const {
  Corner values;
  if (sources_.normals) values.normal = sources_.normals->at(face, point, corner);
  if (sources_.uvs) values.uv = sources_.uvs->at(face, point, corner);
  if (sources_.colors) values.color = sources_.colors->at(face, point, corner);
  return values;
}

std::uint32_t MeshAssembly::vertex(std::size_t face, std::size_t point, std::size_t corner) {
  if (has_one_vertex_per_point_ && first_[point] != kNone) return first_[point];
  const Corner values = values_of(face, point, corner);
  int tries = 0;
  for (std::uint32_t v = first_[point]; v != kNone && tries < kMaxTries; v = next_[v], ++tries) {
    if (is_same(v, values)) return v;
  }
  return add_vertex(point, values);
}

bool MeshAssembly::has_usable_points(std::span<const std::int32_t> indices) const {
  for (const std::int32_t index : indices) {
    if (index < 0 || static_cast<std::size_t>(index) >= first_.size()) return false;
  }
  if (are_points_finite_) return true;
  for (const std::int32_t index : indices) {
    const float* p = sources_.points.span.data() + static_cast<std::size_t>(index) * 3;
    if (!all_finite({p, 3})) return false;
  }
  return true;
}

void MeshAssembly::add_triangle(std::size_t face, std::uint32_t a, std::uint32_t b,
                                std::uint32_t c) {
  if (sources_.is_left_handed) std::swap(b, c);
  mesh_.triangles.push_back({a, b, c});
  if (!slot_of_face_.empty()) mesh_.material_slots.push_back(slot_of_face_[face]);
}

// A face that refers to points that do not exist is left out.
void MeshAssembly::add_face(std::size_t face, std::size_t corner, std::size_t count) {
  const auto indices = sources_.indices.span.subspan(corner, count);
  if (!has_usable_points(indices)) return;
  const auto made = [&](std::size_t i) {
    return vertex(face, static_cast<std::size_t>(indices[i]), corner + i);
  };
  if (count == 3) {
    const std::uint32_t a = made(0);
    const std::uint32_t b = made(1);
    return add_triangle(face, a, b, made(2));
  }
  ring_.clear();
  ring_points_.clear();
  for (std::size_t i = 0; i < count; ++i) {
    ring_.push_back(made(i));
    ring_points_.push_back(mesh_.positions[ring_.back()]);
  }
  split_.clear();
  triangulate(ring_points_, split_);
  for (const auto& [a, b, c] : split_) add_triangle(face, ring_[a], ring_[b], ring_[c]);
}

// The most usual mesh: triangles of sound points, and nothing that differs between the corners that
// meet at a point.
bool MeshAssembly::is_plain() const {
  const auto counts = sources_.counts.span;
  const auto indices = sources_.indices.span;
  if (!has_one_vertex_per_point_ || !are_points_finite_ || sources_.holes) return false;
  bool result = counts.size() <= indices.size() / 3;
  for (const std::int32_t count : counts) result &= count == 3;
  if (!result) return false;
  const auto points = static_cast<std::uint32_t>(first_.size());
  for (const std::int32_t index : indices.first(counts.size() * 3)) {
    result &= static_cast<std::uint32_t>(index) < points;
  }
  return result;
}

void MeshAssembly::add_plain_faces() {
  const auto indices = sources_.indices.span;
  mesh_.triangles.resize(sources_.counts.span.size());
  std::size_t corner = 0;
  for (auto& triangle : mesh_.triangles) {
    for (std::uint32_t& made : triangle) {
      const auto point = static_cast<std::size_t>(indices[corner]);
      made = first_[point];
      if (made == kNone) made = add_vertex(point, values_of(corner / 3, point, corner));
      ++corner;
    }
    if (sources_.is_left_handed) std::swap(triangle[1], triangle[2]);
  }
  mesh_.material_slots.assign(slot_of_face_.begin(), slot_of_face_.end());
}

void MeshAssembly::add_faces() {
  const auto counts = sources_.counts.span;
  const std::size_t corners = sources_.indices.span.size();
  std::vector<char> is_hole(sources_.holes ? counts.size() : 0);
  for (std::size_t i = 0; sources_.holes && i < sources_.holes->span.size(); ++i) {
    const std::int32_t hole = sources_.holes->span[i];
    if (hole >= 0 && static_cast<std::size_t>(hole) < counts.size()) {
      is_hole[static_cast<std::size_t>(hole)] = 1;
    }
  }
  // A polygon of n corners is n - 2 triangles.
  mesh_.triangles.reserve(corners - std::min(corners, 2 * counts.size()));
  std::size_t corner = 0;
  for (std::size_t face = 0; face < counts.size(); ++face) {
    if (counts[face] < 0) break;
    const auto count = static_cast<std::size_t>(counts[face]);
    if (count > corners - corner) break;
    if (count >= 3 && (is_hole.empty() || !is_hole[face])) add_face(face, corner, count);
    corner += count;
  }
}

Mesh MeshAssembly::build() {
  // Along seams there are several vertices per point.
  const std::size_t vertices =
      has_one_vertex_per_point_ ? first_.size() : first_.size() + first_.size() / kSpareShare;
  mesh_.positions.reserve(vertices);
  if (sources_.normals) mesh_.normals.reserve(vertices);
  if (sources_.uvs) mesh_.uvs.reserve(vertices);
  next_.reserve(vertices);
  if (is_plain()) {
    add_plain_faces();
  } else {
    add_faces();
  }
  for (Vec3f& normal : mesh_.normals) {
    const float length = normal.norm();
    normal = length > 0.0f && std::isfinite(length) ? Vec3f(normal / length) : Vec3f::UnitZ();
  }
  for (Vec2f& uv : mesh_.uvs) {
    if (!uv.allFinite()) uv.setZero();
  }
  for (Vec3f& color : mesh_.colors) {
    if (!color.allFinite()) color.setOnes();
  }
  give_back_room(mesh_.positions);
  give_back_room(mesh_.normals);
  give_back_room(mesh_.uvs);
  give_back_room(mesh_.colors);
  give_back_room(mesh_.triangles);
  give_back_room(mesh_.material_slots);
  return std::move(mesh_);
}

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
  for (const usd::Primvar& primvar : primvars) {
    if (primvar.type.starts_with("texCoord2")) return primvar.name;
  }
  for (const usd::Primvar& primvar : primvars) {
    if (primvar.type == "float2[]") return primvar.name;
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

// Colours that differ; a single one goes to the material.
std::optional<CornerData> read_colors(const Stage& stage, const Prim* owner) {
  if (!owner) return std::nullopt;
  auto colors = read_corner_data(stage, *owner, kDisplayColor, 3, "constant");
  if (colors && colors->count() <= 1) colors.reset();
  return colors;
}

// The slot of each face; empty when all faces are of slot 0.
std::vector<std::uint16_t> slots_of_faces(const Stage& stage, const MeshTranslator::Prims& subsets,
                                          std::size_t faces) {
  std::vector<std::uint16_t> slots;
  if (subsets.empty()) return slots;
  slots.resize(faces);
  for (std::size_t i = 0; i < subsets.size(); ++i) {
    const auto indices = usd::numbers<std::int32_t>(stage.value(*subsets[i], "indices"), 1);
    if (!indices) continue;
    for (const std::int32_t face : indices->span) {
      if (face >= 0 && static_cast<std::size_t>(face) < slots.size()) {
        slots[static_cast<std::size_t>(face)] = static_cast<std::uint16_t>(i + 1);
      }
    }
  }
  return slots;
}

}  // namespace

void MeshTranslator::note_read(std::size_t bytes) {
  constexpr std::size_t kMostBytes = std::size_t{8} << 20;
  bytes_read_ += bytes;
  if (bytes_read_ < kMostBytes) return;
  stage_.assets().release_pages();
  bytes_read_ = 0;
}

void MeshTranslator::read_display_color(const Primvars& primvars, TranslatedMesh& result) const {
  for (const usd::Primvar& primvar : primvars) {
    const std::string name = "primvars:" + primvar.name;
    if (primvar.name == "displayColor") {
      const auto color = usd::numbers<float>(stage_.value(*primvar.owner, name), 3);
      if (color && color->span.size() == 3) {
        result.display_color = Vec3f(color->span[0], color->span[1], color->span[2]);
      }
    }
    if (primvar.name == "displayOpacity") {
      const auto opacity = usd::numbers<float>(stage_.value(*primvar.owner, name), 1);
      if (opacity && opacity->span.size() == 1) result.display_opacity = opacity->span[0];
    }
  }
}

TranslatedMesh MeshTranslator::translate(const Prim& prim, const Prims& subsets,
                                         const std::vector<std::string>& uv_names) {
  const Primvars primvars = geometry_.primvars(prim);
  const std::string& type = prim.type_name;
  TranslatedMesh result;
  if (type == "Mesh") {
    result = translate_mesh(prim, primvars, subsets, uv_names);
  } else if (type == "Points" || type == "BasisCurves") {
    result = translate_thin(prim, primvars);
  } else {
    result = translate_shape(prim);
  }
  read_display_color(primvars, result);
  return result;
}

TranslatedMesh MeshTranslator::translate_mesh(const Prim& prim, const Primvars& primvars,
                                              const Prims& subsets,
                                              const std::vector<std::string>& uv_names) {
  TranslatedMesh result;
  const std::string uv_name = find_uv(primvars, uv_names);
  const Prim* uv_owner = uv_name.empty() ? nullptr : owner_of(primvars, uv_name);
  const Prim* color_owner = owner_of(primvars, "displayColor");
  const bool has_primvar_normals = owner_of(primvars, "normals") != nullptr;
  const std::string normals = has_primvar_normals ? "primvars:normals" : "normals";
  const std::string uv = "primvars:" + uv_name;

  Key key;
  for (const std::string& name :
       {std::string("points"), std::string("faceVertexCounts"), std::string("faceVertexIndices"),
        std::string("holeIndices"), std::string("orientation"), std::string("subdivisionScheme"),
        std::string("doubleSided"), normals, normals + ":indices"}) {
    key.push_back(stage_.value_spec(prim, name));
  }
  for (const auto& [who, name] :
       {std::pair(uv_owner, uv), std::pair(color_owner, std::string(kDisplayColor))}) {
    key.push_back(who ? stage_.value_spec(*who, name) : nullptr);
    key.push_back(who ? stage_.value_spec(*who, name + ":indices") : nullptr);
  }
  for (const Prim* subset : subsets) key.push_back(stage_.value_spec(*subset, "indices"));
  std::shared_ptr<const Mesh>& known = meshes_[{key, uv_name}];
  if (known) {
    result.mesh = known;
    return result;
  }

  auto points = usd::numbers<float>(stage_.value(prim, "points"), 3);
  auto counts = usd::numbers<std::int32_t>(stage_.value(prim, "faceVertexCounts"), 1);
  auto indices = usd::numbers<std::int32_t>(stage_.value(prim, "faceVertexIndices"), 1);
  if (!points || !counts || !indices) return result;
  Sources sources;
  sources.points = std::move(*points);
  sources.counts = std::move(*counts);
  sources.indices = std::move(*indices);
  sources.holes = usd::numbers<std::int32_t>(stage_.value(prim, "holeIndices"), 1);
  sources.normals =
      read_corner_data(stage_, prim, normals, 3, has_primvar_normals ? "constant" : "vertex");
  if (uv_owner) sources.uvs = read_corner_data(stage_, *uv_owner, uv, 2, "constant");
  sources.colors = read_colors(stage_, color_owner);
  sources.is_left_handed =
      usd::token_or(stage_, prim, "orientation", "rightHanded") == "leftHanded";
  const auto slots = slots_of_faces(stage_, subsets, sources.counts.span.size());
  Mesh mesh = MeshAssembly(sources, slots).build();
  note_read(bytes_of(sources));
  if (mesh.triangles.empty()) return result;
  mesh.is_double_sided = usd::bool_or(stage_, prim, "doubleSided", false);
  const bool is_smooth = usd::token_or(stage_, prim, "subdivisionScheme", "catmullClark") != "none";
  if (mesh.normals.empty() && is_smooth) mesh.normals = smooth_normals(mesh);
  mesh.validate(prim.path);
  known = pool_.share(std::move(mesh));
  result.mesh = known;
  return result;
}

TranslatedMesh MeshTranslator::translate_shape(const Prim& prim) {
  Key key;
  for (const char* name : kShapeAttributes) key.push_back(stage_.value_spec(prim, name));
  std::shared_ptr<const Mesh>& known = meshes_[{key, prim.type_name}];
  if (!known) {
    if (auto mesh = make_shape(stage_, prim)) known = pool_.share(std::move(*mesh));
  }
  TranslatedMesh result;
  result.mesh = known;
  return result;
}

TranslatedMesh MeshTranslator::translate_thin(const Prim& prim, const Primvars& primvars) {
  const Prim* color_owner = owner_of(primvars, "displayColor");
  Key key;
  for (const char* name :
       {"points", "widths", "curveVertexCounts", "type", "basis", "wrap", "doubleSided"}) {
    key.push_back(stage_.value_spec(prim, name));
  }
  key.push_back(color_owner ? stage_.value_spec(*color_owner, kDisplayColor) : nullptr);
  std::shared_ptr<const Mesh>& known = meshes_[{key, prim.type_name}];
  TranslatedMesh result;
  if (!known) {
    const auto colors = read_colors(stage_, color_owner);
    ThinMesh made = prim.type_name == "Points"
                        ? mesh_of_points(stage_, prim, colors ? &*colors : nullptr)
                        : mesh_of_curves(stage_, prim, colors ? &*colors : nullptr);
    result.lacks = std::move(made.lacks);
    if (made.mesh.triangles.empty()) return result;
    made.mesh.validate(prim.path);
    known = pool_.share(std::move(made.mesh));
  }
  result.mesh = known;
  return result;
}

}  // namespace diorama::loader_usd
