// SPDX-License-Identifier: Apache-2.0
#include "render_scene.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <span>

#include "diorama/error.h"
#include "renderer_support/stopwatch.h"

namespace diorama {
namespace {

std::string device_options(const std::string& isa, int threads) {
  return "threads=" + std::to_string(std::max(1, threads)) + ",start_threads=0,isa=" + isa;
}

std::shared_ptr<const Texture> make_white_sky() {
  auto texture = std::make_shared<Texture>();
  texture->width = 64;
  texture->height = 32;
  texture->channels = 1;
  texture->floats.assign(64 * 32, 1.0f);
  return texture;
}

ShadingMesh::Point hit_point(const RTCFilterFunctionNArguments* args, unsigned i) {
  return point_on_triangle(RTCHitN_primID(args->hit, args->N, i), RTCHitN_u(args->hit, args->N, i),
                           RTCHitN_v(args->hit, args->N, i));
}

void pass_where_cut_out(const RTCFilterFunctionNArguments* args) {
  const auto& instance = *static_cast<const MeshInstance*>(args->geometryUserPtr);
  for (unsigned i = 0; i < args->N; ++i) {
    if (args->valid[i] == 0) continue;
    const ShadingMesh::Point point = hit_point(args, i);
    const ShadingMaterial& material = instance.material(point.triangle);
    if (!material.is_cut_out) continue;
    const Vec2f uv = instance.uv(point.triangle, point.u, point.v);
    const float opacity = material.opacity_at(uv, 0.0f);
    const float threshold = material.source->opacity_threshold;
    const bool is_absent = threshold > 0.0f ? opacity < threshold : opacity <= 0.0f;
    if (is_absent) args->valid[i] = 0;
  }
}

/// The share of light along a straight line through one surface of this material.
Vec3f straight_share(const MeshInstance& instance, const ShadingMesh::Point& point,
                     const Vec3f& direction, bool passes_glass) {
  const ShadingMaterial& material = instance.material(point.triangle);
  if (!material.dims_shadows) return Vec3f::Zero();
  const Material& m = *material.source;
  const Vec2f uv = instance.uv(point.triangle, point.u, point.v);
  const float opacity = material.opacity_at(uv, 0.0f);
  const float present = m.opacity_threshold > 0.0f ? (opacity < m.opacity_threshold ? 0.0f : 1.0f)
                                                   : std::clamp(opacity, 0.0f, 1.0f);
  Vec3f share = Vec3f::Constant(1.0f - present);
  const bool is_clear = m.transmission > 0.0f && (passes_glass || m.is_thin_walled);
  if (present <= 0.0f || !is_clear) return share;

  const auto corners = instance.shading->corners(point.triangle);
  const Vec3f a = instance.vertex(corners[0]);
  const Vec3f normal = (instance.vertex(corners[1]) - a).cross(instance.vertex(corners[2]) - a);
  const float cosine = std::abs(normal.normalized().dot(direction));
  const float once = fresnel_dielectric(std::max(1e-4f, cosine), std::max(1.0001f, m.ior));
  const float reflected = m.is_thin_walled ? 2.0f * once / (1.0f + once) : once;
  Vec3f tint = m.base_color;
  if (material.base_color) {
    tint = tint.cwiseProduct(material.base_color.at(uv, 0.0f).head<3>().matrix());
  }
  if (!m.is_thin_walled) tint = tint.cwiseMax(0.0f).cwiseSqrt();
  const float weight = present * m.transmission * (1.0f - m.metallic) * (1.0f - reflected);
  return share + weight * tint;
}

}  // namespace

RenderScene::RenderScene(Host& host, const Options& options)
    : host_(host),
      options_(options),
      device_(rtcNewDevice(device_options(options.isa, host.thread_count()).c_str())),
      materials_(host, options.stacks_lobes),
      default_material_(std::make_shared<Material>()),
      white_sky_(make_white_sky()) {
  if (!device_) throw Error(ErrorKind::Plugin, "Embree cannot start on this machine");
}

RenderScene::~RenderScene() {
  release_moving_scene();
  if (scene_) rtcReleaseScene(scene_);
  rtcReleaseDevice(device_);
}

void RenderScene::check_device(const char* action) const {
  const RTCError error = rtcGetDeviceError(device_);
  if (error == RTC_ERROR_NONE) return;
  throw Error(ErrorKind::Internal,
              std::string("Embree failed to ") + action + " (error " + std::to_string(int(error)) +
                  (error == RTC_ERROR_OUT_OF_MEMORY ? ", out of memory)" : ")"));
}

void RenderScene::take(const Scene& scene) {
  std::erase_if(domes_, [](const auto& entry) { return entry.second.owner.expired(); });
  release_moving_scene();
  const Instances previous = std::move(instances_);
  instances_.clear();
  light_nodes_.clear();
  {
    const Stopwatch watch(times_.shading_s);
    collect(scene, scene.root(), Affine::Identity(), false);
    assign_shading_meshes();
    assign_materials(scene);
    pack_uvs();
  }
  {
    const Stopwatch watch(times_.tree_s);
    upload(previous);
    blur(scene);
  }
  const Stopwatch watch(times_.lights_s);
  lights_ = LightTable(options_.has_disk_lamps);
  add_lights(scene);
  add_emitters();
  lights_.finish();
  learn_sky();
}

RenderScene::Kept RenderScene::kept() const {
  return {shading_meshes_.size(), materials_.material_count(), materials_.texture_count(),
          domes_.size(), materials_.albedo_row_count()};
}

// Only what stays counts, so that the grid is the same whatever moved before, and is kept.
void RenderScene::learn_sky() {
  Surroundings now = surroundings();
  if (!(now == surroundings_)) sky_grids_.clear();
  surroundings_ = std::move(now);
  static_assert(SkyGrid::kMostRays <= RayPacket8::kSize);
  const auto sees = [this](std::span<const SkyGrid::Ray> rays) {
    RayPacket8 packet;
    packet.clear();
    for (const auto& [origin, direction] : rays) {
      packet.add(origin, direction, 0.0f, kInfinite, kMoment);
    }
    std::uint32_t lit = 0;
    transmittance(scene_, packet, true, kStaticMask, [&](int i, const Vec3f& share) {
      lit |= std::uint32_t(share.maxCoeff() > 0.0f) << i;
    });
    return lit;
  };
  std::vector<CachedGrid> used;
  lights_.learn_sky([&](const std::shared_ptr<const DomeTexture>& dome,
                        const Eigen::Matrix3f& world_from_dome) -> std::shared_ptr<const SkyGrid> {
    if (surroundings_.bounds.is_empty()) return nullptr;
    const auto same = [&](const CachedGrid& cached) {
      return cached.dome == dome && cached.world_from_dome == world_from_dome;
    };
    const auto it = std::find_if(sky_grids_.begin(), sky_grids_.end(), same);
    if (it != sky_grids_.end()) {
      used.push_back(*it);
    } else {
      used.push_back({dome, world_from_dome,
                      std::make_shared<const SkyGrid>(*dome, world_from_dome, surroundings_.bounds,
                                                      sees, host_)});
    }
    return used.back().grid;
  });
  sky_grids_ = std::move(used);
}

RenderScene::Surroundings RenderScene::surroundings() const {
  Surroundings result;
  for (const auto& instance : instances_) {
    if (instance->is_movable) continue;
    result.meshes.push_back(instance->mesh);
    result.poses.push_back(instance->world_from_node.matrix());
    result.bounds.add(instance->bounds);
    for (const ShadingMaterial* m : instance->materials) {
      result.clear_materials.push_back(m->dims_shadows ? m->source : nullptr);
    }
  }
  return result;
}

void RenderScene::collect(const Scene& scene, NodeId id, const Affine& world_from_parent,
                          bool is_movable) {
  const Node& node = scene[id];
  is_movable |= node.rigid_body.has_value();
  if (!node.is_visible) return;
  const Affine world_from_node = world_from_parent * node.parent_from_node;
  const double determinant = world_from_node.linear().determinant();
  if (node.mesh && !node.mesh->triangles.empty() && std::abs(determinant) > 0.0) {
    auto instance = std::make_unique<MeshInstance>();
    instance->node = id;
    instance->mesh = node.mesh;
    instance->world_from_node = world_from_node;
    instance->normal_from_node = world_from_node.linear().inverse().transpose().cast<float>();
    instance->is_mirrored = determinant < 0.0;
    instance->is_movable = is_movable;
    instances_.push_back(std::move(instance));
  }
  if (node.light) light_nodes_.push_back(id);
  for (NodeId child : node.children) collect(scene, child, world_from_node, is_movable);
}

void RenderScene::assign_shading_meshes() {
  auto before = std::move(shading_meshes_);
  shading_meshes_.clear();
  std::vector<std::shared_ptr<const Mesh>> missing;
  for (const auto& instance : instances_) {
    const auto [it, is_new] = shading_meshes_.emplace(instance->mesh.get(), nullptr);
    if (!is_new) continue;
    // The entry keeps its mesh alive, so an address never comes to mean another mesh.
    if (const auto old = before.find(instance->mesh.get()); old != before.end()) {
      it->second = old->second;
    } else {
      missing.push_back(instance->mesh);
    }
  }
  std::vector<std::shared_ptr<ShadingMesh>> made(missing.size());
  host_.parallel_for(missing.size(),
                     [&](std::size_t i) { made[i] = std::make_shared<ShadingMesh>(missing[i]); });
  for (std::size_t i = 0; i < made.size(); ++i) shading_meshes_[missing[i].get()] = made[i];
  for (const auto& instance : instances_) {
    instance->shading = shading_meshes_.at(instance->mesh.get());
  }
}

void RenderScene::assign_materials(const Scene& scene) {
  std::vector<std::shared_ptr<const Material>> used{default_material_};
  for (const auto& instance : instances_) {
    for (const auto& m : scene[instance->node].materials) {
      if (m) used.push_back(m);
    }
  }
  materials_.keep(used);
  for (const auto& instance : instances_) {
    const auto& assigned = scene[instance->node].materials;
    // A slot beyond the list falls to the default material.
    const std::size_t highest = instance->shading->highest_slot();
    const std::size_t slots = std::min(highest, assigned.size()) + 1;
    for (std::size_t i = 0; i < slots; ++i) {
      const bool is_set = i < assigned.size() && assigned[i];
      instance->materials.push_back(materials_.at(is_set ? assigned[i] : default_material_));
    }
  }
}

void RenderScene::pack_uvs() {
  std::set<ShadingMesh*> textured;
  for (const auto& instance : instances_) {
    const auto reads_uv = [](const ShadingMaterial* m) { return m->reads_uv; };
    if (!std::ranges::any_of(instance->materials, reads_uv)) continue;
    textured.insert(shading_meshes_.at(instance->mesh.get()).get());
  }
  const std::vector<ShadingMesh*> meshes(textured.begin(), textured.end());
  host_.parallel_for(meshes.size(), [&](std::size_t i) { meshes[i]->pack_uvs(); });
}

void RenderScene::attenuate_shadow_ray(const RTCFilterFunctionNArguments* args) {
  auto& shadow = *reinterpret_cast<ShadowContext*>(args->context);
  const auto& instance = *static_cast<const MeshInstance*>(args->geometryUserPtr);
  const unsigned count = args->N;
  for (unsigned i = 0; i < count; ++i) {
    if (args->valid[i] == 0) continue;
    const Vec3f direction(RTCRayN_dir_x(args->ray, count, i), RTCRayN_dir_y(args->ray, count, i),
                          RTCRayN_dir_z(args->ray, count, i));
    const Vec3f share =
        straight_share(instance, hit_point(args, i), direction.normalized(), shadow.passes_glass);
    const unsigned ray = RTCRayN_id(args->ray, count, i);
    shadow.attenuate(ray, share);
    if (shadow.transmittance[ray].maxCoeff() > 1e-4f) args->valid[i] = 0;
  }
}

bool RenderScene::can_keep(const Instances& previous) const {
  if (!scene_ || previous.size() != instances_.size()) return false;
  for (std::size_t i = 0; i < previous.size(); ++i) {
    if (previous[i]->mesh != instances_[i]->mesh) return false;
    if (previous[i]->is_movable != instances_[i]->is_movable) return false;
  }
  return true;
}

// Equal meshes in equal order keep their trees; moved ones are fitted or built again. Otherwise all
// is built, so that geometry numbers never depend on what was shown before.
void RenderScene::upload(const Instances& previous) {
  const bool keeps = can_keep(previous);
  if (keeps) {
    for (std::size_t i = 0; i < instances_.size(); ++i) {
      instances_[i]->world_positions = std::move(previous[i]->world_positions);
      instances_[i]->bounds = previous[i]->bounds;
      instances_[i]->geometry = previous[i]->geometry;
    }
  } else {
    build_all();
  }
  const auto has_moved = [&](std::size_t i) {
    if (!keeps) return instances_[i]->is_movable;  // build_all() left it at its origin
    return previous[i]->world_from_node.matrix() != instances_[i]->world_from_node.matrix();
  };
  host_.parallel_for(instances_.size(), [&](std::size_t i) {
    MeshInstance& instance = *instances_[i];
    if (!has_moved(i)) return;
    instance.bounds = place(*instance.mesh, instance.world_from_node, instance.world_positions);
  });
  for (std::size_t i = 0; i < instances_.size(); ++i) {
    MeshInstance& instance = *instances_[i];
    rtcSetGeometryUserData(instance.geometry, &instance);
    set_filters(instance, instance.geometry);
    if (!has_moved(i)) continue;
    rtcUpdateGeometryBuffer(instance.geometry, RTC_BUFFER_TYPE_VERTEX, 0);
    rtcCommitGeometry(instance.geometry);
  }
  rtcCommitScene(scene_);
  check_device("build the ray tracing structure");
}

// A tree that is fitted to new poses depends on the pose it was built in. What may move is built in
// its own space, so that the result is the same whatever poses came before.
void RenderScene::build_all() {
  if (scene_) rtcReleaseScene(scene_);
  scene_ = rtcNewScene(device_);
  // Two levels: the scene over whole meshes is rebuilt cheaply, each mesh has a good tree.
  rtcSetSceneFlags(scene_, RTC_SCENE_FLAG_DYNAMIC);
  rtcSetSceneBuildQuality(scene_, RTC_BUILD_QUALITY_LOW);
  host_.parallel_for(instances_.size(), [&](std::size_t i) {
    MeshInstance& instance = *instances_[i];
    const Affine pose = instance.is_movable ? Affine::Identity() : instance.world_from_node;
    instance.bounds = place(*instance.mesh, pose, instance.world_positions);
  });
  for (std::size_t i = 0; i < instances_.size(); ++i) {
    MeshInstance& instance = *instances_[i];
    instance.geometry = make_geometry(instance);
    set_filters(instance, instance.geometry);
    rtcCommitGeometry(instance.geometry);
    rtcAttachGeometryByID(scene_, instance.geometry, unsigned(i));
    rtcReleaseGeometry(instance.geometry);
  }
  rtcCommitScene(scene_);
}

void RenderScene::set_filters(const MeshInstance& instance, RTCGeometry geometry) {
  bool is_cut_out = false;
  bool dims_shadows = false;
  for (const ShadingMaterial* m : instance.materials) {
    is_cut_out |= m->is_cut_out;
    dims_shadows |= m->dims_shadows;
  }
  rtcSetGeometryIntersectFilterFunction(geometry, is_cut_out ? &pass_where_cut_out : nullptr);
  rtcSetGeometryOccludedFilterFunction(geometry, dims_shadows ? &attenuate_shadow_ray : nullptr);
}

/// Puts the mesh's vertices into the world; returns their box.
Aabb RenderScene::place(const Mesh& mesh, const Affine& pose, std::vector<float>& positions) {
  // One float more: Embree reads vertices in pieces of 16 bytes.
  positions.resize(3 * mesh.positions.size() + 1, 0.0f);
  const Eigen::Matrix3f linear = pose.linear().cast<float>();
  const Vec3f translation = pose.translation().cast<float>();
  Vec3f low = Vec3f::Constant(kInfinite);
  Vec3f high = -low;
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const Vec3f p = linear * mesh.positions[i] + translation;
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
    positions[3 * i] = p.x();
    positions[3 * i + 1] = p.y();
    positions[3 * i + 2] = p.z();
  }
  return {low.cast<double>(), high.cast<double>()};
}

