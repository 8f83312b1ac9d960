// SPDX-License-Identifier: Apache-2.0
#include "embree_scene.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <span>
#include <utility>

#include "diorama/error.h"
#include "renderer_support/stopwatch.h"

namespace diorama {
namespace {

std::string device_options(const std::string& isa, int threads) {
  return "threads=" + std::to_string(std::max(1, threads)) + ",start_threads=0,isa=" + isa;
}

ShadingMesh::Point hit_point(const RTCFilterFunctionNArguments* args, unsigned i) {
  return point_on_triangle(RTCHitN_primID(args->hit, args->N, i), RTCHitN_u(args->hit, args->N, i),
                           RTCHitN_v(args->hit, args->N, i));
}

/// The share of light along a straight line through one surface of this material; where it moves,
/// the direction is what it is to the surface at the moment of the poses.
Vec3f straight_share(const MeshInstance& instance, const ShadingMesh::Point& point,
                     const Vec3f& direction, Passage passage) {
  const ShadingMaterial& material = instance.material(point.triangle);
  if (!material.dims_shadows) return Vec3f::Zero();
  if (passage == Passage::CutOuts && material.is_blended) return Vec3f::Zero();
  const Material& m = *material.source;
  const Vec2f uv = instance.uv(point.triangle, point.u, point.v);
  const float opacity = material.opacity_at(uv, 0.0f);
  const float present = m.opacity_threshold > 0.0f ? (opacity < m.opacity_threshold ? 0.0f : 1.0f)
                                                   : std::clamp(opacity, 0.0f, 1.0f);
  Vec3f share = Vec3f::Constant(1.0f - present);
  const bool is_clear = m.transmission > 0.0f && (passage == Passage::Glass ||
                                                  (passage == Passage::Panes && m.is_thin_walled));
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

/// One float more than the vertices need: Embree reads them in pieces of 16 bytes.
std::vector<float> room_for(const Mesh& mesh) {
  return std::vector<float>(3 * mesh.positions.size() + 1, 0.0f);
}

/// x, y, z of a mesh's vertices at a pose.
void place(const Mesh& mesh, const Eigen::Matrix3f& linear, const Vec3f& translation,
           std::vector<float>& positions) {
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const Vec3f p = linear * mesh.positions[i] + translation;
    positions[3 * i] = p.x();
    positions[3 * i + 1] = p.y();
    positions[3 * i + 2] = p.z();
  }
}

void set_positions(RTCGeometry geometry, unsigned step, const std::vector<float>& positions) {
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, step, RTC_FORMAT_FLOAT3,
                             positions.data(), 0, 3 * sizeof(float), positions.size() / 3);
}

void set_pose(RTCGeometry geometry, unsigned step, const Eigen::Matrix3f& linear,
              const Vec3f& translation) {
  Eigen::Matrix<float, 3, 4> pose;
  pose << linear, translation;
  rtcSetGeometryTransform(geometry, step, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, pose.data());
}

}  // namespace

EmbreeScene::EmbreeScene(Host& host, const Options& options)
    : host_(host),
      scene_(host, options.scene),
      device_(rtcNewDevice(device_options(options.isa, host.thread_count()).c_str())) {
  if (!device_) throw Error(ErrorKind::Plugin, "Embree cannot start on this machine");
}

EmbreeScene::~EmbreeScene() = default;

void EmbreeScene::check_device(const char* action) const {
  const RTCError error = rtcGetDeviceError(device_.get());
  if (error == RTC_ERROR_NONE) return;
  throw Error(ErrorKind::Internal,
              std::string("Embree failed to ") + action + " (error " + std::to_string(int(error)) +
                  (error == RTC_ERROR_OUT_OF_MEMORY ? ", out of memory)" : ")"));
}

void EmbreeScene::take(const Scene& scene, const std::function<void()>& beside) {
  const bool was_ready = std::exchange(is_ready_, false);
  bool has_changed = false;
  {
    const Stopwatch watch(times_.shading_s);
    has_changed = scene_.take(scene);
  }
  if (!has_changed && was_ready) {
    times_.tree_s = times_.lights_s = 0.0;
    is_ready_ = true;
    return beside();
  }
  moving_tree_.reset();
  if (!was_ready) tree_.reset();  // what an error left half made
  const auto make_trees = [&] {
    const Stopwatch watch(times_.tree_s);
    update_trees();
    blur();
  };
  const bool is_lit = scene_.is_lit();
  if (is_lit) {
    host_.parallel_for(2, [&](std::size_t i) { i == 0 ? make_trees() : beside(); });
  } else {
    make_trees();
  }
  {
    const Stopwatch watch(times_.lights_s);
    scene_.light(scene, [this](std::span<const CellGrid::Ray> rays) { return sees(rays); });
  }
  is_ready_ = true;
  if (!is_lit) beside();
}

