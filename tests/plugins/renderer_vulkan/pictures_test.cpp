// SPDX-License-Identifier: Apache-2.0
// Both renderers make the same pictures and the same labels.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <future>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "diorama/rng.h"
#include "embree_renderer.h"
#include "path_tracer.h"
#include "plugins/renderer_embree/test_world.h"
#include "renderer_support/denoiser.h"
#include "renderer_support/plane_filter.h"
#include "renderer_support/rigid_motion.h"
#include "support/catch.h"
#include "support/render_host/render_host.h"
#include "virtual_light_tracer.h"
#include "vulkan_for_tests.h"
#include "vulkan_renderer.h"

namespace diorama {
namespace {

using test::at;
using test::dome;
using test::inside_out;
using test::matte;
using test::RenderHost;
using test::room_with_shade;
using test::TestWorld;

struct Pictures {
  Image<Vec3f> embree;
  Image<Vec3f> vulkan;
};

/// How far apart two pictures are that share their random numbers: nearly all pixels are equal but
/// for rounding; a few paths go other ways.
struct Difference {
  double mean = 0.0;     ///< Of the pictures' means, relative.
  double unequal = 0.0;  ///< Share of the pixels that differ by more than a hundredth.
};

Difference difference(const Image<Vec3f>& one, const Image<Vec3f>& other) {
  double a = 0.0;
  double b = 0.0;
  std::size_t unequal = 0;
  const auto p = one.pixels();
  const auto q = other.pixels();
  for (std::size_t i = 0; i < p.size(); ++i) {
    a += double(p[i].sum());
    b += double(q[i].sum());
    const float scale = std::max(1e-3f, p[i].cwiseAbs().maxCoeff());
    if (!((p[i] - q[i]).cwiseAbs().maxCoeff() < 0.01f * scale)) ++unequal;
  }
  return {a == b ? 0.0 : std::abs(b / a - 1.0), double(unequal) / double(p.size())};
}

Frame render(PathRenderer&& renderer, const Scene& scene, NodeId camera, const NameSet& channels) {
  renderer.prepare(scene);
  return renderer.render({camera, channels, 5});
}

Frame render_by_embree(const Scene& scene, NodeId camera, const PictureParams& params,
                       const NameSet& channels) {
  RenderHost host(2);
  return render(EmbreeRenderer(params, host), scene, camera, channels);
}

VulkanRenderer::Params on_device(const PictureParams& params) {
  VulkanRenderer::Params own;
  static_cast<PictureParams&>(own) = params;
  return own;
}

Frame render_by_vulkan(const Scene& scene, NodeId camera, const PictureParams& params,
                       const NameSet& channels,
                       const std::shared_ptr<const PathDevice>& device = test::path_device()) {
  RenderHost host(2);
  return render(VulkanRenderer(on_device(params), host, device), scene, camera, channels);
}

PictureParams reference(int samples, int bounces = 4) {
  PictureParams params;
  params.samples = samples;
  params.max_bounces = bounces;
  params.denoise = false;
  params.path_reuse = false;  // Embree's alone.
  params.exposure = "fixed";
  return params;
}

Pictures render_both(const TestWorld& world, NodeId camera, const PictureParams& params) {
  const NameSet channels{std::string(kColorHdr.name)};
  Pictures pictures{render_by_embree(world.scene, camera, params, channels).get(kColorHdr),
                    render_by_vulkan(world.scene, camera, params, channels).get(kColorHdr)};
  // What both ways to find what rays meet see of it.
  if (const auto device = test::ray_query_device()) {
    const Frame by_query = render_by_vulkan(world.scene, camera, params, channels, device);
    const Difference found = difference(pictures.vulkan, by_query.get(kColorHdr));
    CAPTURE(found.mean, found.unequal);
    CHECK(found.mean < 0.001);
    CHECK(found.unequal < 0.01);
  }
  return pictures;
}

Difference difference(const Pictures& pictures, const char* name) {
  // DIORAMA_TEST_PICTURES=FOLDER shows them side by side.
  if (const char* folder = std::getenv("DIORAMA_TEST_PICTURES")) {
    const RenderHost host(1);
    const int width = pictures.embree.width();
    const int height = pictures.embree.height();
    Image<Rgba8> both(2 * width, height, Rgba8{});
    const auto byte = [](float v) {
      return std::uint8_t(255.0f * srgb_from_linear(std::clamp(v, 0.0f, 1.0f)) + 0.5f);
    };
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const Vec3f& left = pictures.embree.at(x, y);
        const Vec3f& right = pictures.vulkan.at(x, y);
        both.at(x, y) = {byte(left.x()), byte(left.y()), byte(left.z()), 255};
        both.at(x + width, y) = {byte(right.x()), byte(right.y()), byte(right.z()), 255};
      }
    }
    test::write_png(host, both, std::filesystem::path(folder) / (std::string(name) + ".png"));
  }
  return difference(pictures.embree, pictures.vulkan);
}

Light rect_light(float radiance) {
  Light panel;
  panel.kind = LightKind::Rect;
  panel.width_m = 1.2;
  panel.height_m = 0.7;
  panel.color = Vec3f(radiance, radiance, 1.25f * radiance);
  return panel;
}

/// A room with a ball of the material and a box beside it, under a panel and a lamp.
TestWorld room_with(const Material& material) {
  TestWorld world;
  world.add("room", inside_out(make_box(Vec3(5, 4, 3))), matte(0.6f));
  world.add("ball", make_sphere(0.6, 48), material, at(0.6, 0.4, -0.8));
  Material box;
  box.base_color = Vec3f(0.2f, 0.5f, 0.3f);
  box.roughness = 0.3f;
  Affine turned = at(-0.9, 0.7, -1.0);
  turned.rotate(Eigen::AngleAxisd(0.4, Vec3::UnitZ()));
  turned.scale(Vec3(1.0, 0.7, 1.3));
  world.add("box", make_box(Vec3(0.7, 0.6, 0.9)), box, turned);
  world.add(rect_light(4.0f), at(1.0, 0.3, 1.3));
  Light lamp;
  lamp.radius_m = 0.15;
  lamp.color = Vec3f(30.0f, 25.0f, 20.0f);
  world.add(lamp, at(-1.2, -0.8, 1.0));
  return world;
}

NodeId camera_into(TestWorld& world) {
  return world.add_camera(35, 26, 28.0, Vec3(-0.6, -1.8, 0.3), Vec3(0.1, 0.5, -0.7));
}

std::shared_ptr<const Texture> checks(int width, int height, int channels, ColorSpace space,
                                      bool has_floats) {
  auto texture = std::make_shared<Texture>();
  texture->name = "checks";
  texture->width = width;
  texture->height = height;
  texture->channels = channels;
  texture->color_space = space;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < channels; ++c) {
        const int value = (x * 37 + y * 91 + c * 53 + (x / 3 + y / 2) % 2 * 120) % 256;
        if (has_floats) {
          texture->floats.push_back(float(value) / 200.0f);
        } else {
          texture->bytes.push_back(std::uint8_t(value));
        }
      }
    }
  }
  return texture;
}

TextureInput input(std::shared_ptr<const Texture> texture) {
  TextureInput result;
  result.texture = std::move(texture);
  return result;
}

