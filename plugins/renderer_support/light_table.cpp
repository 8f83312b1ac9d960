// SPDX-License-Identifier: Apache-2.0
#include "light_table.h"

#include <algorithm>
#include <cmath>

namespace diorama {

void LightTable::finish() {
  std::vector<LightTree::Light> placed;
  order_.resize(records_.size());
  for (std::uint32_t i = 0; i < records_.size(); ++i) {
    const Record& r = records_[i];
    if (!r.is_body()) {
      surroundings_.push_back(i);
      continue;
    }
    order_[i] = std::uint32_t(bodies_.size());
    bodies_.push_back(i);
    if (r.shape != LightShape::Triangles) shapes_.push_back(i);
    placed.push_back({r.position, r.radius, r.direction, r.spread, r.depth, r.behind, r.power});
  }
  tree_ = LightTree(placed);
  for (const Record& light : records_) columns_.add(light);
  for (std::uint32_t lane = 0; lane < tree_.root_count(); ++lane) {
    const std::int32_t body = tree_.light_of_root(lane);
    entry_lights_.push_back(body < 0 ? -1 : std::int32_t(bodies_[std::uint32_t(body)]));
  }
  entry_lights_.insert(entry_lights_.end(), surroundings_.begin(), surroundings_.end());
}

bool LightTable::has_small_lights() const {
  return std::any_of(records_.begin(), records_.end(), [](const Record& light) {
    return light.shape != LightShape::Dome || light.texture->has_sun();
  });
}

bool LightTable::has_lamps() const {
  return std::any_of(records_.begin(), records_.end(),
                     [](const Record& light) { return is_lamp(light); });
}

void LightTable::Columns::add(const Record& light) {
  shape.push_back(std::int32_t(light.shape));
  for (int k = 0; k < 3; ++k) {
    position[std::size_t(k)].push_back(light.position[k]);
    axis_x[std::size_t(k)].push_back(light.axis_x[k]);
    axis_y[std::size_t(k)].push_back(light.axis_y[k]);
    direction[std::size_t(k)].push_back(light.direction[k]);
  }
  radius.push_back(light.radius);
  area.push_back(light.area);
  one_minus_cos.push_back(light.one_minus_cos);
}

void LightTable::add(const Light& light, const Affine& world_from_node,
                     std::shared_ptr<const DomeTexture> texture) {
  Record r;
  const Eigen::Matrix3f linear = world_from_node.linear().cast<float>();
  r.position = world_from_node.translation().cast<float>();
  r.direction = -linear.col(2).normalized();
  r.radiance = light.color.cwiseMax(0.0f);
  r.is_visible_to_camera = light.is_visible_to_camera;
  if (light.cone_angle_rad < kPi) {
    const double inner = light.cone_angle_rad * (1.0 - std::clamp(light.cone_softness, 0.0, 1.0));
    r.cos_outer = float(std::cos(light.cone_angle_rad));
    r.cos_inner = std::max(float(std::cos(inner)), r.cos_outer + 1e-5f);
  }
  switch (light.kind) {
    case LightKind::Sphere:
      r.shape = has_disk_lamps_ ? LightShape::TurningDisk : LightShape::Sphere;
      r.radius = float(light.radius_m) * std::cbrt(std::abs(linear.determinant()));
      r.area = kPiF * r.radius * r.radius;
      break;
    case LightKind::Rect:
    case LightKind::Disk: {
      const bool is_disk = light.kind == LightKind::Disk;
      r.shape = is_disk ? LightShape::Disk : LightShape::Rect;
      r.axis_x = linear.col(0) * float(is_disk ? light.radius_m : 0.5 * light.width_m);
      r.axis_y = linear.col(1) * float(is_disk ? light.radius_m : 0.5 * light.height_m);
      const Vec3f normal = r.axis_x.cross(r.axis_y);
      r.area = normal.norm() * (is_disk ? kPiF : 4.0f);
      r.radius = std::max(r.axis_x.norm(), r.axis_y.norm()) * (is_disk ? 1.0f : 1.41422f);
      r.spread = 0.0f;
      // The plane's own normal: a sheared node's -z is not perpendicular to it.
      if (r.area > 0.0f) {
        r.direction = normal.normalized() * (normal.dot(r.direction) < 0.0f ? -1.0f : 1.0f);
      }
      break;
    }
    case LightKind::Distant: {
      r.shape = LightShape::Distant;
      r.sun = std::make_shared<const SunGrid>();
      const double half = 0.5 * std::clamp(light.angle_rad, 0.0, kPi);
      r.power = luminance(r.radiance);
      r.one_minus_cos = float(2.0 * std::pow(std::sin(0.5 * half), 2));
      if (r.one_minus_cos > 0.0f) r.radiance /= float(kPi * std::pow(std::sin(half), 2));
      break;
    }
    case LightKind::Dome:
      r.shape = LightShape::Dome;
      r.dome_from_world = world_from_node.rotation().transpose().cast<float>();
      r.texture = std::move(texture);
      r.sky = std::make_shared<const SkyGrid>(*r.texture);
      r.power = luminance(r.radiance);
      break;
  }
  if (r.is_body()) r.power = luminance(r.radiance) * r.area;
  if (r.power > 0.0f && std::isfinite(r.power)) records_.push_back(std::move(r));
}

void LightTable::learn_surroundings(const SkyGridOf& sky_grid_of, const SunGridOf& sun_grid_of) {
  for (const std::uint32_t index : surroundings_) {
    Record& light = records_[index];
    if (light.shape == LightShape::Dome) {
      light.sky = sky_grid_of(light.texture, light.dome_from_world.transpose());
    } else {
      light.sun = sun_grid_of(-light.direction, light.one_minus_cos);
    }
  }
}

void LightTable::find_direction(Record& light) {
  Vec3f sum = Vec3f::Zero();
  for (const auto& t : light.triangles) sum += t.front(light.is_mirrored);
  if (!(sum.norm() > 0.0f)) return;
  const Vec3f direction = sum.normalized();
  float cosine = 1.0f;
  float depth = 0.0f;
  for (const auto& t : light.triangles) {
    cosine = std::min(cosine, direction.dot(t.front(light.is_mirrored).normalized()));
    for (const Vec3f& corner : t.corners()) {
      depth = std::max(depth, std::abs(direction.dot(corner - light.position)));
    }
  }
  if (cosine <= 0.0f) return;
  light.direction = direction;
  light.spread = std::sqrt(std::max(0.0f, 1.0f - cosine * cosine));
  light.depth = depth + light.spread * light.radius;
  light.behind = light.is_double_sided ? 0.02f : 0.0f;
  light.power *= 2.0f;
}

std::uint32_t LightTable::add(EmittingTriangles source) {
  Record r;
  r.shape = LightShape::Triangles;
  r.instance = source.instance;
  r.is_double_sided = source.is_double_sided;
  r.is_mirrored = source.is_mirrored;
  r.radiance = source.mean_radiance;
  Aabb bounds;
  double area = 0.0;
  for (const EmittingTriangles::Triangle& t : source.triangles) {
    const double size = 0.5 * double(t.ab.cross(t.ac).norm());
    if (!(size > 0.0)) continue;
    area += size;
    r.triangles.push_back(t);
    r.cumulative_area.push_back(float(area));
    for (const Vec3f& corner : t.corners()) bounds.add(Vec3(corner.cast<double>()));
  }
  r.area = float(area);
  if (!bounds.is_empty()) {
    r.position = bounds.centre().cast<float>();
    r.radius = float(0.5 * bounds.size().norm());
  }
  r.power = 0.5f * luminance(r.radiance) * r.area;
  if (!r.is_double_sided || source.is_closed) find_direction(r);
  records_.push_back(std::move(r));
  return std::uint32_t(records_.size() - 1);
}

}  // namespace diorama
