// SPDX-License-Identifier: Apache-2.0
#include "lights.h"

#include <algorithm>
#include <cmath>

namespace diorama {
namespace {

constexpr float kFar = std::numeric_limits<float>::infinity();

/// 1 - cos of the half angle under which a sphere of this squared sine is seen, without
/// cancellation.
float one_minus_cos_of(float sin2) {
  return sin2 / (1.0f + std::sqrt(std::max(0.0f, 1.0f - sin2)));
}

}  // namespace

void Lights::add_record(Record record) {
  const auto index = std::uint32_t(lights_.size());
  switch (record.shape) {
    case Shape::Sphere:
    case Shape::Rect:
    case Shape::Disk:
      bodies_.push_back(index);
      break;
    case Shape::Distant:
    case Shape::Dome:
      surroundings_.push_back(index);
      break;
    case Shape::Triangles:
      break;
  }
  lights_.push_back(std::move(record));
}

void Lights::add(const Light& light, const Affine& world_from_node,
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
      r.shape = Shape::Sphere;
      r.radius = float(light.radius_m) * std::cbrt(std::abs(linear.determinant()));
      r.area = kPiF * r.radius * r.radius;
      break;
    case LightKind::Rect:
    case LightKind::Disk: {
      const bool is_disk = light.kind == LightKind::Disk;
      r.shape = is_disk ? Shape::Disk : Shape::Rect;
      r.axis_x = linear.col(0) * float(is_disk ? light.radius_m : 0.5 * light.width_m);
      r.axis_y = linear.col(1) * float(is_disk ? light.radius_m : 0.5 * light.height_m);
      const Vec3f normal = r.axis_x.cross(r.axis_y);
      r.area = normal.norm() * (is_disk ? kPiF : 4.0f);
      r.radius = std::max(r.axis_x.norm(), r.axis_y.norm()) * (is_disk ? 1.0f : 1.41422f);
      // The plane's own normal: a sheared node's -z is not perpendicular to it.
      if (r.area > 0.0f) {
        r.direction = normal.normalized() * (normal.dot(r.direction) < 0.0f ? -1.0f : 1.0f);
      }
      break;
    }
    case LightKind::Distant: {
      r.shape = Shape::Distant;
      const double half = 0.5 * std::clamp(light.angle_rad, 0.0, kPi);
      r.power = luminance(r.radiance);
      r.one_minus_cos = float(2.0 * std::pow(std::sin(0.5 * half), 2));
      if (r.one_minus_cos > 0.0f) r.radiance /= float(kPi * std::pow(std::sin(half), 2));
      break;
    }
    case LightKind::Dome:
      r.shape = Shape::Dome;
      r.dome_from_world = world_from_node.rotation().transpose().cast<float>();
      r.texture = std::move(texture);
      r.sky = std::make_shared<const SkyGrid>(*r.texture);
      r.power = luminance(r.radiance);
      break;
  }
  const bool is_body = r.shape == Shape::Sphere || r.shape == Shape::Rect || r.shape == Shape::Disk;
  if (is_body) r.power = luminance(r.radiance) * r.area;
  if (r.power > 0.0f && std::isfinite(r.power)) add_record(std::move(r));
}

void Lights::learn_sky(const Aabb& bounds, const SkyGrid::Sees& sees, Host& host) {
  if (bounds.is_empty()) return;
  for (std::uint32_t index : surroundings_) {
    Record& light = lights_[index];
    if (light.shape != Shape::Dome) continue;
    const Eigen::Matrix3f world_from_dome = light.dome_from_world.transpose();
    light.sky =
        std::make_shared<const SkyGrid>(*light.texture, world_from_dome, bounds, sees, host);
  }
}

std::uint32_t Lights::add(EmittingTriangles source) {
  Record r;
  r.shape = Shape::Triangles;
  r.geometry = source.geometry;
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
    for (const Vec3f& p : {t.a, Vec3f(t.a + t.ab), Vec3f(t.a + t.ac)})
      bounds.add(Vec3(p.cast<double>()));
  }
  r.area = float(area);
  if (!bounds.is_empty()) {
    r.position = bounds.centre().cast<float>();
    r.radius = float(0.5 * bounds.size().norm());
  }
  r.power = 0.5f * luminance(r.radiance) * r.area;
  add_record(std::move(r));
  return std::uint32_t(lights_.size() - 1);
}

float Lights::cone_factor(const Record& light, const Vec3f& from_light) {
  if (light.cos_outer < -1.0f) return 1.0f;
  const float c = from_light.dot(light.direction);
  const float t =
      std::clamp((c - light.cos_outer) / (light.cos_inner - light.cos_outer), 0.0f, 1.0f);
  return t * t * (3.0f - 2.0f * t);
}

