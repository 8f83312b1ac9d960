// SPDX-License-Identifier: Apache-2.0
#include "training_scenes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <span>
#include <utility>

#include "benchmarks/bench_scene.h"
#include "diorama/error.h"
#include "loader_dining_room/dining_room_loader.h"
#include "loader_samples/samples_loader.h"
#include "loader_samples/sky.h"
#include "loader_usd/usd_loader.h"
#include "modelling/textures.h"

namespace diorama::training {
namespace {

constexpr double kSensorWidthMm = 20.955;
constexpr std::uint64_t kFirstRoom = 100000;  // far from the rooms of the sample pack and of tests

std::shared_ptr<const Material> shared(Material material) {
  return std::make_shared<const Material>(std::move(material));
}

NodeId add_mesh(Scene& scene, const char* name, Mesh mesh, Material material, const Affine& pose) {
  const NodeId node = scene.create(scene.root(), name);
  scene.edit(node).mesh = std::make_shared<const Mesh>(std::move(mesh));
  scene.edit(node).materials = {shared(std::move(material))};
  scene.set_pose(node, pose);
  return node;
}

Affine at(const Vec3& place, const Quat& turn = Quat::Identity()) {
  return Affine(Eigen::Translation3d(place) * turn);
}

double log_uniform(Rng& rng, double low, double high) {
  return std::exp(rng.uniform(std::log(low), std::log(high)));
}

Vec3f random_color(Rng& rng) {
  const auto grey = float(rng.uniform(0.03, 0.9));
  const auto vividness = float(rng.uniform());
  Vec3f color;
  for (int k = 0; k < 3; ++k) color[k] = grey + vividness * (float(rng.uniform(0.02, 0.9)) - grey);
  return color;
}

std::shared_ptr<const Texture> random_texture(Rng& rng, Host& host) {
  using namespace modelling;
  constexpr int kPixels = 256;
  const std::uint64_t seed = rng.bits();
  switch (rng.index(8)) {
    case 0:
      return make_wood(host, random_wood(rng), seed, kPixels).color;
    case 1:
      return make_tiles(host, {.other = color(0x40526a), .tiles_per_repeat = 6}, seed, kPixels)
          .color;
    case 2:
      return make_marble(host, color(0xe8e4dc), color(0x6a6660), seed, kPixels).color;
    case 3:
      return make_wallpaper(host, color(0xd8d0b8), color(0x7a4a3a), rng.chance(0.5), seed, kPixels)
          .color;
    case 4:
      return make_fabric(host, color(0x90a0b0), color(0x405060), 0.2, seed, kPixels).color;
    case 5:
      return make_rug(rng.fork("rug"), kPixels, kPixels);
    case 6:
      return make_painting(rng.fork("painting"), kPixels, kPixels);
    default:
      return make_book_spines(rng.fork("books"), 12, kPixels, kPixels);
  }
}

TextureInput input_of(std::shared_ptr<const Texture> texture, double repeats) {
  TextureInput input;
  input.texture = std::move(texture);
  input.uv_from_mesh_uv.leftCols<2>() *= float(repeats);
  return input;
}

/// Full and empty squares, as opacity.
std::shared_ptr<const Texture> holes(Rng& rng) {
  constexpr int kPixels = 64;
  const auto cells = int(4 + rng.index(9));
  auto texture = std::make_shared<Texture>();
  texture->name = "holes";
  texture->width = texture->height = kPixels;
  texture->channels = 1;
  for (int y = 0; y < kPixels; ++y) {
    for (int x = 0; x < kPixels; ++x) {
      const bool is_full = x * cells / kPixels % 2 == 0 || y * cells / kPixels % 2 == 0;
      texture->bytes.push_back(is_full ? 255 : 0);
    }
  }
  return texture;
}

Material random_material(Rng& rng, Host& host) {
  Material m;
  m.base_color = random_color(rng);
  m.roughness = float(rng.uniform(0.05, 1.0));
  const double kind = rng.uniform();
  if (kind < 0.14) {
    m.transmission = 1.0f;
    m.roughness = rng.chance(0.8) ? 0.0f : float(rng.uniform(0.05, 0.5));
    m.base_color = Vec3f::Ones() - 0.3f * float(rng.uniform()) * random_color(rng);
    m.ior = float(rng.uniform(1.3, 1.7));
  } else if (kind < 0.2) {
    m.transmission = 1.0f;
    m.roughness = 0.0f;
    m.is_thin_walled = true;
    m.base_color = Vec3f::Ones() - 0.4f * float(rng.uniform()) * random_color(rng);
  } else if (kind < 0.36) {
    m.metallic = 1.0f;
    m.base_color = m.base_color.cwiseMax(0.3f);
    m.roughness = rng.chance(0.4) ? float(rng.uniform(0.0, 0.1)) : float(rng.uniform(0.1, 0.6));
  } else if (kind < 0.42) {
    m.opacity = float(rng.uniform(0.2, 0.8));
  } else if (kind < 0.46) {
    m.opacity_texture = input_of(holes(rng), 1.0);
    m.opacity_threshold = 0.5f;
  } else if (kind < 0.52) {
    m.clearcoat = 1.0f;
    m.clearcoat_roughness = float(rng.uniform(0.0, 0.2));
  } else if (kind < 0.54) {
    m.emission = float(log_uniform(rng, 100.0, 5000.0)) * random_color(rng);
  }
  if (m.transmission == 0.0f && rng.chance(0.45)) {
    m.base_color = Vec3f::Ones();
    m.base_color_texture = input_of(random_texture(rng, host), rng.uniform(0.5, 4.0));
  }
  return m;
}

Mesh random_shape(Rng& rng) {
  const double size = log_uniform(rng, 0.04, 0.3);
  switch (rng.index(8)) {
    case 0:
      return make_box(size * Vec3(1.0, rng.uniform(0.3, 1.0), rng.uniform(0.3, 1.0)));
    case 1:
      return make_sphere(0.5 * size, 64);
    case 2:
      return make_cylinder(0.3 * size, size);
    case 3:
      return make_cone(0.4 * size, size);
    case 4:
      return make_capsule(0.2 * size, 0.6 * size);
    case 5:
      return make_plane(size, size);
    case 6:  // wires and sticks
      return make_cylinder(log_uniform(rng, 0.0006, 0.006), rng.uniform(0.1, 0.8), 12);
    default:  // leaves of paper, shelves
      return make_box(Vec3(size, size, 0.002));
  }
}

/// Something in the box, turned at random: a shape, or an object or prop of the samples.
void add_thing(Scene& scene, const Aabb& box, Rng& rng, Host& host) {
  const Affine pose = at(rng.uniform_in(box), rng.uniform_rotation());
  if (rng.chance(0.6)) {
    add_mesh(scene, "shape", random_shape(rng), random_material(rng, host), pose);
    return;
  }
  const NodeId node = scene.create(scene.root(), "thing");
  samples::SamplesLoader loader({rng.chance(0.7) ? "objects" : "props"}, host);
  const auto names = loader.assets();
  loader.load(names[rng.index(names.size())], scene, node);
  const double extent = (scene.world_bounds(node).max - scene.world_bounds(node).min).maxCoeff();
  scene.set_pose(node, pose * Eigen::Scaling(std::min(1.0, 0.35 / std::max(0.01, extent))));
}

void add_sky(Scene& scene, Rng& rng, Host& host) {
  const NodeId node = scene.create(scene.root(), "sky");
  Light light;
  light.kind = LightKind::Dome;
  light.color = Vec3f::Constant(float(1000.0 * log_uniform(rng, 0.3, 3.0)));
  samples::SkyLook look;
  look.name = "training";
  look.sun_elevation_deg = rng.uniform(4.0, 75.0);
  look.sun_azimuth_deg = rng.uniform(0.0, 360.0);
  look.turbidity = rng.uniform(2.0, 6.0);
  look.cloud_cover = rng.chance(0.5) ? rng.uniform() : 0.0;
  look.sun_strength = rng.chance(0.6) ? 1.0 : rng.uniform();
  look.mean_luminance = rng.uniform(0.4, 1.2);
  look.ground = samples::Ground(rng.index(4));
  if (rng.chance(0.85)) light.texture = samples::make_sky(look, host);
  scene.edit(node).light = light;
  scene.set_pose(node,
                 at(Vec3::Zero(), Quat(Eigen::AngleAxisd(rng.uniform(0, 2 * kPi), Vec3::UnitZ()))));
}

void add_lamps(Scene& scene, const Aabb& box, std::size_t count, Rng& rng) {
  for (std::size_t i = 0; i < count; ++i) {
    Light light;
    const double kind = rng.uniform();
    light.kind = kind < 0.7 ? LightKind::Sphere : LightKind::Rect;
    light.radius_m = log_uniform(rng, 0.01, 0.2);
    light.width_m = rng.uniform(0.1, 0.8);
    light.height_m = rng.uniform(0.1, 0.8);
    // As bright together whatever the size, within a factor of some tens.
    const double area = light.kind == LightKind::Sphere ? 4 * kPi * light.radius_m * light.radius_m
                                                        : light.width_m * light.height_m;
    light.color = float(log_uniform(rng, 30.0, 1000.0) / area) *
                  (Vec3f::Ones() - 0.5f * float(rng.uniform()) * random_color(rng));
    light.is_visible_to_camera = rng.chance(0.5);
    if (light.kind == LightKind::Sphere && rng.chance(0.2)) light.cone_angle_rad = 0.5;
    const NodeId node = scene.create(scene.root(), "lamp");
    scene.edit(node).light = light;
    scene.set_pose(node, at(rng.uniform_in(box), rng.uniform_rotation()));
  }
}

/// Takes the light out of all below the node with a chance, each on its own.
void darken(Scene& scene, NodeId below, double chance, Rng& rng) {
  for (const NodeId node : scene.subtree(below)) {
    const bool glows =
        scene[node].light || std::ranges::any_of(scene[node].materials, [](const auto& material) {
          return material && !material->emission.isZero(0.0f);
        });
    if (!glows || !rng.chance(chance)) continue;
    scene.edit(node).light.reset();
    for (auto& material : scene.edit(node).materials) {
      if (!material || material->emission.isZero(0.0f)) continue;
      Material dark = *material;
      dark.emission.setZero();
      material = shared(std::move(dark));
    }
  }
}

/// The glass around bulbs, which the tutorial's jobs hide.
void hide_bulb_glasses(Scene& scene) {
  for (const char* pattern : {"/**CeilingLight*001_SPLIT_GLA*", "/**Lamp*001_SPLIT_GLA*"}) {
    for (const NodeId node : scene.match(pattern)) scene.edit(node).is_visible = false;
  }
}

/// A cut-out of a picture of one of four sizes.
NodeId add_cut_out(Scene& scene, int width, int height, const Vec3& eye, const Vec3& target,
                   Rng& rng) {
  constexpr std::array<int, 5> kWidths{256, 320, 320, 480, 640};
  const int whole_width = kWidths[rng.index(kWidths.size())];
  const int whole_height = whole_width * 3 / 4;
  Camera camera =
      Camera::from_lens(whole_width, whole_height, rng.uniform(14.0, 32.0), kSensorWidthMm);
  camera.width = width;
  camera.height = height;
  camera.cx -= rng.uniform(0.0, whole_width - width);
  camera.cy -= rng.uniform(0.0, std::max(0, whole_height - height));
  camera.near_m = 0.05;
  if (rng.chance(0.12)) {
    camera.f_stop = rng.uniform(1.4, 5.6);
    camera.focus_distance_m = (target - eye).norm();
  }
  const NodeId node = scene.create(scene.root(), "camera");
  scene.edit(node).camera = camera;
  scene.set_pose(node, Transform{eye, look_rotation(target - eye)});
  return node;
}

NodeId add_whole(Scene& scene, int width, int height, double focal_length_mm, const Vec3& eye,
                 const Vec3& target) {
  const NodeId node = scene.create(scene.root(), "camera");
  Camera camera = Camera::from_lens(width, height, focal_length_mm, kSensorWidthMm);
  camera.near_m = 0.05;
  scene.edit(node).camera = camera;
  scene.set_pose(node, Transform{eye, look_rotation(target - eye)});
  return node;
}

Aabb box_of(const Vec3& min, const Vec3& max) {
  Aabb box;
  box.min = min;
  box.max = max;
  return box;
}

void fill_room(Set& set, std::uint64_t seed, int cameras, int width, int height, Rng& rng,
               Host& host) {
  Scene& scene = set.scene;
  const NodeId root = scene.create(scene.root(), "room");
  dining_room::DiningRoomLoader({}, host).load("dining_room:" + std::to_string(kFirstRoom + seed),
                                               scene, root);
  if (rng.chance(0.6)) hide_bulb_glasses(scene);
  const Aabb room = scene.world_bounds(root);
  const NodeId table = scene.match("/room/**TableDining*").at(0);
  const Aabb top = scene.world_bounds(table);
  const double light = rng.uniform();  // by day, by night, both
  if (light < 0.7) add_sky(scene, rng, host);
  darken(scene, root, light < 0.35 ? 1.0 : 0.3, rng);
  const Aabb around = box_of(top.min + Vec3(-0.6, -0.6, 0.1), top.max + Vec3(0.6, 0.6, 0.6));
  for (std::size_t i = 4 + rng.index(14); i > 0; --i) add_thing(scene, around, rng, host);
  const Vec3 inset(0.5, 0.5, 0.0);
  const Aabb above = box_of(Vec3(room.min.x(), room.min.y(), 1.2) + inset,
                            Vec3(room.max.x(), room.max.y(), 2.2) - inset);
  if (light >= 0.35) add_lamps(scene, above, rng.index(light >= 0.7 ? 5 : 3), rng);
  if (light >= 0.7 && rng.chance(0.3)) add_lamps(scene, above, 12, rng);
  const Aabb eyes = box_of(Vec3(room.min.x(), room.min.y(), 0.6) + inset,
                           Vec3(room.max.x(), room.max.y(), 2.1) - inset);
  for (int i = 0; i < cameras; ++i) {
    const Vec3 target =
        rng.uniform_in(box_of(top.min - Vec3(0.4, 0.4, 0.1), top.max + Vec3(0.4, 0.4, 0.5)));
    Vec3 eye = rng.uniform_in(eyes);
    if (rng.chance(0.35)) eye = target + rng.uniform(0.3, 0.6) * (eye - target);
    set.cameras.push_back(add_cut_out(scene, width, height, eye, target, rng));
  }
}

void fill_stage(Set& set, int cameras, int width, int height, Rng& rng, Host& host) {
  Scene& scene = set.scene;
  Material floor;
  floor.roughness = float(rng.uniform(0.2, 1.0));
  floor.base_color = random_color(rng).cwiseMax(0.1f);
  if (rng.chance(0.5)) {
    floor.base_color = Vec3f::Ones();
    floor.base_color_texture = input_of(random_texture(rng, host), 4.0);
  }
  add_mesh(scene, "floor", make_plane(6, 6), floor, at(Vec3::Zero()));
  if (rng.chance(0.5)) {
    add_mesh(scene, "wall", make_box(Vec3(6, 0.1, 3)), random_material(rng, host),
             at(Vec3(0, 2.0, 1.5)));
  }
  const Aabb space = box_of(Vec3(-0.7, -0.7, 0.05), Vec3(0.7, 0.7, 0.7));
  for (std::size_t i = 5 + rng.index(16); i > 0; --i) add_thing(scene, space, rng, host);
  const bool has_sky = rng.chance(0.7);
  if (has_sky) add_sky(scene, rng, host);
  if (!has_sky || rng.chance(0.5)) {
    add_lamps(scene, box_of(Vec3(-2, -2, 1.0), Vec3(2, 1.8, 2.5)), 1 + rng.index(3), rng);
  }
  for (int i = 0; i < cameras; ++i) {
    const double around = rng.uniform(-kPi, 0.0);
    const double distance = rng.uniform(0.8, 3.0);
    const Vec3 eye(distance * std::cos(around), distance * std::sin(around), rng.uniform(0.2, 1.8));
    const Vec3 target = rng.uniform_in(space);
    set.cameras.push_back(add_cut_out(scene, width, height, eye, target, rng));
  }
}

void add_real_sky(Scene& scene, const std::filesystem::path& file, double turn, Host& host) {
  const NodeId node = scene.create(scene.root(), "sky");
  Light light;
  light.kind = LightKind::Dome;
  light.color = Vec3f::Constant(1000.0f);
  light.texture = host.read_texture(file);
  scene.edit(node).light = light;
  scene.set_pose(node, at(Vec3::Zero(), Quat(Eigen::AngleAxisd(turn, Vec3::UnitZ()))));
}

/// Two views of a room with a table, from opposite corners.
void add_room_views(Set& set, NodeId room_node, int width, int height) {
  const Aabb room = set.scene.world_bounds(room_node);
  const auto tables = set.scene.match("/room/**TableDining*");
  const Vec3 middle = tables.empty() ? room.centre() : set.scene.world_bounds(tables[0]).centre();
  const Vec3 target(middle.x(), middle.y(), 0.85);
  for (const double side : {1.0, -1.0}) {
    const Vec3 corner(side > 0 ? room.min.x() + 0.7 : room.max.x() - 0.7, room.min.y() + 0.8, 1.6);
    set.cameras.push_back(add_whole(set.scene, width, height, 20.0,
                                    corner + 0.3 * (target - corner) + Vec3(0, 0, 0.3), target));
  }
}

struct JudgedRoom {
  const char* asset;
  const char* sky;  ///< Null: by night.
  double turn;
  bool has_lamps;
};
constexpr std::array<JudgedRoom, 4> kJudgedRooms{{
    {"dining_room:5", "Cloudy/kloofendal_48d_partly_cloudy_4k.hdr", 0.4, false},
    {"dining_room:1", nullptr, 0.0, true},
    {"dining_room:8", "Clear/qwantani_4k.hdr", 2.0, true},
    {"dining_room:3", "Cloudy/champagne_castle_1_4k.hdr", 4.0, false},
}};

constexpr std::array kFurnished{1, 3};
constexpr int kOtherSets = int(kFurnished.size()) + 3;

}  // namespace

Set training_set(std::uint64_t seed, int cameras, int width, int height, Host& host) {
  Set set;
  set.name = "set_" + std::to_string(seed);
  Rng rng = Rng(seed).fork("denoiser training");
  if (rng.chance(0.7)) {
    fill_room(set, seed, cameras, width, height, rng, host);
  } else {
    fill_stage(set, cameras, width, height, rng, host);
  }
  return set;
}

int judged_set_count() { return int(kJudgedRooms.size()) + kOtherSets; }

Set judged_set(int number, int width, int height, const std::filesystem::path& data, Host& host) {
  const std::filesystem::path assets = data / "assets_root";
  const std::filesystem::path skies = assets / "NVIDIA/Assets/Skies";
  Set set;
  Scene& scene = set.scene;
  if (number < int(kJudgedRooms.size())) {
    const JudgedRoom& judged = kJudgedRooms[std::size_t(number)];
    set.name = "room_" + std::to_string(number);
    const NodeId root = scene.create(scene.root(), "room");
    dining_room::DiningRoomLoader({}, host).load(judged.asset, scene, root);
    hide_bulb_glasses(scene);
    Rng rng(1);
    if (!judged.has_lamps) darken(scene, root, 1.0, rng);
    if (judged.sky) add_real_sky(scene, skies / judged.sky, judged.turn, host);
    add_room_views(set, root, width, height);
    return set;
  }
  number -= int(kJudgedRooms.size());
  loader_usd::UsdLoader usd({}, host);
  if (number < int(kFurnished.size())) {
    const std::string room = std::to_string(kFurnished[std::size_t(number)]);
    set.name = "furnished_" + room;
    const NodeId root = scene.create(scene.root(), "room");
    usd.load((assets / "Isaac/Samples/Replicator/Infinigen/dining_rooms" / ("dining_room_" + room) /
              "export_scene.blend/export_scene.usdc")
                 .string(),
             scene, root);
    hide_bulb_glasses(scene);
    // As with environment.max_lamp_lux: lamps of 1e8 nits would drown the sky.
    for (const NodeId node : scene.subtree(root)) {
      if (!scene[node].light) continue;
      const float brightest = scene[node].light->color.maxCoeff();
      if (brightest > 20000.0f) scene.edit(node).light->color *= 20000.0f / brightest;
    }
    if (number == 0) add_real_sky(scene, skies / "Clear/noon_grass_4k.hdr", 1.0, host);
    add_room_views(set, root, width, height);
    return set;
  }
  number -= int(kFurnished.size());
  if (number == 0) {
    set.name = "ycb";
    Material floor;
    floor.base_color = Vec3f::Constant(0.5f);
    add_mesh(scene, "floor", make_plane(6, 6), floor, at(Vec3::Zero()));
    const std::filesystem::path folder = assets / "Isaac/Props/YCB/Axis_Aligned";
    std::vector<std::filesystem::path> files;
    for (const auto& entry : std::filesystem::directory_iterator(folder)) {
      if (entry.path().extension() == ".usd") files.push_back(entry.path());
    }
    std::ranges::sort(files);
    Rng rng(4);
    for (std::size_t i = 0; i < 2 * files.size(); ++i) {
      const NodeId node = scene.create(scene.root(), "object");
      usd.load(files[i % files.size()].string(), scene, node);
      const Aabb box = scene.world_bounds(node);
      const Vec3 place(rng.uniform(-0.35, 0.35), rng.uniform(-0.25, 0.35), rng.uniform(0.05, 0.3));
      scene.set_pose(node,
                     at(place, rng.uniform_rotation()) * Eigen::Translation3d(Vec3(-box.centre())));
    }
    Light lamp;
    lamp.radius_m = 0.06;
    lamp.color = Vec3f::Constant(40000.0f);
    const NodeId node = scene.create(scene.root(), "lamp");
    scene.edit(node).light = lamp;
    scene.set_pose(node, at(Vec3(-0.8, -0.6, 1.2)));
    add_real_sky(scene, skies / "Cloudy/champagne_castle_1_4k.hdr", 1.0, host);
    set.cameras = {add_whole(scene, width, height, 24.0, Vec3(0.1, -1.1, 0.6), Vec3(0, 0, 0.14)),
                   add_whole(scene, width, height, 35.0, Vec3(-0.7, -0.7, 0.3), Vec3(0, 0, 0.15))};
    return set;
  }
  const bool is_diffuse = number == 1;
  set.name = is_diffuse ? "bench_diffuse" : "bench_principled";
  scene = bench::load_bench_scene(data / "bench", host, is_diffuse);
  set.cameras = {bench::add_bench_camera(data / "bench", scene, width, height)};
  return set;
}

}  // namespace diorama::training
