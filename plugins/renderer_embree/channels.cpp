// SPDX-License-Identifier: Apache-2.0
#include "channels.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "path_tracer.h"
#include "ray_blocks.h"

namespace diorama {
namespace {

/// Distance where nothing was met.
constexpr float kMiss = std::numeric_limits<float>::infinity();

/// What one pixel's ray met.
struct CentreHit {
  CameraRay ray;
  RayHit hit;
};

/// Makes one channel: `value` of every pixel that met something.
class ChannelFiller {
 public:
  ChannelFiller(Frame& frame, const NameSet& wanted, const View& view,
                const std::vector<CentreHit>& hits, Host& host)
      : frame_(frame), wanted_(wanted), view_(view), hits_(hits), host_(host) {}

  template <class Pixel, class Value>
  void fill(Channel<Pixel> channel, const Pixel& miss, Value&& value) {
    if (!wanted_.contains(channel.name)) return;
    const int width = view_.camera().width;
    Image<Pixel> image(width, view_.camera().height, miss);
    host_.parallel_for(std::size_t(image.height()), [&](std::size_t y) {
      auto row = image.row(int(y));
      const CentreHit* hits = &hits_[y * std::size_t(width)];
      for (std::size_t x = 0; x < row.size(); ++x) {
        if (!hits[x].hit) continue;
        SurfaceGeometry surface =
            RenderScene::surface_at(hits[x].hit, hits[x].ray.origin, hits[x].ray.direction);
        RenderScene::add_uv(surface, hits[x].hit);
        row[x] = value(hits[x], surface);
      }
    });
    frame_.set(channel, std::move(image));
  }

