// SPDX-License-Identifier: Apache-2.0
#include "loader_usd/mesh_assembly.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <span>
#include <utility>

#include "loader_usd/polygon.h"

namespace diorama::loader_usd {
namespace {

// Without a branch the loops take many numbers at once.
bool all_finite(std::span<const float> numbers) {
  constexpr std::uint32_t kExponent = 0x7F800000;
  bool result = true;
  for (const float number : numbers) {
    result &= (std::bit_cast<std::uint32_t>(number) & kExponent) != kExponent;
  }
  return result;
}

bool all_below(std::span<const std::int32_t> indices, std::size_t limit) {
  const auto bound = static_cast<std::uint32_t>(std::min<std::size_t>(limit, 0x80000000u));
  bool result = true;
  for (const std::int32_t index : indices) result &= static_cast<std::uint32_t>(index) < bound;
  return result;
}

// The mesh stays, so it should not keep much room that it does not need; a little is not worth a
// copy of the list.
template <class T>
void give_back_room(std::vector<T>& list) {
  if (list.capacity() - list.size() > list.size() / 8) list.shrink_to_fit();
}

bool is_per_point(const CornerData& data) {
  return data.interpolation == Interpolation::Vertex ||
         data.interpolation == Interpolation::Varying;
}

class MeshAssembly {
 public:
  MeshAssembly(MeshSources sources, const std::function<void()>& rest);

  AssembledMesh build();

 private:
  static constexpr std::uint32_t kNone = 0xFFFFFFFF;
  // A point that all faces share must not cost the square of their number.
  static constexpr int kMaxTries = 64;
  static constexpr std::size_t kCornersBetweenRests = 32768;

  // The face of a mesh and its corner.
  struct Corner {
    std::size_t face;
    std::size_t corner;
  };
  // Values that may differ between the corners of a point.
  struct Seam {
    const CornerData* data;
    const float* values;  ///< Those of all corners, if they are stored like that.
    std::size_t stride;
    bool has_three;  ///< Numbers that count; otherwise two.

    bool is_same(const Corner& a, const Corner& b) const {
      return values ? is_same(values + a.corner * stride, values + b.corner * stride)
                    : is_same_element(a, b);
    }
    // By bits, so that numbers that are none are equal, too.
    bool is_same(const float* a, const float* b) const {
      const auto is_equal = [&](std::size_t i) {
        return std::bit_cast<std::uint32_t>(a[i]) == std::bit_cast<std::uint32_t>(b[i]);
      };
      return is_equal(0) && is_equal(1) && (!has_three || is_equal(2));
    }
    [[gnu::noinline]] bool is_same_element(const Corner& a, const Corner& b) const {
      const float* first = data->at(a.face, 0, a.corner);
      const float* second = data->at(b.face, 0, b.corner);
      return first && second ? is_same(first, second) : first == second;
    }
  };

  std::size_t point_of(std::size_t corner) const {
    return static_cast<std::size_t>(indices_[corner]);
  }
  Vec3 position(std::size_t corner) const { return point_in(points_, corner); }
  Vec3 position_at_rest(std::size_t corner) const { return point_in(points_at_rest_, corner); }
  Vec3 point_in(std::span<const float> points, std::size_t corner) const {
    const float* p = points.data() + point_of(corner) * 3;
    return Vec3(p[0], p[1], p[2]);
  }
  void add_seam(const std::optional<CornerData>& data, bool has_three);
  const float* values_of_corners(const CornerData& data) const;
  bool has_usable_points(std::span<const std::int32_t> indices);
  bool is_same(std::uint32_t vertex, const Corner& wanted) const;
  std::uint32_t vertex(std::size_t face, std::size_t corner);
  std::uint32_t add_vertex(std::size_t face, std::size_t corner);
  void add_faces();
  void add_face(std::size_t face, std::size_t corner, std::size_t count);
  void add_quad(std::size_t face, std::size_t corner);
  void add_polygon(std::size_t face, std::size_t corner, std::size_t count);
  void add_triangle(std::size_t face, std::uint32_t a, std::uint32_t b, std::uint32_t c);
  void add_normal(const Vec3& normal, std::span<const std::uint32_t> vertices);
  std::vector<char> find_holes() const;
  std::size_t count_triangles() const;

  template <class Vector, class Repair>
  std::vector<Vector> gather(const CornerData& data, Repair repair) const;
  void finish_made_normals();
  void gather_positions();
  void gather_attributes(bool are_of_points);

