// SPDX-License-Identifier: Apache-2.0
#include "gpu_scene.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <queue>
#include <set>
#include <utility>

#include "gpu_bytes.h"
#include "renderer_support/srgb_bytes.h"

namespace diorama {
namespace {

/// See sample_dome() of lights.glsl.
std::vector<std::uint32_t> words_of(const DomeTexture& dome) {
  constexpr std::size_t kWords = 5;
  std::vector<std::uint32_t> words(kWords * dome.patches().size());
  for (std::size_t i = 0; i < dome.patches().size(); ++i) {
    const SquareDistribution& patch = dome.patches()[i];
    words[kWords * i] = std::uint32_t(patch.width());
    words[kWords * i + 1] = std::uint32_t(patch.height());
    words[kWords * i + 2] = std::uint32_t(words.size());
    add_floats(words, patch.weights());
    words[kWords * i + 3] = std::uint32_t(words.size());
    add_floats(words, patch.row_sums());
    words[kWords * i + 4] = std::uint32_t(words.size());
    add_floats(words, patch.within_row());
  }
  return words;
}

/// See grid_cell() of lights.glsl.
std::vector<std::uint32_t> words_of(const CellGrid& grid) {
  std::vector<std::uint32_t> words;
  add_floats(words, {grid.low().data(), 3});
  add_floats(words, {grid.cells_per_metre().data(), 3});
  for (const int count : grid.counts()) words.push_back(std::uint32_t(count));
  return words;
}

std::vector<std::uint32_t> words_of(const SunGrid& sun) {
  std::vector<std::uint32_t> words = words_of(sun.grid());
  add_floats(words, sun.shares());
  return words;
}

std::vector<std::uint32_t> words_of(const SkyGrid& sky) {
  std::vector<std::uint32_t> words = words_of(sky.grid());
  const auto cells = std::uint32_t(sky.grid().size());
  for (std::uint32_t cell = 0; cell < cells; ++cell) {
    words.push_back(std::bit_cast<std::uint32_t>(sky.power(cell)));
  }
  for (std::uint32_t cell = 0; cell < cells; ++cell) add_floats(words, sky.borders(cell));
  return words;
}

/// See tree_score() of lights.glsl.
std::vector<std::uint32_t> words_of(const LightTree& tree) {
  std::vector<std::uint32_t> words;
  for (const LightTree::Block& b : tree.blocks()) {
    for (const auto* lanes : {&b.x, &b.y, &b.z, &b.radius, &b.power, &b.direction_x, &b.direction_y,
                              &b.direction_z, &b.depth, &b.slope, &b.base, &b.spread, &b.behind}) {
      add_floats(words, *lanes);
    }
    for (const std::int32_t child : b.child) words.push_back(std::uint32_t(child));
    words.insert(words.end(), {b.count, b.parent, b.lane_of_parent, 0u});
  }
  return words;
}

gpu::Rows rows_of(const Eigen::Matrix3f& linear, const Vec3f& translation) {
  gpu::Rows rows;
  for (int k = 0; k < 3; ++k) {
    rows[std::size_t(k)] = {linear(k, 0), linear(k, 1), linear(k, 2), translation[k]};
  }
  return rows;
}

std::array<Vec3f, 3> rows_of(const Eigen::Matrix3f& matrix) {
  return {matrix.row(0).transpose(), matrix.row(1).transpose(), matrix.row(2).transpose()};
}

float half_area(const TreeBox& box) {
  const Vec3f size = (box.high - box.low).cwiseMax(0.0f);
  return size.x() * size.y() + size.y() * size.z() + size.z() * size.x();
}

/// A box in the space of an instance's mesh, in the world, as far as it reaches into another.
TreeBox placed(const TreeBox& box, const MeshInstance& instance, const TreeBox& within) {
  if (box.is_empty()) return box;
  TreeBox result;
  for (int i = 0; i < 8; ++i) {
    const Vec3f corner((i & 1) != 0 ? box.high.x() : box.low.x(),
                       (i & 2) != 0 ? box.high.y() : box.low.y(),
                       (i & 4) != 0 ? box.high.z() : box.low.z());
    result.add(instance.to_world(corner));
  }
  const float margin = 2e-6f * result.low.cwiseAbs().cwiseMax(result.high.cwiseAbs()).sum();
  result.low = (result.low.array() - margin).matrix().cwiseMax(within.low);
  result.high = (result.high.array() + margin).matrix().cwiseMin(within.high);
  return result;
}

}  // namespace

TreeBox box_over_time(const MeshInstance& instance, double window) {
  Aabb bounds = instance.bounds;
  if (instance.motion) {
    const RigidMotion& motion = instance.motion->motion;
    const double half = 0.5 * window;
    Aabb swept;
    if (motion.angular.norm() > 0.0) {
      double radius = 0.0;
      for (int i = 0; i < 8; ++i) {
        radius = std::max(radius, (bounds.corner(i) - motion.centre).norm());
      }
      for (const double side : {-1.0, 1.0}) {
        const Vec3 centre = motion.centre + side * half * motion.linear;
        swept.add(Vec3(centre - Vec3::Constant(radius)));
        swept.add(Vec3(centre + Vec3::Constant(radius)));
      }
    } else {
      for (const double side : {-1.0, 1.0}) {
        swept.add(Vec3(bounds.min + side * half * motion.linear));
        swept.add(Vec3(bounds.max + side * half * motion.linear));
      }
    }
    bounds = swept;
  }
  // Rays meet triangles in the space of the mesh: rounding may put them beside the box.
  const float margin = 1e-6f * float(bounds.min.cwiseAbs().cwiseMax(bounds.max.cwiseAbs()).sum());
  TreeBox box;
  box.add(Vec3f(bounds.min.cast<float>() - Vec3f::Constant(margin)));
  box.add(Vec3f(bounds.max.cast<float>() + Vec3f::Constant(margin)));
  return box;
}

void GpuScene::take(const RenderScene& scene) {
  const bool has_same_shapes = shape_revision_ == scene.shape_revision();
  if (has_same_shapes && pose_revision_ == scene.pose_revision()) return;
  // Set at the end: what an error leaves undone is done by the next call.
  shape_revision_ = 0;
  if (!has_same_shapes) {
    take_meshes(scene);
    take_textures(scene);
  }
  take_skies(scene.lights());
  take_tables(scene);
  pose_revision_ = scene.pose_revision();
  shape_revision_ = scene.shape_revision();
}

VulkanDevice::Transfer GpuScene::transfer_to(VulkanBuffer& buffer, std::span<const std::byte> bytes,
                                             const char* what) const {
  buffer.grow(device_, bytes.size(), VulkanBuffer::Place::Device, what);
  return {bytes, &buffer, 0};
}

void GpuScene::take_meshes(const RenderScene& scene) {
  std::vector<std::shared_ptr<const ShadingMesh>> used;
  for (const RenderScene::UsedMesh& mesh : scene.meshes()) used.push_back(mesh.shading);
  const auto on_device = assets_.take(used, host_);
  meshes_.clear();
  for (std::size_t i = 0; i < used.size(); ++i) meshes_.emplace(used[i].get(), on_device[i]);
}

void GpuScene::take_textures(const RenderScene& scene) {
  std::map<std::uint64_t, GpuAssets::OwnedTexture> used;
  const auto take = [&](const MipTexture& texture, const std::shared_ptr<const void>& owner) {
    used.try_emplace(texture.number(), GpuAssets::OwnedTexture{owner, &texture});
  };
  for (const MeshInstance& instance : scene.instances()) {
    for (const ShadingMaterial* m : instance.materials) {
      for (const TextureSlot* slot :
           {&m->base_color, &m->metallic, &m->roughness, &m->normal, &m->opacity, &m->emission}) {
        if (*slot) take(*slot->texture, slot->input->texture);
      }
    }
  }
  for (const LightTable::Record& light : scene.lights().records()) {
    if (light.texture) take(light.texture->image(), light.texture);
  }
  std::vector<GpuAssets::OwnedTexture> wanted;
  for (const auto& [number, texture] : used) wanted.push_back(texture);
  const auto on_device = assets_.take(wanted, host_);
  textures_.clear();
  std::uint32_t place = 0;
  for (const auto& [number, texture] : used) {
    textures_[number] = {on_device[place], place};
    ++place;
  }
}

void GpuScene::take_skies(const LightTable& lights) {
  std::set<const void*> used;
  const auto take = [&](const auto& source) {
    used.insert(source.get());
    if (skies_.contains(source.get())) return;
    const std::vector<std::uint32_t> words = words_of(*source);
    skies_.emplace(source.get(),
                   WordsOnDevice{source, assets_.upload(std::as_bytes(std::span(words)), "a sky")});
  };
  for (const LightTable::Record& light : lights.records()) {
    if (light.sun) take(light.sun);
    if (!light.sky) continue;
    take(light.texture);
    take(light.sky);
  }
  std::erase_if(skies_, [&](const auto& entry) { return !used.contains(entry.first); });
}

gpu::Slot GpuScene::slot_of(const TextureSlot& slot) const {
  gpu::Slot result{};
  result.texture = gpu::kNone;
  if (!slot) return result;
  const TextureInput& input = *slot.input;
  result.scale = input.scale;
  result.bias = input.bias;
  for (int k = 0; k < 3; ++k) {
    result.map_u[std::size_t(k)] = input.uv_from_mesh_uv(0, k);
    result.map_v[std::size_t(k)] = input.uv_from_mesh_uv(1, k);
  }
  result.texture = textures_.at(slot.texture->number()).number;
  result.wrap_u = std::uint32_t(input.wrap_u);
  result.wrap_v = std::uint32_t(input.wrap_v);
  result.channel = std::uint32_t(input.channel);
  return result;
}

gpu::Surface GpuScene::surface_of(const SurfaceBsdf& surface) const {
  const MaterialTables& tables = material_tables_;
  gpu::Surface result;
  if (surface.table) {
    result.layer = tables.base + tables.layers.at(surface.table);
    result.layer_rows = std::uint32_t(surface.table->means().size());
  }
  if (surface.glass) {
    result.glass = tables.base + tables.glasses.at(surface.glass);
    result.glass_rows = std::uint32_t(surface.glass->rows());
    result.eta = surface.glass->eta();
    result.has_glass = 1;
  }
  result.base = surface.base;
  result.metallic = surface.metallic;
  result.transmission = surface.transmission;
  result.alpha = surface.alpha;
  result.f0 = surface.layers.f0;
  result.specular = surface.layers.specular;
  result.coat = surface.layers.coat;
  result.coat_alpha = surface.layers.coat_alpha;
  return result;
}

gpu::Material GpuScene::material_of(const ShadingMaterial& material) const {
  const Material& m = *material.source;
  gpu::Material result;
  result.surfaces = {surface_of(material.sharp), surface_of(material.soft)};
  result.slots = {slot_of(material.base_color), slot_of(material.metallic),
                  slot_of(material.roughness),  slot_of(material.normal),
                  slot_of(material.opacity),    slot_of(material.emission)};
  result.base_color = m.base_color;
  result.emission = m.emission;
  result.opacity = m.opacity;
  result.opacity_threshold = m.opacity_threshold;
  result.ior = m.ior;
  result.transmission = m.transmission;
  result.metallic = m.metallic;
  const auto set = [&](bool is_set, std::uint32_t flag) { result.flags |= is_set ? flag : 0u; };
  set(material.is_thin_glass, gpu::kThinGlass);
  set(material.is_blended, gpu::kBlended);
  set(material.reads_uv, gpu::kReadsUv);
  set(material.is_textured, gpu::kTextured);
  set(material.is_cut_out, gpu::kCutOut);
  set(material.dims_shadows, gpu::kDimsShadows);
  set(material.emits, gpu::kEmits);
  set(material.is_special, gpu::kSpecial);
  set(m.is_thin_walled, gpu::kThinWalled);
  return result;
}

gpu::Instance GpuScene::instance_of(const MeshInstance& instance, double window) const {
  gpu::Instance result = meshes_.at(instance.shading)->parts;
  const Eigen::Matrix3f inverse = instance.linear.cast<double>().inverse().cast<float>();
  const Vec3f back =
      -(instance.linear.cast<double>().inverse() * instance.translation.cast<double>())
           .cast<float>();
  result.world_from_node = rows_of(instance.linear, instance.translation);
  result.node_from_world = rows_of(inverse, back);
  result.normal_from_node = rows_of(instance.normal_from_node);
  result.material_count = std::uint32_t(instance.materials.size());
  if (instance.is_mirrored) result.flags |= gpu::kMirrored;
  if (!instance.triangle_lights.empty()) result.flags |= gpu::kHasLights;
  for (const ShadingMaterial* m : instance.materials) {
    if (m->is_cut_out) result.flags |= gpu::kCutsOut;
    if (m->dims_shadows) result.flags |= gpu::kDims;
  }
  if (instance.motion && window > 0.0) {
    const RigidMotion& motion = instance.motion->motion;
    const double speed = motion.angular.norm();
    result.flags |= gpu::kMoves;
    result.centre = motion.centre.cast<float>();
    result.linear = motion.linear.cast<float>();
    if (speed > 0.0) result.axis = (motion.angular / speed).cast<float>();
    result.turns_per_s = float(speed);
  }
  return result;
}

gpu::Light GpuScene::light_of(const LightTable::Record& light) const {
  gpu::Light result{};
  if (light.sun) result.grid = skies_.at(light.sun.get()).memory.address();
  if (light.sky) {
    result.patches = skies_.at(light.texture.get()).memory.address();
    result.grid = skies_.at(light.sky.get()).memory.address();
  }
  result.position = light.position;
  result.axis_x = light.axis_x;
  result.axis_y = light.axis_y;
  result.direction = light.direction;
  result.radiance = light.radiance;
  result.dome_from_world = rows_of(light.dome_from_world);
  result.radius = light.radius;
  result.area = light.area;
  result.power = light.power;
  result.one_minus_cos = light.one_minus_cos;
  result.cos_outer = light.cos_outer;
  result.cos_inner = light.cos_inner;
  result.shape = std::uint32_t(light.shape);
  result.flags = (light.is_mirrored ? gpu::kLightMirrored : 0u) |
                 (light.is_double_sided ? gpu::kLightDoubleSided : 0u) |
                 (light.is_visible_to_camera ? gpu::kLightVisible : 0u);
  result.texture = light.texture ? textures_.at(light.texture->image().number()).number : 0u;
  result.instance = light.instance;
  result.triangle_count = std::uint32_t(light.triangles.size());
  return result;
}

// Large things overlap: a room holds all others, a table its cups. Their trees are opened, largest
// part first, and the tree over the instances is built over the parts, so that rays enter what they
// pass near (Benthin et al. 2017).
GpuScene::References GpuScene::references_of(const RenderScene& scene) const {
  constexpr std::size_t kPartsPerInstance = 3;  // beside itself
  constexpr std::size_t kFurtherParts = 256;
  constexpr std::size_t kMostParts = 1u << 16;  // more are only memory
  References result;
  std::priority_queue<std::pair<float, std::uint32_t>> largest;  // area, number
  const auto add = [&](std::uint32_t instance, std::uint32_t child, const TreeBox& box) {
    const auto number = std::uint32_t(result.parts.size());
    result.parts.push_back({instance, child});
    result.boxes.push_back(box);
    if ((child & TreeNode::kLeaf) == 0) largest.emplace(half_area(box), number);
  };
  for (std::uint32_t i = 0; i < scene.instances().size(); ++i) {
    add(i, 0, box_over_time(scene.instances()[i], scene.window()));
  }
  const std::size_t most =
      result.parts.size() +
      std::min(kPartsPerInstance * result.parts.size() + kFurtherParts, kMostParts);
  while (!largest.empty() && result.parts.size() < most) {
    const std::uint32_t number = largest.top().second;
    largest.pop();
    const gpu::Reference part = result.parts[number];
    const MeshInstance& instance = scene.instances()[part.instance];
    const auto& top = meshes_.at(instance.shading)->top;
    const auto node = top.find(part.child);
    if (instance.motion || node == top.end() || !node->second.has_b()) continue;
    const TreeBox whole = result.boxes[number];
    const TreeBox a = placed({node->second.low_a, node->second.high_a}, instance, whole);
    const TreeBox b = placed({node->second.low_b, node->second.high_b}, instance, whole);
    // Turned boxes may be no smaller than what they are part of.
    if (half_area(a) + half_area(b) > 1.5f * half_area(whole)) continue;
    result.parts[number].child = node->second.child_a;
    result.boxes[number] = a;
    if ((node->second.child_a & TreeNode::kLeaf) == 0) largest.emplace(half_area(a), number);
    add(part.instance, node->second.child_b, b);
  }
  return result;
}

gpu::Address GpuScene::take_structure(const RenderScene& scene,
                                      std::span<const gpu::Instance> instances) {
  if (!device_.traces_by_query()) return 0;
  std::vector<SceneStructure::Instance> records;
  for (std::size_t i = 0; i < instances.size(); ++i) {
    const gpu::Instance& instance = instances[i];
    const MeshOnDevice& mesh = *meshes_.at(scene.instances()[i].shading);
    const gpu::Address structure = mesh.structure.structure.address();
    const bool is_too_large = structure == 0 && mesh.triangle_count > 0;
    if ((instance.flags & gpu::kMoves) != 0 || is_too_large) return 0;
    records.push_back({instance.world_from_node, structure,
                       (instance.flags & (gpu::kCutsOut | gpu::kDims)) == 0});
  }
  return structure_.build(records);
}

void GpuScene::take_tables(const RenderScene& scene) {
  const LightTable& table = scene.lights();
  std::map<const ShadingMaterial*, std::uint32_t> material_numbers;
  std::vector<const ShadingMaterial*> used;
  std::vector<std::uint32_t> slot_materials;
  for (const MeshInstance& instance : scene.instances()) {
    for (const ShadingMaterial* m : instance.materials) {
      const auto [entry, is_new] = material_numbers.emplace(m, std::uint32_t(used.size()));
      if (is_new) used.push_back(m);
      slot_materials.push_back(entry->second);
    }
  }

  // What the tables below point to.
  GpuBytes blob;
  MaterialTables& parts = material_tables_;
  parts = {};
  for (const ShadingMaterial* m : used) {
    for (const SurfaceBsdf* s : {&m->sharp, &m->soft}) {
      if (s->table && !parts.layers.contains(s->table)) {
        std::vector<std::array<float, 4>> columns;
        for (const LayerTable::Node& n : s->table->nodes())
          columns.push_back({n[0], n[1], n[2], n[3]});
        for (const LayerTable::Means& mean : s->table->means()) {
          columns.push_back({mean.kept, mean.plastic, mean.missing, mean.above});
        }
        parts.layers.emplace(s->table, blob.add(columns));
      }
      if (s->glass && !parts.glasses.contains(s->glass)) {
        std::vector<float> values = s->glass->directional();
        values.insert(values.end(), s->glass->means().begin(), s->glass->means().end());
        parts.glasses.emplace(s->glass, blob.add(values));
      }
    }
  }
  std::vector<std::size_t> triangle_lights;
  for (const MeshInstance& instance : scene.instances()) {
    triangle_lights.push_back(
        instance.triangle_lights.empty() ? 0 : blob.add(instance.triangle_lights));
  }
  std::vector<std::size_t> lamp_triangles;
  for (const LightTable::Record& light : table.records()) {
    std::vector<TriangleColumns> columns;
    for (std::size_t i = 0; i < light.triangles.size(); ++i) {
      const EmittingTriangles::Triangle& t = light.triangles[i];
      columns.push_back(columns_of(t.a, t.index, t.ab, light.cumulative_area[i], t.ac));
    }
    lamp_triangles.push_back(blob.add(columns));
  }
  const std::size_t linear = blob.add(std::span<const float>(linear_from_byte(true)));
  const auto parts_transfer = transfer_to(parts_, blob.bytes(), "tables of materials and lamps");
  parts.base = parts_.address();

  std::vector<gpu::Instance> instances;
  std::uint32_t first_material = 0;
  for (std::size_t i = 0; i < scene.instances().size(); ++i) {
    const MeshInstance& instance = scene.instances()[i];
    gpu::Instance& made = instances.emplace_back(instance_of(instance, scene.window()));
    made.first_material = first_material;
    made.triangle_lights = parts.base + triangle_lights[i];
    first_material += made.material_count;
  }
  std::vector<gpu::Material> materials;
  for (const ShadingMaterial* m : used) materials.push_back(material_of(*m));
  std::vector<gpu::Texture> textures;
  for (const auto& [number, texture] : textures_) textures.push_back(texture.on_device->record);
  std::vector<gpu::Light> lights;
  for (std::size_t i = 0; i < table.records().size(); ++i) {
    lights.push_back(light_of(table.records()[i]));
    lights.back().triangles = parts.base + lamp_triangles[i];
  }
  std::vector<std::uint32_t> places;
  for (const LightTree::Place& place : table.tree().places()) {
    places.insert(places.end(), {place.block, place.lane});
  }

  GpuBytes tables;
  gpu::World world;
  world.structure = take_structure(scene, instances);
  traces_by_query_ = world.structure != 0;
  const References references = references_of(scene);
  world.tree = tables.add(tree_of_single(references.boxes).nodes);
  world.references = tables.add(references.parts);
  world.instances = tables.add(instances);
  world.slot_materials = tables.add(slot_materials);
  world.materials = tables.add(materials);
  world.textures = tables.add(textures);
  world.lights = tables.add(lights);
  world.light_blocks = tables.add(words_of(table.tree()));
  world.light_places = tables.add(places);
  world.light_bodies = tables.add(table.bodies());
  world.light_order = tables.add(table.order());
  world.surroundings = tables.add(table.surroundings());
  world.entry_lights = tables.add(table.entry_lights());
  world.light_shapes = tables.add(table.shapes());
  const auto tables_transfer = transfer_to(tables_, tables.bytes(), "tables of the scene");
  for (gpu::Address* address :
       {&world.tree, &world.references, &world.instances, &world.slot_materials, &world.materials,
        &world.textures, &world.lights, &world.light_blocks, &world.light_places,
        &world.light_bodies, &world.light_order, &world.surroundings, &world.entry_lights,
        &world.light_shapes}) {
    *address += tables_.address();
  }
  world.linear_from_srgb = parts.base + linear;
  world.instance_count = std::uint32_t(instances.size());
  world.light_count = std::uint32_t(lights.size());
  world.root_count = table.tree().root_count();
  world.entry_count = std::uint32_t(table.entry_lights().size());
  world.shape_count = std::uint32_t(table.shapes().size());
  world.surroundings_count = std::uint32_t(table.surroundings().size());
  world.block_count = std::uint32_t(table.tree().blocks().size());
  world.stacks_lobes = scene.stacks_lobes() ? 1 : 0;
  world.window = float(scene.window());
  const auto world_transfer =
      transfer_to(world_, std::as_bytes(std::span(&world, 1)), "tables of the scene");
  device_.upload(std::array{parts_transfer, tables_transfer, world_transfer});
}

}  // namespace diorama
