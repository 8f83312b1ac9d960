// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/settling.h"

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <set>

#include "framework/host/node_content.h"

namespace diorama {
namespace {

/// So long must a thing move without getting anywhere.
constexpr double kJitterS = 1.5;

std::string number_text(const char* format, double number) {
  char text[64];
  std::snprintf(text, sizeof text, format, number);
  return text;
}

std::string visit_text(int visit) { return "visit " + std::to_string(visit + 1); }

std::vector<std::string> lines_of(const VisitReport& report) {
  std::vector<std::string> lines;
  const std::string front = visit_text(report.visit) + ": ";
  if (!report.rest_after_s) {
    lines.push_back(front + number_text("not at rest after %.2f s\n", report.simulated_s));
  }
  const auto tell = [&](const std::vector<Incident>& incidents, const char* what) {
    for (const Incident& incident : incidents) {
      lines.push_back(front + incident.path + " " + incident.why + what + "\n");
    }
  };
  tell(report.born_inside, "");
  tell(report.respawned, ", so it was placed anew");
  tell(report.dropped, ", so it was taken out");
  tell(report.unsettled, "");
  tell(report.cameras, "");
  return lines;
}

nlohmann::ordered_json as_json(const std::vector<Incident>& incidents, const char* name) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const Incident& incident : incidents) {
    list.push_back({{name, incident.path}, {"why", incident.why}});
  }
  return list;
}

nlohmann::ordered_json as_json(const ObjectAtEnd& object) {
  nlohmann::ordered_json json{{"object", object.path}, {"falls", object.falls}};
  if (const auto& place = object.before_last_step) {
    json["before_last_step"] = {place->x(), place->y(), place->z()};
  }
  return json;
}

nlohmann::ordered_json as_json(const PlacedNode& node) {
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column) {
      rows.push_back(node.parent_from_node.matrix()(row, column));
    }
  }
  return {{"node", node.path}, {"parent_from_node", rows}, {"visible", node.is_visible}};
}

nlohmann::ordered_json as_json(const std::vector<PlacedNode>& nodes) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const PlacedNode& node : nodes) list.push_back(as_json(node));
  return list;
}

/// What has left the room falls for ever and says nothing about the rest.
bool falls_in(const Room& room, const Scene& scene, NodeId object) {
  const auto& body = scene[object].rigid_body;
  return body && body->has_gravity && room.holds(scene, object);
}

/// Nodes with a mesh at or below them.
std::set<NodeId> nodes_with_shape(const Scene& scene) {
  std::set<NodeId> shaped;
  for (const NodeId id : scene.subtree(scene.root())) {
    if (!scene[id].mesh) continue;
    for (NodeId node = id; node != scene.root() && shaped.insert(node).second;) {
      node = scene[node].parent;
    }
  }
  return shaped;
}

}  // namespace

void SettleSummary::Worst::add(double its_value, const VisitReport& report) {
  if (visit >= 0 && its_value <= value) return;
  value = its_value;
  visit = report.visit;
  body = report.deepest_body;
}

void SettleSummary::add(const VisitReport& report) {
  constexpr std::int64_t kMostLines = 40;
  ++visit_count_;
  falling_ += report.falling_objects;
  outside_ += std::int64_t(report.left_room.size());
  if (report.rest_after_s) rest_after_s_.add(*report.rest_after_s, report);
  max_speed_.add(report.max_speed, report);
  max_penetration_m_.add(report.max_penetration_m, report);
  for (const std::string& line : lines_of(report)) {
    if (lines_++ < kMostLines) first_lines_ += line;
  }
}

