// SPDX-License-Identifier: Apache-2.0
#include "diorama/renderer.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>

#include "framework/conformance/fingerprint.h"
#include "framework/conformance/kinds.h"
#include "framework/conformance/reference_views.h"
#include "framework/conformance/sample_scene.h"

namespace diorama::conformance {
namespace {

Frame rendered(Renderer& renderer, NodeId camera) {
  return renderer.render({camera, renderer.provides(), 1});
}

/// Every camera of the sample scene, with all channels.
std::string rendered_scene(const Subject& subject, Host& host) {
  const auto renderer = subject.make<Renderer>(host);
  const Scene scene = sample_scene();
  renderer->prepare(scene);
  std::string frames;
  for (const NodeId camera : cameras_of(scene)) {
    frames += fingerprint(rendered(*renderer, camera));
    for (const CoverageMask& mask : renderer->cover(camera, labelled_instances(scene), true)) {
      frames.append(mask.bits.begin(), mask.bits.end());
      frames.append(reinterpret_cast<const char*>(mask.distances.data()),
                    mask.distances.size() * sizeof(float));
    }
  }
  require_same(sample_scene(), scene, "changes the scene");
  return frames;
}

/// Where no leaf was hit, the other channels say so in the way of conventions.md.
void check_misses(const Frame& frame) {
  const Image<std::uint32_t>& leaves = frame.get(kLeafId);
  const auto check = [&]<class Pixel>(const Channel<Pixel>& channel, const auto& is_miss) {
    if (!frame.has(channel.name)) return;
    const auto pixels = frame.get(channel).pixels();
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      require(leaves.pixels()[i] != 0 || is_miss(pixels[i]),
              "channel '" + std::string(channel.name) + "' has a value where nothing was hit");
    }
  };
  const auto is_infinite = [](float value) { return std::isinf(value) && value > 0; };
  const auto is_zero = [](const auto& value) { return value.isZero(0); };
  check(kDistanceToCamera, is_infinite);
  check(kDistanceToImagePlane, is_infinite);
  check(kNormals, is_zero);
  check(kPosition, is_zero);
  check(kUv, is_zero);
  check(kAlbedo, is_zero);
  check(kMotion, is_zero);
}

/// The pixels of an instance are among those that it covers alone, at the distance of the picture.
void check_coverage(Renderer& renderer, const Scene& scene, const Frame& frame, NodeId camera) {
  const std::vector<LabelledInstance> instances = labelled_instances(scene);
  const std::vector<CoverageMask> masks = renderer.cover(camera, instances, true);
  const Image<std::uint32_t>& leaves = frame.get(kLeafId);
  for (std::size_t i = 0; i < instances.size(); ++i) {
    const std::string path = scene.path(instances[i].node);
    for (int y = 0; y < leaves.height(); ++y) {
      for (int x = 0; x < leaves.width(); ++x) {
        const auto& own = instances[i].leaves;
        const bool is_own = std::ranges::find(own, NodeId{leaves.at(x, y)}) != own.end();
        if (!is_own) continue;
        require(masks[i].covers(x, y), path + " is seen where cover() says it is not");
        if (!frame.has(kDistanceToCamera.name)) continue;
        const float seen = frame.get(kDistanceToCamera).at(x, y);
        const float covered = masks[i].distances[masks[i].index(x, y)];
        require(std::abs(seen - covered) <= 1e-4f * seen,
                path + " is seen at another distance than cover() says");
      }
    }
  }
}

void check_ids(const Subject& subject) {
  const auto renderer = subject.make<Renderer>();
  const Scene scene = sample_scene();
  renderer->prepare(scene);
  const NodeId camera = cameras_of(scene).front();
  const Frame frame = rendered(*renderer, camera);
  require(frame.has(kLeafId.name), "does not provide 'leaf_id', which all labels follow from");
  const NodeId hidden = scene.require("/Assets/hidden"), box = scene.require("/Assets/box");
  const auto ids = frame.get(kLeafId).pixels();
  require(std::ranges::find(ids, box.index) != ids.end(), "does not show a box before the camera");
  require(std::ranges::find(ids, hidden.index) == ids.end(), "shows a hidden node");
  check_misses(frame);
  check_coverage(*renderer, scene, frame, camera);
}

/// Compares one channel with what exact rays meet, where that is decided. A few pixels may differ
/// by rounding; what is wrong on purpose or by mistake differs in many.
class RendererComparison {
 public:
  RendererComparison(const ReferenceView& view, const Frame& frame) : view_(view), frame_(frame) {
    const ReferenceEye eye(view.scene, view.camera);
    for (int y = 0; y < frame.camera.height; ++y) {
      for (int x = 0; x < frame.camera.width; ++x) pixels_.push_back(eye.look(x, y));
    }
  }

