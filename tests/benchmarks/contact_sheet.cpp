// SPDX-License-Identifier: Apache-2.0
// Renders the pictures of plugins/renderer_embree/README.md:
//
//   contact_sheet plugins/renderer_embree/pictures
#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <functional>

#include "camera_sensor.h"
#include "depth_sensor.h"
#include "embree_renderer.h"
#include "loader_dining_room/dining_room_loader.h"
#include "modelling/canvas.h"
#include "modelling/textures.h"
#include "support/render_host/render_host.h"

namespace {

using namespace diorama;
using modelling::Canvas;

constexpr int kTileWidth = 240;
constexpr int kTileHeight = 180;

/// Pictures side by side, each with a line of text below.
class Sheet {
 public:
  Sheet(int columns, int width, int height) : columns_(columns), width_(width), height_(height) {}

  void add(const std::string& name, Image<Rgba8> picture) {
    std::printf("%s\n", name.c_str());
    std::fflush(stdout);
    tiles_.emplace_back(name, std::move(picture));
  }
  void write(const Host& host, const std::filesystem::path& file) const {
    const int count = int(tiles_.size());
    const int rows = (count + columns_ - 1) / columns_;
    const int cell_height = height_ + kCaption;
    Canvas names(columns_ * width_, rows * cell_height, modelling::color(0xffffff));
    for (int i = 0; i < count; ++i) {
      names.centred_text((i % columns_ + 0.5) * width_, (i / columns_ + 1) * cell_height - 6.0, 9.0,
                         tiles_[std::size_t(i)].first, modelling::color(0x202020));
    }
    Image<Rgba8> sheet(names.width(), names.height(), Rgba8{255, 255, 255, 255});
    for (int y = 0; y < sheet.height(); ++y) {
      for (int x = 0; x < sheet.width(); ++x) {
        for (int k = 0; k < 3; ++k) {
          sheet.at(x, y)[std::size_t(k)] = std::uint8_t(255.0f * names.at(x, y)[k] + 0.5f);
        }
      }
    }
    for (int i = 0; i < count; ++i) {
      const Image<Rgba8>& tile = tiles_[std::size_t(i)].second;
      for (int y = 0; y < height_; ++y) {
        for (int x = 0; x < width_; ++x) {
          sheet.at(i % columns_ * width_ + x, i / columns_ * cell_height + y) = tile.at(x, y);
        }
      }
    }
    test::write_png(host, sheet, file);
  }

