// SPDX-License-Identifier: Apache-2.0
#include "render_scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <utility>

namespace diorama {
namespace {

// A clip with flow shows what bends at a time, the next, the last, and the first again.
constexpr std::uint64_t kTakesKept = 4;

std::shared_ptr<const Texture> make_white_sky() {
  auto texture = std::make_shared<Texture>();
  texture->width = 64;
  texture->height = 32;
  texture->channels = 1;
  texture->floats.assign(64 * 32, 1.0f);
  return texture;
}

Aabb world_bounds(const MeshInstance& instance) {
  Vec3f low = Vec3f::Constant(kInfinite);
  Vec3f high = -low;
  for (const Vec3f& position : instance.source().positions) {
    const Vec3f p = instance.to_world(position);
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  return {low.cast<double>(), high.cast<double>()};
}

bool is_same_pose(const MeshInstance& a, const MeshInstance& b) {
  return a.linear == b.linear && a.translation == b.translation;
}

bool emits(const MeshInstance& instance) {
  return std::ranges::any_of(instance.materials, [](const auto* m) { return m->emits; });
}

}  // namespace

RenderScene::RenderScene(Host& host, const Options& options)
    : host_(host),
      options_(options),
      materials_(host, options.stacks_lobes),
      default_material_(std::make_shared<Material>()),
      white_sky_(make_white_sky()) {}

bool RenderScene::take(const Scene& scene) {
  const bool has_same_shapes = shape_revision_ == scene.shape_revision();
  if (has_same_shapes && pose_revision_ == scene.pose_revision()) return false;
  // Set at the end: what an error leaves undone is done by the next call.
  shape_revision_ = 0;
  needs_light_ |= !has_same_shapes;
  const std::vector<Placed> previous_lights = std::move(placed_lights_);
  placed_lights_.clear();
  std::vector<Placed> placed;
  collect(scene, scene.root(), Affine::Identity(), false, placed);
  const auto is_same = [](const Placed& a, const Placed& b) {
    return a.world_from_node.matrix() == b.world_from_node.matrix();
  };
  const bool has_same_lights = std::ranges::equal(placed_lights_, previous_lights, is_same);
  // What moves while a shutter is open has velocities, too, which may differ at the same place.
  const bool is_still = window_ <= 0.0 && shutter_window(scene) <= 0.0;
  if (has_same_shapes && has_same_lights && is_still &&
      std::ranges::equal(placed, placed_meshes_, is_same)) {
    // Only cameras moved, or what is neither seen nor shines.
    pose_revision_ = scene.pose_revision();
    shape_revision_ = scene.shape_revision();
    return false;
  }
  const std::vector<MeshInstance> previous = instances_;
  const std::vector<UsedMesh> previous_meshes = meshes_;  // that `previous` points to
  if (!has_same_shapes) {
    domes_->forget_dead_images();
    assign_meshes(scene, placed);
    assign_materials(scene);
    pack_uvs();
  }
  assign_poses(placed, previous);
  assign_motions(scene, placed);
  needs_light_ |= !has_same_lights;
  placed_meshes_ = std::move(placed);
  pose_revision_ = scene.pose_revision();
  shape_revision_ = scene.shape_revision();
  return true;
}

void RenderScene::light(const Scene& scene, const CellGrid::Sees& sees) {
  if (!needs_light_) return;
  lights_ = LightTable(options_.has_disk_lamps);
  add_lights(scene);
  add_emitters();
  lights_.finish();
  learn_surroundings(sees);
  needs_light_ = false;
}

RenderScene::Kept RenderScene::kept() const {
  return {shading_meshes_.size() + bent_.size(), materials_.material_count(),
          materials_.texture_count(), domes_->size(), materials_.albedo_row_count()};
}

void RenderScene::collect(const Scene& scene, NodeId id, const Affine& world_from_parent,
                          bool is_movable, std::vector<Placed>& meshes) {
  const Node& node = scene[id];
  is_movable |= node.rigid_body.has_value() || node.animation.has_value();
  if (!node.is_visible) return;
  const Affine world_from_node = world_from_parent * node.parent_from_node;
  const double determinant = world_from_node.linear().determinant();
  if (node.mesh && !node.mesh->triangles.empty() && std::abs(determinant) > 0.0) {
    meshes.push_back({id, is_movable, world_from_node});
  }
  if (node.light) placed_lights_.push_back({id, is_movable, scene.world_from_node(id)});
  for (NodeId child : node.children) collect(scene, child, world_from_node, is_movable, meshes);
}

void RenderScene::assign_meshes(const Scene& scene, const std::vector<Placed>& placed) {
  auto before = std::move(shading_meshes_);
  shading_meshes_.clear();
  std::map<NodeId, const Mesh*> mesh_before;
  for (const MeshInstance& instance : instances_) {
    if (instance.is_movable) mesh_before.emplace(instance.node, &instance.source());
  }
  ++takes_;
  std::map<const Mesh*, std::uint32_t> numbers;
  std::vector<std::shared_ptr<const Mesh>> used;
  std::vector<std::shared_ptr<const Mesh>> missing;
  std::set<const Mesh*> left;  // for another mesh of the same node
  instances_.clear();
  for (const Placed& p : placed) {
    const auto& mesh = scene[p.node].mesh;
    const auto bent = mesh_before.find(p.node);
    if (bent != mesh_before.end() && bent->second != mesh.get()) left.insert(bent->second);
    const auto [number, is_new] = numbers.emplace(mesh.get(), std::uint32_t(used.size()));
    MeshInstance& instance = instances_.emplace_back();
    instance.node = p.node;
    instance.is_movable = p.is_movable;
    instance.mesh = number->second;
    if (!is_new) continue;
    used.push_back(mesh);
    // The entry keeps its mesh alive, so an address never comes to mean another mesh.
    if (const auto old = before.find(mesh.get()); old != before.end()) {
      shading_meshes_.insert(before.extract(old));
    } else if (const auto bent_before = bent_.find(mesh.get()); bent_before != bent_.end()) {
      shading_meshes_[mesh.get()] = std::move(bent_before->second.shading);
      bent_.erase(bent_before);
    } else {
      missing.push_back(mesh);
    }
  }
  for (const Mesh* mesh : left) {
    const auto old = before.find(mesh);
    if (old != before.end()) bent_[mesh] = {std::move(old->second), takes_};
  }
  // A mesh that nobody else has is of a scene that is gone.
  std::erase_if(bent_, [&](const auto& entry) {
    return takes_ - entry.second.left_at >= kTakesKept ||
           entry.second.shading->shared_source().use_count() == 1;
  });
  std::vector<std::shared_ptr<ShadingMesh>> made(missing.size());
  host_.parallel_for(missing.size(),
                     [&](std::size_t i) { made[i] = std::make_shared<ShadingMesh>(missing[i]); });
  for (std::size_t i = 0; i < made.size(); ++i) shading_meshes_[missing[i].get()] = made[i];
  meshes_.clear();
  for (const auto& mesh : used) meshes_.push_back({shading_meshes_.at(mesh.get()), 0});
  for (MeshInstance& instance : instances_) {
    instance.shading = meshes_[instance.mesh].shading.get();
    ++meshes_[instance.mesh].instance_count;
  }
}

void RenderScene::assign_materials(const Scene& scene) {
  std::vector<std::shared_ptr<const Material>> used{default_material_};
  for (const MeshInstance& instance : instances_) {
    for (const auto& m : scene[instance.node].materials) {
      if (m) used.push_back(m);
    }
  }
  materials_.keep(used);
  slot_materials_.clear();
  std::vector<std::size_t> ends;
  for (const MeshInstance& instance : instances_) {
    const auto& assigned = scene[instance.node].materials;
    // A slot beyond the list falls to the default material.
    const std::size_t highest = instance.shading->highest_slot();
    const std::size_t slots = std::min(highest, assigned.size()) + 1;
    for (std::size_t i = 0; i < slots; ++i) {
      const bool is_set = i < assigned.size() && assigned[i];
      slot_materials_.push_back(materials_.at(is_set ? assigned[i] : default_material_));
    }
    ends.push_back(slot_materials_.size());
  }
  std::size_t begin = 0;
  for (std::size_t i = 0; i < instances_.size(); ++i) {
    instances_[i].materials = {&slot_materials_[begin], ends[i] - begin};
    begin = ends[i];
  }
}

void RenderScene::pack_uvs() {
  std::set<ShadingMesh*> textured;
  for (const MeshInstance& instance : instances_) {
    const auto reads_uv = [](const ShadingMaterial* m) { return m->reads_uv; };
    if (!std::ranges::any_of(instance.materials, reads_uv)) continue;
    textured.insert(shading_meshes_.at(&instance.source()).get());
  }
  const std::vector<ShadingMesh*> meshes(textured.begin(), textured.end());
  host_.parallel_for(meshes.size(), [&](std::size_t i) { meshes[i]->pack_uvs(); });
}

/// Boxes are the dear part: they are kept where nothing moved.
void RenderScene::assign_poses(const std::vector<Placed>& placed,
                               const std::vector<MeshInstance>& previous) {
  std::vector<std::uint8_t> has_moved(instances_.size(), 1);
  host_.parallel_for(instances_.size(), [&](std::size_t i) {
    MeshInstance& instance = instances_[i];
    const Affine& pose = placed[i].world_from_node;
    instance.linear = pose.linear().cast<float>();
    instance.translation = pose.translation().cast<float>();
    instance.normal_from_node = pose.linear().inverse().transpose().cast<float>();
    instance.is_mirrored = pose.linear().determinant() < 0.0;
    if (i < previous.size() && previous[i].shading == instance.shading &&
        is_same_pose(previous[i], instance)) {
      instance.bounds = previous[i].bounds;
      has_moved[i] = 0;
    } else {
      instance.bounds = world_bounds(instance);
    }
  });
  for (std::size_t i = 0; i < instances_.size(); ++i) {
    if (has_moved[i] == 0) continue;
    needs_light_ |= !instances_[i].is_movable || emits(instances_[i]);
  }
}

void RenderScene::assign_motions(const Scene& scene, const std::vector<Placed>& placed) {
  window_ = shutter_window(scene);
  motions_.clear();
  for (MeshInstance& instance : instances_) instance.motion = nullptr;
  if (window_ <= 0.0) return;
  std::vector<std::size_t> moving;
  for (std::size_t i = 0; i < instances_.size(); ++i) {
    if (!instances_[i].is_movable) continue;
    const RigidMotion motion = body_motion(scene, instances_[i].node);
    if (!motion.moves(instances_[i].bounds, window_)) continue;
    motions_.push_back({motion, window_, placed[i].world_from_node});
    moving.push_back(i);
  }
  for (std::size_t k = 0; k < moving.size(); ++k) instances_[moving[k]].motion = &motions_[k];
}

void RenderScene::add_lights(const Scene& scene) {
  for (const Placed& placed : placed_lights_) {
    const Light& light = *scene[placed.node].light;
    std::shared_ptr<const DomeTexture> dome;
    if (light.kind == LightKind::Dome) {
      dome = domes_->dome_of(light.texture ? light.texture : white_sky_);
    }
    lights_.add(light, placed.world_from_node, dome);
  }
}

namespace {

/// Says whether the lamp encloses a volume, and which side is outside then.
void find_outside(EmittingTriangles& lamp) {
  constexpr double kOpen = 0.01;  // share of the area that a closed surface may lack
  Vec3 sum = Vec3::Zero();
  double area = 0.0;
  double volume = 0.0;
  const Vec3 inside = lamp.triangles[0].a.cast<double>();
  for (const auto& [a, ab, ac, index] : lamp.triangles) {
    const Vec3 normal = ab.cast<double>().cross(ac.cast<double>());
    sum += normal;
    area += normal.norm();
    volume += (a.cast<double>() - inside).dot(normal);
  }
  lamp.is_closed = sum.norm() < kOpen * area;
  if (lamp.is_closed) lamp.is_mirrored = volume < 0.0;
}

/// Lamps that shine to one side, or outwards, show any place but half of their surface. Triangles
/// that face similar ways make a light of their own, so that samples go to those that shine on it.
std::array<std::vector<EmittingTriangles::Triangle>, 8> by_facing(const EmittingTriangles& lamp) {
  std::array<std::vector<EmittingTriangles::Triangle>, 8> groups;
  const bool faces_all_ways = lamp.is_double_sided && !lamp.is_closed;
  for (const EmittingTriangles::Triangle& triangle : lamp.triangles) {
    const Vec3f normal = triangle.front(lamp.is_mirrored);
    const std::size_t octant = std::size_t(normal.x() > 0.0f) |
                               std::size_t(normal.y() > 0.0f) << 1 |
                               std::size_t(normal.z() > 0.0f) << 2;
    groups[faces_all_ways ? 0 : octant].push_back(triangle);
  }
  return groups;
}

}  // namespace

void RenderScene::add_emitters() {
  std::size_t count = 0;
  for (const MeshInstance& instance : instances_) {
    if (emits(instance)) count += instance.shading->number_end();
  }
  triangle_lights_.assign(count, MeshInstance::kNoLight);
  std::size_t begin = 0;
  for (std::size_t number = 0; number < instances_.size(); ++number) {
    MeshInstance& instance = instances_[number];
    instance.triangle_lights = {};
    if (!emits(instance)) continue;
    const std::span<std::uint32_t> lights(&triangle_lights_[begin], instance.shading->number_end());
    begin += lights.size();
    instance.triangle_lights = lights;
    for (std::size_t slot = 0; slot < instance.materials.size(); ++slot) {
      if (instance.materials[slot]->emits) add_emitters(std::uint32_t(number), slot, lights);
    }
  }
}

/// The lights of one material of an instance.
void RenderScene::add_emitters(std::uint32_t number, std::size_t slot,
                               std::span<std::uint32_t> triangle_lights) {
  const MeshInstance& instance = instances_[number];
  const ShadingMaterial& material = *instance.materials[slot];
  EmittingTriangles emitting;
  emitting.instance = number;
  emitting.is_double_sided = instance.source().is_double_sided;
  emitting.is_mirrored = instance.is_mirrored;
  emitting.mean_radiance = material.source->emission;
  if (material.emission) {
    const int top = material.emission.texture->level_count() - 1;
    emitting.mean_radiance = emitting.mean_radiance.cwiseProduct(
        Vec3f(material.emission.texture->texel(top, 0, 0).head<3>().matrix()));
  }
  for (std::uint32_t t = 0; t < instance.shading->number_end(); ++t) {
    if (instance.shading->is_repeated(t) || instance.slot(t) != slot) continue;
    const auto corners = instance.shading->corners(t);
    const Vec3f a = instance.vertex(corners[0]);
    const Vec3f ab = instance.vertex(corners[1]) - a;
    const Vec3f ac = instance.vertex(corners[2]) - a;
    emitting.triangles.push_back({a, ab, ac, t});
  }
  if (emitting.triangles.empty()) return;
  if (emitting.is_double_sided) find_outside(emitting);
  for (const auto& group : by_facing(emitting)) {
    if (group.empty()) continue;
    emitting.triangles = group;
    const std::uint32_t light = lights_.add(emitting);
    for (const auto& [a, ab, ac, t] : group) {
      triangle_lights[t] = light;
      const bool is_alone = t % 2 == 0 && instance.shading->is_repeated(t + 1);
      if (is_alone) triangle_lights[t + 1] = light;
    }
  }
}

namespace {

/// The one of `kept` with this key, or a new one; it is added to `used`.
template <class Cached, class Key, class Make>
auto grid_of(const std::vector<Cached>& kept, std::vector<Cached>& used, const Key& key,
             Make&& make) {
  const auto it = std::ranges::find(kept, key, &Cached::key);
  used.push_back(it != kept.end() ? *it : Cached{key, make()});
  return used.back().grid;
}

}  // namespace

// Only what stays counts, so that the grids are the same whatever moved before, and are kept.
void RenderScene::learn_surroundings(const CellGrid::Sees& sees) {
  Surroundings now = surroundings();
  if (!(now == surroundings_)) {
    sky_grids_.clear();
    sun_grids_.clear();
  }
  surroundings_ = std::move(now);
  const Aabb& bounds = surroundings_.bounds;
  if (bounds.is_empty()) return;
  std::vector<CachedSky> skies;
  std::vector<CachedSun> suns;
  lights_.learn_surroundings(
      [&](const std::shared_ptr<const DomeTexture>& dome, const Eigen::Matrix3f& world_from_dome) {
        return grid_of(sky_grids_, skies, std::pair(dome, world_from_dome), [&] {
          return std::make_shared<const SkyGrid>(*dome, world_from_dome, bounds, sees, host_);
        });
      },
      [&](const Vec3f& towards, float one_minus_cos) {
        return grid_of(sun_grids_, suns, std::pair(towards, one_minus_cos), [&] {
          return std::make_shared<const SunGrid>(towards, one_minus_cos, bounds, sees, host_);
        });
      });
  sky_grids_ = std::move(skies);
  sun_grids_ = std::move(suns);
}

RenderScene::Surroundings RenderScene::surroundings() const {
  Surroundings result;
  for (const MeshInstance& instance : instances_) {
    if (instance.is_movable) continue;
    result.meshes.push_back(instance.shading->shared_source());
    result.poses.push_back({instance.linear, instance.translation});
    result.bounds.add(instance.bounds);
    for (const ShadingMaterial* m : instance.materials) {
      result.clear_materials.push_back(m->dims_shadows ? m->source : nullptr);
    }
  }
  return result;
}

}  // namespace diorama