/// The mesh's triangles, as yet without vertices.
RTCGeometry RenderScene::new_geometry(const ShadingMesh& mesh) const {
  const auto& quads = mesh.quads();
  if constexpr (embree::kTakesQuads) {
    RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_QUAD);
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT4, quads.data(),
                               0, sizeof(quads[0]), quads.size());
    return geometry;
  } else {
    using Corners = std::array<std::uint32_t, 3>;
    RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
    void* room = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                         sizeof(Corners), 2 * quads.size());
    check_device("make a geometry");
    auto* corners = static_cast<Corners*>(room);
    for (const auto& [a, b, c, d] : quads) {
      *corners++ = {a, b, d};
      *corners++ = {c, d, b};
    }
    return geometry;
  }
}

Vec3f MeshInstance::turned(const Vec3f& direction, float time) const {
  const double seconds = double(time - kMoment) * window;
  return (motion.then_from_now(seconds).linear() * direction.cast<double>()).cast<float>();
}

// A second scene for the colours: what moves has its vertices at several times, the rest is shared.
// Labels go on meeting the first one, so that they are the same with and without a shutter.
void RenderScene::blur(const Scene& scene) {
  window_ = shutter_window(scene);
  if (window_ <= 0.0) return;
  std::vector<std::uint32_t> moving;
  for (std::uint32_t i = 0; i < instances_.size(); ++i) {
    MeshInstance& instance = *instances_[i];
    if (!instance.is_movable) continue;
    instance.motion = body_motion(scene, instance.node);
    instance.window = window_;
    if (instance.motion.moves(instance.bounds, window_)) moving.push_back(i);
  }
  if (moving.empty()) return;
  moving_scene_ = rtcNewScene(device_);
  for (std::uint32_t i = 0; i < instances_.size(); ++i) {
    if (std::binary_search(moving.begin(), moving.end(), i)) {
      add_moving_geometry(i);
    } else {
      rtcAttachGeometryByID(moving_scene_, instances_[i]->geometry, i);
    }
  }
  rtcCommitScene(moving_scene_);
  check_device("build the ray tracing structure of moving things");
}

