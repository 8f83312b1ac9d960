// SPDX-License-Identifier: Apache-2.0
#include "loader_samples/model.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace diorama::samples {

using namespace modelling;

Model finish(MeshBuilder& builder, std::vector<MaterialPtr> materials) {
  const Vec3 centre = builder.bounds().centre();
  Mesh mesh = *builder.build();
  for (Vec3f& p : mesh.positions) p -= centre.cast<float>();
  return {std::make_shared<const Mesh>(std::move(mesh)), std::move(materials)};
}

Model make_carton(const Vec3& size, double bevel, const Color& ground, double roughness,
                  const FacePainter& paint) {
  // Front, right, back and left in a row, top and bottom below the first two.
  const double w = size.x(), d = size.y(), h = size.z();
  const double scale = 1024 / (2 * (w + d));
  const int rows = int(std::ceil((h + d) * scale / 4)) * 4;
  Canvas canvas(1024, rows, ground);
  struct Place {
    int face;
    double x, y, w, h;
  };
  const std::array<Place, 6> places{{{2, 0, 0, w, h},
                                     {1, w, 0, d, h},
                                     {3, w + d, 0, w, h},
                                     {0, 2 * w + d, 0, d, h},
                                     {5, 0, h, w, d},
                                     {4, w, h, w, d}}};
  BoxPrint print;
  for (const Place& p : places) {
    paint(canvas, p.face, p.x * scale, p.y * scale, p.w * scale, p.h * scale);
    const Vec2 low(p.x * scale / 1024, 1 - (p.y + p.h) * scale / rows);
    const Vec2 high((p.x + p.w) * scale / 1024, 1 - p.y * scale / rows);
    // Half a texel inside, so that neighbours do not bleed in.
    const Vec2 inset(0.7 / 1024, 0.7 / rows);
    print[std::size_t(p.face)] = {low + inset, high - inset};
  }
  MeshBuilder builder;
  builder.begin(Affine::Identity(), {});
  add_printed_box(builder, size, bevel, print, 3);
  return finish(builder, {make_picture_material("print", canvas.texture("print"), roughness)});
}

std::vector<ProfilePoint> smooth_profile(std::span<const ProfilePoint> knots, int steps) {
  std::vector<Vec3> points;
  for (const ProfilePoint& k : knots) points.emplace_back(k.r, 0, k.z);
  std::vector<ProfilePoint> result;
  for (const Vec3& p : smooth_path(points, steps)) {
    result.push_back({std::max(0.0005, p.x()), p.z()});
  }
  return result;
}

std::vector<ProfilePoint> vessel(std::span<const ProfilePoint> outer, double thickness) {
  std::vector<ProfilePoint> profile{{0, outer.front().z}};
  profile.insert(profile.end(), outer.begin(), outer.end());
  const double floor = outer.front().z + thickness;
  const ProfilePoint rim = outer.back();
  profile.push_back({rim.r - thickness / 2, rim.z + thickness * 0.4});
  for (std::size_t i = outer.size(); i-- > 0;) {
    const ProfilePoint inner{outer[i].r - thickness, outer[i].z};
    if (inner.z <= floor + 1e-4 || inner.r < 0.002) break;
    profile.push_back(inner);
  }
  profile.push_back({std::max(0.002, outer.front().r - thickness), floor});
  profile.push_back({0, floor});
  return profile;
}

}  // namespace diorama::samples