// A mesh pressed nearly flat is met in world space: rays lose too much on their way into its own.
bool EmbreeScene::is_shared(const MeshInstance& instance) const {
  constexpr float kMostStretch = 1e4f;
  return scene_.meshes()[instance.mesh].instance_count > 1 &&
         instance.linear.norm() * instance.normal_from_node.norm() < kMostStretch;
}

EmbreeScene::Trees EmbreeScene::trees() const {
  Trees trees;
  trees.shared = shared_trees_.size();
  for (const auto& [mesh, tree] : shared_trees_) trees.vertices += tree.positions.size() / 3;
  for (const Placed& placed : placed_) {
    if (placed.is_shared) continue;
    ++trees.in_world;
    trees.vertices += placed.positions.size() / 3;
  }
  return trees;
}

/// Which of the rays leave what is not movable.
std::uint32_t EmbreeScene::sees(std::span<const CellGrid::Ray> rays) const {
  static_assert(CellGrid::kMostRays <= RayPacket8::kSize);
  RayPacket8 packet;
  packet.clear();
  for (const auto& [origin, direction] : rays) {
    packet.add(origin, direction, 0.0f, kInfinite, kMoment);
  }
  std::uint32_t lit = 0;
  transmittance(tree_.get(), packet, Passage::Glass, kStaticMask, [&](int i, const Vec3f& share) {
    lit |= std::uint32_t(share.maxCoeff() > 0.0f) << i;
  });
  return lit;
}

std::uint32_t EmbreeScene::number_of(const RTCFilterFunctionNArguments* args, unsigned i) {
  const unsigned shared = RTCHitN_instID(args->hit, args->N, i, 0);
  const bool is_shared = shared != RTC_INVALID_GEOMETRY_ID;
  return is_shared ? shared : RTCHitN_geomID(args->hit, args->N, i);
}

const MeshInstance& EmbreeScene::instance_of(const RTCFilterFunctionNArguments* args, unsigned i) {
  const auto& instances = *static_cast<const std::vector<MeshInstance>*>(args->geometryUserPtr);
  return instances[number_of(args, i)];
}

void EmbreeScene::pass_where_left_or_cut_out(const RTCFilterFunctionNArguments* args) {
  const auto& meeting = *reinterpret_cast<const MeetingContext*>(args->context);
  for (unsigned i = 0; i < args->N; ++i) {
    if (args->valid[i] == 0) continue;
    const MeshInstance& instance = instance_of(args, i);
    const ShadingMesh::Point point = hit_point(args, i);
    if (meeting.left_instances) {
      const unsigned ray = RTCRayN_id(args->ray, args->N, i);
      if (meeting.left_instances[ray] == std::int32_t(number_of(args, i)) &&
          meeting.left_triangles[ray] == std::int32_t(point.triangle)) {
        args->valid[i] = 0;
        continue;
      }
    }
    const ShadingMaterial& material = instance.material(point.triangle);
    if (!material.is_cut_out) continue;
    const Vec2f uv = instance.uv(point.triangle, point.u, point.v);
    const float opacity = material.opacity_at(uv, 0.0f);
    const float threshold = material.source->opacity_threshold;
    const bool is_absent = threshold > 0.0f ? opacity < threshold : opacity <= 0.0f;
    if (is_absent) args->valid[i] = 0;
  }
}

void EmbreeScene::attenuate_shadow_ray(const RTCFilterFunctionNArguments* args) {
  auto& shadow = *reinterpret_cast<ShadowContext*>(args->context);
  const unsigned count = args->N;
  for (unsigned i = 0; i < count; ++i) {
    if (args->valid[i] == 0) continue;
    const MeshInstance& instance = instance_of(args, i);
    Vec3f direction(RTCRayN_dir_x(args->ray, count, i), RTCRayN_dir_y(args->ray, count, i),
                    RTCRayN_dir_z(args->ray, count, i));
    // In shared trees rays are in the space of the mesh, and turn with it.
    if (RTCHitN_instID(args->hit, count, i, 0) != RTC_INVALID_GEOMETRY_ID) {
      direction = instance.linear * direction;
    } else if (instance.motion) {
      direction = instance.motion->turned_back(direction, RTCRayN_time(args->ray, count, i));
    }
    const Vec3f share =
        straight_share(instance, hit_point(args, i), direction.normalized(), shadow.passage);
    const unsigned ray = RTCRayN_id(args->ray, count, i);
    shadow.attenuate(ray, share);
    if (shadow.transmittance[ray].maxCoeff() > 1e-4f) args->valid[i] = 0;
  }
}