// Never zero where light may arrive: cosines are those of the light's whole extent, with a floor
// because a glossy surface weighs directions otherwise than by the cosine.
float Lights::score(const Record& light, const Receiver& receiver) const {
  constexpr float kFloor = 0.1f;
  const auto receiver_cosine = [&](float cosine) {
    if (receiver.is_two_sided) cosine = std::abs(cosine);
    return cosine <= 0.0f ? 0.0f : std::max(kFloor, std::min(1.0f, cosine));
  };
  if (light.shape == Shape::Dome) {
    return light.power * light.sky->power(light.sky->cell(receiver.position));
  }
  if (light.shape == Shape::Distant) {
    const float reach = std::sqrt(light.one_minus_cos * (2.0f - light.one_minus_cos)) + 1e-3f;
    return light.power * receiver_cosine(reach - receiver.normal.dot(light.direction));
  }
  const Vec3f to_light = light.position - receiver.position;
  const float distance2 = to_light.squaredNorm();
  const float distance = std::sqrt(distance2);
  const float near = std::max(distance, light.radius);
  float at_receiver = receiver.normal.dot(to_light);
  if (receiver.is_two_sided) at_receiver = std::abs(at_receiver);
  const float cosine =
      receiver_cosine((at_receiver + light.radius * 1.001f) / std::max(near, 1e-20f));
  float at_light = 1.0f;
  const bool is_one_sided = light.shape == Shape::Rect || light.shape == Shape::Disk;
  if (is_one_sided) {
    const float height = -to_light.dot(light.direction);
    if (height <= 0.0f) return 0.0f;
    at_light = std::max(kFloor, height / std::max(distance, 1e-20f));
  }
  return light.power * cosine * at_light / std::max(near * near, 1e-20f);
}

Lights::Choice Lights::choose(Receiver& receiver, float u) const {
  Choice choice;
  float chosen_score = 0.0f;
  float total = 0.0f;
  for (std::uint32_t i = 0; i < lights_.size(); ++i) {
    const float s = score(lights_[i], receiver);
    if (!(s > 0.0f)) continue;
    total += s;
    const float share = s / total;
    // One number serves all decisions: what is left of it stays uniform.
    if (u < share) {
      choice.light = i;
      chosen_score = s;
      u = u / share;
    } else {
      u = (u - share) / (1.0f - share);
    }
  }
  receiver.total_score = total;
  if (total > 0.0f) choice.probability = chosen_score / total;
  return choice;
}

float Lights::probability(std::uint32_t light, const Receiver& receiver) const {
  if (!(receiver.total_score > 0.0f)) return 0.0f;
  return score(lights_[light], receiver) / receiver.total_score;
}

LightSample Lights::sample(std::uint32_t index, const Vec3f& from, const Vec2f& u) const {
  const Record& light = lights_[index];
  switch (light.shape) {
    case Shape::Sphere:
      return sample_sphere(light, from, u);
    case Shape::Rect:
    case Shape::Disk:
      return sample_flat(light, from, u);
    case Shape::Distant:
      return sample_distant(light, u);
    case Shape::Dome:
      return sample_dome(light, from, u);
    case Shape::Triangles:
      break;
  }
  return sample_triangles(light, from, u);
}

LightSample Lights::sample_sphere(const Record& light, const Vec3f& from, const Vec2f& u) {
  const Vec3f to_centre = light.position - from;
  const float distance2 = to_centre.squaredNorm();
  const float sin2 = light.radius * light.radius / distance2;
  if (!(sin2 < 1.0f)) return {};
  const float distance = std::sqrt(distance2);
  const float one_minus_cos = one_minus_cos_of(sin2);
  const Vec3f local = uniform_cone(u, one_minus_cos);
  LightSample s;
  s.direction = basis_around(to_centre / distance).to_world(local).normalized();
  const float sine2 = std::max(0.0f, 1.0f - local.z() * local.z());
  s.distance = distance * local.z() -
               std::sqrt(std::max(0.0f, light.radius * light.radius - distance2 * sine2));
  s.radiance = light.radiance * cone_factor(light, -s.direction);
  s.density = 1.0f / (2.0f * kPiF * one_minus_cos);
  return s;
}

LightSample Lights::sample_flat(const Record& light, const Vec3f& from, const Vec2f& u) {
  const Vec2f p = light.shape == Shape::Disk ? disk_from_square(u)
                                             : Vec2f(2.0f * u.x() - 1.0f, 2.0f * u.y() - 1.0f);
  const Vec3f to_light = light.position + p.x() * light.axis_x + p.y() * light.axis_y - from;
  const float distance2 = to_light.squaredNorm();
  LightSample s;
  s.distance = std::sqrt(distance2);
  s.direction = to_light / s.distance;
  const float cosine = -s.direction.dot(light.direction);
  if (!(cosine > 1e-6f)) return {};
  s.density = distance2 / (cosine * light.area);
  s.radiance = light.radiance * cone_factor(light, -s.direction);
  return s;
}

LightSample Lights::sample_distant(const Record& light, const Vec2f& u) {
  LightSample s;
  s.distance = kFar;
  s.radiance = light.radiance;
  if (light.one_minus_cos <= 0.0f) {
    s.direction = -light.direction;
    s.density = kFar;
    return s;
  }
  const Vec3f local = uniform_cone(u, light.one_minus_cos);
  s.direction = basis_around(-light.direction).to_world(local).normalized();
  s.density = 1.0f / (2.0f * kPiF * light.one_minus_cos);
  return s;
}

