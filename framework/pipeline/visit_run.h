// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "diorama/host.h"
#include "diorama/scene.h"
#include "framework/annotators/flow.h"
#include "framework/annotators/motion.h"
#include "framework/pipeline/capture_plan.h"
#include "framework/pipeline/clip_track.h"
#include "framework/pipeline/environment_patterns.h"
#include "framework/pipeline/job.h"
#include "framework/pipeline/job_components.h"
#include "framework/pipeline/physics_view.h"
#include "framework/pipeline/settle_check.h"
#include "framework/pipeline/settling.h"
#include "framework/pipeline/view_report.h"
#include "framework/pipeline/view_search.h"
#include "framework/pipeline/writer_queue.h"

namespace diorama {

/// The run was asked to stop; what is on disk can be resumed.
class Interrupted final : public std::exception {
 public:
  ~Interrupted() override;
  const char* what() const noexcept override { return "interrupted"; }
};

/// What a visit leaves beside its captures.
struct VisitResult {
  int captures = 0;
  std::vector<VisitReport> reports;  ///< None when the visit was cut short by the end of the job.
  int respawned = 0;                 ///< Objects that had left the room and were placed anew.
  std::vector<std::pair<int, std::vector<ViewOutcome>>> views;  ///< By capture.
  std::int64_t refused = 0;                                     ///< Draws of all these views.
  std::map<std::string, double> seconds;                        ///< Phase to wall time.
};

/// One pass through one environment, in a scene of its own and by one thread. The source reads in
/// the order in which things happen.
class VisitRun {
 public:
  struct Setting {
    const Job& job;
    const CapturePlan& plan;
    const JobStreams& streams;
    const JobComponents& shared;
    EnvironmentPatterns& environment_patterns;
    VisitComponents& components;  ///< No other visit's meanwhile.
    Host& host;
    std::function<bool(int capture)> is_needed;
    std::function<void()> stop_if_asked;  ///< Throws Interrupted or Stopped.
    /// Called before each capture is made; throws when it cannot be written.
    std::function<void()> before_capture;
    /// Takes finished captures in planned order; `result` is that of the visit so far.
    std::function<void(PendingCapture, const VisitResult& result)> hand_over;
  };

  VisitRun(Setting setting, const PlannedVisit& planned);
  ~VisitRun();

  /// Throws what components throw, Interrupted and Stopped.
  VisitResult run();

 private:
  struct Draw;
  void set_up();
  void show_other_environments(const EnvironmentPatterns::Look& look);
  void randomize(const std::string& moment, int number, int capture,
                 const std::optional<ClipFrame>& clip = {});
  std::vector<std::size_t> call_randomizers(const std::string& moment, int number, int capture,
                                            const Draw& draw,
                                            const std::optional<ClipFrame>& clip = {});
  LastStep last_step() const { return {before_last_step_, last_step_s_}; }
  void simulate(const TimelineStep& step);
  std::vector<Flaw> advance(const TimelineStep& step);
  std::vector<Flaw> unsettled(const TimelineStep& step) const;
  void respawn(const std::vector<Flaw>& flaws);
  void drop(const std::vector<Flaw>& flaws);
  void reset_physics();
  void take_captures(const TimelineStep& step);
  void record(const TimelineStep& step);
  void play(const PlannedCapture& first, const ClipFrame& at);
  void call_players(const PlannedCapture& first, const ClipFrame& at,
                    void (Randomizer::*show)(Scene&, const ClipFrame&));
  void measure_flows(const std::optional<ClipFrame>& clip, std::vector<Frame>& frames);
  FlowMeter::NodeThere nodes_in(int frame) const;
  void set_motion(const std::optional<ClipFrame>& clip, Frame& frame);
  void take_or_pass(const PlannedCapture& planned);
  void take(const PlannedCapture& planned);
  ViewSearch view_search(const PlannedCapture& planned, bool is_passed = false);
  void choose_views(ViewSearch& search);
  void note_blocked_cameras();
  std::vector<Frame> take_frames(const PlannedCapture& planned, ViewSearch& search);
  void prepare_renderer();
  Frame make_frame(std::size_t camera, const PlannedCapture& planned);
  void measure_coverage(NodeId camera, Frame& frame);
  Image<Rgba8> make_overview(int capture);
  VisitReport make_report() const;

  Setting setting_;
  const Job& job_;
  VisitComponents& components_;
  Host& host_;
  PlannedVisit planned_;
  VisitResult result_;

  Scene scene_;
  NodeId environment_;
  Vec3 working_area_world_ = Vec3::Zero();
  std::vector<NodeId> objects_;
  std::vector<NodeId> cameras_;
  SceneAsSetUp as_set_up_;
  HiddenNodes hidden_;
  BodyPoses before_last_step_;  ///< Empty when nothing moved by itself since it was placed.
  double last_step_s_ = 0.0;    ///< Length of that step; 0: none was taken.
  ClipTrack track_;             ///< Of the clip that is being taken.
  PlayWatch watch_;             ///< Over those that play it.
  NodeId overview_;             ///< Null unless this visit makes an overview picture.
  SmallCameras small_cameras_;
  /// Randomizers that placed cameras at the last moment.
  std::vector<std::size_t> camera_randomizers_;
  int next_capture_ = 0;  ///< Of the visit's.
  std::map<std::string, int> events_;
  int simulations_to_come_ = 0;  ///< Steps of the timeline that let things move.
  double simulated_s_ = 0.0;
  double moving_until_s_ = 0.0;  ///< When something in the room was last seen moving.
  int redraws_ = 0;              ///< Streams that placed objects anew so far.
  VisitReport report_;           ///< What happened so far.
};

}  // namespace diorama