/// A scene in Embree's trees, and on the device.
struct SceneOnDevice {
  explicit SceneOnDevice(const Scene& source) {
    meshes.take(source);
    scene.take(meshes.render_scene());
  }
  RenderHost host{2};
  const PathDevice& device = *test::path_device();
  EmbreeScene meshes{host, {"sse2", {}}};
  GpuScene scene{device, host};
};
}  // namespace

TEST_CASE("surfaces of every kind look as Embree's", "[vulkan]") {
  if (!test::has_vulkan_device()) return;
  const std::vector<std::pair<const char*, std::function<void(Material&)>>> materials{
      {"matte", [](Material& m) { m.specular = 0.0f; }},
      {"plastic", [](Material& m) { m.roughness = 0.3f; }},
      {"metal", [](Material& m) { m.metallic = 1.0f, m.roughness = 0.4f; }},
      {"mirror", [](Material& m) { m.metallic = 1.0f, m.roughness = 0.0f; }},
      {"coated", [](Material& m) { m.clearcoat = 1.0f, m.clearcoat_roughness = 0.2f; }},
      {"glass", [](Material& m) { m.transmission = 1.0f, m.roughness = 0.0f; }},
      {"frosted", [](Material& m) { m.transmission = 0.9f, m.roughness = 0.5f; }},
      {"pane", [](Material& m) { m.transmission = 0.8f, m.is_thin_walled = true; }},
      {"veil", [](Material& m) { m.opacity = 0.4f; }},
      {"lamp", [](Material& m) { m.emission = Vec3f(2.0f, 4.0f, 3.0f); }},
  };
  for (const auto& [name, change] : materials) {
    for (const bool has_caustics : {false, true}) {
      Material material;
      material.base_color = Vec3f(0.8f, 0.5f, 0.3f);
      change(material);
      TestWorld world = room_with(material);
      const NodeId camera = camera_into(world);
      PictureParams params = reference(8);
      params.caustics = has_caustics;
      const Difference d = difference(render_both(world, camera, params), name);
      CAPTURE(name, has_caustics, d.mean, d.unequal);
      CHECK(d.mean < 0.002);
      CHECK(d.unequal < 0.05);
    }
  }
}

namespace {

/// A slab on a table, `gap_m` above it, seen from above through nothing but its top.
TestWorld slab_on_table(const Material& material, double gap_m) {
  TestWorld world;
  world.add(dome(1.0f));
  world.add("table", make_box(Vec3(4, 4, 0.5)), matte(0.5f), at(0, 0, -0.25));
  world.add("slab", make_box(Vec3(1.4, 1.4, 0.02)), material, at(0, 0, 0.01 + gap_m));
  return world;
}

float mean_of(const Image<Vec3f>& picture) {
  Vec3f sum = Vec3f::Zero();
  for (const Vec3f& pixel : picture.pixels()) sum += pixel;
  return sum.mean() / float(picture.pixels().size());
}

}  // namespace

TEST_CASE("what touches glass from behind is seen through it", "[vulkan]") {
  struct Case {
    const char* name;
    Material material;
    double least;  ///< Of the brightness of the same, lifted by 2 mm.
  };
  Material clear;
  clear.base_color.setOnes();
  clear.specular = 0.0f;
  Material pane = clear;
  pane.transmission = 1.0f;
  pane.is_thin_walled = true;
  Material veil = clear;
  veil.opacity = 0.3f;
  Material glass = clear;
  glass.transmission = 1.0f;
  glass.roughness = 0.0f;
  // Light from what touches solid glass begins inside of it, and part of it stays there.
  const std::vector<Case> cases{
      {"pane", pane, 0.96}, {"veil", veil, 0.88}, {"solid glass", glass, 0.5}};
  PictureParams params = reference(64, 8);
  params.caustics = true;
  const NameSet channels{std::string(kColorHdr.name)};
  for (const Case& c : cases) {
    const auto means_at = [&](double gap_m) {
      TestWorld world = slab_on_table(c.material, gap_m);
      const NodeId camera = world.add_camera(20, 14, 30.0, Vec3(0.2, -0.5, 0.9), Vec3(0, 0, 0));
      std::vector<float> means{
          mean_of(render_by_embree(world.scene, camera, params, channels).get(kColorHdr))};
      if (test::has_vulkan_device()) {
        means.push_back(
            mean_of(render_by_vulkan(world.scene, camera, params, channels).get(kColorHdr)));
      }
      return means;
    };
    const std::vector<float> lifted = means_at(2e-3);
    for (const double gap_m : {0.0, 2e-5}) {
      const std::vector<float> touching = means_at(gap_m);
      CAPTURE(c.name, gap_m, touching, lifted);
      for (std::size_t i = 0; i < touching.size(); ++i) {
        CHECK(touching[i] > c.least * lifted[i]);
        CHECK(touching[i] < 1.08 * lifted[i]);
      }
    }
  }
}

TEST_CASE("paths are connected with virtual lights as by Embree", "[vulkan]") {
  if (!test::has_vulkan_device()) return;
  TestWorld world = room_with_shade();
  const NodeId camera = world.add_camera(160, 120, 80.0, Vec3(-0.9, -1.8, 0.7), Vec3(0.1, 0.6, 0));
  PictureParams params = reference(4);
  const Pictures plain = render_both(world, camera, params);
  const Difference d = difference(plain, "virtual_lights");
  CAPTURE(d.mean, d.unequal);
  CHECK(d.mean < 0.002);
  CHECK(d.unequal < 0.05);
  params.virtual_lights = false;
  const NameSet channels{std::string(kColorHdr.name)};
  const Frame without = render_by_vulkan(world.scene, camera, params, channels);
  CHECK(difference(plain.vulkan, without.get(kColorHdr)).unequal > 0.5);
  // Where the light of a lamp is found by chance it counts for less.
  params.virtual_lights = true;
  params.caustics = true;
  CHECK(difference(render_both(world, camera, params), "with_caustics").mean < 0.002);
  // Paths that learn for a cache are connected, too.
  params.caustics = false;
  params.denoise = true;
  CHECK(difference(render_both(world, camera, params), "with_cache").mean < 0.004);
}

TEST_CASE("few connected paths are traced alike after many others", "[vulkan]") {
  if (!test::has_vulkan_device()) return;
  TestWorld world = room_with_shade();
  const NodeId camera = world.add_camera(40, 24, 20.0, Vec3(-0.9, -1.8, 0.7), Vec3(0.1, 0.6, 0));
  SceneOnDevice both(world.scene);
  auto& [host, device, meshes, scene] = both;
  const View view(world.scene, camera);
  const PathSettings settings{.max_bounces = 4};
  const PathTracer alone(meshes, view, {settings}, Isa::Sse2);
  const SurfaceParts parts(meshes.instances(), 500);
  RayCounts rays;
  const VirtualLightTracer finder(meshes, view, alone, parts, 3, host, rays);
  const VirtualLights lights = finder.lights(300, 0, rays);
  REQUIRE(lights.size() > 50);
  const auto few = [&](GpuPathTracer& tracer) {
    tracer.begin(view, settings, scene, meshes.window());
    tracer.connect_with(lights);
    tracer.trace(SamplePlan(40, 24, {2}, 9).next_round({}, 0.0));
    return undenoised(tracer.film());
  };
  GpuPathTracer fresh(device, host);
  const Image<Vec3f> expected = few(fresh);
  // What it has room for stays: columns are longer than there are paths.
  GpuPathTracer used(device, host);
  used.begin(view, settings, scene, meshes.window());
  used.trace(SamplePlan(40, 24, {64}, 9).next_round({}, 0.0));
  CHECK(few(used) == expected);
  used.begin(view, settings, scene, meshes.window());
  used.trace(SamplePlan(40, 24, {2}, 9).next_round({}, 0.0));
  CHECK(undenoised(used.film()) != expected);
}

