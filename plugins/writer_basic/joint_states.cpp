// SPDX-License-Identifier: Apache-2.0
#include "writer_basic/joint_states.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>

namespace diorama {
namespace {

constexpr std::array kKindWords{"fixed", "revolute", "prismatic"};

/// JSON has no infinity.
Json limit_json(double limit) { return std::isfinite(limit) ? Json(limit) : Json(); }

double limit_from(const Json& json, double none) {
  return json.is_null() ? none : json.get<double>();
}

}  // namespace

Json joint_states_json(const Frame& frame) {
  Json list = Json::array();
  for (const JointState& state : frame.joints) {
    Json entry = Json::object();
    entry["name"] = state.path.substr(state.path.rfind('/') + 1);
    entry["prim_path"] = state.path;
    entry["kind"] = kKindWords[std::size_t(state.kind)];
    entry["parent_prim_path"] = state.parent_path;
    entry["child_prim_path"] = state.child_path;
    entry["position"] = state.position;
    entry["lower_limit"] = limit_json(state.lower);
    entry["upper_limit"] = limit_json(state.upper);
    list.push_back(std::move(entry));
  }
  return Json{{"joints", std::move(list)}};
}

std::vector<JointState> joint_states_from(const Json& json) {
  std::vector<JointState> states;
  for (const Json& entry : json.at("joints")) {
    JointState state;
    state.path = entry.at("prim_path").get<std::string>();
    const auto word = entry.at("kind").get<std::string>();
    const auto kind = std::find(kKindWords.begin(), kKindWords.end(), word);
    if (kind == kKindWords.end()) throw std::runtime_error("a joint is of no known kind");
    state.kind = JointKind(kind - kKindWords.begin());
    state.parent_path = entry.at("parent_prim_path").get<std::string>();
    state.child_path = entry.at("child_prim_path").get<std::string>();
    state.position = entry.at("position").get<double>();
    state.lower = limit_from(entry.at("lower_limit"), -kInfinity);
    state.upper = limit_from(entry.at("upper_limit"), kInfinity);
    if (!std::isfinite(state.position) || !(state.lower <= state.upper)) {
      throw std::runtime_error("numbers of joint " + state.path + " cannot be");
    }
    states.push_back(std::move(state));
  }
  return states;
}

}  // namespace diorama
