// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "diorama/renderer.h"
#include "diorama/scene.h"
#include "framework/pipeline/view_rules.h"

namespace diorama {

/// What one camera has to show: a rule, and per quota of it the bin that this view has to fall
/// into; nothing for a quota that the scene cannot meet.
struct WantedView {
  const ViewRule* rule = nullptr;
  std::vector<std::optional<std::size_t>> bins;
};

/// What became of a view.
struct ViewVerdict {
  std::vector<std::string> failed;  ///< "seen.truncation", "seen.quotas.label"; empty: it holds.
  double shortfall = 0.0;           ///< How far from holding it is; compares views of one camera.
  bool holds() const { return failed.empty(); }
  void add(const ViewVerdict& other);
};

/// Judges views of a scene in which nothing but the cameras moves meanwhile.
class ViewCheck {
 public:
  /// `rules` outlive this. Bounds and labels are those of now.
  ViewCheck(const Scene& scene, const std::vector<const ViewRule*>& rules);
  ~ViewCheck();
  ViewCheck(ViewCheck&&) noexcept;
  ViewCheck& operator=(ViewCheck&&) noexcept;

  /// The rule has as many targets in the scene as it wants to see.
  bool has_targets(const ViewRule& rule) const;
  /// One of the rule's targets has this label.
  bool has_label(const ViewRule& rule, const std::string& label) const;

  /// By where things are, without a ray: what fails here fails by_labels(), too.
  ViewVerdict by_place(const Scene& scene, NodeId camera, const WantedView& wanted) const;

  /// Of a camera: `render` gives kLeafId, `cover` is Renderer::cover().
  struct Labels {
    std::function<Image<std::uint32_t>()> render;
    std::function<std::vector<CoverageMask>(std::span<const LabelledInstance>)> cover;
    /// How many pixels of the picture lie from one pixel of these labels to the next, across and
    /// down. With more than one, what is out of a condition by a clear margin fails, and all else
    /// holds.
    int step = 1;
  };
  /// All but the brightness. `camera` is the one of the labels.
  ViewVerdict by_labels(const Scene& scene, NodeId camera, const std::vector<WantedView>& wanted,
                        const Labels& labels) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// By the mean of a picture, 0 to 1.
ViewVerdict judge_brightness(const ViewRule& rule, const Image<Rgba8>& picture);

}  // namespace diorama