TEST_CASE("paths that chose their way at glass are counted as by Embree", "[vulkan]") {
  struct Case {
    const char* name;
    std::function<void(Material&)> change;
    double least;  ///< Of the picture's paths.
    double most;
  };
  const std::vector<Case> cases{
      {"matte", [](Material&) {}, 0.0, 0.0},
      {"mirror", [](Material& m) { m.metallic = 1.0f, m.roughness = 0.0f; }, 0.0, 0.0},
      {"glass", [](Material& m) { m.transmission = 1.0f, m.roughness = 0.0f; }, 0.15, 0.5},
      // It has a colour of its own, where paths are recorded before they choose.
      {"frosted", [](Material& m) { m.transmission = 0.9f, m.roughness = 0.5f; }, 0.0, 0.0},
      {"pane", [](Material& m) { m.transmission = 0.8f, m.is_thin_walled = true; }, 0.15, 0.5},
      {"veil", [](Material& m) { m.opacity = 0.4f; }, 0.15, 0.5},
      {"opaque veil", [](Material& m) { m.opacity = 1.0f; }, 0.0, 0.0}};
  RenderHost host(2);
  for (const Case& c : cases) {
    Material material = matte(0.7f);
    c.change(material);
    TestWorld world = room_with(material);
    const View view(world.scene, camera_into(world));
    EmbreeScene meshes(host, {"sse2", {}});
    meshes.take(world.scene);
    const PathSettings settings{.max_bounces = 4};
    const int width = view.camera().width;
    const int height = view.camera().height;
    const auto jobs = SamplePlan(width, height, {8}, 9).next_round({}, 0.0);
    RayCounts rays;
    const Film here = PathTracer(meshes, view, {settings}, Isa::Sse2).film(jobs, host, rays);
    double mean = 0.0;
    for (const FilmPixel& pixel : here.pixels()) {
      mean += double(pixel.chance_share) / double(here.pixels().size());
    }
    CAPTURE(c.name, mean);
    CHECK(mean >= c.least);
    CHECK(mean <= c.most);
    if (!test::has_vulkan_device()) continue;
    GpuScene scene(*test::path_device(), host);
    scene.take(meshes.render_scene());
    GpuPathTracer tracer(*test::path_device(), host);
    tracer.begin(view, settings, scene, meshes.window());
    tracer.trace(jobs);
    const Film film = tracer.film();
    std::size_t unequal = 0;
    for (std::size_t i = 0; i < film.pixels().size(); ++i) {
      unequal += film.pixels()[i].chance_share == here.pixels()[i].chance_share ? 0 : 1;
    }
    CAPTURE(unequal);
    CHECK(unequal <= film.pixels().size() / 100);
  }
}

TEST_CASE("textures and colours of corners look as Embree's", "[vulkan]") {
  if (!test::has_vulkan_device()) return;
  const std::vector<std::pair<const char*, std::function<void(Material&)>>> materials{
      {"colour",
       [](Material& m) {
         m.base_color_texture = input(checks(64, 32, 3, ColorSpace::Srgb, false));
         m.base_color_texture.uv_from_mesh_uv << 2.0f, 0.3f, 0.1f, -0.2f, 1.5f, 0.4f;
       }},
      {"mirrored wrap",
       [](Material& m) {
         m.base_color_texture = input(checks(15, 9, 4, ColorSpace::Srgb, false));
         m.base_color_texture.uv_from_mesh_uv << 3.0f, 0.0f, -1.0f, 0.0f, 3.0f, -1.0f;
         m.base_color_texture.wrap_u = Wrap::Mirror;
         m.base_color_texture.wrap_v = Wrap::Black;
       }},
      {"floats",
       [](Material& m) {
         m.base_color_texture = input(checks(20, 12, 3, ColorSpace::Srgb, true));
         m.base_color_texture.wrap_u = Wrap::Clamp;
       }},
      {"roughness and metal",
       [](Material& m) {
         m.roughness_texture = input(checks(16, 16, 1, ColorSpace::Linear, false));
         m.metallic_texture = input(checks(8, 16, 3, ColorSpace::Linear, false));
         m.metallic_texture.channel = 2;
         m.clearcoat = 0.5f;
       }},
      {"rough glass",
       [](Material& m) {
         m.roughness_texture = input(checks(16, 16, 2, ColorSpace::Linear, false));
         m.transmission = 0.8f;
       }},
      {"bumps",
       [](Material& m) {
         m.normal_texture = input(checks(24, 24, 3, ColorSpace::Linear, false));
         m.normal_texture.scale = {0.8f, 0.8f, 1.0f, 1.0f};
         m.normal_texture.bias = {-0.4f, -0.4f, 0.3f, 0.0f};
       }},
      {"holes",
       [](Material& m) {
         m.opacity_texture = input(checks(12, 10, 1, ColorSpace::Linear, false));
         m.opacity_threshold = 0.5f;
       }},
      {"gauze",
       [](Material& m) {
         m.opacity_texture = input(checks(12, 10, 1, ColorSpace::Linear, false));
       }},
      {"glowing picture",
       [](Material& m) {
         m.emission = Vec3f(1.0f, 2.0f, 3.0f);
         m.emission_texture = input(checks(12, 10, 3, ColorSpace::Srgb, false));
       }},
  };
  for (const auto& [name, change] : materials) {
    Material material;
    material.base_color = Vec3f(0.9f, 0.8f, 0.7f);
    change(material);
    TestWorld world = room_with(material);
    Mesh quilt = make_plane(1.5, 1.0);
    for (std::size_t i = 0; i < quilt.positions.size(); ++i) {
      quilt.colors.push_back(Vec3f(0.2f + 0.2f * float(i), 0.9f, 0.3f));
    }
    Affine wall = at(0.2, 1.9, 0.0);
    wall.rotate(Eigen::AngleAxisd(1.5, Vec3::UnitX()));
    world.add("quilt", quilt, matte(0.9f), wall);
    const NodeId camera = camera_into(world);
    const Difference d = difference(render_both(world, camera, reference(8)), name);
    CAPTURE(name, d.mean, d.unequal);
    CHECK(d.mean < 0.002);
    CHECK(d.unequal < 0.05);
  }
}

