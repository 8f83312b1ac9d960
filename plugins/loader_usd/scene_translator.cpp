// SPDX-License-Identifier: Apache-2.0
#include "loader_usd/scene_translator.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <tuple>

#include "diorama/error.h"
#include "diorama/joints.h"
#include "loader_usd/conversion.h"
#include "loader_usd/light_translator.h"
#include "loader_usd/usd/extent.h"
#include "loader_usd/usd/path.h"

namespace diorama::loader_usd {
namespace {

using usd::Prim;
using usd::Stage;

constexpr int kMaxInstancerNesting = 8;
constexpr int kCameraWidth = 1280;
// Small files may ask for any number of nodes by references to references and nested instancers.
constexpr std::size_t kMaxNodes = 500'000;
// What a unit is where a stage does not say: a centimetre.
constexpr double kFallbackUnit = 0.01;

bool is_length(double number) { return number > 0.0 && std::isfinite(number); }

// How many units of the outer layer one of the inner layer is, as far as both say so.
double unit_ratio(std::optional<double> inside, std::optional<double> outside) {
  return inside && outside ? *inside / *outside : 1.0;
}

// Whether the author took care of the units by hand: a scale of about that much.
bool is_scaled_by(const usd::LocalTransform& local, double ratio) {
  const double volume = std::abs(to_affine(local.matrix).linear().determinant());
  return ratio != 1.0 && std::abs(std::cbrt(volume) / ratio - 1.0) < 0.05;
}

bool is_left_out(const std::string& type) {
  constexpr std::string_view kTypes[] = {"NurbsCurves", "HermiteCurves", "NurbsPatch", "TetMesh",
                                         "Volume",      "GeometryLight", "PluginLight"};
  return std::find(std::begin(kTypes), std::end(kTypes), type) != std::end(kTypes);
}

// The rotation and translation of a map.
Affine without_scale(const Affine& affine) {
  Affine rigid = Affine::Identity();
  const Transform parts = Transform::from_affine(affine);
  rigid.linear() = parts.rotation.toRotationMatrix();
  rigid.translation() = affine.translation();
  return rigid;
}

}  // namespace

SceneTranslator::SceneTranslator(Stage& stage, Host& host, Scene& scene)
    : stage_(stage),
      scene_(scene),
      geometry_(stage),
      meshes_(stage, geometry_),
      materials_(stage, host),
      physics_(stage, scene),
      meters_per_unit_(stage.meters_per_unit()),
      root_from_stage_(stage.is_z_up() ? Affine::Identity() : z_up_from_y_up()) {
  metrics_of(stage.root_layer());
  if (!is_length(meters_per_unit_)) meters_per_unit_ = kFallbackUnit;
  root_from_stage_.linear() *= meters_per_unit_;
}

std::string SceneTranslator::describe_units() const {
  std::ostringstream text;
  text << "units: " << meters_per_unit_ << " m, " << (stage_.is_z_up() ? "z" : "y") << " up";
  return text.str();
}

// Warns of what cannot be believed; it is then as if nothing were said.
SceneTranslator::Metrics SceneTranslator::metrics_of(const usd::Layer& layer) const {
  Metrics metrics;
  metrics.meters_per_unit = layer.get(layer.root(), "metersPerUnit").as_number();
  if (metrics.meters_per_unit && !is_length(*metrics.meters_per_unit)) {
    std::ostringstream text;
    text << layer.identifier() << ": metersPerUnit is " << *metrics.meters_per_unit
         << ", expected a number above 0; it counts as not said, which is " << kFallbackUnit;
    stage_.diagnostics().warn(text.str());
    metrics.meters_per_unit.reset();
  }
  const usd::Value axis = layer.get(layer.root(), "upAxis");
  if (axis.is_empty()) return metrics;
  const std::string word = axis.as_text() ? *axis.as_text() : "no text";
  if (word == "Y" || word == "Z") {
    metrics.is_z_up = word == "Z";
  } else {
    stage_.diagnostics().warn(layer.identifier() + ": upAxis is '" + word +
                              "', expected 'Y' or 'Z'; it counts as not said, which is 'Y'");
  }
  return metrics;
}

void SceneTranslator::translate(NodeId root) {
  const Place place{root, Affine::Identity()};
  for (const Prim* prim : stage_.visible_children(stage_.root())) {
    if (is_drawn(*prim)) translate_prim(*prim, place, root_from_stage_ * local_pose(*prim, place));
  }
  add_joints(root);
  stage_.assets().release_pages();
  materials_.read_textures();
  finish_materials();
  report_notes();
}

// Says once per kind what the scene cannot hold.
void SceneTranslator::report_notes() {
  for (const auto& [what, noted] : notes_) {
    std::string line = stage_.root_layer().identifier() + ": <" + noted.first_path + "> " + what;
    if (!noted.first_detail.empty()) line += " (" + noted.first_detail + ")";
    if (noted.count > 1) {
      line += ", like " + std::to_string(noted.count - 1) + " more of them";
    }
    stage_.diagnostics().warn(line);
  }
}

void SceneTranslator::note(const Prim& prim, const std::string& what, const std::string& detail) {
  Noted& noted = notes_[what];
  if (noted.count++ > 0) return;
  noted.first_path = prim.path;
  noted.first_detail = detail;
}

void SceneTranslator::translate_children(const Prim& prim, const Place& place) {
  for (const Prim* child : drawn_children(prim)) {
    if (is_drawn(*child)) translate_prim(*child, place, local_pose(*child, place));
  }
}

// Below prototypes overs count as well: they are how files keep prototypes from being drawn by
// themselves.
std::vector<const Prim*> SceneTranslator::drawn_children(const Prim& prim) {
  if (instancer_depth_ == 0) return stage_.visible_children(prim);
  std::vector<const Prim*> result = stage_.children(prim);
  std::erase_if(result, [](const Prim* child) { return !child->is_active || child->is_abstract; });
  return result;
}

// Whether the prim or something below it becomes a node.
bool SceneTranslator::is_drawn(const Prim& prim) {
  const std::pair key(&prim, instancer_depth_ > 0);
  const auto known = drawn_.find(key);
  if (known != drawn_.end()) return known->second;
  const bool is_group =
      prim.type_name.empty() || prim.type_name == "Scope" || !prim.traits.is_known;
  bool result = prim.traits.is_xformable;
  // Skeletons move points of others.
  if (prim.type_name == "Skeleton") result = false;
  if (is_joint(prim.type_name)) result = true;
  if (is_foreign_joint(prim.type_name)) {
    note(prim, "is of type " + prim.type_name + ", which does not hold bodies together");
  }
  if (is_group) {
    for (const Prim* child : drawn_children(prim)) result |= is_drawn(*child);
  }
  drawn_[key] = result;
  return result;
}

// A prim that refers to an asset with other units or another axis is scaled and turned to fit, as
// Omniverse's metrics assembler does it. Only what both sides say counts.
Affine SceneTranslator::unit_correction(const Prim& prim) const {
  Affine result = Affine::Identity();
  if (stage_.has_property(prim, "xformOp:scale:unitsResolve")) return result;
  const auto& nodes = prim.index.nodes;
  // The outermost arc that was authored on this prim, and what the layer around it says.
  for (const usd::IndexNode& node : nodes) {
    const bool is_file_arc = node.arc == usd::Arc::Reference || node.arc == usd::Arc::Payload;
    if (!is_file_arc || node.is_due_to_ancestor() || !node.contributes()) continue;
    const usd::LayerStack* outer = nodes[static_cast<std::size_t>(node.parent)].stack;
    if (outer == node.stack) continue;
    const Metrics inside = metrics_of(node.stack->root());
    const Metrics outside = metrics_of(outer->root());
    const double ratio = unit_ratio(inside.meters_per_unit, outside.meters_per_unit);
    if (!is_scaled_by(usd::local_transform(stage_, prim), ratio)) result.linear() *= ratio;
    if (inside.is_z_up && outside.is_z_up && *inside.is_z_up != *outside.is_z_up) {
      const Affine turn = z_up_from_y_up();
      result = result * (*outside.is_z_up ? turn : turn.inverse());
    }
    break;
  }
  return result;
}

Affine SceneTranslator::local_pose(const Prim& prim, const Place& parent) {
  const usd::LocalTransform local = usd::local_transform(stage_, prim);
  if (!local.lost_op.empty()) note(prim, "has a transform that cannot be read", local.lost_op);
  Affine pose = finite_pose(prim, to_affine(local.matrix)) * unit_correction(prim);
  if (local.resets_stack && prim.parent && prim.parent->parent) {
    pose = parent.root_from_node.inverse() * root_from_stage_ * pose;
  }
  return finite_pose(prim, pose);
}

Affine SceneTranslator::finite_pose(const Prim& prim, const Affine& pose) {
  if (pose.matrix().allFinite()) return pose;
  note(prim, "has a pose that is not finite; it stays where its parent is");
  return Affine::Identity();
}

void SceneTranslator::translate_prim(const Prim& prim, const Place& parent, const Affine& pose) {
  if (++node_count_ > kMaxNodes) {
    throw Error(ErrorKind::Asset, stage_.root_layer().identifier() + ": more than " +
                                      std::to_string(kMaxNodes) + " nodes, at <" + prim.path + ">");
  }
  Place place;
  place.node = scene_.create(parent.node, usd::path::name(prim.path));
  place.root_from_node = parent.root_from_node * pose;
  scene_.set_pose(place.node, pose);
  if (instancer_depth_ == 0) {
    nodes_[&prim] = place.node;
    if (is_joint(prim.type_name)) joints_.emplace_back(&prim, place.node);
  } else if (is_joint(prim.type_name)) {
    note(prim, "is a joint in an instancer, and holds nothing");
  }
  const bool is_hidden = prim.traits.is_imageable &&
                         usd::token_or(stage_, prim, "visibility", "inherited") == "invisible";
  if (is_hidden) scene_.edit(place.node).is_visible = false;
  if (is_left_out(prim.type_name)) note_undrawn(prim, prim.type_name);
  if (prim.traits.is_gprim) add_shape(prim, place);
  if (prim.type_name == "Camera") add_camera(prim, place);
  if (prim.traits.is_light) add_light(prim, place);
  add_labels(prim, place.node);
  if (const auto name = usd::token_or(stage_, prim, "diorama:keypoint", ""); !name.empty()) {
    scene_.edit(place.node).keypoints = {{name, Vec3::Zero()}};
  }
  if (prim.type_name == "PointInstancer") {
    add_instances(prim, place);
  } else {
    translate_children(prim, place);
  }
  physics_.translate(prim, place.node);
}

// Says of what is meant to be seen that it is not.
void SceneTranslator::note_undrawn(const Prim& prim, const std::string& type) {
  const std::string purpose = geometry_.purpose(prim);
  if (purpose == "guide" || purpose == "proxy" || !geometry_.is_visible(prim)) return;
  note(prim, "is of type " + type + ", which is not drawn");
}

// --- Shapes -----------------------------------------------------------------------------------

std::shared_ptr<const Material> SceneTranslator::plain_material(const TranslatedMesh& mesh) {
  const bool has_colors = mesh.mesh && !mesh.mesh->colors.empty();
  const Vec3f color = mesh.display_color.value_or(Vec3f::Constant(has_colors ? 1.0f : 0.5f));
  std::shared_ptr<const Material>& known =
      plain_materials_[{color.x(), color.y(), color.z(), mesh.display_opacity}];
  if (!known) {
    Material material;
    material.name = "displayColor";
    material.base_color = color.allFinite() ? Vec3f(color.cwiseMax(0.0f)) : Vec3f::Constant(0.5f);
    material.opacity = std::clamp(mesh.display_opacity, 0.0f, 1.0f);
    known = std::make_shared<const Material>(std::move(material));
  }
  return known;
}

// What the prim is drawn with in full; a material for previews alone is better than none.
std::string SceneTranslator::drawn_material(const Prim& prim) {
  std::string lost;
  std::string path = geometry_.material(prim, "full", &lost);
  if (path.empty()) path = geometry_.material(prim, "preview");
  if (!lost.empty()) note(prim, "is bound to a material that is not there", "<" + lost + ">");
  return path;
}

void SceneTranslator::add_shape(const Prim& prim, const Place& place) {
  std::vector<std::string> paths{drawn_material(prim)};
  std::vector<const Prim*> subsets;
  if (prim.type_name == "Mesh") {
    for (const Prim* child : drawn_children(prim)) {
      if (child->type_name != "GeomSubset") continue;
      if (usd::token_or(stage_, *child, "elementType", "face") != "face") continue;
      // Subsets of other families sort faces for other ends.
      const std::string family = usd::token_or(stage_, *child, "familyName", "materialBind");
      if (family != "materialBind" && !family.empty()) continue;
      std::string path = drawn_material(*child);
      if (path.empty()) continue;
      subsets.push_back(child);
      paths.push_back(std::move(path));
    }
  }
  std::vector<std::string> uv_names;
  bool with_colors = false;
  for (const std::string& path : paths) {
    const TranslatedMaterial& material = materials_.translate(path);
    uv_names.insert(uv_names.end(), material.uv_names.begin(), material.uv_names.end());
    with_colors |= material.reads_display_color();
  }
  const TranslatedMesh mesh = meshes_.translate(prim, subsets, uv_names, with_colors);
  if (!mesh.lacks.empty()) note_undrawn(prim, prim.type_name + " " + mesh.lacks);
  for (const std::string& loss : mesh.losses) note(prim, loss);
  if (mesh.lacks_uvs) note(prim, "is textured by several primvars, of which the first one counts");
  if (!mesh.mesh) return;
  std::vector<std::shared_ptr<const Material>> materials;
  for (const std::string& path : paths) {
    const TranslatedMaterial& known = materials_.translate(path);
    materials.push_back(known.material ? known.material : plain_material(mesh));
    if (known.display_color_fallback && mesh.mesh->colors.empty()) {
      const Vec3f color = mesh.display_color.value_or(*known.display_color_fallback);
      tints_.push_back({place.node, materials.size() - 1, color});
    }
  }
  const std::string purpose = geometry_.purpose(prim);
  Node& content = scene_.edit(place.node);
  content.mesh = mesh.mesh;
  content.materials = std::move(materials);
  if (purpose == "guide" || purpose == "proxy") content.is_visible = false;
  if (usd::has_schema(stage_, prim, "MeshLightAPI")) {
    MeshLight light = translate_mesh_light(stage_, prim, *mesh.mesh, stage_scale(place));
    for (const std::string& loss : light.losses) note(prim, "is a light whose " + loss);
    mesh_lights_.emplace_back(place.node, std::move(light));
  }
}

// Some meshes have materials of their own: those that read the mesh's one colour, and those of
// meshes that are lights. They are made when the others have their textures.
void SceneTranslator::finish_materials() {
  using Original = std::shared_ptr<const Material>;
  std::map<std::pair<Original, std::vector<float>>, Original> tinted;
  for (const auto& [node, slot, color] : tints_) {
    Original& material = scene_.edit(node).materials[slot];
    Original& known = tinted[{material, {color.x(), color.y(), color.z()}}];
    if (!known) {
      Material copy = *material;
      copy.base_color = color.allFinite() ? Vec3f(color.cwiseMax(0.0f)) : Vec3f::Zero();
      known = std::make_shared<const Material>(std::move(copy));
    }
    material = known;
  }
  std::map<std::tuple<Original, std::vector<float>, std::string>, Original> shining;
  for (const auto& [node, light] : mesh_lights_) {
    const Vec3f& e = light.emission;
    for (Original& material : scene_.edit(node).materials) {
      Original& known = shining[{material, {e.x(), e.y(), e.z()}, light.sync_mode}];
      if (!known) known = std::make_shared<const Material>(shining_material(*material, light));
      material = known;
    }
  }
}

// --- Cameras and lights -----------------------------------------------------------------------

void SceneTranslator::add_camera(const Prim& prim, Place& place) {
  const auto number = [&](const char* name, double fallback) {
    const double value = usd::number_or(stage_, prim, name, fallback);
    return std::isfinite(value) && value > 0.0 ? value : fallback;
  };
  const double aperture = number("horizontalAperture", 20.955);
  const double height = number("verticalAperture", 15.2908);
  const int rows = std::clamp(static_cast<int>(std::lround(kCameraWidth * height / aperture)), 1,
                              8 * kCameraWidth);
  Camera camera = Camera::from_lens(kCameraWidth, rows, number("focalLength", 50.0), aperture);
  std::array<double, 2> range{1.0, 1000000.0};
  stage_.value(prim, "clippingRange").read(range);
  if (!std::isfinite(range[0]) || !std::isfinite(range[1])) range = {1.0, 1000000.0};
  // The film is moved, so the axis meets the picture on the other side of its middle.
  const auto offset = [&](const char* name) {
    const double value = usd::number_or(stage_, prim, name, 0.0);
    return std::isfinite(value) ? value / aperture * kCameraWidth : 0.0;
  };
  camera.cx -= offset("horizontalApertureOffset");
  camera.cy += offset("verticalApertureOffset");
  if (usd::token_or(stage_, prim, "projection", "perspective") == "orthographic") {
    note(prim, "is an orthographic camera, which is taken as a perspective one");
  }
  camera.near_m = std::max(range[0] * meters_per_unit_, 1e-4);
  camera.far_m = std::max(range[1] * meters_per_unit_, camera.near_m * 2.0);
  camera.f_stop = number("fStop", 0.0);
  camera.focus_distance_m = number("focusDistance", 0.0) * meters_per_unit_;
  // A camera has no size: the units must not stand in its pose.
  const Affine root_from_camera = without_scale(place.root_from_node);
  const Affine root_from_parent =
      place.root_from_node * scene_[place.node].parent_from_node.inverse();
  scene_.set_pose(place.node, finite_pose(prim, root_from_parent.inverse() * root_from_camera));
  place.root_from_node = root_from_camera;
  scene_.edit(place.node).camera = camera;
}

// The mean factor by which the prim's transforms enlarge, in stage units.
double SceneTranslator::stage_scale(const Place& place) const {
  return std::cbrt(std::abs(place.root_from_node.linear().determinant())) / meters_per_unit_;
}

// By the letter the pole of a DomeLight is +y on every stage. People who light a stage that has z
// up mean its sky, so a dome is taken as if it stood on a stage that has y up. DomeLight_1 may say.
bool SceneTranslator::has_z_pole(const Prim& dome) const {
  if (dome.type_name == "DomeLight_1") {
    const std::string pole = usd::token_or(stage_, dome, "poleAxis", "scene");
    if (pole == "Y" || pole == "Z") return pole == "Z";
  }
  return stage_.is_z_up();
}

void SceneTranslator::add_light(const Prim& prim, Place& place) {
  auto light = translate_light(stage_, prim, stage_scale(place), materials_.textures());
  if (!light) return;
  for (const std::string& loss : light->losses) note(prim, "is a light whose " + loss);
  Affine turned = scene_[place.node].parent_from_node * light->prim_from_light;
  if (light->light.kind == LightKind::Dome && has_z_pole(prim)) {
    turned = scene_[place.node].parent_from_node * z_up_from_y_up() * light->prim_from_light;
  }
  scene_.set_pose(place.node, turned);
  scene_.edit(place.node).light = std::move(light->light);
}

// --- Labels --------------------------------------------------------------------------------------

// Labels of UsdSemantics, and of the SemanticsAPI that was used before. Several of one type are one
// text with commas, as Replicator writes them.
void SceneTranslator::add_labels(const Prim& prim, NodeId node) {
  constexpr std::string_view kNew = "semantics:labels:";
  constexpr std::string_view kOld = "semantic:";
  constexpr std::string_view kOldType = ":params:semanticType";
  std::map<std::string, usd::Strings> found;
  const auto add = [&](const std::string& type, const std::string& label) {
    usd::Strings& labels = found[type];
    const bool is_known = std::find(labels.begin(), labels.end(), label) != labels.end();
    if (!label.empty() && !is_known) labels.push_back(label);
  };
  for (const std::string& name : stage_.property_names(prim, "semantic")) {
    if (name.starts_with(kNew)) {
      const usd::Value value = stage_.value(prim, name);
      if (!value.as_strings()) continue;
      for (const std::string& label : *value.as_strings()) add(name.substr(kNew.size()), label);
    } else if (name.starts_with(kOld) && name.ends_with(kOldType)) {
      const std::string data =
          name.substr(0, name.size() - kOldType.size()) + ":params:semanticData";
      const std::string type = usd::token_or(stage_, prim, name, "");
      if (!type.empty()) add(type, usd::token_or(stage_, prim, data, ""));
    }
  }
  for (const auto& [type, labels] : found) {
    std::string joined;
    for (const std::string& label : labels) joined += (joined.empty() ? "" : ",") + label;
    if (!joined.empty()) scene_.edit(node).labels[type] = std::move(joined);
  }
}

// --- Joints -----------------------------------------------------------------------------------

void SceneTranslator::add_joints(NodeId root) {
  JointTranslator translator(stage_, scene_, root, root_from_stage_, nodes_,
                             [this](const Prim& prim, const std::string& what,
                                    const std::string& detail) { note(prim, what, detail); });
  for (const auto& [prim, node] : joints_) {
    // Assets in other units than the stage's say their limits in these.
    double unit = meters_per_unit_;
    for (const Prim* at = prim; at && at->parent; at = at->parent) {
      unit *= std::cbrt(std::abs(unit_correction(*at).linear().determinant()));
    }
    translator.translate(*prim, node, unit);
  }
  // Bodies need not stand where their joints are at 0.
  for (const CompoundJoint& compound : compound_joints(scene_)) place_frames(scene_, compound);
}

// --- PointInstancer ---------------------------------------------------------------------------

void SceneTranslator::add_instances(const Prim& prim, const Place& place) {
  if (instancer_depth_ >= kMaxInstancerNesting) {
    note(prim, "is an instancer within too many instancers");
    return;
  }
  ++instancer_depth_;
  const usd::PointInstances instances = usd::point_instances(stage_, prim);
  if (instances.lacks_prototypes) note(prim, "has instances of prototypes that are not there");
  if (instances.lacks_positions) note(prim, "has fewer positions than instances");
  for (const usd::PointInstance& instance : instances.list) {
    const Affine pose =
        to_affine(instance.instancer_from_prototype) * unit_correction(*instance.prototype);
    translate_prim(*instance.prototype, place, finite_pose(prim, pose));
  }
  --instancer_depth_;
}

}  // namespace diorama::loader_usd
