// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "diorama/host.h"
#include "diorama/renderer.h"
#include "framework/pipeline/capture_plan.h"
#include "framework/pipeline/settling.h"
#include "framework/pipeline/view_check.h"
#include "framework/pipeline/view_report.h"

namespace diorama {

/// Poses and lenses of some nodes, and of those below them, at one moment.
class SavedView {
 public:
  SavedView() = default;
  SavedView(const Scene& scene, const std::vector<NodeId>& tops);
  /// Touches what differs only.
  void restore(Scene& scene) const;
  bool is_of(const Scene& scene) const;

 private:
  struct Part {
    NodeId node;
    Affine parent_from_node;
    std::optional<Camera> camera;
  };
  std::vector<Part> parts_;
};

/// The numbers of a capture's views under one rule, over the whole dataset: views of a rule are
/// counted in capture order, cameras within.
std::uint64_t view_number(const Job& job, const ViewRule& rule, int capture, std::size_t camera,
                          std::size_t cameras);

/// Nodes with few of a camera's pixels, which views are judged by before all of them are looked at.
struct SmallCameras {
  /// By camera; rays of fewer and of more of its pixels, as kGridSteps says.
  std::map<NodeId, std::vector<NodeId>> of_labels;
  std::map<NodeId, NodeId> of_light;  ///< The same view in larger pixels, for the brightness.
};

/// Makes them for the cameras whose views rules speak of.
SmallCameras create_small_cameras(const Job& job, const std::vector<NodeId>& cameras, Scene& scene);

/// Draws the views of one capture anew until they hold, each camera (or rig) by itself. Everything
/// else stays as the first draw left it.
class ViewSearch {
 public:
  struct Setting {
    const Job& job;
    const JobStreams& streams;
    Host& host;
    Renderer& renderer;
    Scene& scene;
    const std::vector<NodeId>& cameras;  ///< All of the visit, in job order.
    const SmallCameras& small_cameras;
    PlannedCapture capture;
    bool is_passed = false;   ///< It is not made now: whoever made it has logged what it lacks.
    bool can_redraw = false;  ///< Some randomizer places cameras at this moment.
    /// Lets these randomizers draw once more, from the stream of that number.
    std::function<void(int number)> redraw;
  };

  explicit ViewSearch(Setting setting);
  ~ViewSearch();

  /// Leaves the cameras at views that hold, or that came nearest. Throws Error(Config) at a limit
  /// at which the job is to stop, and what the renderer throws.
  void run();
  /// Rules speak of some camera.
  bool judges_views() const { return !groups_.empty(); }
  /// Some view is known only once refuse_pictures() has judged it.
  bool needs_pictures() const;
  /// Judges the finished pictures of the cameras, which is what takes light. Frames whose view has
  /// to be drawn anew by run() are named by their index.
  std::vector<std::size_t> refuse_pictures(const std::vector<Frame>& frames);
  /// Wall time that run() spent on views that were refused.
  double refused_s() const { return refused_s_; }
  /// Per camera that rules speak of.
  std::vector<ViewOutcome> outcomes() const;

 private:
  struct Group;
  void make_groups();
  WantedView wanted_view(const ViewRule& rule, std::size_t camera);
  void judge(const std::vector<Group*>& pending);
  void settle(Group& group, const ViewVerdict& verdict);
  void end_at_limit(Group& group);
  void draw_anew(const std::vector<Group*>& pending);
  ViewVerdict by_place(const Group& group) const;
  void place_small_cameras(const Group& group);
  ViewVerdict by_grid(const Group& group, std::size_t grid);
  ViewVerdict by_labels(const Group& group);
  ViewVerdict by_labels_of(NodeId camera, const std::vector<WantedView>& wanted, int step);
  ViewVerdict by_light(const Group& group);
  Frame render(NodeId camera, std::string_view channel);
  void prepare();

  Setting setting_;
  std::vector<const ViewRule*> rules_;
  std::vector<Group> groups_;
  std::optional<ViewCheck> check_;
  std::optional<SavedNodes> others_;
  int draws_ = 0;
  double refused_s_ = 0.0;
};

}  // namespace diorama
