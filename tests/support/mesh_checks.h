// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "diorama/geometry.h"

namespace diorama::test {

/// What is wrong with a mesh that bounds a solid. Points nearer than 10 micrometres are one.
struct MeshFaults {
  int open_edges = 0;   ///< Edges whose two directions do not balance: holes, or torn seams.
  int flipped = 0;      ///< Triangles whose vertex normals point to their back.
  int degenerate = 0;   ///< Triangles without area.
  double volume = 0.0;  ///< Positive when triangles face outwards.
};

inline MeshFaults mesh_faults(const Mesh& mesh) {
  MeshFaults faults;
  std::map<std::array<long, 3>, int> welded;
  std::vector<int> point;
  for (const Vec3f& p : mesh.positions) {
    const std::array<long, 3> key{std::lround(double(p.x()) * 1e5),
                                  std::lround(double(p.y()) * 1e5),
                                  std::lround(double(p.z()) * 1e5)};
    point.push_back(welded.emplace(key, int(welded.size())).first->second);
  }
  std::map<std::pair<int, int>, int> balance;
  for (const auto& [a, b, c] : mesh.triangles) {
    const Vec3 pa = mesh.positions[a].cast<double>(), pb = mesh.positions[b].cast<double>(),
               pc = mesh.positions[c].cast<double>();
    faults.volume += pa.dot(pb.cross(pc)) / 6;
    const Vec3 normal = (pb - pa).cross(pc - pa);
    if (normal.norm() < 1e-11) ++faults.degenerate;
    const Vec3 shading = (mesh.normals[a] + mesh.normals[b] + mesh.normals[c]).cast<double>();
    if (normal.dot(shading) < 0) ++faults.flipped;
    const std::array<int, 3> corner{point[a], point[b], point[c]};
    for (std::size_t k = 0; k < 3; ++k) {
      const int from = corner[k], to = corner[(k + 1) % 3];
      if (from < to) ++balance[{from, to}];
      if (from > to) --balance[{to, from}];
    }
  }
  for (const auto& [edge, count] : balance) faults.open_edges += count != 0 ? 1 : 0;
  return faults;
}

}  // namespace diorama::test