TEST_CASE("lights of every kind shine as Embree's", "[vulkan]") {
  if (!test::has_vulkan_device()) return;
  const auto sky = [](bool has_picture) {
    Light light = dome(0.8f);
    if (has_picture) light.texture = checks(64, 32, 3, ColorSpace::Linear, true);
    return light;
  };
  const auto of_kind = [](LightKind kind, auto&& change) {
    Light light;
    light.kind = kind;
    light.color = Vec3f(9.0f, 8.0f, 7.0f);
    light.radius_m = 0.3;
    change(light);
    return light;
  };
  const std::vector<std::pair<const char*, std::vector<Light>>> lights{
      {"sphere", {of_kind(LightKind::Sphere, [](Light&) {})}},
      {"disk",
       {of_kind(LightKind::Disk, [](Light& l) { l.cone_angle_rad = 0.9, l.cone_softness = 0.4; })}},
      {"hidden", {of_kind(LightKind::Rect, [](Light& l) { l.is_visible_to_camera = false; })}},
      {"sun", {of_kind(LightKind::Distant, [](Light& l) { l.angle_rad = 0.2; })}},
      {"point sun", {of_kind(LightKind::Distant, [](Light& l) { l.angle_rad = 0.0; })}},
      {"white sky", {sky(false)}},
      {"sky", {sky(true)}},
      {"sky and sun",
       {sky(true), of_kind(LightKind::Distant, [](Light& l) { l.angle_rad = 0.05; })}},
      {"dark", {}},
  };
  for (const auto& [name, all] : lights) {
    TestWorld world;
    world.add("floor", make_plane(6, 5), matte(0.5f), at(0, 0, -0.7));
    Affine lying = at(1.2, 0.0, 0.3);
    lying.rotate(Eigen::AngleAxisd(1.2, Vec3::UnitY()));
    world.add("wall", make_plane(2, 3), matte(0.7f), lying);
    Material shiny;
    shiny.metallic = 1.0f;
    shiny.roughness = 0.2f;
    world.add("ball", make_sphere(0.5), shiny, at(0.2, 0.1, -0.1));
    for (const Light& light : all) {
      Affine above = at(-0.5, -0.3, 1.6);
      above.rotate(Eigen::AngleAxisd(0.3, Vec3::UnitX()));
      world.add(light, above);
    }
    const NodeId camera =
        world.add_camera(32, 24, 26.0, Vec3(-1.6, -2.8, 1.3), Vec3(0.1, 0.2, 0.0));
    for (const char* lamps : {"sphere", "disk"}) {
      PictureParams params = reference(8);
      params.sphere_lights = lamps;
      const Pictures pictures = render_both(world, camera, params);
      if (all.empty()) {
        for (const Vec3f& p : pictures.vulkan.pixels()) REQUIRE(p.isZero());
        continue;
      }
      const Difference d = difference(pictures, name);
      CAPTURE(name, lamps, d.mean, d.unequal);
      CHECK(d.mean < 0.002);
      CHECK(d.unequal < 0.05);
    }
  }
}

TEST_CASE("a hall of lamps is lit as Embree's", "[vulkan]") {
  if (!test::has_vulkan_device()) return;
  TestWorld world;
  world.add("hall", inside_out(make_box(Vec3(6, 5, 3))), matte(0.6f));
  // More than are compared at once, of all shapes, and one mesh many times, mirrored and stretched.
  const auto lamp = std::make_shared<const Mesh>(make_cone(0.1, 0.2, 12));
  Material glow;
  glow.emission = Vec3f(3.0f, 5.0f, 4.0f);
  const auto material = std::make_shared<const Material>(glow);
  for (int i = 0; i < 14; ++i) {
    Affine place = at(-2.4 + 0.36 * i, -1.5 + 0.25 * (i % 5), 0.6 + 0.1 * (i % 7));
    place.rotate(Eigen::AngleAxisd(0.4 * i, Vec3(0.3, 0.8, 0.5).normalized()));
    place.scale(Vec3(i % 2 == 0 ? 1.0 : -1.0, 1.0 + 0.05 * i, 0.8));
    const NodeId node = world.scene.create(world.base, "lamp_" + std::to_string(i));
    world.scene.edit(node).mesh = lamp;
    world.scene.edit(node).materials = {material};
    world.scene.set_pose(node, place);
    Light light;
    light.kind = i % 3 == 0 ? LightKind::Sphere : i % 3 == 1 ? LightKind::Rect : LightKind::Disk;
    light.radius_m = 0.08;
    light.width_m = light.height_m = 0.2;
    light.color = Vec3f(10.0f, 4.0f + float(i), 6.0f);
    world.add(light, at(-2.2 + 0.33 * i, 1.2 - 0.2 * (i % 4), 1.2));
  }
  const NodeId camera = world.add_camera(40, 30, 30.0, Vec3(-2.0, -2.0, 0.4), Vec3(0.5, 0.6, 0.0));
  const Difference d = difference(render_both(world, camera, reference(8)), "hall");
  CAPTURE(d.mean, d.unequal);
  CHECK(d.mean < 0.002);
  CHECK(d.unequal < 0.05);
}

TEST_CASE("lenses show what they show with Embree", "[vulkan]") {
  if (!test::has_vulkan_device()) return;
  const std::vector<std::pair<const char*, std::function<void(Camera&)>>> cameras{
      {"bent",
       [](Camera& c) {
         c.lens = LensModel::OpencvPinhole, c.distortion = {-0.1, 0.02};
       }},
      {"fisheye",
       [](Camera& c) {
         c.lens = LensModel::FisheyePolynomial;
         c.fisheye_polynomial = {0.0, 1.0 / 15.0, 0.0, 1e-6, 0.0, 0.0};
         c.fisheye_max_angle_rad = 1.1;  // nothing in the corners
       }},
      {"blur", [](Camera& c) { c.f_stop = 0.2, c.focus_distance_m = 1.2; }},
  };
  for (const auto& [name, change] : cameras) {
    Material material;
    material.roughness = 0.4f;
    TestWorld world = room_with(material);
    const NodeId camera = camera_into(world);
    change(*world.scene.edit(camera).camera);
    const Difference d = difference(render_both(world, camera, reference(16)), name);
    CAPTURE(name, d.mean, d.unequal);
    CHECK(d.mean < 0.004);
    CHECK(d.unequal < 0.06);
  }
}

TEST_CASE("what moves while the shutter is open is blurred as with Embree", "[vulkan]") {
  if (!test::has_vulkan_device()) return;
  Material material;
  material.roughness = 0.4f;
  TestWorld world = room_with(material);
  RigidBody body;
  body.linear_velocity = Vec3(1.0, 2.0, -3.0);
  for (const char* path : {"/base/ball", "/base/box"}) {
    world.scene.edit(world.scene.match(path).at(0)).rigid_body = body;
  }
  const NodeId camera = camera_into(world);
  Camera& lens = *world.scene.edit(camera).camera;
  lens.exposure_time_s = 0.04;
  lens.readout_time_s = 0.03;
  lens.linear_velocity = Vec3(0.5, 0.2, 0.0);
  const Difference d = difference(render_both(world, camera, reference(16)), "shutter");
  CAPTURE(d.mean, d.unequal);
  CHECK(d.mean < 0.001);
  CHECK(d.unequal < 0.02);
}

