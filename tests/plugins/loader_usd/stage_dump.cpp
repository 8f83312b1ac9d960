// SPDX-License-Identifier: Apache-2.0
#include "plugins/loader_usd/stage_dump.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <set>

#include "usd/error.h"
#include "usd/extent.h"
#include "usd/geometry.h"
#include "usd/stage.h"

namespace diorama::usd::test {
namespace {

using nlohmann::json;

json to_json(const Box& box) {
  if (box.is_empty()) return nullptr;
  return json::array({box.min, box.max});
}

struct Totals {
  std::size_t prims = 0;
  std::size_t meshes = 0;
  std::size_t points = 0;
  std::size_t faces = 0;
  std::size_t face_vertices = 0;
  std::size_t point_instances = 0;
  Box bounds;
  Box visible_bounds;
};

class StageDump {
 public:
  explicit StageDump(Stage& stage) : stage_(stage), geometry_(stage) {}

  json dump() {
    json result;
    result["opens"] = true;
    result["upAxis"] = stage_.up_axis();
    result["metersPerUnit"] = stage_.meters_per_unit();
    const std::string default_prim = stage_.default_prim();
    result["defaultPrim"] = default_prim.empty() ? json(nullptr) : json(default_prim);
    prims_ = json::array();
    visit_children(stage_.root());
    result["prims"] = std::move(prims_);
    result["totals"] = {{"prims", totals_.prims},
                        {"meshes", totals_.meshes},
                        {"points", totals_.points},
                        {"faces", totals_.faces},
                        {"faceVertices", totals_.face_vertices},
                        {"pointInstances", totals_.point_instances},
                        {"worldBounds", to_json(totals_.bounds)},
                        {"visibleWorldBounds", to_json(totals_.visible_bounds)}};
    result["warnings"] = stage_.warnings();
    return result;
  }

 private:
  void visit_children(const Prim& prim) {
    for (const Prim* child : stage_.visible_children(prim)) {
      ++totals_.prims;
      prims_.push_back(dump_prim(*child));
      visit_children(*child);
    }
  }

  json dump_prim(const Prim& prim) {
    json out;
    out["path"] = prim.path;
    if (!prim.type_name.empty()) out["type"] = prim.type_name;
    const Value kind = stage_.metadata(prim, "kind");
    if (kind.as_text() && !kind.as_text()->empty()) out["kind"] = *kind.as_text();
    const Strings schemas = api_schemas(prim.type_name, stage_.metadata_list(prim, "apiSchemas"));
    if (!schemas.empty()) out["apiSchemas"] = schemas;
    if (prim.is_instance) out["instance"] = true;
    if (prim.is_instance_proxy) out["instanceProxy"] = true;
    if (prim.traits.is_imageable) {
      if (!geometry_.is_visible(prim)) out["visibility"] = "invisible";
      if (const std::string purpose = geometry_.purpose(prim); purpose != "default") {
        out["purpose"] = purpose;
      }
    }
    if (prim.traits.is_xformable && !(geometry_.world_from_prim(prim) == Matrix())) {
      out["localToWorld"] = geometry_.world_from_prim(prim).m;
    }
    if (prim.type_name == "Mesh") dump_mesh(prim, out);
    if (prim.traits.is_boundable && !prim.traits.is_light && prim.type_name != "Mesh")
      dump_extent(prim, out);
    if (prim.type_name == "PointInstancer") dump_instancer(prim, out);
    if (prim.type_name == "GeomSubset") out["indices"] = count(prim, "indices", Type::Int);
    if (prim.traits.is_gprim) dump_primvars(prim, out);
    if (prim.traits.is_gprim || prim.type_name == "GeomSubset") {
      const std::string material = geometry_.material(prim);
      if (!material.empty()) out["material"] = material;
    }
    if (std::find(schemas.begin(), schemas.end(), "LightAPI") != schemas.end()) {
      dump_light(prim, out);
    }
    dump_physics(prim, out);
    return out;
  }