void RenderScene::release_moving_scene() {
  if (moving_scene_) rtcReleaseScene(moving_scene_);
  moving_scene_ = nullptr;
}

void RenderScene::add_moving_geometry(std::uint32_t index) {
  // Vertices run straight from step to step: short enough that a turn stays round. An odd number of
  // steps has one in the middle.
  constexpr double kTurnPerStep = 0.1;  // radians
  constexpr double kMostHalves = RTC_MAX_TIME_STEP_COUNT / 2;
  MeshInstance& instance = *instances_[index];
  const double turn = 0.5 * instance.motion.angular.norm() * window_;
  const int half = int(std::clamp(std::ceil(turn / kTurnPerStep), 1.0, kMostHalves));
  const unsigned steps = 2 * unsigned(half) + 1;
  const Mesh& mesh = *instance.mesh;
  RTCGeometry geometry = new_geometry(*instance.shading);
  rtcSetGeometryMask(geometry, kMovableMask);
  rtcSetGeometryTimeStepCount(geometry, steps);
  instance.blurred_positions.resize(steps);
  for (unsigned step = 0; step < steps; ++step) {
    const double share = double(step) / (steps - 1) - double(kMoment);
    const Affine pose = instance.motion.then_from_now(share * window_) * instance.world_from_node;
    std::vector<float>& positions = instance.blurred_positions[step];
    place(mesh, pose, positions);
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, step, RTC_FORMAT_FLOAT3,
                               positions.data(), 0, 3 * sizeof(float), mesh.positions.size());
  }
  rtcSetGeometryUserData(geometry, &instance);
  set_filters(instance, geometry);
  rtcCommitGeometry(geometry);
  rtcAttachGeometryByID(moving_scene_, geometry, index);
  rtcReleaseGeometry(geometry);
}