// What is as it was keeps its tree; moved instances are fitted or built again, and those that have
// another mesh take the place of what was there before. Numbers are those of the instances,
// whatever was shown before.
void EmbreeScene::update_trees() {
  find_filters();
  update_shared_trees();
  const std::vector<std::size_t> changed = changed_instances();
  update_filters();
  if (!changed.empty()) {
    attach(changed);
    // What is movable has its tree built as attach() left it, in its own space.
    rtcCommitScene(tree_.get());
  }
  move_to_poses();
  rtcCommitScene(tree_.get());
  check_device("build the ray tracing structure");
  forget_shared_trees();
}

/// Trees have the filters that any instance of their mesh needs: filters look at the material.
void EmbreeScene::find_filters() {
  lets_through_.assign(scene_.meshes().size(), 0);
  for (const MeshInstance& instance : instances()) {
    for (const ShadingMaterial* m : instance.materials) {
      if (m->dims_shadows) lets_through_[instance.mesh] = 1;
    }
  }
}

/// To be followed by a commit: Embree counts filters then.
void EmbreeScene::set_filters(RTCGeometry geometry, bool lets_through) const {
  rtcSetGeometryUserData(geometry, const_cast<std::vector<MeshInstance>*>(&instances()));
  rtcSetGeometryIntersectFilterFunction(geometry,
                                        lets_through ? &pass_where_left_or_cut_out : nullptr);
  rtcSetGeometryOccludedFilterFunction(geometry, lets_through ? &attenuate_shadow_ray : nullptr);
}

void EmbreeScene::update_filters() {
  for (std::size_t i = 0; i < placed_.size(); ++i) {
    const bool lets_through = lets_through_[instances()[i].mesh] != 0;
    if (!placed_[i].geometry || placed_[i].lets_through == lets_through) continue;
    placed_[i].lets_through = lets_through;
    if (!placed_[i].is_shared) set_filters(placed_[i].geometry.get(), lets_through);
    rtcCommitGeometry(placed_[i].geometry.get());
  }
}

void EmbreeScene::update_shared_trees() {
  for (std::size_t i = 0; i < scene_.meshes().size(); ++i) {
    const auto& [mesh, count] = scene_.meshes()[i];
    if (count < 2) continue;
    const auto known = shared_trees_.find(mesh.get());
    if (known == shared_trees_.end()) {
      shared_trees_.emplace(mesh.get(), make_shared_tree(mesh, lets_through_[i] != 0));
    } else if (known->second.lets_through != (lets_through_[i] != 0)) {
      known->second.lets_through = lets_through_[i] != 0;
      commit(known->second);
    }
  }
}

void EmbreeScene::forget_shared_trees() {
  std::set<const ShadingMesh*> used;
  for (const auto& [mesh, count] : scene_.meshes()) {
    if (count > 1) used.insert(mesh.get());
  }
  std::erase_if(shared_trees_, [&](const auto& entry) { return !used.contains(entry.first); });
}

EmbreeScene::SharedTree EmbreeScene::make_shared_tree(std::shared_ptr<const ShadingMesh> mesh,
                                                      bool lets_through) const {
  SharedTree shared{std::move(mesh), {}, lets_through, nullptr, nullptr};
  const Mesh& source = shared.mesh->source();
  shared.positions = room_for(source);
  place(source, Eigen::Matrix3f::Identity(), Vec3f::Zero(), shared.positions);
  shared.geometry = new_geometry(*shared.mesh);
  set_positions(shared.geometry.get(), 0, shared.positions);
  rtcSetGeometryMask(shared.geometry.get(), ~0u);  // instances have masks of their own
  shared.tree.reset(rtcNewScene(device_.get()));
  rtcAttachGeometryByID(shared.tree.get(), shared.geometry.get(), 0);
  commit(shared);
  return shared;
}

void EmbreeScene::commit(const SharedTree& shared) const {
  set_filters(shared.geometry.get(), shared.lets_through);
  rtcCommitGeometry(shared.geometry.get());
  rtcCommitScene(shared.tree.get());
  check_device("build the tree of a mesh");
}