/// Turns a whole of things beside its own centre, in `room_with(...)`: a shiny ball, a box with
/// bumps and a pane, which is above the picture and dims what is below.
NodeId add_turning_things(TestWorld& world, const Vec3& angular_velocity) {
  const NodeId body = world.scene.create(world.base, "body");
  world.scene.set_pose(body, at(-0.1, 0.6, -0.7));
  RigidBody turning;
  turning.linear_velocity = Vec3(1.0, 2.0, -3.0);
  turning.angular_velocity = angular_velocity;
  world.scene.edit(body).rigid_body = turning;
  const auto add = [&](const char* name, Mesh mesh, Material material, const Affine& pose) {
    const NodeId node = world.scene.create(body, name);
    world.scene.edit(node).mesh = std::make_shared<const Mesh>(std::move(mesh));
    world.scene.edit(node).materials = {std::make_shared<const Material>(std::move(material))};
    world.scene.set_pose(node, pose);
  };
  Affine flat = at(-0.5, -0.3, 0.2);
  flat.rotate(Eigen::AngleAxisd(0.7, Vec3(0.2, 0.9, 0.4).normalized()));
  flat.scale(Vec3(0.5, 1.0, 1.4));
  add("egg", make_sphere(0.4, 32), matte(0.8f), flat);
  Material bumps = matte(0.7f);
  bumps.normal_texture = input(checks(24, 24, 3, ColorSpace::Linear, false));
  bumps.normal_texture.scale = {0.8f, 0.8f, 1.0f, 1.0f};
  bumps.normal_texture.bias = {-0.4f, -0.4f, 0.3f, 0.0f};
  Affine askew = at(0.4, 0.2, -0.1);
  askew.rotate(Eigen::AngleAxisd(0.4, Vec3(0.5, 0.1, 0.9).normalized()));
  add("bumps", make_box(Vec3(0.4, 0.3, 0.6)), bumps, askew);
  Material pane;
  pane.base_color = Vec3f(0.9f, 0.6f, 0.3f);
  pane.transmission = 1.0f;
  pane.is_thin_walled = true;
  Affine above = at(0.1, 0.2, 1.5);
  above.rotate(Eigen::AngleAxisd(0.6, Vec3::UnitX()));
  add("pane", make_plane(1.4, 1.2), pane, above);
  return body;
}

TEST_CASE("a row of a rolling shutter is that of a still at its time", "[vulkan]") {
  if (!test::has_vulkan_device()) return;
  TestWorld world;
  world.add("floor", make_plane(8, 8), matte(0.6f), at(0, 0, -1.4));
  const NodeId body = add_turning_things(world, Vec3(5.0, -9.0, 7.0));
  // Without chance: one light that is a point, and none from elsewhere.
  Light sun;
  sun.kind = LightKind::Distant;
  sun.angle_rad = 0.0;
  sun.color = Vec3f(3.0f, 2.0f, 1.0f);
  Affine leaning = Affine::Identity();
  leaning.rotate(Eigen::AngleAxisd(0.3, Vec3(1.0, -0.3, 0.1).normalized()));
  world.add(sun, leaning);
  constexpr int kRows = 26;
  const NodeId camera = camera_into(world);
  RenderHost host(2);
  EmbreeRenderer embree(reference(1, 0), host);
  VulkanRenderer vulkan(on_device(reference(1, 0)), host, test::path_device());
  const auto picture = [&](PathRenderer& renderer) {
    renderer.prepare(world.scene);
    return renderer.render({camera, {std::string(kColorHdr.name)}, 5}).get(kColorHdr);
  };
  world.scene.edit(camera).camera->readout_time_s = 0.07;
  const Image<Vec3f> rolling_embree = picture(embree);
  const Image<Vec3f> rolling_vulkan = picture(vulkan);
  world.scene.edit(camera).camera->readout_time_s = 0.0;
  const Affine base = world.scene.world_from_node(world.base);
  const Affine now = world.scene.world_from_node(body);
  const RigidMotion motion = body_motion(world.scene, body);
  for (int y = 1; y < kRows; y += 4) {
    const double seconds = 0.07 * ((y + 0.5) / kRows - 0.5);
    world.scene.set_pose(body, base.inverse() * motion.then_from_now(seconds) * now);
    const auto unequal = [&](const Image<Vec3f>& p, const Image<Vec3f>& q, float most) {
      int count = 0;
      for (int x = 0; x < p.width(); ++x) {
        count += (p.at(x, y) - q.at(x, y)).cwiseAbs().maxCoeff() > most ? 1 : 0;
      }
      return count;
    };
    // Where edges are by rounding; Embree's turns are pieces of straight ways.
    CAPTURE(y);
    CHECK(unequal(rolling_vulkan, picture(vulkan), 1e-3f) <= 1);
    CHECK(unequal(rolling_embree, picture(embree), 1e-2f) <= 2);
  }
}

TEST_CASE("what turns while the shutter is open is blurred as with Embree", "[vulkan]") {
  if (!test::has_vulkan_device()) return;
  for (const double turns_per_s : {2.0, 40.0}) {
    TestWorld world = room_with(matte(0.6f));
    // One path that parts from Embree's at an edge counts little where no light is bright.
    world.scene.edit(world.scene.match("/base/light*").at(1)).light->color *= 0.1f;
    add_turning_things(world, 2.0 * kPi * turns_per_s * Vec3(0.4, -0.7, 0.6));
    const NodeId rig = world.scene.create(world.base, "rig");
    RigidBody carried;
    carried.angular_velocity = Vec3(-0.8, 0.5, 1.5);
    world.scene.edit(rig).rigid_body = carried;
    const NodeId made = camera_into(world);
    const NodeId camera = world.scene.create(rig, "turning_camera");
    world.scene.edit(camera).camera = world.scene[made].camera;
    world.scene.set_pose(camera, world.scene[made].parent_from_node);
    world.scene.erase(made);
    Camera& lens = *world.scene.edit(camera).camera;
    lens.exposure_time_s = 0.03;
    lens.readout_time_s = 0.02;
    const Pictures pictures = render_both(world, camera, reference(32, 2));
    const Difference d = difference(pictures, turns_per_s > 10.0 ? "whirling" : "turning");
    double worst = 0.0;  // of blocks
    constexpr int kBlock = 7;
    for (int top = 0; top + kBlock <= 26; top += kBlock) {
      for (int left = 0; left + kBlock <= 35; left += kBlock) {
        double p = 0.0;
        double q = 0.0;
        for (int i = 0; i < kBlock * kBlock; ++i) {
          p += double(pictures.embree.at(left + i % kBlock, top + i / kBlock).sum());
          q += double(pictures.vulkan.at(left + i % kBlock, top + i / kBlock).sum());
        }
        worst = std::max(worst, std::abs(p - q) / p);
      }
    }
    CAPTURE(turns_per_s, d.mean, d.unequal, worst);
    CHECK(d.mean < 0.001);
    CHECK(d.unequal < 0.06);
    CHECK(worst < 0.02);
  }
}

TEST_CASE("what a job says of pictures holds on the device", "[vulkan]") {
  if (!test::has_vulkan_device()) return;
  const std::vector<std::pair<const char*, std::function<void(PictureParams&)>>> changes{
      {"blender", [](PictureParams& p) { p.principled = "blender"; }},
      {"clamp", [](PictureParams& p) { p.clamp = 0.2; }},
      {"direct", [](PictureParams& p) { p.max_bounces = 0; }},
      {"long", [](PictureParams& p) { p.max_bounces = 30, p.samples = 4; }},
      {"denoised", [](PictureParams& p) { p.denoise = true; }},
      {"real_time", [](PictureParams& p) { p.mode = "real_time", p.samples = 1; }},
      {"preview", [](PictureParams& p) { p.mode = "preview", p.samples = 2; }},
      {"error target", [](PictureParams& p) { p.error_target = 0.12, p.samples = 64; }},
  };
  Material coated;
  coated.base_color = Vec3f(0.7f, 0.1f, 0.1f);
  coated.clearcoat = 1.0f;
  for (const auto& [name, change] : changes) {
    TestWorld world = room_with(coated);
    const NodeId camera = camera_into(world);
    PictureParams params = reference(8);
    change(params);
    const Difference d = difference(render_both(world, camera, params), name);
    CAPTURE(name, d.mean, d.unequal);
    // A round more or less of an error target hangs on single paths.
    const bool is_adaptive = params.error_target > 0.0;
    CHECK(d.mean < (is_adaptive ? 0.01 : 0.003));
    if (!is_adaptive) CHECK(d.unequal < 0.08);
  }
}