  MeshSources sources_;
  const std::function<void()>& rest_;
  std::span<const float> points_;
  std::span<const float> points_at_rest_;
  std::span<const std::int32_t> counts_;
  std::span<const std::int32_t> indices_;
  bool are_points_finite_;
  bool are_indices_sound_;
  bool makes_normals_;
  std::size_t corner_count_;
  bool needs_faces_ = false;
  std::vector<Seam> seams_;
  Mesh mesh_;
  // The vertices that were made of each point are a chain: the youngest one, and the one before
  // each. Where no attribute has seams there is one per point.
  std::vector<std::uint32_t> last_;
  std::vector<std::uint32_t> before_;
  // The corner and the face that a vertex was made of; the face only where an attribute needs it.
  std::vector<std::uint32_t> corner_of_;
  std::vector<std::uint32_t> face_of_;
  std::vector<std::uint32_t> ring_;
  std::vector<Vec3f> ring_points_;
  std::vector<std::array<std::uint32_t, 3>> split_;
  Losses losses_;
};

MeshAssembly::MeshAssembly(MeshSources sources, const std::function<void()>& rest)
    : sources_(std::move(sources)),
      rest_(rest),
      points_(sources_.points.span),
      points_at_rest_(sources_.points_at_rest.size() == points_.size()
                          ? std::span<const float>(sources_.points_at_rest)
                          : points_),
      counts_(sources_.counts.span),
      indices_(sources_.indices.span),
      are_points_finite_(all_finite(points_)),
      are_indices_sound_(all_below(indices_, points_.size() / 3)),
      makes_normals_(sources_.is_smooth && !sources_.normals),
      corner_count_(indices_.size()),
      last_(points_.size() / 3, kNone) {
  add_seam(sources_.normals, true);
  add_seam(sources_.uvs, false);
  add_seam(sources_.colors, true);
}

void MeshAssembly::add_seam(const std::optional<CornerData>& data, bool has_three) {
  if (!data) return;
  const bool is_per_face = data->interpolation == Interpolation::Uniform;
  if (!is_per_face && data->interpolation != Interpolation::FaceVarying) return;
  seams_.push_back({&*data, values_of_corners(*data), data->width, has_three});
  needs_faces_ |= is_per_face;
}

// Where each corner has its own values, one behind the other; null for other data.
const float* MeshAssembly::values_of_corners(const CornerData& data) const {
  const bool is_plain = data.interpolation == Interpolation::FaceVarying && !data.indices &&
                        data.count() >= corner_count_;
  return is_plain ? data.values.span.data() : nullptr;
}

bool MeshAssembly::is_same(std::uint32_t vertex, const Corner& wanted) const {
  const Corner made{needs_faces_ ? face_of_[vertex] : 0, corner_of_[vertex]};
  for (const Seam& seam : seams_) {
    if (!seam.is_same(made, wanted)) return false;
  }
  return true;
}

std::uint32_t MeshAssembly::add_vertex(std::size_t face, std::size_t corner) {
  const auto added = static_cast<std::uint32_t>(corner_of_.size());
  std::uint32_t& last = last_[point_of(corner)];
  corner_of_.push_back(static_cast<std::uint32_t>(corner));
  if (!seams_.empty()) before_.push_back(last);
  if (needs_faces_) face_of_.push_back(static_cast<std::uint32_t>(face));
  if (makes_normals_) mesh_.normals.push_back(Vec3f::Zero());
  return last = added;
}

std::uint32_t MeshAssembly::vertex(std::size_t face, std::size_t corner) {
  std::uint32_t v = last_[point_of(corner)];
  if (v == kNone) return add_vertex(face, corner);
  if (seams_.empty()) return v;
  const Corner wanted{face, corner};
  for (int tries = 0; v != kNone && tries < kMaxTries; v = before_[v], ++tries) {
    if (is_same(v, wanted)) return v;
  }
  return add_vertex(face, corner);
}

bool MeshAssembly::has_usable_points(std::span<const std::int32_t> indices) {
  if (!are_indices_sound_ && !all_below(indices, last_.size())) {
    losses_.insert("has faces with points that do not exist, which are left out");
    return false;
  }
  if (are_points_finite_) return true;
  for (const std::int32_t index : indices) {
    if (all_finite(points_.subspan(static_cast<std::size_t>(index) * 3, 3))) continue;
    losses_.insert("has faces with points that are not finite, which are left out");
    return false;
  }
  return true;
}

void MeshAssembly::add_triangle(std::size_t face, std::uint32_t a, std::uint32_t b,
                                std::uint32_t c) {
  if (sources_.is_left_handed) std::swap(b, c);
  mesh_.triangles.push_back({a, b, c});
  if (!sources_.slot_of_face.empty()) mesh_.material_slots.push_back(sources_.slot_of_face[face]);
}

// As long as the face is large, for all its corners: how it is split must not show.
void MeshAssembly::add_normal(const Vec3& normal, std::span<const std::uint32_t> vertices) {
  const Vec3f added = normal.cast<float>();
  for (const std::uint32_t v : vertices) mesh_.normals[v] += added;
}

// The diagonal from the first to the third corner splits four corners into two triangles that face
// the same way, as it does in convex quads and so in nearly all, or the quad is any polygon.
void MeshAssembly::add_quad(std::size_t face, std::size_t corner) {
  const auto halves = [&](const auto& place) {
    const Vec3 origin = place(corner);
    const Vec3 diagonal = place(corner + 2) - origin;
    return std::pair(Vec3((place(corner + 1) - origin).cross(diagonal)),
                     Vec3(diagonal.cross(place(corner + 3) - origin)));
  };
  const auto [first, second] = halves([&](std::size_t at) { return position_at_rest(at); });
  const double both = first.dot(second);
  if (!(first.squaredNorm() + both > 0.0 && second.squaredNorm() + both > 0.0)) {
    return add_polygon(face, corner, 4);
  }
  const std::uint32_t a = vertex(face, corner);
  const std::uint32_t b = vertex(face, corner + 1);
  const std::uint32_t c = vertex(face, corner + 2);
  const std::uint32_t d = vertex(face, corner + 3);
  add_triangle(face, a, b, c);
  add_triangle(face, a, c, d);
  if (!makes_normals_) return;
  const auto [one, other] = halves([&](std::size_t at) { return position(at); });
  add_normal(one + other, std::array{a, b, c, d});
}

void MeshAssembly::add_polygon(std::size_t face, std::size_t corner, std::size_t count) {
  ring_.clear();
  ring_points_.clear();
  for (std::size_t i = corner; i < corner + count; ++i) {
    ring_.push_back(vertex(face, i));
    ring_points_.push_back(position_at_rest(i).cast<float>());
  }
  split_.clear();
  triangulate(ring_points_, split_);
  Vec3 normal = Vec3::Zero();
  for (const auto& [a, b, c] : split_) {
    add_triangle(face, ring_[a], ring_[b], ring_[c]);
    const Vec3 origin = position(corner + a);
    normal += (position(corner + b) - origin).cross(position(corner + c) - origin);
  }
  if (makes_normals_) add_normal(normal, ring_);
}

void MeshAssembly::add_face(std::size_t face, std::size_t corner, std::size_t count) {
  if (!has_usable_points(indices_.subspan(corner, count))) return;
  if (count == 4) return add_quad(face, corner);
  if (count != 3) return add_polygon(face, corner, count);
  const std::uint32_t a = vertex(face, corner);
  const std::uint32_t b = vertex(face, corner + 1);
  const std::uint32_t c = vertex(face, corner + 2);
  add_triangle(face, a, b, c);
  if (!makes_normals_) return;
  const Vec3 origin = position(corner);
  add_normal((position(corner + 1) - origin).cross(position(corner + 2) - origin),
             std::array{a, b, c});
}

std::vector<char> MeshAssembly::find_holes() const {
  if (!sources_.holes) return {};
  std::vector<char> is_hole(counts_.size());
  for (const std::int32_t hole : sources_.holes->span) {
    if (hole >= 0 && static_cast<std::size_t>(hole) < counts_.size()) {
      is_hole[static_cast<std::size_t>(hole)] = 1;
    }
  }
  return is_hole;
}

// A polygon of n corners is n - 2 triangles.
std::size_t MeshAssembly::count_triangles() const {
  std::size_t triangles = 0;
  for (const std::int32_t count : counts_) {
    triangles += static_cast<std::size_t>(std::max(count - 2, 0));
  }
  return std::min(triangles, indices_.size());
}

void MeshAssembly::add_faces() {
  const std::size_t corners = indices_.size();
  const std::vector<char> is_hole = find_holes();
  mesh_.triangles.reserve(count_triangles());
  if (!sources_.slot_of_face.empty()) mesh_.material_slots.reserve(mesh_.triangles.capacity());
  std::size_t corner = 0;
  std::size_t next_rest = kCornersBetweenRests;
  std::size_t face = 0;
  for (; face < counts_.size(); ++face) {
    if (counts_[face] < 0) break;
    if (corner >= next_rest) {
      rest_();
      next_rest = corner + kCornersBetweenRests;
    }
    const auto count = static_cast<std::size_t>(counts_[face]);
    if (count > corners - corner) break;
    if (count >= 3 && (is_hole.empty() || !is_hole[face])) add_face(face, corner, count);
    corner += count;
  }
  if (face < counts_.size()) {
    losses_.insert("has a face that reaches behind the indices, from which on faces are left out");
  } else if (corner < corners) {
    losses_.insert("has more indices than its faces have corners");
  }
}

// The values that each vertex was made with; `repair` turns them into a vector.
template <class Vector, class Repair>
std::vector<Vector> MeshAssembly::gather(const CornerData& data, Repair repair) const {
  std::vector<Vector> result(corner_of_.size());
  if (const float* values = values_of_corners(data)) {
    for (std::size_t v = 0; v < result.size(); ++v) {
      result[v] = repair(values + corner_of_[v] * data.width);
    }
    return result;
  }
  for (std::size_t v = 0; v < result.size(); ++v) {
    const std::size_t corner = corner_of_[v];
    const std::size_t point = is_per_point(data) ? point_of(corner) : 0;
    result[v] = repair(data.at(needs_faces_ ? face_of_[v] : 0, point, corner));
  }
  return result;
}

Vec3f unit(const Vec3f& normal) {
  // In doubles even the shortest float has a length and a reciprocal.
  const Vec3 exact = normal.cast<double>();
  const double length = exact.norm();
  if (!(length > 0.0) || !std::isfinite(length)) return Vec3f::UnitZ();
  return (exact * (1.0 / length)).cast<float>();
}

// Normals belong to points: seams of other attributes must not show in the shading.
void MeshAssembly::finish_made_normals() {
  for (const std::uint32_t last : last_) {
    if (seams_.empty() || last == kNone || before_[last] == kNone) continue;
    Vec3f sum = Vec3f::Zero();
    for (std::uint32_t v = last; v != kNone; v = before_[v]) sum += mesh_.normals[v];
    for (std::uint32_t v = last; v != kNone; v = before_[v]) mesh_.normals[v] = sum;
  }
  const float side = sources_.is_left_handed ? -1.0f : 1.0f;
  for (Vec3f& normal : mesh_.normals) normal = unit(side * normal);
}

void MeshAssembly::gather_positions() {
  mesh_.positions.resize(corner_of_.size());
  for (std::size_t v = 0; v < corner_of_.size(); ++v) {
    const float* p = points_.data() + point_of(corner_of_[v]) * 3;
    mesh_.positions[v] = Vec3f(p[0], p[1], p[2]);
  }
}

void MeshAssembly::gather_attributes(bool are_of_points) {
  const auto has = [&](const std::optional<CornerData>& data) {
    return data && is_per_point(*data) == are_of_points;
  };
  if (has(sources_.normals)) {
    mesh_.normals = gather<Vec3f>(*sources_.normals, [](const float* n) -> Vec3f {
      return n ? unit(Vec3f(n[0], n[1], n[2])) : Vec3f::UnitZ();
    });
  }
  if (has(sources_.uvs)) {
    mesh_.uvs = gather<Vec2f>(*sources_.uvs, [](const float* uv) -> Vec2f {
      return uv && all_finite({uv, 2}) ? Vec2f(uv[0], uv[1]) : Vec2f::Zero();
    });
  }
  if (has(sources_.colors)) {
    mesh_.colors = gather<Vec3f>(*sources_.colors, [](const float* c) -> Vec3f {
      return c && all_finite({c, 3}) ? Vec3f(c[0], c[1], c[2]) : Vec3f::Ones();
    });
  }
}

// Gives back what it read as soon as nothing needs it any more: big meshes decide how much memory
// a whole scene takes.
AssembledMesh MeshAssembly::build() {
  // Along seams there are several vertices per point; points need not be used.
  const std::size_t used = std::min(last_.size(), indices_.size());
  const std::size_t vertices = used + (seams_.empty() ? 0 : used / 8);
  corner_of_.reserve(vertices);
  if (!seams_.empty()) before_.reserve(vertices);
  if (needs_faces_) face_of_.reserve(vertices);
  if (makes_normals_) mesh_.normals.reserve(vertices);
  add_faces();
  sources_.counts = {};
  if (makes_normals_) finish_made_normals();
  last_ = {};
  before_ = {};
  gather_positions();
  gather_attributes(true);
  sources_.indices = {};
  if (corner_count_ >= kCornersBetweenRests) rest_();
  gather_attributes(false);
  give_back_room(mesh_.triangles);
  give_back_room(mesh_.normals);
  return {std::move(mesh_), std::move(losses_)};
}

}  // namespace

AssembledMesh assemble_mesh(MeshSources sources, const std::function<void()>& rest) {
  return MeshAssembly(std::move(sources), rest).build();
}

}  // namespace diorama::loader_usd