  /// `is_right(pixel of the channel, what is met there)`; called where something is hit.
  template <class Pixel, class IsRight>
  void check(const Channel<Pixel>& channel, const char* hint, IsRight&& is_right) const {
    if (!frame_.has(channel.name)) return;
    const auto found = frame_.get(channel).pixels();
    int compared = 0;
    int wrong = 0;
    int first = -1;
    for (std::size_t i = 0; i < pixels_.size(); ++i) {
      if (!pixels_[i].is_decided || !is_compared(channel.name, pixels_[i])) continue;
      ++compared;
      if (is_right(found[i], pixels_[i])) continue;
      ++wrong;
      if (first < 0) first = int(i);
    }
    if (wrong * 200 <= compared) return;
    const int width = frame_.camera.width;
    require(false, "channel '" + std::string(channel.name) + "' is wrong in " +
                       std::to_string(wrong) + " of " + std::to_string(compared) +
                       " pixels before " + view_.name + ", the first at (" +
                       std::to_string(first % width) + ", " + std::to_string(first / width) +
                       "): " + hint);
  }

  void check_all() const {
    check(kLeafId, "rays go through pixels' centres, pixel (0, 0) is top left",
          [](std::uint32_t id, const ReferencePixel& met) {
            return id == (met.leaf ? met.leaf.index : 0);
          });
    const auto is_near = [](double found, double expected) {
      return std::abs(found - expected) <= 2e-3 * std::max(1.0, std::abs(expected));
    };
    check(kDistanceToCamera, "metres from the camera's centre along the ray",
          [&](float found, const ReferencePixel& met) { return is_near(found, met.distance); });
    check(kDistanceToImagePlane, "metres along the axis, not along the ray",
          [&](float found, const ReferencePixel& met) { return is_near(found, met.depth); });
    check(kNormals, "unit length, in world space, towards the camera",
          [](const Vec3f& found, const ReferencePixel& met) {
            return (found.cast<double>() - met.normal).norm() < 0.02;
          });
    check(kPosition, "metres, in world space", [](const Vec3f& found, const ReferencePixel& met) {
      return (found.cast<double>() - met.position).norm() < 5e-3;
    });
    check(kUv, "uv of the mesh", [](const Vec2f& found, const ReferencePixel& met) {
      return (found.cast<double>() - met.uv).norm() < 0.02;
    });
    check(kAlbedo, "linear base colour", [](const Vec3f& found, const ReferencePixel& met) {
      return (found - met.albedo).norm() < 0.02f;
    });
    check(kColor, "alpha is 255",
          [](const Rgba8& found, const ReferencePixel&) { return found[3] == 255; });
  }

  /// Every leaf has a colour of its own: the picture must follow the ids more than their mirror
  /// images.
  template <class Pixel, class Rgb>
  void check_orientation(const Channel<Pixel>& channel, Rgb&& rgb) const {
    if (!frame_.has(channel.name)) return;
    const Image<Pixel>& image = frame_.get(channel);
    const auto followed = [&](bool flips_x, bool flips_y) {
      return explained_share(image, flips_x, flips_y, rgb);
    };
    const double upright = followed(false, false);
    const std::pair<const char*, double> others[]{
        {"left and right are exchanged", followed(true, false)},
        {"top and bottom are exchanged", followed(false, true)},
        {"it is upside down", followed(true, true)}};
    for (const auto& [what, share] : others) {
      require(share <= upright + 0.1, "channel '" + std::string(channel.name) + "' looks as if " +
                                          what + " before " + view_.name);
    }
  }

 private:
  /// What a miss holds is another check's matter.
  static bool is_compared(std::string_view channel, const ReferencePixel& met) {
    return met.leaf || channel == kLeafId.name;
  }