 private:
  static constexpr int kCaption = 20;
  int columns_;
  int width_;
  int height_;
  std::vector<std::pair<std::string, Image<Rgba8>>> tiles_;
};

EmbreeRenderer::Params quality(int samples) {
  EmbreeRenderer::Params params;
  params.samples = samples;
  return params;
}

Image<Rgba8> render(const Scene& scene, NodeId camera, const EmbreeRenderer::Params& params,
                    Host& host) {
  EmbreeRenderer renderer(params, host);
  renderer.prepare(scene);
  return renderer.render({camera, {std::string(kColor.name)}, 1}).get(kColor);
}

NodeId add_camera(Scene& scene, int width, int height, double focal_length_mm, const Vec3& eye,
                  const Vec3& target) {
  const NodeId node = scene.create(scene.root(), "camera");
  Camera camera = Camera::from_lens(width, height, focal_length_mm, 20.955);
  camera.near_m = 0.05;
  scene.edit(node).camera = camera;
  scene.set_pose(node, Transform{eye, look_rotation(target - eye)});
  return node;
}

NodeId add_mesh(Scene& scene, const char* name, Mesh mesh, const Material& material,
                const Vec3& place) {
  const NodeId node = scene.create(scene.root(), name);
  scene.edit(node).mesh = std::make_shared<const Mesh>(std::move(mesh));
  scene.edit(node).materials = {std::make_shared<const Material>(material)};
  scene.set_pose(node, Affine(Eigen::Translation3d(place)));
  return node;
}

void add_light(Scene& scene, const Light& light, const Vec3& place, const Vec3& target) {
  const NodeId node = scene.create(scene.root(), "light");
  scene.edit(node).light = light;
  scene.set_pose(node, Transform{place, look_rotation(target - place)});
}

Material plain(const Vec3f& color, float roughness) {
  Material material;
  material.base_color = color;
  material.roughness = roughness;
  return material;
}

TextureInput textured(std::shared_ptr<const Texture> texture, float repeats) {
  TextureInput input;
  input.texture = std::move(texture);
  input.uv_from_mesh_uv.leftCols<2>() *= repeats;
  return input;
}

Light light_of(LightKind kind, float brightness) {
  Light light;
  light.kind = kind;
  light.color = Vec3f::Constant(brightness);
  return light;
}

/// A tiled floor with a wall behind.
void add_stage(Scene& scene, Host& host) {
  modelling::TileLook look;
  look.other = modelling::color(0x8f8a80);
  const auto tiles = modelling::make_tiles(host, look, 3, 512);
  Material floor = plain(Vec3f::Ones(), 0.5f);
  floor.base_color_texture = textured(tiles.color, 3.0f);
  add_mesh(scene, "floor", make_plane(6, 6), floor, Vec3::Zero());
  add_mesh(scene, "wall", make_box(Vec3(6, 0.1, 4)), plain(Vec3f(0.6f, 0.58f, 0.55f), 0.9f),
           Vec3(0, 2.0, 2.0));
}

// The lights.

Image<Rgba8> lit_stage(Host& host, const std::function<void(Scene&)>& add_lights,
                       double exposure_ev = 0.0) {
  Scene scene;
  add_stage(scene, host);
  add_mesh(scene, "ball", make_sphere(0.5, 64), plain(Vec3f(0.7f, 0.15f, 0.1f), 0.35f),
           Vec3(-0.55, 0.3, 0.5));
  add_mesh(scene, "box", make_box(Vec3(0.6, 0.6, 0.9)), plain(Vec3f(0.25f, 0.4f, 0.6f), 0.6f),
           Vec3(0.6, 0.5, 0.45));
  add_lights(scene);
  const NodeId camera =
      add_camera(scene, kTileWidth, kTileHeight, 24.0, Vec3(0.2, -3.3, 1.7), Vec3(0, 0.3, 0.65));
  EmbreeRenderer::Params params = quality(128);
  params.exposure_ev = exposure_ev;
  return render(scene, camera, params, host);
}

std::shared_ptr<const Texture> evening_sky() {
  auto sky = std::make_shared<Texture>();
  sky->name = "evening sky";
  sky->width = 256;
  sky->height = 128;
  sky->channels = 3;
  for (int y = 0; y < sky->height; ++y) {
    for (int x = 0; x < sky->width; ++x) {
      const float up = 1.0f - float(y) / 64.0f;  // 1 at the zenith, 0 at the horizon
      const Vec3f zenith(0.25f, 0.4f, 0.8f), horizon(1.2f, 0.7f, 0.4f), ground(0.15f, 0.12f, 0.1f);
      Vec3f color = up > 0.0f ? Vec3f(horizon + (zenith - horizon) * std::sqrt(up)) : ground;
      const float off = std::hypot(float(x - 200), 1.5f * float(y - 45));
      if (off < 4.0f) color = Vec3f(300.0f, 200.0f, 100.0f);
      sky->floats.insert(sky->floats.end(), {color.x(), color.y(), color.z()});
    }
  }
  return sky;
}

void draw_lights(const std::filesystem::path& folder, Host& host) {
  Sheet sheet(4, kTileWidth, kTileHeight);
  const Vec3 above(-1.2, -1.0, 2.6);
  const Vec3 target(0, 0.3, 0.4);
  sheet.add("SPHERE", lit_stage(host, [&](Scene& scene) {
              Light light = light_of(LightKind::Sphere, 600.0f);
              light.radius_m = 0.15;
              add_light(scene, light, above, target);
            }));
  sheet.add("RECT", lit_stage(host, [&](Scene& scene) {
              Light light = light_of(LightKind::Rect, 60.0f);
              light.width_m = 1.6;
              light.height_m = 0.5;
              add_light(scene, light, above, target);
            }));
  sheet.add("DISK", lit_stage(host, [&](Scene& scene) {
              Light light = light_of(LightKind::Disk, 80.0f);
              light.radius_m = 0.4;
              add_light(scene, light, above, target);
            }));
  sheet.add("DISTANT", lit_stage(host, [&](Scene& scene) {
              Light light = light_of(LightKind::Distant, 20.0f);
              light.angle_rad = 0.05;
              add_light(scene, light, above, target);
            }));
  sheet.add("DOME WITHOUT PICTURE", lit_stage(host, [&](Scene& scene) {
              add_light(scene, light_of(LightKind::Dome, 1.0f), Vec3::Zero(), Vec3(0, 1, 0));
            }));
  sheet.add("DOME WITH A LOW SUN", lit_stage(host, [&](Scene& scene) {
              const NodeId node = scene.create(scene.root(), "sky");
              Light light = light_of(LightKind::Dome, 1.0f);
              light.texture = evening_sky();
              scene.edit(node).light = light;
              scene.set_pose(node, Affine(Eigen::AngleAxisd(2.0, Vec3::UnitZ())));
            }));
  sheet.add("SPOT", lit_stage(
                        host,
                        [&](Scene& scene) {
                          Light light = light_of(LightKind::Sphere, 2000.0f);
                          light.radius_m = 0.1;
                          light.cone_angle_rad = 0.35;
                          light.cone_softness = 0.3;
                          add_light(scene, light, above, target);
                        },
                        -3.0));
  sheet.add("GLOWING MESH", lit_stage(host, [&](Scene& scene) {
              Material glow = plain(Vec3f::Zero(), 1.0f);
              glow.emission = Vec3f(60.0f, 40.0f, 15.0f);
              add_mesh(scene, "ring", make_capsule(0.06, 1.6), glow, Vec3(-1.3, -0.2, 0.9));
            }));
  sheet.write(host, folder / "lights.png");
}

// The surfaces.

struct Surface {
  const char* name;
  std::function<void(Material&, Host&)> change;
};

/// White where shade(u, v) says so; alpha only.
std::shared_ptr<const Texture> mask(const std::function<bool(double, double)>& is_there) {
  constexpr int kPixels = 512;
  auto texture = std::make_shared<Texture>();
  texture->name = "mask";
  texture->width = texture->height = kPixels;
  texture->channels = 1;
  for (int y = 0; y < kPixels; ++y) {
    for (int x = 0; x < kPixels; ++x) {
      texture->bytes.push_back(is_there((x + 0.5) / kPixels, (y + 0.5) / kPixels) ? 255 : 0);
    }
  }
  return texture;
}

const std::vector<Surface>& surfaces() {
  static const std::vector<Surface> all{
      {"MATTE", [](Material& m, Host&) { m.specular = 0.0f; }},
      {"PLASTIC", [](Material& m, Host&) { m.roughness = 0.25f; }},
      {"CLEAR COAT",
       [](Material& m, Host&) {
         m.roughness = 0.7f;
         m.clearcoat = 1.0f;
         m.clearcoat_roughness = 0.03f;
       }},
      {"POLISHED METAL",
       [](Material& m, Host&) {
         m.base_color = Vec3f(0.95f, 0.75f, 0.4f);
         m.metallic = 1.0f;
         m.roughness = 0.05f;
       }},
      {"ROUGH METAL",
       [](Material& m, Host&) {
         m.base_color = Vec3f(0.95f, 0.75f, 0.4f);
         m.metallic = 1.0f;
         m.roughness = 0.5f;
       }},
      {"GLASS",
       [](Material& m, Host&) {
         m.base_color = Vec3f(0.95f, 1.0f, 0.97f);
         m.transmission = 1.0f;
         m.roughness = 0.0f;
       }},
      {"FROSTED GLASS",
       [](Material& m, Host&) {
         m.base_color = Vec3f(0.95f, 1.0f, 0.97f);
         m.transmission = 1.0f;
         m.roughness = 0.4f;
       }},
      {"THIN PANE",
       [](Material& m, Host&) {
         m.base_color = Vec3f(0.8f, 0.9f, 1.0f);
         m.transmission = 1.0f;
         m.is_thin_walled = true;
         m.roughness = 0.0f;
       }},
      {"CUT-OUT",
       [](Material& m, Host&) {
         m.opacity_texture = textured(mask([](double u, double v) {
                                        return std::hypot(u * 24 - std::floor(u * 24) - 0.5,
                                                          v * 12 - std::floor(v * 12) - 0.5) > 0.35;
                                      }),
                                      1.0f);
         m.opacity_threshold = 0.5f;
       }},
      {"VEIL", [](Material& m, Host&) { m.opacity = 0.35f; }},
      {"NORMAL MAP",
       [](Material& m, Host& host) {
         const auto wicker = modelling::make_wicker(host, modelling::color(0xb08850), 5, 512);
         m.base_color.setOnes();
         m.base_color_texture = textured(wicker.color, 2.0f);
         m.normal_texture = textured(wicker.normal, 2.0f);
         m.roughness = 0.5f;
       }},
      {"TEXTURE",
       [](Material& m, Host& host) {
         m.base_color.setOnes();
         m.base_color_texture = textured(modelling::make_wood(host, {}, 4, 512).color, 2.0f);
         m.roughness = 0.3f;
       }},
  };
  return all;
}

void draw_surfaces(const std::filesystem::path& folder, Host& host) {
  Sheet sheet(4, kTileWidth, kTileHeight);
  for (const Surface& surface : surfaces()) {
    Scene scene;
    add_stage(scene, host);
    Material material = plain(Vec3f(0.6f, 0.1f, 0.08f), 1.0f);
    surface.change(material, host);
    add_mesh(scene, "ball", make_sphere(0.65, 96), material, Vec3(0, 0.2, 0.65));
    Light window = light_of(LightKind::Rect, 25.0f);
    window.width_m = 1.2;
    window.height_m = 1.2;
    add_light(scene, window, Vec3(-1.8, -1.6, 2.4), Vec3(0, 0.2, 0.5));
    add_light(scene, light_of(LightKind::Dome, 0.5f), Vec3::Zero(), Vec3(0, 1, 0));
    const NodeId camera =
        add_camera(scene, kTileWidth, kTileHeight, 28.0, Vec3(0, -3.0, 1.4), Vec3(0, 0.2, 0.62));
    sheet.add(surface.name, render(scene, camera, quality(192), host));
  }
  sheet.write(host, folder / "surfaces.png");
}

// Rooms.

/// A closed room with one window and a table in it.
Scene window_room(Host& host) {
  Scene scene;
  const Material wall = plain(Vec3f(0.75f, 0.72f, 0.66f), 0.9f);
  add_mesh(scene, "back", make_box(Vec3(4, 0.1, 2.6)), wall, Vec3(0, 2, 1.3));
  add_mesh(scene, "front", make_box(Vec3(4, 0.1, 2.6)), wall, Vec3(0, -2.6, 1.3));
  add_mesh(scene, "right", make_box(Vec3(0.1, 4.6, 2.6)), wall, Vec3(2, -0.3, 1.3));
  add_mesh(scene, "ceiling", make_box(Vec3(4, 4.6, 0.1)), wall, Vec3(0, -0.3, 2.65));
  Material floor = plain(Vec3f::Ones(), 0.4f);
  floor.base_color_texture = textured(modelling::make_planks(host, {}, 2, 1024).color, 2.0f);
  add_mesh(scene, "floor", make_plane(4, 4.6), floor, Vec3(0, -0.3, 0.0));
  // The left wall leaves an opening from 0.9 to 2.1 m.
  add_mesh(scene, "sill", make_box(Vec3(0.2, 4.6, 0.9)), wall, Vec3(-2, -0.3, 0.45));
  add_mesh(scene, "lintel", make_box(Vec3(0.2, 4.6, 0.5)), wall, Vec3(-2, -0.3, 2.35));
  add_mesh(scene, "pier", make_box(Vec3(0.2, 2.2, 1.2)), wall, Vec3(-2, -1.5, 1.5));
  add_mesh(scene, "post", make_box(Vec3(0.2, 0.8, 1.2)), wall, Vec3(-2, 1.6, 1.5));
  const Material oak = plain(Vec3f(0.35f, 0.2f, 0.1f), 0.4f);
  add_mesh(scene, "table", make_box(Vec3(1.2, 0.8, 0.05)), oak, Vec3(0.2, 0.6, 0.75));
  for (const double x : {-0.3, 0.7}) {
    for (const double y : {0.3, 0.9}) {
      add_mesh(scene, "leg", make_box(Vec3(0.06, 0.06, 0.73)), oak, Vec3(x, y, 0.365));
    }
  }
  Material glass = plain(Vec3f::Ones(), 0.0f);
  glass.transmission = 1.0f;
  add_mesh(scene, "glass", make_sphere(0.14, 64), glass, Vec3(0.0, 0.5, 0.92));
  Material copper = plain(Vec3f(0.95f, 0.6f, 0.45f), 0.25f);
  copper.metallic = 1.0f;
  add_mesh(scene, "pot", make_cylinder(0.12, 0.22), copper, Vec3(0.45, 0.7, 0.89));
  add_mesh(scene, "cone", make_cone(0.12, 0.3), plain(Vec3f(0.1f, 0.4f, 0.2f), 0.6f),
           Vec3(0.3, 0.35, 0.93));
  const NodeId sky = scene.create(scene.root(), "sky");
  Light light = light_of(LightKind::Dome, 1.0f);
  light.texture = evening_sky();
  scene.edit(sky).light = light;
  scene.set_pose(sky, Affine(Eigen::AngleAxisd(-1.75, Vec3::UnitZ())));
  return scene;
}

/// A generated dining room at night: one lamp on the table, no sky, nothing else that glows.
Scene night_room(Host& host) {
  Scene scene;
  const NodeId root = scene.create(scene.root(), "room");
  dining_room::DiningRoomLoader({}, host).load("dining_room:7", scene, root);
  for (const NodeId node : scene.match("/room/**")) {
    scene.edit(node).light.reset();
    for (auto& material : scene.edit(node).materials) {
      if (!material || material->emission.isZero(0.0f)) continue;
      auto dark = std::make_shared<Material>(*material);
      dark->emission.setZero();
      material = std::move(dark);
    }
  }
  const Aabb table = scene.world_bounds(scene.match("/room/**TableDining*").at(0));
  const Vec3 top(table.centre().x(), table.centre().y(), table.max.z());
  Material glow = plain(Vec3f::Constant(0.8f), 1.0f);
  glow.emission = Vec3f(300.0f, 170.0f, 70.0f);
  add_mesh(scene, "lamp", make_sphere(0.07, 48), glow, top + Vec3(0, 0, 0.3));
  add_mesh(scene, "stand", make_cylinder(0.02, 0.23), plain(Vec3f::Constant(0.1f), 0.3f),
           top + Vec3(0, 0, 0.115));
  return scene;
}

NodeId add_room_camera(Scene& scene, int width, int height) {
  const Aabb room = scene.world_bounds(scene.require("/room"));
  const Vec3 corner(room.min.x() + 0.5, room.min.y() + 0.5, 1.7);
  return add_camera(scene, width, height, 15.0, corner,
                    Vec3(room.centre().x(), room.centre().y(), 0.8));
}

void draw_rooms(const std::filesystem::path& folder, Host& host) {
  constexpr int kWidth = 480;
  constexpr int kHeight = 360;
  Sheet sheet(2, kWidth, kHeight);
  Scene window = window_room(host);
  const NodeId inside =
      add_camera(window, kWidth, kHeight, 17.0, Vec3(1.5, -2.3, 1.5), Vec3(-0.3, 0.7, 0.9));
  sheet.add("SKY THROUGH A WINDOW", render(window, inside, quality(256), host));
  Scene night = night_room(host);
  sheet.add("NIGHT WITH ONE LAMP",
            render(night, add_room_camera(night, kWidth, kHeight), quality(128), host));
  sheet.write(host, folder / "rooms.png");
}

void draw_shutter(const std::filesystem::path& folder, Host& host) {
  constexpr int kWidth = 320;
  constexpr int kHeight = 240;
  Sheet sheet(3, kWidth, kHeight);
  const auto picture = [&](const std::function<void(Camera&)>& change) {
    Scene scene;
    add_stage(scene, host);
    add_light(scene, light_of(LightKind::Dome, 0.4f), Vec3::Zero(), Vec3(0, 1, 0));
    Light lamp = light_of(LightKind::Sphere, 400.0f);
    lamp.radius_m = 0.2;
    add_light(scene, lamp, Vec3(-1.5, -1.5, 3.0), Vec3::Zero());
    for (int i = 0; i < 5; ++i) {
      const NodeId box =
          add_mesh(scene, "box", make_box(Vec3(0.3, 0.3, 0.6)),
                   plain(Vec3f(0.7f, 0.3f - 0.05f * float(i), 0.1f * float(i)), 0.4f),
                   Vec3(-1.2 + 0.6 * i, -1.2 + 0.6 * i, 0.7));
      RigidBody body;
      body.linear_velocity = Vec3(i == 2 ? 4.0 : 0.0, 0, 0);
      body.angular_velocity = Vec3(0, i == 3 ? 20.0 : 0.0, i == 1 ? 20.0 : 0.0);
      scene.edit(box).rigid_body = body;
    }
    const NodeId camera =
        add_camera(scene, kWidth, kHeight, 24.0, Vec3(0.4, -3.8, 1.6), Vec3(0, 0, 0.6));
    change(*scene.edit(camera).camera);
    return render(scene, camera, quality(128), host);
  };
  sheet.add("LENS OF 60 MM", picture([](Camera& camera) {
              camera.f_stop = 0.4;
              camera.focus_distance_m = 3.8;
            }));
  sheet.add("EXPOSURE OF 1/20 S", picture([](Camera& camera) { camera.exposure_time_s = 0.05; }));
  sheet.add("ROLLING SHUTTER OF 1/10 S",
            picture([](Camera& camera) { camera.readout_time_s = 0.1; }));
  sheet.write(host, folder / "shutter.png");
}

/// Exact light and depth, and what sensors make of them.
void draw_sensors(const std::filesystem::path& folder, Host& host) {
  constexpr int kWidth = 320;
  constexpr int kHeight = 240;
  Sheet sheet(3, kWidth, kHeight);
  Scene scene = window_room(host);
  const NodeId node =
      add_camera(scene, kWidth, kHeight, 17.0, Vec3(1.5, -1.2, 1.5), Vec3(-0.1, 0.7, 0.85));
  EmbreeRenderer renderer(quality(64), host);
  renderer.prepare(scene);
  Frame frame = renderer.render({node,
                                 {std::string(kColor.name), std::string(kColorHdr.name),
                                  std::string(kDistanceToImagePlane.name)},
                                 1});
  const auto grey = [](const Image<float>& depth) {
    Image<Rgba8> image(depth.width(), depth.height(), Rgba8{0, 0, 0, 255});
    for (std::size_t i = 0; i < depth.pixels().size(); ++i) {
      const float z = depth.pixels()[i];
      const bool is_measured = z > 0.0f && std::isfinite(z);
      const auto value = std::uint8_t(is_measured ? 40.0f + 215.0f / (1.0f + 0.3f * z * z) : 0.0f);
      image.pixels()[i] = {value, value, value, 255};
    }
    return image;
  };
  sheet.add("AS RENDERED", frame.get(kColor));
  for (const double iso : {400.0, 6400.0}) {
    CameraSensor::Params params;
    params.iso = iso;
    params.red_shift_px = 1.0;
    params.blue_shift_px = -1.0;
    CameraSensor(params, host).annotate(scene, frame);
    sheet.add("SENSOR - ISO " + std::to_string(int(iso)), frame.get(kColor));
  }
  sheet.add("EXACT DEPTH", grey(frame.get(kDistanceToImagePlane)));
  for (const double baseline_m : {0.05, 0.15}) {
    DepthSensor::Params params;
    params.baseline_m = baseline_m;
    DepthSensor(params, host).annotate(scene, frame);
    sheet.add("STEREO OF " + std::to_string(int(100 * baseline_m + 0.5)) + " CM",
              grey(frame.get(kSensorDepth)));
  }
  sheet.write(host, folder / "sensors.png");
}

void draw_denoising(const std::filesystem::path& folder, Host& host) {
  constexpr int kWidth = 320;
  constexpr int kHeight = 240;
  Sheet sheet(3, kWidth, kHeight);
  Scene scene = night_room(host);
  const NodeId camera = add_room_camera(scene, kWidth, kHeight);
  for (const bool denoise : {false, true}) {
    for (const int samples : {4, 16, 64}) {
      EmbreeRenderer::Params params = quality(samples);
      params.denoise = denoise;
      sheet.add(std::to_string(samples) + (denoise ? " PATHS, DENOISED" : " PATHS"),
                render(scene, camera, params, host));
    }
  }
  sheet.write(host, folder / "denoising.png");
}

}  // namespace

int main(int argc, char** argv) {
  std::filesystem::path folder;
  std::string only;
  int threads = 2;
  CLI::App app{"Renders the contact sheets of the path tracer's page"};
  app.add_option("folder", folder, "Where to put lights.png, surfaces.png ...")->required();
  app.add_option("--only", only)
      ->check(CLI::IsMember({"lights", "surfaces", "rooms", "shutter", "sensors", "denoising"}));
  app.add_option("--threads", threads);
  CLI11_PARSE(app, argc, argv);
  try {
    std::filesystem::create_directories(folder);
    test::RenderHost host(threads);
    const std::vector<std::pair<std::string, void (*)(const std::filesystem::path&, Host&)>> sheets{
        {"lights", &draw_lights},   {"surfaces", &draw_surfaces}, {"rooms", &draw_rooms},
        {"shutter", &draw_shutter}, {"sensors", &draw_sensors},   {"denoising", &draw_denoising}};
    for (const auto& [name, draw] : sheets) {
      if (only.empty() || only == name) draw(folder, host);
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
