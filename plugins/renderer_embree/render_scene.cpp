// SPDX-License-Identifier: Apache-2.0
#include "render_scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "diorama/error.h"

namespace diorama {
namespace {

constexpr float kInfinite = std::numeric_limits<float>::infinity();

template <class V>
V blend(const std::vector<V>& values, const std::array<std::uint32_t, 3>& corners, float u,
        float v) {
  return values[corners[0]] * (1.0f - u - v) + values[corners[1]] * u + values[corners[2]] * v;
}

std::string device_options(const std::string& isa, int threads) {
  std::string options = "threads=" + std::to_string(std::max(1, threads)) + ",start_threads=0";
  if (isa != "auto") return options + ",isa=" + isa;
  // Measured: single rays are a tenth slower with AVX-512 than with AVX2 (Zen 4).
  return __builtin_cpu_supports("avx2") ? options + ",isa=avx2" : options;
}

std::shared_ptr<const Texture> make_white_sky() {
  auto texture = std::make_shared<Texture>();
  texture->width = 64;
  texture->height = 32;
  texture->channels = 1;
  texture->floats.assign(64 * 32, 1.0f);
  return texture;
}

/// Carried by shadow rays; the filter below weakens it.
struct ShadowContext {
  embree::Context context;
  Vec3f transmittance = Vec3f::Ones();
  bool passes_glass = true;
};

void pass_where_cut_out(const RTCFilterFunctionNArguments* args) {
  const auto& instance = *static_cast<const MeshInstance*>(args->geometryUserPtr);
  const std::uint32_t triangle = RTCHitN_primID(args->hit, args->N, 0);
  const ShadingMaterial& material = instance.material(triangle);
  if (!material.is_cut_out) return;
  const float u = RTCHitN_u(args->hit, args->N, 0);
  const float v = RTCHitN_v(args->hit, args->N, 0);
  const float opacity = material.opacity_at(instance.uv(triangle, u, v), 0.0f);
  const float threshold = material.source->opacity_threshold;
  const bool is_absent = threshold > 0.0f ? opacity < threshold : opacity <= 0.0f;
  if (is_absent) args->valid[0] = 0;
}

/// The share of light along a straight line through one surface of this material.
Vec3f straight_share(const MeshInstance& instance, std::uint32_t triangle, float u, float v,
                     const Vec3f& direction, bool passes_glass) {
  const ShadingMaterial& material = instance.material(triangle);
  if (!material.dims_shadows) return Vec3f::Zero();
  const Material& m = *material.source;
  const Vec2f uv = instance.uv(triangle, u, v);
  const float opacity = material.opacity_at(uv, 0.0f);
  const float present = m.opacity_threshold > 0.0f ? (opacity < m.opacity_threshold ? 0.0f : 1.0f)
                                                   : std::clamp(opacity, 0.0f, 1.0f);
  Vec3f share = Vec3f::Constant(1.0f - present);
  const bool is_clear = m.transmission > 0.0f && (passes_glass || m.is_thin_walled);
  if (present <= 0.0f || !is_clear) return share;

  const auto& corners = instance.mesh->triangles[triangle];
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

void weaken_shadow_ray(const RTCFilterFunctionNArguments* args) {
  auto& shadow = *reinterpret_cast<ShadowContext*>(args->context);
  const auto& instance = *static_cast<const MeshInstance*>(args->geometryUserPtr);
  const Vec3f direction(RTCRayN_dir_x(args->ray, args->N, 0), RTCRayN_dir_y(args->ray, args->N, 0),
                        RTCRayN_dir_z(args->ray, args->N, 0));
  const Vec3f share = straight_share(
      instance, RTCHitN_primID(args->hit, args->N, 0), RTCHitN_u(args->hit, args->N, 0),
      RTCHitN_v(args->hit, args->N, 0), direction.normalized(), shadow.passes_glass);
  shadow.transmittance = shadow.transmittance.cwiseProduct(share);
  if (shadow.transmittance.maxCoeff() > 1e-4f) args->valid[0] = 0;
}

RTCRayHit make_ray(const Vec3f& origin, const Vec3f& direction, float t_min, float t_max) {
  RTCRayHit ray;
  ray.ray.org_x = origin.x();
  ray.ray.org_y = origin.y();
  ray.ray.org_z = origin.z();
  ray.ray.dir_x = direction.x();
  ray.ray.dir_y = direction.y();
  ray.ray.dir_z = direction.z();
  ray.ray.tnear = t_min;
  ray.ray.tfar = t_max;
  ray.ray.time = 0.0f;
  ray.ray.mask = ~0u;
  ray.ray.id = 0;
  ray.ray.flags = 0;
  ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  return ray;
}

}  // namespace

float ShadingMaterial::opacity_at(const Vec2f& uv, float footprint) const {
  return opacity ? opacity.scalar(uv, footprint) : source->opacity;
}

Vec3f ShadingMaterial::emission_at(const Vec2f& uv, float footprint) const {
  if (!emission) return source->emission;
  const Vec3f texel = emission.at(uv, footprint).head<3>().matrix().cwiseMax(0.0f);
  return source->emission.cwiseProduct(texel);
}

std::size_t MeshInstance::slot(std::uint32_t triangle) const {
  const std::size_t slot = mesh->material_slots.empty() ? 0 : mesh->material_slots[triangle];
  return std::min(slot, materials.size() - 1);
}

Vec2f MeshInstance::uv(std::uint32_t triangle, float u, float v) const {
  return mesh->uvs.empty() ? Vec2f::Zero() : blend(mesh->uvs, mesh->triangles[triangle], u, v);
}

RenderScene::RenderScene(Host& host, const std::string& isa)
    : host_(host),
      device_(rtcNewDevice(device_options(isa, host.thread_count()).c_str())),
      default_material_(std::make_shared<Material>()),
      white_sky_(make_white_sky()) {
  if (!device_) throw Error(ErrorKind::Plugin, "Embree cannot start on this machine");
}

RenderScene::~RenderScene() {
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
  std::erase_if(textures_, [](const auto& entry) { return entry.second.owner.expired(); });
  std::erase_if(domes_, [](const auto& entry) { return entry.second.owner.expired(); });
  const std::vector<std::unique_ptr<MeshInstance>> previous = std::move(instances_);
  instances_.clear();
  light_nodes_.clear();
  materials_.clear();
  material_indices_.clear();
  collect(scene, scene.root(), Affine::Identity());
  load_textures(scene);
  for (const auto& instance : instances_) {
    const auto& assigned = scene[instance->node].materials;
    const auto slots = std::max<std::size_t>(1, assigned.size());
    for (std::size_t i = 0; i < slots; ++i) {
      const bool is_set = i < assigned.size() && assigned[i];
      instance->materials.push_back(material_index(is_set ? assigned[i] : default_material_));
    }
    // A slot beyond the list falls to the default material.
    const auto& used = instance->mesh->material_slots;
    const bool needs_more = !used.empty() && *std::max_element(used.begin(), used.end()) >= slots;
    if (needs_more) instance->materials.push_back(material_index(default_material_));
    instance->slot_lights.assign(instance->materials.size(), MeshInstance::kNoLight);
    instance->all_materials = &materials_;
  }
  upload(previous);
  lights_ = Lights();
  add_lights(scene);
  add_emitters();
  const auto sees = [this](const Vec3f& origin, const Vec3f& direction) {
    return transmittance(origin, direction, kInfinite, true).maxCoeff() > 0.0f;
  };
  lights_.learn_sky(bounds_, sees, host_);
}

void RenderScene::collect(const Scene& scene, NodeId id, const Affine& world_from_parent) {
  const Node& node = scene[id];
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
    instances_.push_back(std::move(instance));
  }
  if (node.light) light_nodes_.push_back(id);
  for (NodeId child : node.children) collect(scene, child, world_from_node);
}

void RenderScene::load_textures(const Scene& scene) {
  std::vector<std::shared_ptr<const Texture>> missing;
  std::set<const Texture*> seen;
  const auto want = [&](const TextureInput& input) {
    if (!input || !seen.insert(input.texture.get()).second) return;
    const auto it = textures_.find(input.texture.get());
    if (it == textures_.end() || it->second.owner.lock() != input.texture) {
      missing.push_back(input.texture);
    }
  };
  for (const auto& instance : instances_) {
    for (const auto& m : scene[instance->node].materials) {
      if (!m) continue;
      for (const TextureInput* input :
           {&m->base_color_texture, &m->metallic_texture, &m->roughness_texture, &m->normal_texture,
            &m->opacity_texture, &m->emission_texture}) {
        want(*input);
      }
    }
  }
  std::vector<std::shared_ptr<const MipTexture>> made(missing.size());
  host_.parallel_for(missing.size(), [&](std::size_t i) {
    made[i] = std::make_shared<const MipTexture>(missing[i]);
  });
  for (std::size_t i = 0; i < missing.size(); ++i) {
    textures_[missing[i].get()] = {missing[i], made[i]};
  }
}

TextureSlot RenderScene::slot(const TextureInput& input) const {
  if (!input) return {};
  return {&input, textures_.at(input.texture.get()).mips.get()};
}

std::uint32_t RenderScene::material_index(const std::shared_ptr<const Material>& material) {
  const auto [it, is_new] =
      material_indices_.emplace(material.get(), std::uint32_t(materials_.size()));
  if (is_new) materials_.push_back(make_material(material));
  return it->second;
}

ShadingMaterial RenderScene::make_material(std::shared_ptr<const Material> source) {
  const Material& m = *source;
  ShadingMaterial material;
  material.base_color = slot(m.base_color_texture);
  material.metallic = slot(m.metallic_texture);
  material.roughness = slot(m.roughness_texture);
  material.normal = slot(m.normal_texture);
  material.opacity = slot(m.opacity_texture);
  material.emission = slot(m.emission_texture);
  material.is_cut_out = material.opacity || m.opacity < 1.0f;
  material.dims_shadows = material.is_cut_out || m.transmission > 0.0f;
  material.emits = m.emission.maxCoeff() > 0.0f;
  if (m.transmission > 0.0f && !m.is_thin_walled) {
    auto& tables = glass_tables_[std::max(1.0001f, m.ior)];
    if (!tables) tables = std::make_unique<GlassTables>(std::max(1.0001f, m.ior));
    material.glass = tables.get();
  }
  material.source = std::move(source);
  return material;
}

bool RenderScene::can_keep(const std::vector<std::unique_ptr<MeshInstance>>& previous) const {
  if (!scene_ || previous.size() != instances_.size()) return false;
  for (std::size_t i = 0; i < previous.size(); ++i) {
    if (previous[i]->mesh != instances_[i]->mesh) return false;
  }
  return true;
}

// Equal meshes in equal order keep their trees; only moved ones are built again. Otherwise all is
// built, so that geometry numbers never depend on what was shown before.
void RenderScene::upload(const std::vector<std::unique_ptr<MeshInstance>>& previous) {
  const bool keeps = can_keep(previous);
  if (!keeps) {
    if (scene_) rtcReleaseScene(scene_);
    scene_ = rtcNewScene(device_);
    // Two levels: the scene over whole meshes is rebuilt cheaply, each mesh has a good tree.
    rtcSetSceneFlags(scene_, RTC_SCENE_FLAG_DYNAMIC);
    rtcSetSceneBuildQuality(scene_, RTC_BUILD_QUALITY_LOW);
  }
  host_.parallel_for(instances_.size(), [&](std::size_t i) {
    MeshInstance& instance = *instances_[i];
    const bool stays =
        keeps && previous[i]->world_from_node.matrix() == instance.world_from_node.matrix();
    if (keeps) {
      instance.world_positions = std::move(previous[i]->world_positions);
      instance.bounds = previous[i]->bounds;
      instance.geometry = previous[i]->geometry;
    }
    if (!stays) place(instance);
  });
  for (std::size_t i = 0; i < instances_.size(); ++i) {
    MeshInstance& instance = *instances_[i];
    if (!keeps) {
      instance.geometry = make_geometry(instance);
      rtcAttachGeometryByID(scene_, instance.geometry, unsigned(i));
      rtcReleaseGeometry(instance.geometry);
    } else if (previous[i]->world_from_node.matrix() != instance.world_from_node.matrix()) {
      rtcUpdateGeometryBuffer(instance.geometry, RTC_BUFFER_TYPE_VERTEX, 0);
    }
    bool is_cut_out = false;
    bool dims_shadows = false;
    for (std::uint32_t m : instance.materials) {
      is_cut_out |= materials_[m].is_cut_out;
      dims_shadows |= materials_[m].dims_shadows;
    }
    rtcSetGeometryUserData(instance.geometry, &instance);
    rtcSetGeometryIntersectFilterFunction(instance.geometry,
                                          is_cut_out ? &pass_where_cut_out : nullptr);
    rtcSetGeometryOccludedFilterFunction(instance.geometry,
                                         dims_shadows ? &weaken_shadow_ray : nullptr);
    rtcCommitGeometry(instance.geometry);
  }
  rtcCommitScene(scene_);
  check_device("build the ray tracing structure");
  bounds_ = Aabb();
  for (const auto& instance : instances_) bounds_.add(instance->bounds);
}

void RenderScene::place(MeshInstance& instance) const {
  const auto& positions = instance.mesh->positions;
  // One float more: Embree reads vertices in pieces of 16 bytes.
  instance.world_positions.resize(3 * positions.size() + 1, 0.0f);
  instance.bounds = Aabb();
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const Vec3 p = instance.world_from_node * positions[i].cast<double>();
    instance.bounds.add(p);
    for (std::size_t k = 0; k < 3; ++k)
      instance.world_positions[3 * i + k] = float(p[Eigen::Index(k)]);
  }
}