  /// Share of the colours' variance that follows from the leaf seen, in [0, 1].
  template <class Pixel, class Rgb>
  double explained_share(const Image<Pixel>& image, bool flips_x, bool flips_y, Rgb& rgb) const {
    struct Group {
      Vec3 sum = Vec3::Zero();
      double count = 0.0;
    };
    std::map<NodeId, Group> groups;
    Group all;
    double squares = 0.0;
    const int width = image.width();
    const int height = image.height();
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const ReferencePixel& met = pixels_[std::size_t(y) * std::size_t(width) + std::size_t(x)];
        const Vec3 color = rgb(image.at(flips_x ? width - 1 - x : x, flips_y ? height - 1 - y : y));
        for (Group* group : {&groups[met.leaf], &all}) {
          group->sum += color;
          group->count += 1.0;
        }
        squares += color.squaredNorm();
      }
    }
    const Vec3 mean = all.sum / all.count;
    const double total = squares - all.count * mean.squaredNorm();
    double between = 0.0;
    for (const auto& [leaf, group] : groups) {
      between += group.count * (group.sum / group.count - mean).squaredNorm();
    }
    return total > 0.0 ? between / total : 0.0;
  }

  const ReferenceView& view_;
  const Frame& frame_;
  std::vector<ReferencePixel> pixels_;
};

void compare_with_rays(const Subject& subject) {
  for (const ReferenceView& view : reference_views()) {
    const auto renderer = subject.make<Renderer>();
    renderer->prepare(view.scene);
    const Frame frame = rendered(*renderer, view.camera);
    const RendererComparison comparison(view, frame);
    comparison.check_all();
    comparison.check_orientation(kColor, [](const Rgba8& c) { return Vec3(c[0], c[1], c[2]); });
    // Bright pixels would outweigh all others.
    comparison.check_orientation(kColorHdr, [](const Vec3f& c) {
      return Vec3(c.cast<double>().cwiseMax(0.0).cwiseMin(1e6).array().log1p());
    });
  }
}

/// Also beyond the image, as far as masks reach, where the lens says what is there.
void compare_coverage(const Subject& subject) {
  for (const ReferenceView& view : reference_views()) {
    const auto renderer = subject.make<Renderer>();
    renderer->prepare(view.scene);
    const std::vector<LabelledInstance> instances = labelled_instances(view.scene);
    const std::vector<CoverageMask> masks = renderer->cover(view.camera, instances, true);
    const Camera& camera = *view.scene[view.camera].camera;
    const bool is_pinhole = camera.lens == LensModel::Pinhole;
    const int margin_x = is_pinhole ? camera.width / 2 : 0;
    const int margin_y = is_pinhole ? camera.height / 2 : 0;
    for (std::size_t i = 0; i < instances.size(); ++i) {
      const std::string path = view.scene.path(instances[i].node);
      const ReferenceEye eye(view.scene, view.camera, &instances[i].leaves);
      int covered = 0;
      int wrong = 0;
      int far_off = 0;
      for (int y = -margin_y; y < camera.height + margin_y; ++y) {
        for (int x = -margin_x; x < camera.width + margin_x; ++x) {
          const ReferencePixel met = eye.look(x, y);
          if (!met.is_decided) continue;
          if (met.leaf) ++covered;
          const bool is_set = masks[i].covers(x, y);
          if (is_set != bool(met.leaf)) ++wrong;
          if (!is_set || !met.leaf) continue;
          const double distance = masks[i].distances[masks[i].index(x, y)];
          if (std::abs(distance - met.distance) > 2e-3 * std::max(1.0, met.distance)) ++far_off;
        }
      }
      require(wrong * 100 <= covered, "cover() is wrong in " + std::to_string(wrong) +
                                          " pixels of " + path + ", which covers " +
                                          std::to_string(covered) + ", before " + view.name);
      require(far_off * 100 <= covered,
              "cover() gives wrong distances for " + path + " before " + view.name);
    }
  }
}

/// One thing that may be another one in the next picture.
struct Change {
  const char* what;
  void (*make)(ReferenceView& view, NodeId node);
};