 private:
  Frame& frame_;
  const NameSet& wanted_;
  const View& view_;
  const std::vector<CentreHit>& hits_;
  Host& host_;
};

/// Pixels that may see something of a box, at most one image size beyond the image. `blocks` are
/// there for other lenses than a pinhole.
PixelBox possible_pixels(const View& view, const std::optional<RayBlocks>& blocks,
                         const Aabb& bounds) {
  const Camera& camera = view.camera();
  const int w = camera.width;
  const int h = camera.height;
  const PixelBox all{-w, -h, 2 * w, 2 * h};
  if (bounds.is_empty()) return {};
  if (blocks) {
    return blocks->box_of(view.camera_from_world() * bounds.centre(), 0.5 * bounds.size().norm());
  }
  // Straight edges stay straight under a pinhole only, and only in front of the camera.
  Vec2 lo = Vec2::Constant(kInfinity);
  Vec2 hi = Vec2::Constant(-kInfinity);
  int in_front = 0;
  for (int i = 0; i < 8; ++i) {
    const Vec3 corner = view.camera_from_world() * bounds.corner(i);
    if (corner.z() > -1e-6) continue;
    const auto pixel = project(camera, corner);
    if (!pixel) continue;
    ++in_front;
    lo = lo.cwiseMin(*pixel);
    hi = hi.cwiseMax(*pixel);
  }
  if (in_front == 0) return {};
  if (in_front < 8) return all;
  const auto bound = [](double value, int from, int to) {
    return int(std::clamp(value, double(from), double(to)));
  };
  return {bound(std::floor(lo.x()) - 1.0, -w, 2 * w), bound(std::floor(lo.y()) - 1.0, -h, 2 * h),
          bound(std::ceil(hi.x()) + 1.0, -w, 2 * w), bound(std::ceil(hi.y()) + 1.0, -h, 2 * h)};
}

CoverageMask coverage_of(const RenderScene& meshes, const View& view,
                         const std::optional<RayBlocks>& blocks, const LabelledInstance& instance,
                         bool with_distances) {
  std::vector<std::uint32_t> own;
  Aabb bounds;
  for (std::uint32_t i = 0; i < meshes.instances().size(); ++i) {
    const MeshInstance& mesh = *meshes.instances()[i];
    if (std::find(instance.leaves.begin(), instance.leaves.end(), mesh.node) ==
        instance.leaves.end()) {
      continue;
    }
    own.push_back(i);
    bounds.add(mesh.bounds);
  }
  CoverageMask mask;
  mask.box = possible_pixels(view, blocks, bounds);
  if (mask.box.is_empty()) return {};
  const RenderScene::Part part(meshes, own);
  for (int y = mask.box.y_min; y < mask.box.y_max; ++y) {
    for (int x = mask.box.x_min; x < mask.box.x_max; ++x) {
      const auto ray = view.ray(Vec2(x + 0.5, y + 0.5));
      const float distance =
          ray ? part.distance(ray->origin, ray->direction, ray->t_min, ray->t_max) : kMiss;
      mask.bits.push_back(distance < kMiss);
      if (with_distances) mask.distances.push_back(distance);
    }
  }
  return mask.cropped(mask.extent());
}

}  // namespace

NameSet geometry_channels() {
  NameSet names;
  for (std::string_view name : {kDistanceToCamera.name, kDistanceToImagePlane.name, kNormals.name,
                                kLeafId.name, kPosition.name, kUv.name, kAlbedo.name}) {
    names.emplace(name);
  }
  return names;
}

void fill_channels(Frame& frame, const NameSet& wanted, const RenderScene& meshes, const View& view,
                   Host& host) {
  const NameSet known = geometry_channels();
  if (std::none_of(known.begin(), known.end(), [&](const auto& n) { return wanted.contains(n); })) {
    return;
  }
  const int width = view.camera().width;
  const int height = view.camera().height;
  std::vector<CentreHit> hits(std::size_t(width) * std::size_t(height));
  host.parallel_for(std::size_t(height), [&](std::size_t y) {
    for (int x = 0; x < width; ++x) {
      const auto ray = view.ray(Vec2(x + 0.5, double(y) + 0.5));
      if (!ray) continue;
      CentreHit& hit = hits[y * std::size_t(width) + std::size_t(x)];
      hit.ray = *ray;
      hit.hit = meshes.intersect(ray->origin, ray->direction, ray->t_min, ray->t_max);
    }
  });

  const Vec3f none = Vec3f::Zero();
  const Vec2f no_vector = Vec2f::Zero();
  ChannelFiller filler(frame, wanted, view, hits, host);
  filler.fill(kDistanceToCamera, kMiss, [](const CentreHit& h, const SurfaceGeometry& s) {
    return (s.position - h.ray.origin).norm();
  });
  filler.fill(kDistanceToImagePlane, kMiss, [&](const CentreHit&, const SurfaceGeometry& s) {
    return float(-(view.camera_from_world() * s.position.cast<double>()).z());
  });
  filler.fill(kNormals, none, [](const CentreHit&, const SurfaceGeometry& s) { return s.normal; });
  filler.fill(kLeafId, 0u, [](const CentreHit& h, const SurfaceGeometry&) {
    return h.hit.instance->node.index;
  });
  filler.fill(kPosition, none,
              [](const CentreHit&, const SurfaceGeometry& s) { return s.position; });
  filler.fill(kUv, no_vector, [](const CentreHit&, const SurfaceGeometry& s) { return s.uv; });
  filler.fill(kAlbedo, none, [&](const CentreHit& h, const SurfaceGeometry& s) {
    const float width_m = view.pixel_angle() * h.hit.distance;
    return base_color_at(h.hit, s, width_m * s.uv_per_metre);
  });
}

std::vector<CoverageMask> coverage(const RenderScene& meshes, const View& view,
                                   std::span<const LabelledInstance> instances, bool with_distances,
                                   Host& host) {
  std::vector<CoverageMask> masks(instances.size());
  std::optional<RayBlocks> blocks;
  if (view.camera().lens != LensModel::Pinhole) blocks.emplace(view.camera(), host);
  host.parallel_for(instances.size(), [&](std::size_t i) {
    masks[i] = coverage_of(meshes, view, blocks, instances[i], with_distances);
  });
  return masks;
}

}  // namespace diorama
