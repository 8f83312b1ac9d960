// SPDX-License-Identifier: Apache-2.0
// A process of its own: what it held at most is the measure.
#include <sys/resource.h>

#include <cmath>

#include "diorama/abi.h"
#include "diorama/geometry.h"
#include "embree_renderer.h"
#include "support/catch.h"
#include "support/render_host/render_host.h"

namespace diorama {
namespace {

constexpr int kMeshes = 100;
constexpr int kTextureSize = 1024;
constexpr int kGrid = 71;  // 71 x 71 x 2 triangles each

double peak_mib() {
  rusage usage;
  getrusage(RUSAGE_SELF, &usage);
  return double(usage.ru_maxrss) / 1024.0;
}

/// A sheet with hills of its own.
Mesh sheet(int number) {
  Mesh mesh;
  for (int y = 0; y <= kGrid; ++y) {
    for (int x = 0; x <= kGrid; ++x) {
      const float u = float(x) / kGrid;
      const float v = float(y) / kGrid;
      const float hill = 0.1f * std::sin(9.0f * u + float(number)) * std::cos(7.0f * v);
      mesh.positions.emplace_back(u - 0.5f, v - 0.5f, hill);
      mesh.normals.push_back(Vec3f(-0.9f * std::cos(9.0f * u + float(number)), 0, 1).normalized());
      mesh.uvs.emplace_back(u, v);
    }
  }
  const auto corner = [](int x, int y) { return std::uint32_t(y * (kGrid + 1) + x); };
  for (int y = 0; y < kGrid; ++y) {
    for (int x = 0; x < kGrid; ++x) {
      mesh.triangles.push_back({corner(x, y), corner(x + 1, y), corner(x + 1, y + 1)});
      mesh.triangles.push_back({corner(x, y), corner(x + 1, y + 1), corner(x, y + 1)});
    }
  }
  return mesh;
}

std::shared_ptr<const Material> textured(int number) {
  auto texture = std::make_shared<Texture>();
  texture->name = "texture " + std::to_string(number);
  texture->width = texture->height = kTextureSize;
  texture->channels = 3;
  texture->color_space = ColorSpace::Srgb;
  texture->bytes.resize(3 * std::size_t(kTextureSize) * kTextureSize);
  for (std::size_t i = 0; i < texture->bytes.size(); ++i) {
    texture->bytes[i] = std::uint8_t(i * (2 * std::size_t(number) + 1) >> 8);
  }
  auto material = std::make_shared<Material>();
  material->base_color.setOnes();
  material->base_color_texture.texture = std::move(texture);
  return material;
}

}  // namespace

TEST_CASE("a million triangles and a hundred textures fit into 1 GiB", "[memory]") {
#if DIORAMA_DETAIL_ADDRESS_SANITIZER || DIORAMA_DETAIL_THREAD_SANITIZER
  WARN("sanitizers need memory of their own: not measured");
#else
  Scene scene;
  std::size_t triangles = 0;
  for (int i = 0; i < kMeshes; ++i) {
    const NodeId node = scene.create(scene.root(), "sheet");
    auto mesh = std::make_shared<const Mesh>(sheet(i));
    triangles += mesh->triangles.size();
    scene.edit(node).mesh = std::move(mesh);
    scene.edit(node).materials = {textured(i)};
    // Half of them loose, as in a job with many objects.
    if (i % 2 == 0) scene.edit(node).rigid_body = RigidBody{};
    scene.set_pose(node, Affine(Eigen::Translation3d(i % 10, i / 10, 0.0)));
  }
  REQUIRE(triangles > 1'000'000);
  Light sky;
  sky.kind = LightKind::Dome;
  scene.edit(scene.create(scene.root(), "sky")).light = sky;
  const NodeId camera = scene.create(scene.root(), "camera");
  scene.edit(camera).camera = Camera::from_lens(640, 480, 24.0, 20.955);
  scene.set_pose(camera, Affine(Eigen::Translation3d(4.5, 4.5, 12.0)));

  test::RenderHost host(2);
  EmbreeRenderer::Params params;
  params.samples = 2;
  EmbreeRenderer renderer(params, host);
  renderer.prepare(scene);
  const Frame frame = renderer.render({camera, renderer.provides(), 1});
  // A second capture: what moved is fitted, nothing is kept twice.
  for (const NodeId node : scene.match("/sheet*")) {
    Affine pose = scene[node].parent_from_node;
    pose.translation().z() = 0.1;
    scene.set_pose(node, pose);
  }
  renderer.prepare(scene);
  renderer.render({camera, renderer.provides(), 1});

  const double peak = peak_mib();
  INFO("peak of " << peak << " MiB");
  // Less than the textures alone cannot be: then nothing was measured.
  CHECK(peak > 300.0);
  CHECK(peak < 1024.0);
  CHECK(frame.get(kLeafId).at(320, 240) != 0);
#endif
}

}  // namespace diorama