TEST_CASE("labels are Embree's to the byte", "[vulkan]") {
  if (!test::has_vulkan_device()) return;
  const auto all = geometry_channels();
  for (const LensModel lens : {LensModel::Pinhole, LensModel::OpencvPinhole}) {
    Material fence = matte(0.5f);
    fence.opacity_texture = input(checks(12, 10, 1, ColorSpace::Linear, false));
    fence.opacity_threshold = 0.5f;
    TestWorld world = room_with(fence);
    const NodeId camera = camera_into(world);
    Camera& c = *world.scene.edit(camera).camera;
    c.lens = lens;
    c.distortion = {-0.1, 0.02};
    const auto p = render_by_embree(world.scene, camera, reference(1), all);
    const auto q = render_by_vulkan(world.scene, camera, reference(1), all);
    const auto same = [&](auto channel) {
      const auto a = std::as_bytes(p.get(channel).pixels());
      const auto b = std::as_bytes(q.get(channel).pixels());
      return std::ranges::equal(a, b);
    };
    CHECK(same(kDistanceToCamera));
    CHECK(same(kDistanceToImagePlane));
    CHECK(same(kNormals));
    CHECK(same(kLeafId));
    CHECK(same(kPosition));
    CHECK(same(kUv));
    CHECK(same(kAlbedo));

    RenderHost host(2);
    EmbreeRenderer embree(reference(1), host);
    VulkanRenderer vulkan(on_device(reference(1)), host, test::path_device());
    embree.prepare(world.scene);
    vulkan.prepare(world.scene);
    std::vector<LabelledInstance> instances;
    for (const char* path : {"/base/ball", "/base/box"}) {
      instances.push_back(
          {.node = world.scene.match(path).at(0), .leaves = {world.scene.match(path).at(0)}});
    }
    const auto covered = embree.cover(camera, instances, true);
    const auto covered_too = vulkan.cover(camera, instances, true);
    REQUIRE(covered.size() == covered_too.size());
    for (std::size_t i = 0; i < covered.size(); ++i) {
      CHECK(covered[i].bits == covered_too[i].bits);
      CHECK(covered[i].distances == covered_too[i].distances);
      CHECK(std::ranges::count(covered[i].bits, 1) > 0);
    }
  }
}

TEST_CASE("pictures are the same bytes for any threads, and whatever came before", "[vulkan]") {
  if (!test::has_vulkan_device()) return;
  Material glass;
  glass.transmission = 1.0f;
  glass.roughness = 0.2f;
  TestWorld world = room_with(glass);
  const NodeId camera = camera_into(world);
  const NameSet channels{std::string(kColorHdr.name)};
  const auto picture = [&](int threads, bool shows_other_first) {
    RenderHost host(threads);
    VulkanRenderer renderer(on_device(reference(4)), host, test::path_device());
    if (shows_other_first) {
      TestWorld other = room_with(matte(0.3f));
      const NodeId from = camera_into(other);
      renderer.prepare(other.scene);
      renderer.render({from, channels, 5});
      // The same scene with things elsewhere, then back.
      const NodeId ball = world.scene.match("/base/ball").at(0);
      const Affine pose = world.scene[ball].parent_from_node;
      world.scene.set_pose(ball, at(0.1, -0.4, -0.2));
      renderer.prepare(world.scene);
      renderer.render({camera, channels, 5});
      world.scene.set_pose(ball, pose);
    }
    renderer.prepare(world.scene);
    return renderer.render({camera, channels, 5}).get(kColorHdr);
  };
  const Image<Vec3f> one = picture(1, false);
  const Image<Vec3f> three = picture(3, false);
  const Image<Vec3f> later = picture(2, true);
  const auto same = [&](const Image<Vec3f>& other) {
    return std::ranges::equal(std::as_bytes(one.pixels()), std::as_bytes(other.pixels()));
  };
  CHECK(same(three));
  CHECK(same(later));
}

TEST_CASE("memory on the device does not grow with captures", "[vulkan]") {
  if (!test::has_vulkan_device()) return;
  Material painted;
  painted.base_color_texture = input(checks(64, 32, 3, ColorSpace::Srgb, false));
  TestWorld one = room_with(painted);
  TestWorld other = room_with(matte(0.3f));
  other.add(dome(0.2f));
  const NodeId from_one = camera_into(one);
  const NodeId from_other = camera_into(other);
  RenderHost host(2);
  VulkanRenderer renderer(on_device(reference(1, 1)), host, test::path_device());
  std::vector<std::uint64_t> held;
  for (int i = 0; i < 12; ++i) {
    TestWorld& world = i % 2 == 0 ? one : other;
    world.scene.set_pose(world.scene.match("/base/ball").at(0), at(0.1 * i, 0.2, -0.5));
    renderer.prepare(world.scene);
    renderer.render({i % 2 == 0 ? from_one : from_other, {std::string(kColorHdr.name)}, 5});
    held.push_back(test::path_device()->device.held());
  }
  for (std::size_t i = 2; i < held.size(); ++i) CHECK(held[i] == held[1]);
}

TEST_CASE("visits share a device: meshes are there once, pictures are those of one alone",
          "[vulkan]") {
  if (!test::has_vulkan_device()) return;
  const GpuAssets& assets = *test::path_device()->assets;
  Material painted;
  painted.base_color_texture = input(checks(64, 32, 3, ColorSpace::Srgb, false));
  TestWorld world = room_with(painted);
  const NodeId camera = camera_into(world);
  VulkanRenderer::Params params = on_device(reference(2, 2));
  params.devices = Value::make_list();
  for (int i = 0; i < 2; ++i) params.devices.list.push_back(Value::text("0"));
  const auto picture = [&](int threads) {
    RenderHost host(threads);
    VulkanRenderer renderer(params, host);
    renderer.prepare(world.scene);
    const Frame frame = renderer.render({camera, {std::string(kColorHdr.name)}, 5});
    const auto bytes = std::as_bytes(frame.get(kColorHdr).pixels());
    return std::vector<std::byte>(bytes.begin(), bytes.end());
  };
  const std::vector<std::byte> alone = picture(2);
  // The scene keeps its meshes, so the device does.
  const GpuAssets::Kept kept = assets.kept();
  CHECK(kept.meshes == 3);
  CHECK(kept.textures == 1);
  std::vector<std::future<std::vector<std::byte>>> visits;
  for (int i = 0; i < 4; ++i) visits.push_back(std::async(std::launch::async, picture, 1));
  for (auto& visit : visits) CHECK(visit.get() == alone);
  CHECK(assets.kept().meshes == kept.meshes);
}

