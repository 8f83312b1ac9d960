// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "diorama/host.h"
#include "diorama/loader.h"
#include "diorama/scene.h"
#include "framework/pipeline/capture_plan.h"
#include "framework/pipeline/job.h"

/// The steps that turn an empty scene into the start of a visit. Main thread only.
namespace diorama {

/// Loads an environment below /Environment. Assets of `loader`'s own schemes are loaded by it with
/// the job's parameters, files by whoever claims them. Returns the node that stands for the
/// environment.
NodeId load_environment(const std::string& asset, const ComponentConfig& entry, Loader& loader,
                        Scene& scene, Host& host);

/// Whether some part of the path goes like the text, whose '*' stand for anything within a name.
bool holds_text(std::string_view path, std::string_view text);

/// Nodes below the environment that are visible, and that a rule with these texts hides.
std::vector<NodeId> nodes_to_hide(const std::vector<std::string>& texts, NodeId environment,
                                  const Scene& scene);

/// Hides, adds colliders, finds the working area and builds the walls round it. What matches
/// nothing does nothing: EnvironmentPatterns tells of it. Returns the centre of the working area in
/// the world; the origin when there is none.
Vec3 apply_environment_rules(const EnvironmentRules& rules, bool debug, NodeId environment,
                             Scene& scene, Host& host);

/// Spawns the planned objects at the origin, with labels, colliders and rigid bodies. What an asset
/// itself says about labels is dropped; its mass is kept. Returns their nodes in plan order.
std::vector<NodeId> spawn_objects(const std::vector<PlannedObject>& objects, const Job& job,
                                  Scene& scene, Host& host);

void create_lights(const std::vector<LightGroup>& groups, Scene& scene, Host& host);

/// Returns the cameras in job order, members of rigs below the nodes of these.
std::vector<NodeId> create_cameras(const std::vector<CameraGroup>& groups, Scene& scene);

/// Hidden spheres round cameras, for the physics alone; they stay until somebody erases them.
std::vector<NodeId> create_camera_spheres(const std::vector<NodeId>& cameras, double radius_m,
                                          Scene& scene);

/// A camera straight above the working area, looking down, +y of the world up in the picture.
NodeId create_overview_camera(const Vec3& working_area_world, Scene& scene);

}  // namespace diorama