  // OpenUSD sees a value only in the type of the schema.
  std::size_t count(const Prim& prim, const char* name, Type type) const {
    const Value value = stage_.value(prim, name);
    return value.is_array() && value.type() == type ? value.size() : 0;
  }

  void dump_mesh(const Prim& prim, json& out) {
    const std::size_t points = count(prim, "points", Type::Vec3f);
    const std::size_t faces = count(prim, "faceVertexCounts", Type::Int);
    const std::size_t corners = count(prim, "faceVertexIndices", Type::Int);
    out["points"] = points;
    out["faces"] = faces;
    out["faceVertices"] = corners;
    out["subdivision"] = token_or(stage_, prim, "subdivisionScheme", "catmullClark");
    const std::string orientation = token_or(stage_, prim, "orientation", "rightHanded");
    if (orientation != "rightHanded") out["orientation"] = orientation;
    if (bool_or(stage_, prim, "doubleSided", false)) out["doubleSided"] = true;
    const Value normals = stage_.value(prim, "normals");
    if (normals.is_array() && normals.type() == Type::Vec3f) {
      const Value interpolation = stage_.property_metadata(prim, "normals", "interpolation");
      out["normals"] = {interpolation.as_text() ? *interpolation.as_text() : "vertex",
                        count(prim, "normals", Type::Vec3f)};
    }
    Box box;
    if (const auto list = numbers<float>(stage_.value(prim, "points"), 3); list && points > 0) {
      const Matrix& world = geometry_.world_from_prim(prim);
      for (std::size_t i = 0; i + 2 < list->span.size(); i += 3) {
        box.add(transform(world, Vector3{list->span[i], list->span[i + 1], list->span[i + 2]}));
      }
    }
    if (!box.is_empty()) out["worldBounds"] = to_json(box);
    ++totals_.meshes;
    totals_.points += points;
    totals_.faces += faces;
    totals_.face_vertices += corners;
    totals_.bounds.add(box);
    const std::string purpose = geometry_.purpose(prim);
    if (geometry_.is_visible(prim) && (purpose == "default" || purpose == "render")) {
      totals_.visible_bounds.add(box);
    }
  }

  void dump_extent(const Prim& prim, json& out) {
    const std::string purpose = geometry_.purpose(prim);
    const bool is_bounded =
        purpose == "default" || purpose == "render" || purpose == "proxy" || purpose == "guide";
    const auto extent = local_extent(stage_, prim);
    if (extent && is_bounded)
      out["worldBounds"] = to_json(transform(geometry_.world_from_prim(prim), *extent));
  }

  void dump_instancer(const Prim& prim, json& out) {
    const auto list = [&](const char* name) {
      std::vector<double> result;
      const Value value = stage_.value(prim, name);
      if (const auto items = numbers<double>(value, 1)) {
        result.assign(items->span.begin(), items->span.end());
      }
      return result;
    };
    const std::size_t all = count(prim, "protoIndices", Type::Int);
    std::vector<double> ids = list("ids");
    if (ids.size() != all) {
      ids.resize(all);
      for (std::size_t i = 0; i < all; ++i) ids[i] = static_cast<double>(i);
    }
    std::set<double> masked;
    for (const double id : list("invisibleIds")) masked.insert(id);
    for (const std::int64_t id : stage_.metadata_integers(prim, "inactiveIds")) {
      masked.insert(static_cast<double>(id));
    }
    const auto instances = static_cast<std::size_t>(
        std::count_if(ids.begin(), ids.end(), [&](double id) { return !masked.contains(id); }));
    out["instances"] = instances;
    totals_.point_instances += instances;
  }