RTCGeometry RenderScene::make_geometry(MeshInstance& instance) const {
  const Mesh& mesh = *instance.mesh;
  RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
  rtcSetGeometryBuildQuality(geometry, RTC_BUILD_QUALITY_MEDIUM);
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                             instance.world_positions.data(), 0, 3 * sizeof(float),
                             mesh.positions.size());
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                             mesh.triangles.data(), 0, sizeof(mesh.triangles[0]),
                             mesh.triangles.size());
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
        cached = {image, std::make_shared<const DomeTexture>(image)};
      }
      dome = cached.dome;
    }
    lights_.add(light, scene.world_from_node(id), dome);
  }
}

void RenderScene::add_emitters() {
  for (std::size_t g = 0; g < instances_.size(); ++g) {
    MeshInstance& instance = *instances_[g];
    for (std::size_t slot = 0; slot < instance.materials.size(); ++slot) {
      const ShadingMaterial& material = materials_[instance.materials[slot]];
      if (!material.emits) continue;
      EmittingTriangles emitting;
      emitting.geometry = std::uint32_t(g);
      emitting.is_double_sided = instance.mesh->is_double_sided;
      emitting.mean_radiance = material.source->emission;
      if (material.emission) {
        const int top = material.emission.texture->level_count() - 1;
        emitting.mean_radiance = emitting.mean_radiance.cwiseProduct(
            Vec3f(material.emission.texture->texel(top, 0, 0).head<3>().matrix()));
      }
      for (std::uint32_t t = 0; t < instance.mesh->triangles.size(); ++t) {
        if (instance.slot(t) != slot) continue;
        const auto& corners = instance.mesh->triangles[t];
        const Vec3f a = instance.vertex(corners[0]);
        const Vec3f ab = instance.vertex(corners[1]) - a;
        const Vec3f ac = instance.vertex(corners[2]) - a;
        emitting.triangles.push_back({a, ab, ac, t});
      }
      emitting.is_mirrored = instance.is_mirrored;
      if (!emitting.triangles.empty())
        instance.slot_lights[slot] = lights_.add(std::move(emitting));
    }
  }
}

