// SPDX-License-Identifier: Apache-2.0
#include "null_renderer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

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

Rgba8 encoded(const Vec3f& linear) {
  Rgba8 rgba{0, 0, 0, 255};
  for (int k = 0; k < 3; ++k) {
    const float value = srgb_from_linear(std::clamp(linear[k], 0.0f, 1.0f));
    rgba[std::size_t(k)] = std::uint8_t(std::lround(value * 255.0f));
  }
  return rgba;
}

/// The wanted channels of one picture, filled point by point: the points themselves are many times
/// as large.
class ChannelImages {
 public:
  ChannelImages(const NameSet& wanted, const View& view)
      : view_(view),
        color_hdr_(image(wanted, kColorHdr, none())),
        color_(image(wanted, kColor, Rgba8{0, 0, 0, 255})),
        distance_(image(wanted, kDistanceToCamera, kFar)),
        depth_(image(wanted, kDistanceToImagePlane, kFar)),
        normals_(image(wanted, kNormals, none())),
        leaves_(image(wanted, kLeafId, 0u)),
        positions_(image(wanted, kPosition, none())),
        uvs_(image(wanted, kUv, Vec2f(Vec2f::Zero()))),
        albedo_(image(wanted, kAlbedo, none())) {}

  void put(int x, int y, const SurfacePoint& p) {
    if (color_hdr_) color_hdr_->at(x, y) = flat_color(p);
    if (color_) color_->at(x, y) = encoded(flat_color(p));
    if (distance_) distance_->at(x, y) = float(p.distance);
    if (depth_) depth_->at(x, y) = float(-(view_.camera_from_world * p.position).z());
    if (normals_) normals_->at(x, y) = p.normal.cast<float>();
    if (leaves_) leaves_->at(x, y) = p.node.index;
    if (positions_) positions_->at(x, y) = p.position.cast<float>();
    if (uvs_) uvs_->at(x, y) = p.uv;
    if (albedo_) albedo_->at(x, y) = p.albedo;
  }

  void move_to(Frame& frame) {
    move(color_hdr_, kColorHdr, frame);
    move(color_, kColor, frame);
    move(distance_, kDistanceToCamera, frame);
    move(depth_, kDistanceToImagePlane, frame);
    move(normals_, kNormals, frame);
    move(leaves_, kLeafId, frame);
    move(positions_, kPosition, frame);
    move(uvs_, kUv, frame);
    move(albedo_, kAlbedo, frame);
  }

 private:
  static constexpr float kFar = std::numeric_limits<float>::infinity();
  static Vec3f none() { return Vec3f::Zero(); }

  template <class Pixel>
  std::optional<Image<Pixel>> image(const NameSet& wanted, Channel<Pixel> channel,
                                    const Pixel& miss) const {
    if (!wanted.contains(channel.name)) return std::nullopt;
    return Image<Pixel>(view_.camera.width, view_.camera.height, miss);
  }
  template <class Pixel>
  static void move(std::optional<Image<Pixel>>& image, Channel<Pixel> channel, Frame& frame) {
    if (image) frame.set(channel, std::move(*image));
  }
  Vec3f flat_color(const SurfacePoint& p) const {
    const Vec3 to_camera = (view_.world_from_camera.translation() - p.position).normalized();
    return palette(p.node.index) * float(0.3 + 0.7 * std::abs(to_camera.dot(p.normal)));
  }

  const View& view_;
  std::optional<Image<Vec3f>> color_hdr_;
  std::optional<Image<Rgba8>> color_;
  std::optional<Image<float>> distance_;
  std::optional<Image<float>> depth_;
  std::optional<Image<Vec3f>> normals_;
  std::optional<Image<std::uint32_t>> leaves_;
  std::optional<Image<Vec3f>> positions_;
  std::optional<Image<Vec2f>> uvs_;
  std::optional<Image<Vec3f>> albedo_;
};

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
  ChannelImages channels(request.channels, view);
  host_.parallel_for(std::size_t(view.camera.height), [&](std::size_t y) {
    for (int x = 0; x < view.camera.width; ++x) {
      const auto segment = view.segment(x, int(y));
      const SurfacePoint point = segment ? meshes_.first_hit(*segment) : SurfacePoint();
      if (point.node) channels.put(x, int(y), point);
    }
  });
  Frame frame;
  channels.move_to(frame);
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
    const std::size_t pixels = std::size_t(mask.box.width()) * std::size_t(mask.box.height());
    mask.bits.reserve(pixels);
    if (with_distances) mask.distances.reserve(pixels);
    for (int y = mask.box.y_min; y < mask.box.y_max; ++y) {
      host_.stop_if_asked();
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

std::vector<std::uint8_t> NullRenderer::do_see(const Scene& scene, NodeId camera,
                                               std::span<const Vec3> points_world) {
  const Vec3 centre = scene.world_from_node(camera).translation();
  std::vector<std::uint8_t> seen(points_world.size(), 1);
  constexpr std::size_t kAtOnce = 256;
  host_.parallel_for((points_world.size() + kAtOnce - 1) / kAtOnce, [&](std::size_t part) {
    const std::size_t end = std::min((part + 1) * kAtOnce, points_world.size());
    for (std::size_t i = part * kAtOnce; i < end; ++i) {
      const Vec3 towards = points_world[i] - centre;
      const double distance = towards.norm();
      const double reach = distance - sight_margin(distance);
      if (reach <= 0.0) continue;
      const Segment segment{centre, towards / distance, 0.0, reach};
      seen[i] = meshes_.first_hit(segment).node ? 0 : 1;
    }
  });
  return seen;
}

}  // namespace diorama
