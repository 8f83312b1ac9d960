// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "diorama/math.h"
#include "diorama/scene.h"
#include "framework/annotators/motion.h"

/// How the objects of a visit come to rest, and what becomes of those that do not stay in the room.
namespace diorama {

/// What happened to a thing of a visit.
struct Incident {
  std::string path;
  std::string why;  ///< Follows the path: "left the room", "hangs in the air".
};

/// An object as the last captures of a visit show it.
struct ObjectAtEnd {
  std::string path;
  bool falls = false;  ///< Gravity acts on it.
  /// Where it was one step of the simulation earlier, world; nothing: it was placed since.
  std::optional<Vec3> before_last_step;
};

/// A node that is not as loading the environment and the objects leaves it.
struct PlacedNode {
  std::string path;
  Affine parent_from_node = Affine::Identity();
  bool is_visible = true;
};

/// How the objects of one visit ended.
struct VisitReport {
  int visit = 0;
  std::string environment;
  int falling_objects = 0;
  double simulated_s = 0.0;
  /// Simulated time after which no falling object in the room moved faster than the job's
  /// `settle.rest_speed`; nothing: one still did.
  std::optional<double> rest_after_s;
  double max_speed = 0.0;          ///< m/s, of falling objects in the room, at the end.
  double max_penetration_m = 0.0;  ///< At the end of the visit.
  std::string deepest_body;
  std::vector<std::string> left_room;  ///< Paths of objects outside the environment's box.
  std::vector<Incident> born_inside;   ///< Where the moment "environment" put them.
  std::vector<Incident> respawned;     ///< Once per time.
  std::vector<Incident> dropped;       ///< Objects that were taken out.
  std::vector<Incident> unsettled;     ///< Objects that the last captures show all the same.
  std::vector<Incident> cameras;       ///< Blocked ones, once per capture.
  double step_s = 0.0;                 ///< Of the simulation; 0 without one.
  std::vector<ObjectAtEnd> objects;    ///< Those that are there.
  std::vector<PlacedNode> born;        ///< Where the moment "environment" put things.
  std::vector<PlacedNode> placed;      ///< At the end: what has a mesh, or stands above one.
};

/// As JSON text with a newline at its end.
std::string settle_json(const VisitReport& report);

/// For the end of a run: the worst of all visits, and what did not stay where it should. Takes as
/// much memory for many visits as for some; settle/ has everything.
class SettleSummary {
 public:
  /// Of equally bad visits the first counts.
  void add(const VisitReport& report);
  int visit_count() const { return visit_count_; }
  /// Lines that end with a newline; nothing without visits.
  std::string text() const;

 private:
  struct Worst {
    double value = 0.0;
    int visit = -1;  ///< Below 0: none yet.
    std::string body;

    void add(double its_value, const VisitReport& report);
  };

  int visit_count_ = 0;
  std::int64_t falling_ = 0;
  std::int64_t outside_ = 0;
  Worst rest_after_s_;  ///< Of visits that came to rest.
  Worst max_speed_;
  Worst max_penetration_m_;
  std::string first_lines_;
  std::int64_t lines_ = 0;
};

/// The space that an environment takes. It is open above, as rooms may have no roof.
class Room {
 public:
  Room(const Scene& scene, NodeId environment);
  /// Whether the node's place lies in the room; always true when the environment has no meshes.
  bool holds(const Scene& scene, NodeId node) const;

 private:
  Aabb box_;
};

/// The last step of a simulation.
struct LastStep {
  const BodyPoses& before;  ///< Where bodies were; those that were placed since are not among them.
  double seconds = 0.0;     ///< 0: none was taken.
};

/// How fast an object is seen to move, in m/s: by its velocity, or by how far the last step took it
/// if that is more, as engines push bodies out of each other without giving them a velocity.
double speed_of(const Scene& scene, NodeId object, const LastStep& last);

/// Slower than the job's `settle.rest_speed` for so long is at rest: at its highest point a thing
/// is slow as well.
inline constexpr double kRestS = 0.25;

/// Highest speed, in m/s, of those objects in the room that gravity acts on; 0 without any.
double fastest_falling(const Scene& scene, const Room& room, const std::vector<NodeId>& objects,
                       const LastStep& last);

/// Tells things on their way to rest from those that jitter: engines push what is wedged to and fro
/// for as long as they are asked to.
class JitterWatch {
 public:
  /// Looks at the objects at a moment of the simulation; moments come in their order. What is
  /// faster than `rest_speed` moves.
  void look(const Scene& scene, const Room& room, const std::vector<NodeId>& objects,
            const LastStep& last, double rest_speed, double now_s);
  /// Whether something moved in the last quarter of a second, and all that did has been doing so
  /// for a second and a half and got nowhere: the box of its places in that time measures 2 cm, or
  /// a fifth of its way if that is more.
  bool only_jitter_is_left(double now_s) const;

 private:
  /// Where a thing was seen moving.
  struct Sight {
    double at_s = 0.0;
    Vec3 place;          ///< World.
    double way_m = 0.0;  ///< Since the last one.
  };
  static bool gets_nowhere(const std::deque<Sight>& sights);
  std::map<NodeId, std::deque<Sight>> moving_;  ///< The last seconds, without rest.
};

/// Tells which objects have come to a place where it can be asked whether they are stuck.
class PlaceWatch {
 public:
  /// Those that fall, in the room, are less than 2 cm from where the last call found them, and were
  /// not named at that place before.
  std::vector<NodeId> settled_since(const Scene& scene, const Room& room,
                                    const std::vector<NodeId>& objects);

 private:
  struct Places {
    Vec3 last;  ///< World.
    Vec3 named = Vec3::Constant(kInfinity);
  };
  std::map<NodeId, Places> places_;
};

/// Where everything with a mesh stood, and whether it was visible, when a visit had been set up.
class SceneAsSetUp {
 public:
  SceneAsSetUp() = default;
  explicit SceneAsSetUp(const Scene& scene);
  /// What differs now, and what has come, in the order of the tree.
  std::vector<PlacedNode> placed_since(const Scene& scene) const;

 private:
  std::map<NodeId, std::pair<Mat4, bool>> nodes_;
};

/// What every node but some was like at one moment.
class SavedNodes {
 public:
  /// Saves all nodes outside the subtrees of `without`.
  SavedNodes(const Scene& scene, const std::vector<NodeId>& without);
  void restore(Scene& scene) const;
  /// Enough when no shape has changed since; touches only what moved.
  void restore_poses(Scene& scene) const;

 private:
  std::vector<std::pair<NodeId, Node>> nodes_;
};

}  // namespace diorama