constexpr Change kChanges[]{
    {"a node moved",
     [](ReferenceView& view, NodeId node) {
       const Affine pose = view.scene[node].parent_from_node;
       view.scene.set_pose(node, Affine(Eigen::Translation3d(0.0, 0.3, 0.4)) * pose);
     }},
    {"a node was hidden",
     [](ReferenceView& view, NodeId node) { view.scene.edit(node).is_visible = false; }},
    {"a node got another mesh",
     [](ReferenceView& view, NodeId node) {
       // As many points as before.
       view.scene.edit(node).mesh = std::make_shared<const Mesh>(make_box({0.4, 0.7, 0.6}));
     }},
    {"a node got another material",
     [](ReferenceView& view, NodeId node) {
       auto paint = std::make_shared<Material>(*view.scene[node].materials.front());
       paint->base_color = Vec3f(0.9f, 0.1f, 0.7f);
       view.scene.edit(node).materials = {std::move(paint)};
     }},
    {"the camera got another lens",
     [](ReferenceView& view, NodeId) { view.scene.edit(view.camera).camera->fx = 61.0; }},
};

/// What one renderer drew before must not show in what it draws next.
void check_history(const Subject& subject) {
  const auto draw = [](Renderer& renderer, const ReferenceView& view) {
    renderer.prepare(view.scene);
    return fingerprint(rendered(renderer, view.camera));
  };
  const std::vector<ReferenceView> views = reference_views();
  const auto used = subject.make<Renderer>();
  for (const ReferenceView& view : views) draw(*used, view);
  require(draw(*used, views.front()) == draw(*subject.make<Renderer>(), views.front()),
          "draws a scene differently after others");
  for (const Change& change : kChanges) {
    std::vector<ReferenceView> fresh = reference_views();
    ReferenceView& changed = fresh.front();
    const auto still = subject.make<Renderer>();
    const std::string before = draw(*still, changed);
    const NodeId node = changed.scene.require("/Assets/low");
    const Affine pose = changed.scene[node].parent_from_node;
    const Node was = changed.scene[node];
    const Camera lens = *changed.scene[changed.camera].camera;
    change.make(changed, node);
    require(draw(*still, changed) == draw(*subject.make<Renderer>(), changed),
            std::string("does not see that ") + change.what + " since the last picture");
    changed.scene.set_pose(node, pose);
    Node& again = changed.scene.edit(node);
    again.is_visible = was.is_visible;
    again.mesh = was.mesh;
    again.materials = was.materials;
    changed.scene.edit(changed.camera).camera = lens;
    require(draw(*still, changed) == before,
            std::string("draws something else when ") + change.what + " and it was undone");
  }
}

}  // namespace

std::string renderer_output(const Subject& subject) {
  return rendered_scene(subject, subject.host);
}

void check_renderer(const CheckRun& run, const Subject& subject) {
  run.check("an empty scene gives every channel and is left as it was", [&] {
    const auto renderer = subject.make<Renderer>();
    Scene scene;
    const NodeId camera = scene.create(scene.root(), "camera");
    scene.edit(camera).camera = Camera::from_lens(19, 11, 24.0, 20.955);
    const std::string before = fingerprint(scene);
    require(!renderer->provides().empty(), "provides nothing");
    renderer->prepare(scene);
    const Frame frame = rendered(*renderer, camera);
    for (const std::string& channel : renderer->provides()) {
      require(frame.has(channel), "does not fill '" + channel + "', which it provides");
    }
    if (frame.has(kLeafId.name)) check_misses(frame);
    require(before == fingerprint(scene), "changes the scene");
  });
  run.check("ids, misses and coverage are as conventions.md has them", [&] { check_ids(subject); });
  run.check("channels are what exact rays meet", [&] { compare_with_rays(subject); });
  run.check("coverage is what exact rays meet", [&] { compare_coverage(subject); });
  run.check("pictures depend on the scene alone, not on pictures before",
            [&] { check_history(subject); });
  run.check("the same seed gives the same bytes for any number of threads, the scene stays", [&] {
    const std::string frames = rendered_scene(subject, subject.host);
    require(frames == rendered_scene(subject, subject.host), "differs the second time");
    require(frames == rendered_scene(subject, subject.single_threaded_host),
            "differs with one thread");
  });
  run.check("a second scene after the first one was destroyed is survived", [&] {
    const auto renderer = subject.make<Renderer>();
    for (int round = 0; round < 2; ++round) {
      const Scene scene = sample_scene(round);
      renderer->prepare(scene);
      rendered(*renderer, cameras_of(scene).front());
    }
  });
}

}  // namespace diorama::conformance