TEST_CASE("the filter on planes makes of a film there what it makes of it here", "[vulkan]") {
  if (!test::has_vulkan_device()) return;
  const PathDevice& device = *test::path_device();
  RenderHost host(2);
  Material mirror;
  mirror.metallic = 1.0f;
  mirror.roughness = 0.15f;
  TestWorld world = room_with(mirror);
  Material glass;
  glass.transmission = 1.0f;
  glass.roughness = 0.0f;
  world.add("glass", make_sphere(0.3, 32), glass, at(0.0, -0.2, -0.5));
  // Sizes that end within a block of pixels; of several paths some are far too bright.
  for (const auto& [width, height] : {std::pair{67, 35}, std::pair{7, 5}}) {
    const NodeId camera =
        world.add_camera(width, height, 28.0, Vec3(-0.6, -1.8, 0.3), Vec3(0.1, 0.5, -0.7));
    EmbreeScene meshes(host, {"sse2", {}});
    meshes.take(world.scene);
    GpuScene scene(device, host);
    scene.take(meshes.render_scene());
    const View view(world.scene, camera);
    GpuPathTracer tracer(device, host);
    GpuPlaneFilter filter(device, host);
    for (const int samples : {1, 4, 20}) {
      for (const double limit : {0.0, 0.5}) {
        tracer.begin(view, {.max_bounces = 3, .has_caustics = true}, scene, meshes.window());
        SamplePlan plan(width, height, {samples}, 9);
        tracer.trace(plan.next_round({}, 0.0));
        const Image<Vec3f> there = filter.filtered(tracer, view.position(), limit);
        Film film = tracer.film();
        average_chances(film, host);
        DenoiseSettings settings{view.position()};
        if (limit > 0.0) settings.brightest_path = float(limit / quiet_exposure(film));
        const Image<Vec3f> here = filtered_on_planes(film, settings, Isa::Sse2, host);
        REQUIRE(there.width() == width);
        REQUIRE(there.height() == height);
        double sum = 0.0;
        double off = 0.0;
        for (std::size_t i = 0; i < here.pixels().size(); ++i) {
          sum += double(here.pixels()[i].sum());
          off += double((there.pixels()[i] - here.pixels()[i]).cwiseAbs().sum());
        }
        const Image<Vec3f> raw = undenoised(film);
        double changed = 0.0;
        for (std::size_t i = 0; i < raw.pixels().size(); ++i) {
          changed += double((raw.pixels()[i] - here.pixels()[i]).cwiseAbs().sum());
        }
        CAPTURE(width, samples, limit, off / sum, changed / sum);
        CHECK(off < 1e-5 * sum);
        CHECK(changed > 0.01 * sum);  // There is something to filter.
      }
    }
  }
}

TEST_CASE("sums do not depend on how many paths are under way", "[vulkan]") {
  if (!test::has_vulkan_device()) return;
  TestWorld world = room_with(matte(0.7f));
  const NodeId camera = camera_into(world);
  SceneOnDevice both(world.scene);
  auto& [host, device, meshes, scene] = both;
  const View view(world.scene, camera);
  const auto sums = [&](std::uint32_t most_slots) {
    GpuPathTracer tracer(device, host, most_slots);
    tracer.begin(view, {.max_bounces = 3}, scene, meshes.window());
    SamplePlan plan(view.camera().width, view.camera().height, {5}, 9);
    const auto counts = tracer.trace(plan.next_round({}, 0.0));
    CHECK(counts.rays > 5u * 35u * 26u);
    Image<PixelSum> image = tracer.sums();
    std::vector<float> values;
    for (const PixelSum& sum : image.pixels()) {
      const FilmPixel pixel = sum.mean();
      values.insert(values.end(), pixel.scattered.data(), pixel.scattered.data() + 3);
      values.insert(values.end(), pixel.normal.data(), pixel.normal.data() + 3);
      values.insert(values.end(), {pixel.variance, pixel.brightest, pixel.count});
    }
    return values;
  };
  const std::vector<float> many = sums(1000);
  CHECK(sums(1) == many);
  CHECK(sums(7) == many);
}

TEST_CASE("a device's ray queries find what its kernels find", "[vulkan][ray_query]") {
  if (!test::has_vulkan_device()) return;
  const auto device = test::ray_query_device();
  if (!device) {
    WARN("skipped: " << VulkanInstance::of_process().list_of_devices() << ": no ray queries");
    VulkanRenderer::Params params = on_device(reference(1));
    params.ray_query = true;
    RenderHost host(1);
    CHECK_THROWS_WITH(VulkanRenderer(params, host),
                      Catch::Matchers::StartsWith("ray_query: Vulkan device 0 (") &&
                          ContainsSubstring(") has no ray queries; leave ray_query out"));
    return;
  }
  // Mirrored, turned and stretched instances of one mesh, some cut out by a texture, some of glass,
  // some as thin glass; nothing is symmetric.
  Material glass;
  glass.transmission = 1.0f;
  glass.roughness = 0.1f;
  Material pane = glass;
  pane.is_thin_walled = true;
  pane.base_color = Vec3f(0.9f, 0.7f, 0.5f);
  Material holes = matte(0.6f);
  auto mask = std::make_shared<Texture>(*checks(16, 16, 1, ColorSpace::Linear, false));
  for (std::uint8_t& value : mask->bytes) value = value < 128 ? 0 : 255;
  holes.opacity_texture = input(mask);
  holes.opacity_threshold = 0.5f;
  TestWorld world = room_with(matte(0.5f));
  const Mesh ball = make_sphere(0.2, 24);
  const std::array materials{glass, pane, holes, matte(0.8f)};
  Rng rng(11);
  for (int i = 0; i < 24; ++i) {
    Affine pose = at(rng.uniform(-1.6, 1.6), rng.uniform(-0.4, 1.6), rng.uniform(-1.3, 0.8));
    pose.rotate(Eigen::AngleAxisd(rng.uniform(0.0, 3.0), Vec3(1, 2, 3).normalized()));
    const double side = i % 3 == 0 ? -1.0 : 1.0;
    pose.scale(Vec3(side * rng.uniform(0.5, 1.5), rng.uniform(0.5, 1.5), rng.uniform(0.5, 1.5)));
    world.add("ball" + std::to_string(i), ball, materials[std::size_t(i % 4)], pose);
  }
  world.add(dome(0.3f));
  const NodeId camera = camera_into(world);
  const NameSet channels{std::string(kColorHdr.name)};
  const PictureParams params = reference(16, 5);
  RenderHost host(2);
  VulkanRenderer by_query(on_device(params), host, device);
  const auto both = [&](const char* what) {
    by_query.prepare(world.scene);
    const Frame queried = by_query.render({camera, channels, 5});
    const Frame traced = render_by_vulkan(world.scene, camera, params, channels);
    const Difference found = difference(traced.get(kColorHdr), queried.get(kColorHdr));
    CAPTURE(what, found.mean, found.unequal);
    CHECK(found.mean < 0.001);
    CHECK(found.unequal < 0.01);
  };
  both("as placed");
  world.scene.set_pose(world.scene.match("/base/ball3").at(0), at(0.2, 0.3, -0.4));
  world.scene.set_pose(world.scene.match("/base/ball0").at(0), at(-0.4, 0.1, 0.2));
  both("after some moved");
  world.add("wall", make_box(Vec3(0.5, 0.1, 1.0)), matte(0.2f), at(0.3, 1.0, -0.5));
  both("with one more");

  // Not where things move while the shutter is open: queries know one pose of each.
  EmbreeScene meshes(host, {"sse2", {}});
  GpuScene scene(*device, host);
  const auto is_queried = [&] {
    meshes.take(world.scene);
    scene.take(meshes.render_scene());
    return scene.traces_by_query();
  };
  CHECK(is_queried());
  const NodeId moving = world.scene.match("/base/ball3").at(0);
  world.scene.edit(moving).rigid_body.emplace().linear_velocity = Vec3(1.0, 2.0, -3.0);
  world.scene.edit(camera).camera->exposure_time_s = 0.04;
  CHECK_FALSE(is_queried());
  both("with an open shutter");
  world.scene.edit(camera).camera->exposure_time_s = 0.0;
  CHECK(is_queried());
  both("with a still shutter");

  // The same bytes whatever came before, and for any number of threads.
  const Frame last = by_query.render({camera, channels, 5});
  RenderHost other_host(1);
  const Frame anew =
      render(VulkanRenderer(on_device(params), other_host, device), world.scene, camera, channels);
  CHECK(std::ranges::equal(std::as_bytes(last.get(kColorHdr).pixels()),
                           std::as_bytes(anew.get(kColorHdr).pixels())));

  // Memory does not grow where things move.
  const std::uint64_t held = device->device.held();
  for (int i = 0; i < 5; ++i) {
    world.scene.set_pose(world.scene.match("/base/ball5").at(0), at(0.1 * i, 0.3, -0.4));
    by_query.prepare(world.scene);
    by_query.render({camera, channels, 5});
  }
  CHECK(device->device.held() == held);
}

