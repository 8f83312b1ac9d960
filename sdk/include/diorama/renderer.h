// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "diorama/component.h"
#include "diorama/frame.h"
#include "diorama/scene.h"

namespace diorama {

struct RenderRequest {
  NodeId camera;
  NameSet channels;
  std::uint64_t seed = 0;  ///< Noise pattern; same seed, same bytes, whatever the thread count.
};

/// What the last preparation and picture took.
struct RenderReport {
  std::uint64_t paths = 0;  ///< Light paths that began at the camera.
  std::uint64_t rays = 0;   ///< Of these paths, those to lights included.
  /// Wall time by phase in working order: "ray tracing structure", "paths", "denoising".
  std::vector<std::pair<std::string, double>> seconds;
};

/// Points of surfaces, in single precision, lie so far off these: metres at a distance of so many.
inline double sight_margin(double distance_m) { return 1e-4 + 2e-4 * distance_m; }

/// Turns a scene into channels. Called by one thread at a time; may use Host::parallel_for.
class DIORAMA_SDK_API Renderer : public Component {
 public:
  static constexpr ComponentKind kKind = ComponentKind::Renderer;

  ~Renderer() override;

  /// The channels that it can fill.
  virtual NameSet provides() const = 0;
  /// For `diorama bench`; empty unless a renderer says more.
  virtual RenderReport report() const;
  /// Memory that it holds at most while it makes one picture of this camera with these channels,
  /// beside the scene and the channels themselves, in bytes; for the dry run. 0 unless a renderer
  /// says more.
  virtual std::size_t working_bytes(const Camera& camera, const NameSet& channels) const;

  /// Takes in the scene as it is now. Call after every change and before render(); the scene must
  /// stay as it is and alive until the last render() of this preparation.
  void prepare(const Scene& scene);

  /// Checks the request, renders, and checks that every channel is there in the right size. Fills
  /// the camera fields, leaf_paths and channels of the frame; instances are the host's.
  Frame render(const RenderRequest& request);

  /// Per instance, the pixels that it covers for this camera with nothing else in the scene, and,
  /// where asked for, at which distance.
  std::vector<CoverageMask> cover(NodeId camera, std::span<const LabelledInstance> instances,
                                  bool with_distances = false);

  /// 1 for points of the world from which nothing stands between them and the camera's centre that
  /// label channels show, 0 for others. How near and far the camera sees is not asked.
  std::vector<std::uint8_t> sees(NodeId camera, std::span<const Vec3> points_world);

 private:
  virtual void do_prepare(const Scene& scene) = 0;
  virtual Frame do_render(const Scene& scene, const RenderRequest& request) = 0;
  virtual std::vector<CoverageMask> do_cover(const Scene& scene, NodeId camera,
                                             std::span<const LabelledInstance> instances,
                                             bool with_distances) = 0;
  /// By triangles alone, whatever their opacity, unless a renderer does better. What is nearer to a
  /// point than sight_margin() does not hide it.
  virtual std::vector<std::uint8_t> do_see(const Scene& scene, NodeId camera,
                                           std::span<const Vec3> points_world);
  const Scene* scene_ = nullptr;
};

}  // namespace diorama
