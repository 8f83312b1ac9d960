// SPDX-License-Identifier: Apache-2.0
#include "null_renderer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "diorama/rng.h"

namespace diorama {
namespace {

struct View {
  Camera camera;
  Affine world_from_camera;
  Affine camera_from_world;

  View(const Scene& scene, NodeId node)
      : camera(*scene[node].camera), world_from_camera(scene.world_from_node(node)) {
    // Scale of a camera node says nothing about the picture.
    world_from_camera.linear() = world_from_camera.rotation();
    camera_from_world = world_from_camera.inverse();
  }

  std::optional<Segment> segment(int x, int y) const {
    const auto direction = ray_direction(camera, Vec2(x + 0.5, y + 0.5));
    if (!direction) return std::nullopt;
    const double along_axis = -direction->z();
    Segment segment;
    segment.origin = world_from_camera.translation();
    segment.direction = world_from_camera.linear() * *direction;
    // Near and far are planes; a ray that never crosses them (fisheye, backwards) has spheres.
    const double slant = along_axis > 1e-6 ? along_axis : 1.0;
    segment.t_min = camera.near_m / slant;
    segment.t_max = camera.far_m / slant;
    return segment;
  }
};

/// Pixels that may see something of the box, at most one image size beyond the image.
PixelBox possible_pixels(const View& view, const Aabb& bounds) {
  const int w = view.camera.width;
  const int h = view.camera.height;
  const PixelBox all{-w, -h, 2 * w, 2 * h};
  if (bounds.is_empty()) return {};
  // Straight edges stay straight under a pinhole only, and only in front of the camera.
  if (view.camera.lens != LensModel::Pinhole) return all;
  Vec2 lo = Vec2::Constant(kInfinity);
  Vec2 hi = Vec2::Constant(-kInfinity);
  for (int i = 0; i < 8; ++i) {
    const Vec3 corner = view.camera_from_world * bounds.corner(i);
    const auto pixel = corner.z() < -1e-6 ? project(view.camera, corner) : std::nullopt;
    if (!pixel) return all;
    lo = lo.cwiseMin(*pixel);
    hi = hi.cwiseMax(*pixel);
  }
  const auto bound = [](double value, int from, int to) {
    return int(std::clamp(value, double(from), double(to)));
  };
  return {bound(lo.x() - 1.0, -w, 2 * w), bound(lo.y() - 1.0, -h, 2 * h),
          bound(hi.x() + 2.0, -w, 2 * w), bound(hi.y() + 2.0, -h, 2 * h)};
}

Vec3f palette(std::uint32_t id) {
  const Vec3 u = Rng(id).uniform_in(Aabb{Vec3::Constant(0.15), Vec3::Constant(0.95)});
  return u.cast<float>();
}

/// The points of one camera, row by row, and how to make channels of them.
struct Points {
  const View& view;
  std::vector<SurfacePoint> points;

  template <class Pixel, class Value>
  void put(Frame& frame, const NameSet& wanted, Channel<Pixel> channel, const Pixel& miss,
           Value&& value) const {
    if (!wanted.contains(channel.name)) return;
    Image<Pixel> image(view.camera.width, view.camera.height, miss);
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (points[i].node) image.pixels()[i] = value(points[i]);
    }
    frame.set(channel, std::move(image));
  }

  Vec3f flat_color(const SurfacePoint& p) const {
    const Vec3 to_camera = (view.world_from_camera.translation() - p.position).normalized();
    return palette(p.node.index) * float(0.3 + 0.7 * std::abs(to_camera.dot(p.normal)));
  }
};

Rgba8 encoded(const Vec3f& linear) {
  Rgba8 rgba{0, 0, 0, 255};
  for (int k = 0; k < 3; ++k) {
    const float value = srgb_from_linear(std::clamp(linear[k], 0.0f, 1.0f));
    rgba[std::size_t(k)] = std::uint8_t(std::lround(value * 255.0f));
  }
  return rgba;
}

}  // namespace

NullRenderer::NullRenderer(const Params&, Host& host) : host_(host) {}

NameSet NullRenderer::provides() const {
  NameSet names;
  for (std::string_view name :
       {kColor.name, kColorHdr.name, kDistanceToCamera.name, kDistanceToImagePlane.name,
        kNormals.name, kLeafId.name, kPosition.name, kUv.name, kAlbedo.name}) {
    names.emplace(name);
  }
  return names;
}

void NullRenderer::do_prepare(const Scene& scene) { meshes_.take(scene); }

Frame NullRenderer::do_render(const Scene& scene, const RenderRequest& request) {
  const View view(scene, request.camera);
  const int width = view.camera.width;
  const int height = view.camera.height;
  Points all{view, std::vector<SurfacePoint>(std::size_t(width) * std::size_t(height))};
  host_.parallel_for(std::size_t(height), [&](std::size_t y) {
    for (int x = 0; x < width; ++x) {
      const auto segment = view.segment(x, int(y));
      if (segment)
        all.points[y * std::size_t(width) + std::size_t(x)] = meshes_.first_hit(*segment);
    }
  });

  Frame frame;
  const NameSet& wanted = request.channels;
  constexpr float kFar = std::numeric_limits<float>::infinity();
  const Vec3f none = Vec3f::Zero();
  all.put(frame, wanted, kColorHdr, none, [&](const auto& p) { return all.flat_color(p); });
  all.put(frame, wanted, kColor, Rgba8{0, 0, 0, 255},
          [&](const auto& p) { return encoded(all.flat_color(p)); });
  all.put(frame, wanted, kDistanceToCamera, kFar, [](const auto& p) { return float(p.distance); });
  all.put(frame, wanted, kDistanceToImagePlane, kFar,
          [&](const auto& p) { return float(-(view.camera_from_world * p.position).z()); });
  all.put(frame, wanted, kNormals, none,
          [](const auto& p) { return Vec3f(p.normal.template cast<float>()); });
  all.put(frame, wanted, kLeafId, 0u, [](const auto& p) { return p.node.index; });
  all.put(frame, wanted, kPosition, none,
          [](const auto& p) { return Vec3f(p.position.template cast<float>()); });
  all.put(frame, wanted, kUv, Vec2f(Vec2f::Zero()), [](const auto& p) { return p.uv; });
  all.put(frame, wanted, kAlbedo, none, [](const auto& p) { return p.albedo; });
  return frame;
}

std::vector<CoverageMask> NullRenderer::do_cover(const Scene& scene, NodeId camera,
                                                 std::span<const LabelledInstance> instances,
                                                 bool with_distances) {
  const View view(scene, camera);
  std::vector<CoverageMask> masks(instances.size());
  host_.parallel_for(instances.size(), [&](std::size_t i) {
    const NullScene::Part part = meshes_.part(instances[i].leaves);
    CoverageMask mask;
    mask.box = possible_pixels(view, part.bounds);
    if (mask.box.is_empty()) return;
    for (int y = mask.box.y_min; y < mask.box.y_max; ++y) {
      for (int x = mask.box.x_min; x < mask.box.x_max; ++x) {
        const auto segment = view.segment(x, y);
        const double distance = segment ? meshes_.distance(part, *segment) : kInfinity;
        mask.bits.push_back(distance < kInfinity);
        if (with_distances) mask.distances.push_back(float(distance));
      }
    }
    masks[i] = mask.cropped(mask.extent());
  });
  return masks;
}

}  // namespace diorama