RTCGeometry RenderScene::make_geometry(MeshInstance& instance) const {
  const Mesh& mesh = *instance.mesh;
  RTCGeometry geometry = new_geometry(*instance.shading);
  // Refit: built once, then fitted.
  rtcSetGeometryBuildQuality(
      geometry, instance.is_movable ? RTC_BUILD_QUALITY_REFIT : RTC_BUILD_QUALITY_MEDIUM);
  rtcSetGeometryMask(geometry, instance.is_movable ? kMovableMask : kStaticMask);
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                             instance.world_positions.data(), 0, 3 * sizeof(float),
                             mesh.positions.size());
  return geometry;
}

void RenderScene::add_lights(const Scene& scene) {
  for (NodeId id : light_nodes_) {
    const Light& light = *scene[id].light;
    std::shared_ptr<const DomeTexture> dome;
    if (light.kind == LightKind::Dome) {
      const auto& image = light.texture ? light.texture : white_sky_;
      CachedDome& cached = domes_[image.get()];
      if (cached.owner.lock() != image) {
        cached = {image, std::make_shared<const DomeTexture>(*image)};
      }
      dome = cached.dome;
    }
    lights_.add(light, scene.world_from_node(id), dome);
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
  for (std::size_t g = 0; g < instances_.size(); ++g) {
    MeshInstance& instance = *instances_[g];
    const bool emits = std::ranges::any_of(instance.materials,
                                           [](const auto* material) { return material->emits; });
    instance.triangle_lights.assign(emits ? instance.shading->number_end() : 0,
                                    MeshInstance::kNoLight);
    for (std::size_t slot = 0; slot < instance.materials.size(); ++slot) {
      const ShadingMaterial& material = *instance.materials[slot];
      if (!material.emits) continue;
      EmittingTriangles emitting;
      emitting.geometry = std::uint32_t(g);
      emitting.is_double_sided = instance.mesh->is_double_sided;
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
      if (emitting.triangles.empty()) continue;
      if (emitting.is_double_sided) find_outside(emitting);
      for (const auto& group : by_facing(emitting)) {
        if (group.empty()) continue;
        emitting.triangles = group;
        const std::uint32_t light = lights_.add(emitting);
        for (const auto& [a, ab, ac, t] : group) {
          instance.triangle_lights[t] = light;
          const bool is_alone = t % 2 == 0 && instance.shading->is_repeated(t + 1);
          if (is_alone) instance.triangle_lights[t + 1] = light;
        }
      }
    }
  }
}

RenderScene::SubScene::SubScene(const RenderScene& scene,
                                const std::vector<std::uint32_t>& instances)
    : scene_(rtcNewScene(scene.device_)) {
  for (std::uint32_t i : instances) {
    rtcAttachGeometryByID(scene_, scene.instances_[i]->geometry, i);
  }
  rtcCommitScene(scene_);
  scene.check_device("build the structure of one instance");
}

RenderScene::SubScene::~SubScene() { rtcReleaseScene(scene_); }

float RenderScene::SubScene::distance(const Vec3f& origin, const Vec3f& direction, float t_min,
                                      float t_max) const {
  RTCRayHit ray = make_ray(origin, direction, t_min, t_max, kMoment);
  embree::Context context;
  embree::init(context);
  embree::intersect(scene_, context, ray);
  const bool is_met = ray.hit.geomID != RTC_INVALID_GEOMETRY_ID;
  return is_met ? ray.ray.tfar : kInfinite;
}

}  // namespace diorama
