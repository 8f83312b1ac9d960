// SPDX-License-Identifier: Apache-2.0
// Both renderers make the same pictures and the same labels.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <string>

#include "embree_renderer.h"
#include "plugins/renderer_embree/test_world.h"
#include "support/catch.h"
#include "support/render_host/render_host.h"
#include "vulkan_for_tests.h"
#include "vulkan_renderer.h"

namespace diorama {
namespace {

using test::at;
using test::dome;
using test::matte;
using test::RenderHost;
using test::TestWorld;

struct Pictures {
  Image<Vec3f> embree;
  Image<Vec3f> vulkan;
};

template <class Renderer, class Params>
Frame render(const Scene& scene, NodeId camera, const Params& params, const NameSet& channels) {
  RenderHost host(2);
  Renderer renderer(params, host);
  renderer.prepare(scene);
  return renderer.render({camera, channels, 5});
}

VulkanRenderer::Params on_device(const PictureParams& params) {
  VulkanRenderer::Params own;
  static_cast<PictureParams&>(own) = params;
  return own;
}

PictureParams reference(int samples, int bounces = 4) {
  PictureParams params;
  params.samples = samples;
  params.max_bounces = bounces;
  params.denoise = false;
  params.exposure = "fixed";
  return params;
}

Pictures render_both(const TestWorld& world, NodeId camera, const PictureParams& params) {
  const NameSet channels{std::string(kColorHdr.name)};
  return {render<EmbreeRenderer>(world.scene, camera, params, channels).get(kColorHdr),
          render<VulkanRenderer>(world.scene, camera, on_device(params), channels).get(kColorHdr)};
}

/// How far apart two pictures are that share their random numbers: nearly all pixels are equal but
/// for rounding; a few paths go other ways.
struct Difference {
  double mean = 0.0;     ///< Of the pictures' means, relative.
  double unequal = 0.0;  ///< Share of the pixels that differ by more than a hundredth.
};

Difference difference(const Pictures& pictures, const char* name) {
  double a = 0.0;
  double b = 0.0;
  std::size_t unequal = 0;
  const auto p = pictures.embree.pixels();
  const auto q = pictures.vulkan.pixels();
  for (std::size_t i = 0; i < p.size(); ++i) {
    a += double(p[i].sum());
    b += double(q[i].sum());
    const float scale = std::max(1e-3f, p[i].cwiseAbs().maxCoeff());
    if (!((p[i] - q[i]).cwiseAbs().maxCoeff() < 0.01f * scale)) ++unequal;
  }
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
  return {std::abs(b / a - 1.0), double(unequal) / double(p.size())};
}

Mesh inward_box(const Vec3& size) {
  Mesh room = make_box(size);
  for (Vec3f& n : room.normals) n = -n;
  for (auto& t : room.triangles) std::swap(t[1], t[2]);
  return room;
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
  world.add("room", inward_box(Vec3(5, 4, 3)), matte(0.6f));
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
  return world.add_camera(32, 24, 26.0, Vec3(-0.6, -1.8, 0.3), Vec3(0.1, 0.5, -0.7));
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

}  // namespace diorama