LightSample Lights::sample_dome(const Record& light, const Vec3f& from, const Vec2f& u) {
  const SkyGrid::Choice choice = light.sky->choose(light.sky->cell(from), u.x());
  if (choice.probability <= 0.0f) return {};
  const DomeTexture::Draw draw = light.texture->sample(choice.patch, {choice.rest, u.y()});
  LightSample s;
  s.distance = kFar;
  s.direction = (light.dome_from_world.transpose() * draw.direction).normalized();
  s.density = draw.density * choice.probability;
  s.radiance = light.radiance.cwiseProduct(draw.radiance);
  return s;
}

LightSample Lights::sample_triangles(const Record& light, const Vec3f& from, const Vec2f& u) {
  if (light.triangles.empty()) return {};
  const float target = u.x() * light.area;
  const auto it =
      std::upper_bound(light.cumulative_area.begin(), light.cumulative_area.end() - 1, target);
  const auto index = std::size_t(it - light.cumulative_area.begin());
  const float before = index == 0 ? 0.0f : light.cumulative_area[index - 1];
  const float size = light.cumulative_area[index] - before;
  const float again = size > 0.0f ? std::clamp((target - before) / size, 0.0f, 0.999999f) : 0.5f;
  const EmittingTriangles::Triangle& t = light.triangles[index];
  LightSample s;
  s.barycentric = triangle_from_square({again, u.y()});
  const Vec3f to_light = t.a + s.barycentric.x() * t.ab + s.barycentric.y() * t.ac - from;
  const float distance2 = to_light.squaredNorm();
  s.distance = std::sqrt(distance2);
  s.direction = to_light / s.distance;
  const float cosine = -s.direction.dot(t.ab.cross(t.ac).normalized());
  if (!(std::abs(cosine) > 1e-6f) ||
      ((cosine < 0.0f) != light.is_mirrored && !light.is_double_sided))
    return {};
  s.density = distance2 / (std::abs(cosine) * light.area);
  s.radiance = light.radiance;
  s.geometry = light.geometry;
  s.triangle = t.index;
  s.is_surface = true;
  return s;
}

float Lights::density_of_surface(std::uint32_t light, float distance, float cos_at_light) const {
  return distance * distance / (std::max(1e-6f, std::abs(cos_at_light)) * lights_[light].area);
}

float Lights::meet(const Record& light, const Vec3f& from, const Vec3f& direction, float t_max,
                   Vec3f& radiance) {
  switch (light.shape) {
    case Shape::Sphere: {
      const Vec3f to_centre = light.position - from;
      const float distance2 = to_centre.squaredNorm();
      const float radius2 = light.radius * light.radius;
      if (distance2 <= radius2) return 0.0f;  // it shines outwards only
      const float along = to_centre.dot(direction);
      const float off2 = (to_centre - along * direction).squaredNorm();
      if (along <= 0.0f || off2 >= radius2) return 0.0f;
      if (along - std::sqrt(radius2 - off2) >= t_max) return 0.0f;
      radiance = light.radiance * cone_factor(light, -direction);
      return 1.0f / (2.0f * kPiF * one_minus_cos_of(radius2 / distance2));
    }
    case Shape::Rect:
    case Shape::Disk: {
      const float cosine = -direction.dot(light.direction);
      if (cosine <= 1e-6f) return 0.0f;
      const float t = (from - light.position).dot(light.direction) / cosine;
      if (t <= 0.0f || t >= t_max) return 0.0f;
      const Vec3f p = from + t * direction - light.position;
      // Coordinates along the (possibly skew) axes.
      const Vec3f normal = light.axis_x.cross(light.axis_y);
      const float scale = 1.0f / normal.squaredNorm();
      const float x = p.cross(light.axis_y).dot(normal) * scale;
      const float y = light.axis_x.cross(p).dot(normal) * scale;
      const bool is_inside = light.shape == Shape::Disk ? x * x + y * y < 1.0f
                                                        : std::abs(x) < 1.0f && std::abs(y) < 1.0f;
      if (!is_inside) return 0.0f;
      radiance = light.radiance * cone_factor(light, -direction);
      return t * t / (cosine * light.area);
    }
    case Shape::Distant: {
      if (light.one_minus_cos <= 0.0f) return 0.0f;
      // 1 - cos from the difference of the directions keeps narrow suns exact.
      const float off = 0.5f * (direction + light.direction).squaredNorm();
      if (off > light.one_minus_cos) return 0.0f;
      radiance = light.radiance;
      return 1.0f / (2.0f * kPiF * light.one_minus_cos);
    }
    case Shape::Dome: {
      const Vec3f local = light.dome_from_world * direction;
      const DomeTexture::Place place = light.texture->place(local);
      radiance = light.radiance.cwiseProduct(light.texture->radiance(local));
      return place.density * light.sky->probability(light.sky->cell(from), place.patch);
    }
    case Shape::Triangles:
      break;
  }
  return 0.0f;
}

}  // namespace diorama
