// SPDX-License-Identifier: Apache-2.0
#include "channels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include "diorama/renderer.h"
#include "renderer_support/ray_blocks.h"
#include "renderer_support/silhouette.h"

namespace diorama {
namespace {

/// The wanted channels of one frame, filled pixel by pixel.
class ChannelImages {
 public:
  ChannelImages(const NameSet& wanted, const View& view)
      : view_(view),
        distance_(image(wanted, kDistanceToCamera, kInfinite)),
        depth_(image(wanted, kDistanceToImagePlane, kInfinite)),
        normals_(image(wanted, kNormals, Vec3f(Vec3f::Zero()))),
        leaves_(image(wanted, kLeafId, 0u)),
        positions_(image(wanted, kPosition, Vec3f(Vec3f::Zero()))),
        uvs_(image(wanted, kUv, Vec2f(Vec2f::Zero()))),
        albedo_(image(wanted, kAlbedo, Vec3f(Vec3f::Zero()))) {}

  void put(int x, int y, const CameraRay& ray, const RayHit& hit) {
    if (leaves_) leaves_->at(x, y) = hit.instance->node.index;
    SurfaceGeometry s = surface_at(hit, ray.origin, ray.direction);
    if (uvs_ || albedo_) add_uv(s, hit);
    if (distance_) distance_->at(x, y) = (s.position - ray.origin).norm();
    if (depth_)
      depth_->at(x, y) = float(-(view_.camera_from_world() * s.position.cast<double>()).z());
    if (normals_) normals_->at(x, y) = s.normal;
    if (positions_) positions_->at(x, y) = s.position;
    if (uvs_) uvs_->at(x, y) = s.uv;
    if (!albedo_) return;
    const float width_m = view_.pixel_angle() * hit.distance;
    albedo_->at(x, y) = base_color_at(hit, s, width_m * s.uv_per_metre);
  }

  void move_to(Frame& frame) {
    move(distance_, kDistanceToCamera, frame);
    move(depth_, kDistanceToImagePlane, frame);
    move(normals_, kNormals, frame);
    move(leaves_, kLeafId, frame);
    move(positions_, kPosition, frame);
    move(uvs_, kUv, frame);
    move(albedo_, kAlbedo, frame);
  }

 private:
  template <class Pixel>
  std::optional<Image<Pixel>> image(const NameSet& wanted, Channel<Pixel> channel,
                                    const Pixel& miss) const {
    if (!wanted.contains(channel.name)) return std::nullopt;
    return Image<Pixel>(view_.camera().width, view_.camera().height, miss);
  }
  template <class Pixel>
  static void move(std::optional<Image<Pixel>>& image, Channel<Pixel> channel, Frame& frame) {
    if (image) frame.set(channel, std::move(*image));
  }