TEST_CASE("caches learn the same and paths end in them alike on the device", "[vulkan]") {
  if (!test::has_vulkan_device()) return;
  Material material;
  material.roughness = 0.5f;
  TestWorld world = room_with(material);
  Material glass;
  glass.transmission = 1.0f;
  glass.roughness = 0.0f;
  world.add("glass", make_sphere(0.3, 32), glass, at(0.0, -0.2, -0.5));
  const NodeId camera = world.add_camera(67, 35, 28.0, Vec3(-0.6, -1.8, 0.3), Vec3(0.1, 0.5, -0.7));
  SceneOnDevice both(world.scene);
  auto& [host, device, meshes, scene] = both;
  const View view(world.scene, camera);
  SamplePlan plan(67, 35, {32}, 9);
  const std::vector<TraceJob> learning = plan.learning_jobs();
  const std::vector<TraceJob> jobs = plan.next_round({}, 0.0);
  const PathSettings settings{.max_bounces = 4};

  RayCounts rays;
  LearningPaths own_paths =
      PathTracer(meshes, view, {settings}, Isa::Sse2).learn(learning, host, rays);
  const RadianceCache here = own_paths.cache(view.position());
  GpuPathTracer tracer(device, host);
  GpuPathTracer::Counts counts;
  tracer.begin(view, settings, scene, meshes.window());
  LearningPaths device_paths = tracer.learn(learning, counts);
  const RadianceCache there = device_paths.cache(view.position());
  CHECK(counts.rays == Approx(double(rays.rays)).epsilon(0.001));
  CHECK(counts.shadow_rays == Approx(double(rays.shadow_rays)).epsilon(0.001));
  std::size_t known = 0;
  std::size_t unequal = 0;
  for (const RadianceCache::Cell& cell : here.table()) {
    if (cell.key == 0) continue;
    ++known;
    const auto same = std::ranges::find(there.table(), cell.key, &RadianceCache::Cell::key);
    const bool is_equal = same != there.table().end() &&
                          (same->light - cell.light).norm() < 0.01f * (1e-3f + cell.light.norm());
    if (!is_equal) ++unequal;
  }
  CAPTURE(known, unequal);
  CHECK(known > 20);
  CHECK(unequal <= known / 20);

  // The same cache for both: paths end in it alike, also those that learnt.
  own_paths.end_in(here, host);
  device_paths.end_in(here, host);
  const auto alone = [&](const LearningPaths& paths) {
    Image<PixelSum> sums(67, 35, PixelSum());
    paths.for_each(
        [&](const LearningPaths::Path& path) { sums.at(path.x, path.y).add(path.sample); });
    Film means(67, 35);
    for (std::size_t i = 0; i < sums.pixels().size(); ++i) {
      means.pixels()[i] = sums.pixels()[i].mean();
    }
    return means;
  };
  const Difference learnt =
      difference(undenoised(alone(own_paths)), undenoised(alone(device_paths)));
  CAPTURE(learnt.mean, learnt.unequal);
  CHECK(learnt.mean < 0.002);
  CHECK(learnt.unequal < 0.04);
  TraceSettings own{settings};
  own.cache = &here;
  const Film film = PathTracer(meshes, view, own, Isa::Sse2).film(jobs, host, rays, own_paths);
  tracer.begin(view, settings, scene, meshes.window(), &here);
  tracer.count(device_paths);
  const auto ended = tracer.trace(jobs);
  const Film device_film = tracer.film();
  const Difference found = difference(undenoised(film), undenoised(device_film));
  CAPTURE(found.mean, found.unequal);
  CHECK(found.mean < 0.001);
  CHECK(found.unequal < 0.02);
  CHECK(film.at(5, 7).count == 36.0f);
  CHECK(device_film.at(5, 7).count == 36.0f);
  tracer.begin(view, settings, scene, meshes.window());
  const auto whole = tracer.trace(jobs);
  CHECK(double(ended.rays) < 0.9 * double(whole.rays));
  CHECK(double(ended.shadow_rays) < 0.9 * double(whole.shadow_rays));
}

TEST_CASE("a ray that passes forty thousand surfaces is right, or ends the job", "[vulkan]") {
  if (!test::has_vulkan_device()) return;
  // Sheets that are not there, one behind the other: rays look at all of them, and at as many nodes
  // of the tree, which is more than the 65,535 rounds after which lavapipe of Mesa 22.3 ends loops.
  TestWorld world;
  constexpr int kSheets = 40'000;
  Mesh sheets;
  for (int i = 0; i < kSheets; ++i) {
    const float x = 1.0f + 2e-4f * float(i);
    const auto first = std::uint32_t(sheets.positions.size());
    sheets.positions.insert(sheets.positions.end(),
                            {Vec3f(x, -9, -9), Vec3f(x, 9, -9), Vec3f(x, 0, 9)});
    sheets.triangles.push_back({first, first + 1, first + 2});
  }
  Material absent = matte(0.5f);
  absent.opacity = 0.0f;
  absent.opacity_threshold = 0.5f;
  world.add("sheets", sheets, absent);
  world.add(dome(1.0f));
  const NodeId camera = world.add_camera(2, 2, 20.0, Vec3(0, 0, 0), Vec3(1, 0, 0));
  RenderHost host(1);
  VulkanRenderer renderer(on_device(reference(1)), host, test::path_device());
  renderer.prepare(world.scene);
  const NameSet channels{std::string(kColorHdr.name)};
  try {
    const Frame frame = renderer.render({camera, channels, 5});
    CHECK(frame.get(kColorHdr).at(0, 0).x() == Approx(1.0f));
  } catch (const Error& error) {
    CHECK(test::path_device()->kernels.iteration_limit != 0xFFFFFFFFu);
    CHECK_THAT(error.what(),
               ContainsSubstring("and a ray of this scene needs more; use a newer driver, or the "
                                 "renderer embree"));
  }
}

}  // namespace diorama
