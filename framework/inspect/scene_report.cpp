// SPDX-License-Identifier: Apache-2.0
#include "framework/inspect/scene_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <tuple>

#include "framework/pipeline/lamps.h"

namespace diorama {
namespace {

const char* light_kind_name(LightKind kind) {
  switch (kind) {
    case LightKind::Sphere:
      return "sphere";
    case LightKind::Rect:
      return "rect";
    case LightKind::Disk:
      return "disk";
    case LightKind::Distant:
      return "distant";
    case LightKind::Dome:
      return "dome";
  }
  return "unknown";
}

const char* joint_kind_name(JointKind kind) {
  switch (kind) {
    case JointKind::Fixed:
      return "fixed";
    case JointKind::Revolute:
      return "revolute";
    case JointKind::Prismatic:
      return "prismatic";
  }
  return "unknown";
}

std::string describe_node(const Node& node) {
  std::vector<std::string> parts;
  if (node.mesh) {
    parts.push_back(fmt::format("mesh, {} triangles", node.mesh->triangles.size()));
  }
  if (node.light) parts.push_back(fmt::format("{} light", light_kind_name(node.light->kind)));
  if (node.camera) {
    parts.push_back(fmt::format("camera {}x{}", node.camera->width, node.camera->height));
  }
  if (node.rigid_body) parts.push_back(fmt::format("body {:g} kg", node.rigid_body->mass_kg));
  if (node.joint) parts.push_back(fmt::format("{} joint", joint_kind_name(node.joint->kind)));
  if (node.animation) {
    parts.push_back(
        fmt::format("moves from {:g} to {:g} s", node.animation->start_s, node.animation->end_s));
  }
  for (const auto& [taxonomy, label] : node.labels) {
    parts.push_back(fmt::format("{}={}", taxonomy, label));
  }
  return fmt::format("{}", fmt::join(parts, ", "));
}

std::array<const TextureInput*, 6> texture_inputs(const Material& material) {
  return {&material.base_color_texture, &material.metallic_texture, &material.roughness_texture,
          &material.normal_texture,     &material.opacity_texture,  &material.emission_texture};
}

std::vector<const Texture*> textures_of(const Material& material) {
  std::vector<const Texture*> found;
  for (const TextureInput* input : texture_inputs(material)) {
    if (!*input) continue;
    const Texture* texture = input->texture.get();
    if (std::find(found.begin(), found.end(), texture) == found.end()) found.push_back(texture);
  }
  return found;
}

/// Counts what several nodes may share.
struct Shared {
  std::set<const Mesh*> meshes;
  std::set<const Texture*> textures;
  std::map<const Material*, std::size_t> users;
};

void add_node(const Scene& scene, NodeId id, SceneReport& report, Shared& shared) {
  const Node& node = scene[id];
  ++report.nodes;
  if (node.mesh) {
    ++report.meshes;
    report.triangles += node.mesh->triangles.size();
    if (shared.meshes.insert(node.mesh.get()).second) {
      report.unique_triangles += node.mesh->triangles.size();
    }
  }
  for (const auto& material : node.materials) {
    if (!material) continue;
    ++shared.users[material.get()];
    for (const Texture* texture : textures_of(*material)) shared.textures.insert(texture);
  }
  if (node.light) {
    report.lights.push_back({scene.path(id), light_kind_name(node.light->kind), node.light->color,
                             lamp_lux(scene, id)});
  }
  report.cameras += node.camera ? 1 : 0;
  report.rigid_bodies += node.rigid_body ? 1 : 0;
  report.labelled += node.labels.empty() ? 0 : 1;
}

void add_tree(const Scene& scene, NodeId id, int depth, SceneReport& report) {
  const Node& node = scene[id];
  report.tree.push_back({scene.path(id), describe_node(node), depth, node.is_visible});
  for (const NodeId child : node.children) add_tree(scene, child, depth + 1, report);
}

/// Lamps beside which no sky would be seen.
void warn_of_lamps(const Scene& scene, NodeId root, SceneReport& report) {
  constexpr double kTimesSky = 10.0;
  std::size_t count = 0;
  NodeId brightest;
  double most = kTimesSky * kSkyLux;
  for (const NodeId id : scene.subtree(root)) {
    const double lux = lamp_lux(scene, id);
    count += lux > kTimesSky * kSkyLux ? 1 : 0;
    if (lux <= most) continue;
    most = lux;
    brightest = id;
  }
  if (count == 0) return;
  report.warnings.push_back(fmt::format(
      "{}{} lights a surface {:g} m away with {:.3g} lux, {:.3g} times as much as an open sky of "
      "1000 nits: no sky will be seen beside it; environment.max_lamp_lux dims such lamps in a job",
      scene.path(brightest),
      count > 1 ? fmt::format(" (the brightest of {} such lamps)", count) : "", kLampDistance, most,
      most / kSkyLux));
}

nlohmann::json json_vector(const Vec3& v) { return {v.x(), v.y(), v.z()}; }

std::string tree_text(const SceneReport& report, int tree_depth) {
  std::string text;
  std::size_t left_out = 0;
  for (const SceneReport::NodeLine& line : report.tree) {
    if (tree_depth >= 0 && line.depth > tree_depth) {
      ++left_out;
      continue;
    }
    const std::string name = line.path.substr(line.path.rfind('/') + 1);
    text += fmt::format("{:{}}{}", "", 2 + 2 * line.depth, name);
    if (!line.what.empty()) text += fmt::format("  [{}]", line.what);
    if (!line.is_visible) text += "  (hidden)";
    text += '\n';
  }
  if (left_out > 0) text += fmt::format("  ... {} deeper nodes\n", left_out);
  return text;
}

}  // namespace

SceneReport report_scene(const Scene& scene, NodeId root, const std::string& file) {
  SceneReport report;
  report.file = file;
  report.bounds = scene.world_bounds(root);
  Shared shared;
  for (const NodeId id : scene.subtree(root)) add_node(scene, id, report, shared);
  add_tree(scene, root, 0, report);
  warn_of_lamps(scene, root, report);

  report.unique_meshes = shared.meshes.size();
  report.textures = shared.textures.size();
  for (const Texture* texture : shared.textures) {
    report.texture_bytes += texture->bytes.size() + texture->floats.size() * sizeof(float);
  }
  for (const auto& [material, users] : shared.users) {
    SceneReport::MaterialLine line{material->name, users, {}};
    for (const Texture* texture : textures_of(*material)) line.textures.push_back(texture->name);
    report.materials.push_back(std::move(line));
  }
  // The map is ordered by address, which differs from run to run.
  std::sort(report.materials.begin(), report.materials.end(), [](const auto& a, const auto& b) {
    return std::tie(a.name, a.users, a.textures) < std::tie(b.name, b.users, b.textures);
  });
  return report;
}

std::vector<std::string> warnings_about(const SceneReport& report, const std::string& material) {
  std::vector<std::string> found;
  if (material.empty()) return found;
  const std::string quoted = '\'' + material + '\'';
  std::ranges::copy_if(report.warnings, std::back_inserter(found), [&](const std::string& warning) {
    return warning.find(quoted) != std::string::npos;
  });
  return found;
}

std::string report_text(const SceneReport& report, int tree_depth) {
  std::string text = report.file + "\n";
  text +=
      fmt::format("  {} nodes, {} meshes ({} different), {} triangles ({} stored)\n", report.nodes,
                  report.meshes, report.unique_meshes, report.triangles, report.unique_triangles);
  text += fmt::format(
      "  {} materials, {} textures ({:.1f} MiB), {} lights, {} cameras, {} bodies, "
      "{} labelled nodes\n",
      report.materials.size(), report.textures, double(report.texture_bytes) / (1024.0 * 1024.0),
      report.lights.size(), report.cameras, report.rigid_bodies, report.labelled);
  if (report.bounds.is_empty()) {
    text += "  bounds: none (no visible meshes)\n";
  } else {
    const Vec3 size = report.bounds.size();
    text += fmt::format(
        "  bounds: ({:.4g}, {:.4g}, {:.4g}) to ({:.4g}, {:.4g}, {:.4g}) m, "
        "{:.4g} x {:.4g} x {:.4g} m\n",
        report.bounds.min.x(), report.bounds.min.y(), report.bounds.min.z(), report.bounds.max.x(),
        report.bounds.max.y(), report.bounds.max.z(), size.x(), size.y(), size.z());
  }
  for (const std::string& note : report.notes) text += "  " + note + "\n";
  text += "tree\n" + tree_text(report, tree_depth);
  if (!report.materials.empty()) text += "materials\n";
  for (const SceneReport::MaterialLine& line : report.materials) {
    text += fmt::format("  {}  used {}x", line.name, line.users);
    if (!line.textures.empty()) text += fmt::format("  [{}]", fmt::join(line.textures, ", "));
    text += '\n';
    for (const std::string& warning : warnings_about(report, line.name)) {
      text += fmt::format("    ! {}\n", warning);
    }
  }
  if (!report.lights.empty()) text += "lights\n";
  for (const SceneReport::LightLine& line : report.lights) {
    text += fmt::format("  {}  {}  ({:.4g}, {:.4g}, {:.4g})", line.path, line.kind, line.color.x(),
                        line.color.y(), line.color.z());
    if (line.lux > 0.0) text += fmt::format("  {:.4g} lux at {:g} m", line.lux, kLampDistance);
    text += '\n';
  }
  if (!report.warnings.empty()) text += fmt::format("warnings ({})\n", report.warnings.size());
  for (const std::string& warning : report.warnings) text += "  " + warning + "\n";
  return text;
}

std::string report_json(const SceneReport& report) {
  nlohmann::ordered_json json;
  json["file"] = report.file;
  json["nodes"] = report.nodes;
  json["meshes"] = report.meshes;
  json["unique_meshes"] = report.unique_meshes;
  json["triangles"] = report.triangles;
  json["unique_triangles"] = report.unique_triangles;
  json["textures"] = report.textures;
  json["texture_bytes"] = report.texture_bytes;
  json["cameras"] = report.cameras;
  json["rigid_bodies"] = report.rigid_bodies;
  json["labelled"] = report.labelled;
  if (report.bounds.is_empty()) {
    json["bounds_m"] = nullptr;
  } else {
    json["bounds_m"] = {json_vector(report.bounds.min), json_vector(report.bounds.max)};
  }
  json["tree"] = nlohmann::json::array();
  for (const SceneReport::NodeLine& line : report.tree) {
    json["tree"].push_back(
        {{"path", line.path}, {"what", line.what}, {"visible", line.is_visible}});
  }
  json["materials"] = nlohmann::json::array();
  for (const SceneReport::MaterialLine& line : report.materials) {
    json["materials"].push_back({{"name", line.name},
                                 {"users", line.users},
                                 {"textures", line.textures},
                                 {"warnings", warnings_about(report, line.name)}});
  }
  json["lights"] = nlohmann::json::array();
  for (const SceneReport::LightLine& line : report.lights) {
    json["lights"].push_back({{"path", line.path},
                              {"kind", line.kind},
                              {"color", json_vector(line.color.cast<double>())},
                              {"lux_at_2_m", line.lux}});
  }
  json["notes"] = report.notes;
  json["warnings"] = report.warnings;
  // Names of files, materials and textures may be any bytes.
  return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

}  // namespace diorama