  void dump_primvars(const Prim& prim, json& out) {
    json result = json::object();
    for (const Primvar& primvar : geometry_.primvars(prim)) {
      const std::string name = "primvars:" + primvar.name;
      if (!stage_.has_authored_value(*primvar.owner, name)) continue;
      const Value value = stage_.value(*primvar.owner, name);
      json entry = {primvar.interpolation, primvar.type, value.size()};
      if (primvar.is_indexed) entry.push_back("indexed");
      result[primvar.name] = std::move(entry);
    }
    if (!result.empty()) out["primvars"] = std::move(result);
  }

  void dump_light(const Prim& prim, json& out) {
    json light;
    light["intensity"] = number_or(stage_, prim, "inputs:intensity",
                                   prim.type_name == "DistantLight" ? 50000.0 : 1.0);
    light["exposure"] = number_or(stage_, prim, "inputs:exposure", 0.0);
    light["color"] = vector3(stage_, prim, "inputs:color").value_or(Vector3{1, 1, 1});
    light["normalize"] = bool_or(stage_, prim, "inputs:normalize", false);
    const bool has_radius = prim.type_name == "SphereLight" || prim.type_name == "DiskLight" ||
                            prim.type_name == "CylinderLight";
    if (has_radius || stage_.has_property(prim, "inputs:radius")) {
      light["radius"] = number_or(stage_, prim, "inputs:radius", 0.5);
    }
    out["light"] = std::move(light);
  }

  void dump_physics(const Prim& prim, json& out) {
    json physics = json::object();
    for (const char* name : {"physics:mass"}) {
      if (const auto value = stage_.value(prim, name).as_number()) physics[name] = *value;
    }
    for (const char* name :
         {"physics:rigidBodyEnabled", "physics:kinematicEnabled", "physics:collisionEnabled"}) {
      if (const auto value = stage_.value(prim, name).as_bool()) physics[name] = *value;
    }
    const Value approximation = stage_.value(prim, "physics:approximation");
    if (approximation.as_text()) physics["physics:approximation"] = *approximation.as_text();
    if (!physics.empty()) out["physics"] = std::move(physics);
  }

  Stage& stage_;
  Geometry geometry_;
  Totals totals_;
  json prims_;
};

// Compares, collecting at most a few differences.
class Comparison {
 public:
  /// `size` is that of the stage.
  explicit Comparison(double size) : size_(size) {}

  void compare(const std::string& where, const json& ours, const json& expected) {
    if (differences.size() >= 8) return;
    if (ours.is_number() && expected.is_number()) {
      const auto a = ours.get<double>();
      const auto b = expected.get<double>();
      const double allowed =
          is_place(where) ? 1e-4 * size_ : 1e-6 * std::max(std::abs(a), std::abs(b));
      if (!(std::abs(a - b) <= allowed)) add(where, ours, expected);
      return;
    }
    if (is_matrix(where, ours) && is_matrix(where, expected)) {
      return compare_matrices(where, ours, expected);
    }
    // Numbers that are not finite are written as null.
    if (ours.is_number() && expected.is_null() && !std::isfinite(ours.get<double>())) return;
    if (ours.is_array() && expected.is_array() && ours.size() == expected.size()) {
      for (std::size_t i = 0; i < ours.size(); ++i) {
        compare(where + "[" + std::to_string(i) + "]", ours[i], expected[i]);
      }
      return;
    }
    if (ours.is_object() && expected.is_object()) return compare_objects(where, ours, expected);
    if (ours != expected) add(where, ours, expected);
  }

  std::vector<std::string> differences;

 private:
  static bool is_place(const std::string& where) {
    return where.find("orldBounds") != std::string::npos;
  }

  static bool is_matrix(const std::string& where, const json& value) {
    return where.ends_with("localToWorld") && value.is_array() && value.size() == 16 &&
           std::all_of(value.begin(), value.end(), [](const json& n) { return n.is_number(); });
  }