  const View& view_;
  std::optional<Image<float>> distance_;
  std::optional<Image<float>> depth_;
  std::optional<Image<Vec3f>> normals_;
  std::optional<Image<std::uint32_t>> leaves_;
  std::optional<Image<Vec3f>> positions_;
  std::optional<Image<Vec2f>> uvs_;
  std::optional<Image<Vec3f>> albedo_;
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

/// The meshes of one labelled instance.
struct OwnMeshes {
  std::vector<std::uint32_t> numbers;
  std::vector<bool> is_own;  ///< By number.
  Aabb bounds;
  bool has_holes = false;  ///< By texture.
};

OwnMeshes meshes_of(const LabelledInstance& instance, const EmbreeScene& meshes) {
  OwnMeshes own;
  own.is_own.resize(meshes.instances().size(), false);
  for (std::uint32_t i = 0; i < meshes.instances().size(); ++i) {
    const MeshInstance& mesh = meshes.instances()[i];
    const auto& leaves = instance.leaves;
    if (std::find(leaves.begin(), leaves.end(), mesh.node) == leaves.end()) continue;
    own.numbers.push_back(i);
    own.is_own[i] = true;
    own.bounds.add(mesh.bounds);
    own.has_holes |= std::any_of(mesh.materials.begin(), mesh.materials.end(),
                                 [](const ShadingMaterial* m) { return m->is_cut_out; });
  }
  return own;
}

/// By a ray through every pixel of the box: for bent lenses and holes.
CoverageMask traced(const EmbreeScene& meshes, const View& view, const OwnMeshes& own,
                    const PixelBox& box, bool with_distances, const Host& host) {
  CoverageMask mask;
  mask.box = box;
  const EmbreeScene::SubScene sub_scene(meshes, own.numbers);
  for (int y = box.y_min; y < box.y_max; ++y) {
    host.stop_if_asked();
    for (int x = box.x_min; x < box.x_max; ++x) {
      const auto ray = view.ray(Vec2(x + 0.5, y + 0.5));
      const float distance =
          ray ? sub_scene.distance(ray->origin, ray->direction, ray->t_min, ray->t_max) : kInfinite;
      mask.bits.push_back(distance < kInfinite);
      if (with_distances) mask.distances.push_back(distance);
    }
  }
  return mask;
}

CoverageMask drawn(const EmbreeScene& meshes, const View& view, const OwnMeshes& own,
                   const PixelBox& box, bool with_distances, Isa isa) {
  Silhouette silhouette(view.camera(), box, with_distances, isa);
  for (const std::uint32_t number : own.numbers) {
    const MeshInstance& mesh = meshes.instances()[number];
    silhouette.add(mesh.source(), mesh.linear, mesh.translation, view.camera_from_world());
  }
  return silhouette.take();
}

/// A ray along an edge may meet what arithmetic finds a hair beside it. What is seen is covered, at
/// the distance seen, and nothing is nearer.
void agree_with(const SeenMeshes& seen, const OwnMeshes& own, CoverageMask& mask) {
  const PixelBox box = mask.box.clipped(seen.numbers.width(), seen.numbers.height());
  if (box.is_empty()) return;
  const auto width = std::size_t(box.width());
  for (int y = box.y_min; y < box.y_max; ++y) {
    const std::size_t first = mask.index(box.x_min, y);
    const auto numbers = seen.numbers.row(y).subspan(std::size_t(box.x_min), width);
    std::uint8_t* bits = &mask.bits[first];
    for (const std::uint32_t number : own.numbers) {
      for (std::size_t i = 0; i < width; ++i) bits[i] |= std::uint8_t(numbers[i] == number);
    }
    if (mask.distances.empty()) continue;
    const auto distances = seen.distances.row(y).subspan(std::size_t(box.x_min), width);
    for (std::size_t i = 0; i < width; ++i) {
      if (numbers[i] == SeenMeshes::kNone || bits[i] == 0) continue;
      float& distance = mask.distances[first + i];
      const bool is_own = own.is_own[numbers[i]];
      distance = is_own ? distances[i] : std::max(distance, distances[i]);
    }
  }
}

CoverageMask coverage_of(const EmbreeScene& meshes, const View& view,
                         const std::optional<RayBlocks>& blocks, const SeenMeshes& seen,
                         const LabelledInstance& instance, bool with_distances, Isa isa,
                         const Host& host) {
  const OwnMeshes own = meshes_of(instance, meshes);
  const PixelBox box = possible_pixels(view, blocks, own.bounds);
  if (box.is_empty()) return {};
  const bool needs_rays = blocks || own.has_holes;
  CoverageMask mask = needs_rays ? traced(meshes, view, own, box, with_distances, host)
                                 : drawn(meshes, view, own, box, with_distances, isa);
  agree_with(seen, own, mask);
  return mask.cropped(mask.extent());
}

/// Calls it with each channel that fill_channels() knows.
template <class Call>
void for_each_channel(Call call) {
  call(kDistanceToCamera);
  call(kDistanceToImagePlane);
  call(kNormals);
  call(kLeafId);
  call(kPosition);
  call(kUv);
  call(kAlbedo);
}

}  // namespace

NameSet geometry_channels() {
  NameSet names;
  for_each_channel([&](auto channel) { names.emplace(channel.name); });
  return names;
}

std::size_t geometry_bytes_per_pixel(const NameSet& wanted) {
  std::size_t bytes = 0;
  for_each_channel([&]<class Pixel>(Channel<Pixel> channel) {
    if (wanted.contains(channel.name)) bytes += sizeof(Pixel);
  });
  return bytes;
}

void fill_channels(Frame& frame, const NameSet& wanted, const EmbreeScene& meshes, const View& view,
                   SeenMeshes& seen, HitImage* all_hits, Host& host) {
  const int width = view.camera().width;
  const int height = view.camera().height;
  if (seen.numbers.width() != width || seen.numbers.height() != height) {
    seen.numbers = Image<std::uint32_t>(width, height, SeenMeshes::kNone);
    seen.distances = Image<float>(width, height, kInfinite);
  }
  if (all_hits) *all_hits = HitImage(width, height);
  ChannelImages channels(wanted, view);
  const auto fill_row = [&](int y) {
    std::array<int, kBatch> columns;
    BatchRays rays;
    rays.is_coherent = true;
    BatchHits hits;
    // A whole batch is traced before its surfaces are looked at: they are fetched meanwhile.
    for (int begin = 0; begin < width; begin += int(kBatch)) {
      rays.count = 0;
      for (int x = begin; x < std::min(width, begin + int(kBatch)); ++x) {
        seen.numbers.at(x, y) = SeenMeshes::kNone;
        if (all_hits) all_hits->at(x, y) = RayHit();
        const auto ray = view.ray(Vec2(x + 0.5, y + 0.5));
        if (!ray) continue;
        columns[rays.count] = x;
        rays.add(ray->origin, ray->direction, ray->t_min, ray->t_max, kMoment);
      }
      meshes.intersect_now(rays, hits);
      for (std::size_t i = 0; i < rays.count; ++i) {
        if (!hits.instance[i]) continue;
        const RayHit hit = hits.at(i);
        seen.numbers.at(columns[i], y) = hit.number;
        seen.distances.at(columns[i], y) = hit.distance;
        if (all_hits) all_hits->at(columns[i], y) = hit;
        if (wanted.empty()) continue;
        const CameraRay ray{rays.origin.at(i), rays.direction.at(i), rays.t_min[i], rays.t_max[i]};
        channels.put(columns[i], y, ray, hit);
      }
    }
  };
  // Views are judged by some thousand rays each, which take less time than waking threads for each
  // row of them.
  constexpr int kRaysOfTask = 4096;
  const int rows = std::max(1, kRaysOfTask / std::max(width, 1));
  host.parallel_for(std::size_t((height + rows - 1) / rows), [&](std::size_t task) {
    const int first = int(task) * rows;
    for (int y = first; y < std::min(height, first + rows); ++y) fill_row(y);
  });
  channels.move_to(frame);
}

std::vector<CoverageMask> coverage(const EmbreeScene& meshes, const View& view,
                                   const SeenMeshes& seen,
                                   std::span<const LabelledInstance> instances, bool with_distances,
                                   Isa isa, Host& host) {
  std::vector<CoverageMask> masks(instances.size());
  std::optional<RayBlocks> blocks;
  if (view.camera().lens != LensModel::Pinhole) blocks.emplace(view.camera(), host);
  host.parallel_for(instances.size(), [&](std::size_t i) {
    masks[i] = coverage_of(meshes, view, blocks, seen, instances[i], with_distances, isa, host);
  });
  return masks;
}

std::vector<std::uint8_t> seen_points(const EmbreeScene& meshes, const Vec3& centre,
                                      std::span<const Vec3> points_world, Host& host) {
  std::vector<std::uint8_t> seen(points_world.size(), 1);
  const std::size_t batches = (points_world.size() + kBatch - 1) / kBatch;
  host.parallel_for(batches, [&](std::size_t batch) {
    const std::size_t begin = batch * kBatch;
    const std::size_t end = std::min(begin + kBatch, points_world.size());
    std::array<std::size_t, kBatch> point_of_ray;
    BatchRays rays;
    rays.is_coherent = true;
    rays.count = 0;
    for (std::size_t i = begin; i < end; ++i) {
      const Vec3 towards = points_world[i] - centre;
      const double distance = towards.norm();
      const double reach = distance - sight_margin(distance);
      if (reach <= 0.0) continue;
      point_of_ray[rays.count] = i;
      rays.add(centre.cast<float>(), Vec3(towards / distance).cast<float>(), 0.0f, float(reach),
               kMoment);
    }
    BatchHits hits;
    meshes.intersect_now(rays, hits);
    for (std::size_t i = 0; i < rays.count; ++i) {
      if (hits.instance[i]) seen[point_of_ray[i]] = 0;
    }
  });
  return seen;
}

}  // namespace diorama