/// The instances that have to be attached; all of them to a new tree, if their number is another
/// one.
std::vector<std::size_t> EmbreeScene::changed_instances() {
  if (!tree_ || placed_.size() != instances().size()) {
    tree_.reset(rtcNewScene(device_.get()));
    // Two levels: the scene over whole meshes is rebuilt cheaply, each mesh has a good tree.
    rtcSetSceneFlags(tree_.get(), RTC_SCENE_FLAG_DYNAMIC);
    rtcSetSceneBuildQuality(tree_.get(), RTC_BUILD_QUALITY_LOW);
    placed_.clear();
    placed_.resize(instances().size());
  }
  std::vector<std::size_t> changed;
  for (std::size_t i = 0; i < placed_.size(); ++i) {
    const MeshInstance& instance = instances()[i];
    const bool is_kept = placed_[i].mesh.get() == instance.shading &&
                         placed_[i].is_movable == instance.is_movable &&
                         placed_[i].is_shared == is_shared(instance);
    if (is_kept) continue;
    if (placed_[i].geometry) rtcDetachGeometry(tree_.get(), unsigned(i));
    placed_[i] = {};
    changed.push_back(i);
  }
  return changed;
}

// A tree that is fitted to new poses depends on the pose it was built in. What may move is built in
// its own space, so that the result is the same whatever poses came before.
void EmbreeScene::attach(const std::vector<std::size_t>& changed) {
  host_.parallel_for(changed.size(), [&](std::size_t k) {
    const MeshInstance& instance = instances()[changed[k]];
    Placed& placed = placed_[changed[k]];
    placed.mesh = scene_.meshes()[instance.mesh].shading;
    placed.is_movable = instance.is_movable;
    placed.is_shared = is_shared(instance);
    placed.lets_through = lets_through_[instance.mesh] != 0;
    if (placed.is_shared || !placed.is_movable) {
      placed.linear = instance.linear;
      placed.translation = instance.translation;
    }
    if (placed.is_shared) return;
    placed.positions = room_for(instance.source());
    place(instance.source(), placed.linear, placed.translation, placed.positions);
  });
  for (const std::size_t i : changed) {
    Placed& placed = placed_[i];
    if (placed.is_shared) {
      placed.geometry = new_instance(*placed.mesh);
      set_pose(placed.geometry.get(), 0, placed.linear, placed.translation);
    } else {
      placed.geometry = new_geometry(*placed.mesh);
      // Refit: built once, then fitted.
      rtcSetGeometryBuildQuality(placed.geometry.get(), placed.is_movable
                                                            ? RTC_BUILD_QUALITY_REFIT
                                                            : RTC_BUILD_QUALITY_MEDIUM);
      set_positions(placed.geometry.get(), 0, placed.positions);
      set_filters(placed.geometry.get(), placed.lets_through);
    }
    rtcSetGeometryMask(placed.geometry.get(), placed.is_movable ? kMovableMask : kStaticMask);
    rtcCommitGeometry(placed.geometry.get());
    rtcAttachGeometryByID(tree_.get(), placed.geometry.get(), unsigned(i));
  }
}

void EmbreeScene::move_to_poses() {
  std::vector<std::uint8_t> has_moved(placed_.size(), 0);
  host_.parallel_for(placed_.size(), [&](std::size_t i) {
    const MeshInstance& instance = instances()[i];
    Placed& placed = placed_[i];
    if (placed.linear == instance.linear && placed.translation == instance.translation) return;
    has_moved[i] = 1;
    placed.linear = instance.linear;
    placed.translation = instance.translation;
    if (placed.is_shared) return;
    place(instance.source(), placed.linear, placed.translation, placed.positions);
  });
  for (std::size_t i = 0; i < placed_.size(); ++i) {
    if (has_moved[i] == 0) continue;
    const Placed& placed = placed_[i];
    if (placed.is_shared) {
      set_pose(placed.geometry.get(), 0, placed.linear, placed.translation);
    } else {
      rtcUpdateGeometryBuffer(placed.geometry.get(), RTC_BUFFER_TYPE_VERTEX, 0);
    }
    rtcCommitGeometry(placed.geometry.get());
  }
}