std::string SettleSummary::text() const {
  if (visit_count_ == 0) return {};
  std::string text = "objects: " + std::to_string(falling_) + " falling over all visits, " +
                     std::to_string(outside_) + " left the room";
  const auto tell = [&](const char* front, double value, const Worst& worst,
                        const std::string& more) {
    text += number_text(front, value) + visit_text(worst.visit) + more + ")";
  };
  if (rest_after_s_.visit >= 0) {
    tell("; at rest after at most %.2f s (", rest_after_s_.value, rest_after_s_, "");
  }
  tell("; residual speed at most %.4f m/s (", max_speed_.value, max_speed_, "");
  const std::string& deepest = max_penetration_m_.body;
  tell(", deepest penetration %.2f mm (", max_penetration_m_.value * 1000.0, max_penetration_m_,
       deepest.empty() ? "" : ", " + deepest);
  text += "\n" + first_lines_;
  const auto named = std::int64_t(std::count(first_lines_.begin(), first_lines_.end(), '\n'));
  if (lines_ > named) {
    text += "... and " + std::to_string(lines_ - named) + " more, in settle/\n";
  }
  return text;
}

std::string settle_json(const VisitReport& report) {
  nlohmann::ordered_json json;
  json["visit"] = report.visit;
  json["environment"] = report.environment;
  json["falling_objects"] = report.falling_objects;
  json["simulated_s"] = report.simulated_s;
  json["rest_after_s"] = nullptr;
  if (report.rest_after_s) json["rest_after_s"] = *report.rest_after_s;
  json["max_speed_m_per_s"] = report.max_speed;
  json["max_penetration_m"] = report.max_penetration_m;
  json["deepest_body"] = report.deepest_body;
  json["left_room"] = report.left_room;
  json["born_inside"] = as_json(report.born_inside, "object");
  json["respawned"] = as_json(report.respawned, "object");
  json["dropped"] = as_json(report.dropped, "object");
  json["unsettled"] = as_json(report.unsettled, "object");
  json["blocked_cameras"] = as_json(report.cameras, "camera");
  json["step_seconds"] = report.step_s;
  json["objects"] = nlohmann::ordered_json::array();
  for (const ObjectAtEnd& object : report.objects) json["objects"].push_back(as_json(object));
  json["born"] = as_json(report.born);
  json["placed"] = as_json(report.placed);
  return json.dump(1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

Room::Room(const Scene& scene, NodeId environment) : box_(scene.world_bounds(environment)) {
  // Things lie on the outer face of the floor's slab at worst.
  constexpr double kMarginM = 0.01;
  box_.min.array() -= kMarginM;
  box_.max.array() += kMarginM;
  box_.max.z() = kInfinity;
}

bool Room::holds(const Scene& scene, NodeId node) const {
  if (!(box_.min.head<2>().array() <= box_.max.head<2>().array()).all()) return true;
  const Vec3 place = scene.world_from_node(node).translation();
  return (place.array() >= box_.min.array()).all() && (place.array() <= box_.max.array()).all();
}

double speed_of(const Scene& scene, NodeId object, const LastStep& last) {
  const auto& body = scene[object].rigid_body;
  double speed = body ? body->linear_velocity.norm() : 0.0;
  const auto before = last.before.find(object);
  if (before != last.before.end() && last.seconds > 0.0) {
    const Vec3 way = scene.world_from_node(object).translation() - before->second.translation();
    speed = std::max(speed, way.norm() / last.seconds);
  }
  return speed;
}

double fastest_falling(const Scene& scene, const Room& room, const std::vector<NodeId>& objects,
                       const LastStep& last) {
  double fastest = 0.0;
  for (const NodeId object : objects) {
    if (falls_in(room, scene, object)) fastest = std::max(fastest, speed_of(scene, object, last));
  }
  return fastest;
}

void JitterWatch::look(const Scene& scene, const Room& room, const std::vector<NodeId>& objects,
                       const LastStep& last, double rest_speed, double now_s) {
  for (const NodeId object : objects) {
    if (!falls_in(room, scene, object)) continue;
    const double speed = speed_of(scene, object, last);
    if (speed <= rest_speed) continue;
    std::deque<Sight>& sights = moving_[object];
    if (!sights.empty() && now_s - sights.back().at_s >= kRestS) sights.clear();
    const double way = sights.empty() ? 0.0 : speed * (now_s - sights.back().at_s);
    sights.push_back({now_s, scene.world_from_node(object).translation(), way});
    while (sights.size() > 1 && now_s - sights[1].at_s >= kJitterS) sights.pop_front();
  }
}

bool JitterWatch::gets_nowhere(const std::deque<Sight>& sights) {
  constexpr double kPlaceM = 0.02;
  constexpr double kShareOfWay = 0.2;
  if (sights.back().at_s - sights.front().at_s < kJitterS) return false;
  Aabb box;
  double way = 0.0;
  for (const Sight& sight : sights) {
    box.add(sight.place);
    way += sight.way_m;
  }
  return box.size().norm() <= std::max(kPlaceM, kShareOfWay * way);
}

bool JitterWatch::only_jitter_is_left(double now_s) const {
  bool moves = false;
  for (const auto& [object, sights] : moving_) {
    if (now_s - sights.back().at_s >= kRestS) continue;
    if (!gets_nowhere(sights)) return false;
    moves = true;
  }
  return moves;
}

std::vector<NodeId> PlaceWatch::settled_since(const Scene& scene, const Room& room,
                                              const std::vector<NodeId>& objects) {
  constexpr double kNearM = 0.02;
  constexpr double kSameM = 0.001;
  std::vector<NodeId> settled;
  for (const NodeId object : objects) {
    if (!falls_in(room, scene, object)) continue;
    const Vec3 place = scene.world_from_node(object).translation();
    const auto [it, is_new] = places_.try_emplace(object, Places{place});
    Places& places = it->second;
    const bool is_near = !is_new && (place - places.last).norm() < kNearM;
    places.last = place;
    if (!is_near || (place - places.named).norm() < kSameM) continue;
    places.named = place;
    settled.push_back(object);
  }
  return settled;
}

SceneAsSetUp::SceneAsSetUp(const Scene& scene) {
  for (const NodeId node : nodes_with_shape(scene)) {
    nodes_.emplace(node, std::pair(scene[node].parent_from_node.matrix(), scene[node].is_visible));
  }
}

std::vector<PlacedNode> SceneAsSetUp::placed_since(const Scene& scene) const {
  const std::set<NodeId> shaped = nodes_with_shape(scene);
  std::vector<PlacedNode> placed;
  for (const NodeId id : scene.subtree(scene.root())) {
    if (!shaped.contains(id)) continue;
    const Node& node = scene[id];
    const auto known = nodes_.find(id);
    if (known != nodes_.end() && known->second.first == node.parent_from_node.matrix() &&
        known->second.second == node.is_visible) {
      continue;
    }
    placed.push_back({scene.path(id), node.parent_from_node, node.is_visible});
  }
  return placed;
}

SavedNodes::SavedNodes(const Scene& scene, const std::vector<NodeId>& without) {
  std::set<NodeId> left_out;
  for (const NodeId top : without) {
    for (const NodeId node : scene.subtree(top)) left_out.insert(node);
  }
  for (const NodeId node : scene.subtree(scene.root())) {
    if (node != scene.root() && !left_out.contains(node)) nodes_.emplace_back(node, scene[node]);
  }
}

void SavedNodes::restore(Scene& scene) const {
  for (const auto& [node, saved] : nodes_) {
    scene.set_pose(node, saved.parent_from_node);
    copy_content(saved, scene.edit(node));
  }
}

void SavedNodes::restore_poses(Scene& scene) const {
  for (const auto& [node, saved] : nodes_) {
    if (scene[node].parent_from_node.matrix() != saved.parent_from_node.matrix()) {
      scene.set_pose(node, saved.parent_from_node);
    }
    const auto& was = saved.rigid_body;
    const auto& body = scene[node].rigid_body;
    if (!was || !body) continue;
    if (body->linear_velocity == was->linear_velocity &&
        body->angular_velocity == was->angular_velocity) {
      continue;
    }
    scene.set_velocity(node, was->linear_velocity, was->angular_velocity);
  }
}

}  // namespace diorama