RayHit RenderScene::intersect(const Vec3f& origin, const Vec3f& direction, float t_min,
                              float t_max) const {
  RTCRayHit ray = make_ray(origin, direction, t_min, t_max);
  embree::Context context;
  embree::init(context);
  embree::intersect(scene_, context, ray);
  if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) return {};
  return {instances_[ray.hit.geomID].get(),
          ray.hit.geomID,
          ray.hit.primID,
          ray.hit.u,
          ray.hit.v,
          ray.ray.tfar};
}

Vec3f RenderScene::transmittance(const Vec3f& origin, const Vec3f& direction, float t_max,
                                 bool passes_glass) const {
  RTCRayHit ray = make_ray(origin, direction, 0.0f, t_max);
  ShadowContext shadow;
  shadow.passes_glass = passes_glass;
  embree::init(shadow.context);
  embree::occluded(scene_, shadow.context, ray.ray);
  return ray.ray.tfar == -kInfinite ? Vec3f(Vec3f::Zero()) : shadow.transmittance;
}

SurfaceGeometry RenderScene::surface_at(const RayHit& hit, const Vec3f& direction) {
  const MeshInstance& instance = *hit.instance;
  const Mesh& mesh = *instance.mesh;
  const auto& corners = mesh.triangles[hit.triangle];
  const Vec3f a = instance.vertex(corners[0]);
  const Vec3f ab = instance.vertex(corners[1]) - a;
  const Vec3f ac = instance.vertex(corners[2]) - a;
  SurfaceGeometry s;
  s.position = a + hit.u * ab + hit.v * ac;
  const Vec3f cross = ab.cross(ac);
  const float twice_area = cross.norm();
  s.flat_normal = twice_area > 0.0f ? Vec3f(cross / twice_area) : Vec3f(-direction);
  const float facing = s.flat_normal.dot(direction);
  s.is_back = (facing > 0.0f) != instance.is_mirrored;
  if (facing > 0.0f) s.flat_normal = -s.flat_normal;

  s.normal = s.flat_normal;
  if (!mesh.normals.empty()) {
    const Vec3f n = instance.normal_from_node * blend(mesh.normals, corners, hit.u, hit.v);
    const float length = n.norm();
    if (length > 0.0f) s.normal = n / (s.is_back ? -length : length);
    // Seen from the visible side, a normal that points away is bent back to the horizon.
    const float away = s.normal.dot(direction);
    if (away > -1e-4f) s.normal = (s.normal - (away + 1e-4f) * direction).normalized();
  }
  if (!mesh.uvs.empty()) {
    s.uv = blend(mesh.uvs, corners, hit.u, hit.v);
    const Vec2f e = mesh.uvs[corners[1]] - mesh.uvs[corners[0]];
    const Vec2f f = mesh.uvs[corners[2]] - mesh.uvs[corners[0]];
    const float uv_area = std::abs(e.x() * f.y() - e.y() * f.x());
    s.uv_per_metre = twice_area > 0.0f ? std::sqrt(uv_area / twice_area) : 0.0f;
  } else {
    s.uv = Vec2f::Zero();
  }
  return s;
}

RenderScene::Part::Part(const RenderScene& scene, const std::vector<std::uint32_t>& instances)
    : scene_(rtcNewScene(scene.device_)) {
  for (std::uint32_t i : instances) {
    rtcAttachGeometryByID(scene_, scene.instances_[i]->geometry, i);
  }
  rtcCommitScene(scene_);
  scene.check_device("build the structure of one instance");
}

RenderScene::Part::~Part() { rtcReleaseScene(scene_); }

bool RenderScene::Part::is_met(const Vec3f& origin, const Vec3f& direction, float t_min,
                               float t_max) const {
  RTCRayHit ray = make_ray(origin, direction, t_min, t_max);
  embree::Context context;
  embree::init(context);
  embree::intersect(scene_, context, ray);
  return ray.hit.geomID != RTC_INVALID_GEOMETRY_ID;
}

}  // namespace diorama