/// The mesh's triangles, as yet without vertices.
embree::GeometryHandle EmbreeScene::new_geometry(const ShadingMesh& mesh) const {
  const auto& quads = mesh.quads();
  if constexpr (embree::kTakesQuads) {
    embree::GeometryHandle geometry(rtcNewGeometry(device_.get(), RTC_GEOMETRY_TYPE_QUAD));
    rtcSetSharedGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT4,
                               quads.data(), 0, sizeof(quads[0]), quads.size());
    return geometry;
  } else {
    using Corners = std::array<std::uint32_t, 3>;
    embree::GeometryHandle geometry(rtcNewGeometry(device_.get(), RTC_GEOMETRY_TYPE_TRIANGLE));
    void* room = rtcSetNewGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
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

/// Of a mesh with a shared tree, as yet without a pose.
embree::GeometryHandle EmbreeScene::new_instance(const ShadingMesh& mesh) const {
  embree::GeometryHandle geometry(rtcNewGeometry(device_.get(), RTC_GEOMETRY_TYPE_INSTANCE));
  rtcSetGeometryInstancedScene(geometry.get(), shared_trees_.at(&mesh).tree.get());
  return geometry;
}

// A second tree for the colours: what moves is there at several times, the rest is shared. Labels
// go on meeting the first one, so that they are the same with and without a shutter.
void EmbreeScene::blur() {
  moving_positions_.clear();
  const auto moves = [](const MeshInstance& instance) { return instance.motion != nullptr; };
  if (std::ranges::none_of(instances(), moves)) return;
  moving_tree_.reset(rtcNewScene(device_.get()));
  for (std::uint32_t i = 0; i < placed_.size(); ++i) {
    const MeshInstance& instance = instances()[i];
    const embree::GeometryHandle moving = moves(instance) ? make_moving(i) : nullptr;
    rtcAttachGeometryByID(moving_tree_.get(), moving ? moving.get() : placed_[i].geometry.get(), i);
  }
  rtcCommitScene(moving_tree_.get());
  check_device("build the ray tracing structure of moving things");
}

embree::GeometryHandle EmbreeScene::make_moving(std::uint32_t number) {
  // Vertices run straight from step to step: short enough that a turn stays round. An odd number of
  // steps has one in the middle.
  constexpr double kTurnPerStep = 0.1;  // radians
  constexpr double kMostHalves = RTC_MAX_TIME_STEP_COUNT / 2;
  const MeshInstance& instance = instances()[number];
  const auto& [motion, window, world_from_node] = *instance.motion;
  const double turn = 0.5 * motion.angular.norm() * window;
  const int half = int(std::clamp(std::ceil(turn / kTurnPerStep), 1.0, kMostHalves));
  const unsigned steps = 2 * unsigned(half) + 1;
  const bool is_shared = placed_[number].is_shared;
  embree::GeometryHandle geometry =
      is_shared ? new_instance(*instance.shading) : new_geometry(*instance.shading);
  rtcSetGeometryMask(geometry.get(), kMovableMask);
  rtcSetGeometryTimeStepCount(geometry.get(), steps);
  for (unsigned step = 0; step < steps; ++step) {
    const double share = double(step) / (steps - 1) - double(kMoment);
    const Affine pose = motion.then_from_now(share * window) * world_from_node;
    const Eigen::Matrix3f linear = pose.linear().cast<float>();
    const Vec3f translation = pose.translation().cast<float>();
    if (is_shared) {
      set_pose(geometry.get(), step, linear, translation);
      continue;
    }
    std::vector<float>& positions = moving_positions_.emplace_back(room_for(instance.source()));
    place(instance.source(), linear, translation, positions);
    set_positions(geometry.get(), step, positions);
  }
  if (!is_shared) set_filters(geometry.get(), lets_through_[instance.mesh] != 0);
  rtcCommitGeometry(geometry.get());
  return geometry;
}

EmbreeScene::SubScene::SubScene(const EmbreeScene& scene,
                                const std::vector<std::uint32_t>& instances)
    : tree_(rtcNewScene(scene.device_.get())) {
  for (const std::uint32_t i : instances) {
    rtcAttachGeometryByID(tree_.get(), scene.placed_[i].geometry.get(), i);
  }
  rtcCommitScene(tree_.get());
  scene.check_device("build the structure of one instance");
}

float EmbreeScene::SubScene::distance(const Vec3f& origin, const Vec3f& direction, float t_min,
                                      float t_max) const {
  RTCRayHit ray = make_ray(origin, direction, t_min, t_max, kMoment);
  MeetingContext meeting;
  embree::init(meeting.context);
  embree::intersect(tree_.get(), meeting.context, ray);
  const bool is_met = ray.hit.geomID != RTC_INVALID_GEOMETRY_ID;
  return is_met ? ray.ray.tfar : kInfinite;
}

}  // namespace diorama