  // A small number beside large ones may be off by more than itself: a translation counts beside
  // the stage's size, everything else beside the largest of its kind.
  void compare_matrices(const std::string& where, const json& ours, const json& expected) {
    const auto is_translation = [](std::size_t i) { return i >= 12 && i < 15; };
    double largest = 0.0;
    for (std::size_t i = 0; i < 16; ++i) {
      if (!is_translation(i)) largest = std::max(largest, std::abs(expected[i].get<double>()));
    }
    for (std::size_t i = 0; i < 16; ++i) {
      const double allowed = 1e-6 * (is_translation(i) ? size_ : largest);
      const double off = std::abs(ours[i].get<double>() - expected[i].get<double>());
      if (!(off <= allowed)) add(where + "[" + std::to_string(i) + "]", ours[i], expected[i]);
    }
  }

  void compare_objects(const std::string& where, const json& ours, const json& expected) {
    for (const auto& [key, value] : expected.items()) {
      if (!ours.contains(key)) {
        add(where + "." + key, nullptr, value);
      } else {
        compare(where + "." + key, ours[key], value);
      }
    }
    for (const auto& [key, value] : ours.items()) {
      if (!expected.contains(key)) add(where + "." + key, value, nullptr);
    }
  }

  void add(const std::string& where, const json& ours, const json& expected) {
    const auto shorten = [](std::string text) {
      return text.size() > 160 ? text.substr(0, 160) + "..." : text;
    };
    const auto text = [&](const json& value) {
      return shorten(value.dump(-1, ' ', false, json::error_handler_t::replace));
    };
    differences.push_back(where + ": ours " + text(ours) + ", expected " + text(expected));
  }

  double size_;
};

double stage_size(const json& expected) {
  double size = 0.0;
  const auto add = [&](const json& bounds) {
    if (!bounds.is_array()) return;
    for (const json& corner : bounds) {
      for (const json& number : corner) {
        if (number.is_number()) size = std::max(size, std::abs(number.get<double>()));
      }
    }
  };
  add(expected["totals"]["worldBounds"]);
  if (expected.contains("prims")) {
    for (const json& prim : expected["prims"]) {
      if (prim.contains("worldBounds")) add(prim["worldBounds"]);
      if (!prim.contains("localToWorld")) continue;
      const json& matrix = prim["localToWorld"];
      add(json::array({json::array({matrix[12], matrix[13], matrix[14]})}));
    }
  }
  // Without anything that has a size, all that counts is one.
  return size > 0.0 ? size : 1.0;
}

}  // namespace

json dump_stage(const std::string& file) {
  try {
    Stage stage(file);
    return StageDump(stage).dump();
  } catch (const FormatError& error) {
    return {{"opens", false}, {"error", error.what()}};
  }
}

std::vector<std::string> compare_dumps(const json& ours, const json& expected) {
  if (!expected["opens"].get<bool>() || !ours["opens"].get<bool>()) {
    if (ours["opens"] == expected["opens"]) return {};
    return {"opens: ours " + ours["opens"].dump() + ", expected " + expected["opens"].dump() +
            (ours.contains("error") ? ": " + ours["error"].get<std::string>() : "")};
  }
  Comparison comparison(stage_size(expected));
  for (const char* key : {"upAxis", "metersPerUnit", "defaultPrim", "totals"}) {
    comparison.compare(key, ours[key], expected[key]);
  }
  if (expected.value("primsOmitted", false)) return comparison.differences;
  const json& mine = ours["prims"];
  const json& theirs = expected["prims"];
  for (std::size_t i = 0; i < std::min(mine.size(), theirs.size()); ++i) {
    const std::string path = theirs[i]["path"].get<std::string>();
    if (mine[i]["path"] != theirs[i]["path"]) {
      comparison.compare("prims[" + std::to_string(i) + "].path", mine[i]["path"],
                         theirs[i]["path"]);
      break;
    }
    comparison.compare(path, mine[i], theirs[i]);
  }
  return comparison.differences;
}

}  // namespace diorama::usd::test
