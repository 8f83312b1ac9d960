// SPDX-License-Identifier: Apache-2.0
// Of scenes that are gone renderers keep nothing, whatever a job draws anew for each of them.
#include <cmath>
#include <memory>
#include <vector>

#include "diorama/renderer.h"
#include "embree_renderer.h"
#include "embree_scene.h"
#include "null_renderer.h"
#include "support/catch.h"
#include "support/render_host/render_host.h"
#include "test_world.h"

namespace diorama {
namespace {

using test::at;
using test::RenderHost;
using test::TestWorld;

constexpr int kVisits = 12;

/// What scenes are made of, seen from outside.
struct Remains {
  std::vector<std::weak_ptr<const Mesh>> meshes;
  std::vector<std::weak_ptr<const Material>> materials;
  std::vector<std::weak_ptr<const Texture>> textures;

  template <class T>
  static int living(const std::vector<std::weak_ptr<const T>>& list) {
    int count = 0;
    for (const auto& entry : list) count += entry.expired() ? 0 : 1;
    return count;
  }
};

std::shared_ptr<const Texture> picture(int width, int height, int visit) {
  auto texture = std::make_shared<Texture>();
  texture->width = width;
  texture->height = height;
  texture->channels = 3;
  texture->floats.assign(3 * std::size_t(width) * std::size_t(height), 0.5f + 0.01f * float(visit));
  return texture;
}

/// A room of its own for every visit: a textured floor, a pane, a lamp, a sky.
class Visit {
 public:
  Visit(int visit, Remains& remains) {
    const auto add = [&](const char* name, Mesh mesh, Material material, const Affine& pose) {
      material.roughness = 0.2f + 0.013f * float(visit);
      material.base_color_texture.texture = picture(16, 16, visit);
      const NodeId node = world.add(name, std::move(mesh), material, pose);
      remains.meshes.push_back(world.scene[node].mesh);
      remains.materials.push_back(world.scene[node].materials[0]);
      remains.textures.push_back(world.scene[node].materials[0]->base_color_texture.texture);
      return node;
    };
    add("floor", make_plane(4, 4), Material(), at(0, 0, 0));
    Material pane;
    pane.transmission = 1.0f;
    pane.is_thin_walled = true;
    add("pane", make_plane(1, 1), pane, at(0, 0, 1));
    Material glow;
    glow.emission = Vec3f(3, 2, 1);
    add("lamp", make_sphere(0.1), glow, at(1, 0, 1));
    const NodeId ball = add("ball", make_sphere(0.2), Material(), at(0, 0.5, 0.4));
    world.scene.edit(ball).rigid_body = RigidBody{};
    Light sky = test::dome(1.0f);
    sky.texture = picture(64, 32, visit);
    remains.textures.push_back(sky.texture);
    world.add(std::move(sky));
    camera = world.add_camera(8, 6, 8.0, Vec3(2, -2, 2), Vec3(0, 0, 0));
  }
  TestWorld world;
  NodeId camera;
};

/// Shows the renderer scenes that are gone at once; then one of other things.
Remains after_visits(Renderer& renderer) {
  Remains remains;
  for (int i = 0; i < kVisits; ++i) {
    const Visit visit(i, remains);
    renderer.prepare(visit.world.scene);
    renderer.render({visit.camera, renderer.provides(), 1});
  }
  // The tables of the last visit go with the next scene.
  TestWorld other;
  other.add(test::dome(1.0f));
  renderer.prepare(other.scene);
  return remains;
}

}  // namespace

TEST_CASE("renderers keep nothing of scenes that are gone", "[memory]") {
  RenderHost host(2);
  EmbreeRenderer::Params params;
  params.samples = 1;
  EmbreeRenderer embree(params, host);
  NullRenderer null({}, host);
  for (Renderer* renderer : {static_cast<Renderer*>(&embree), static_cast<Renderer*>(&null)}) {
    const Remains remains = after_visits(*renderer);
    CAPTURE(renderer == &embree ? "embree" : "null");
    CHECK(Remains::living(remains.meshes) == 0);
    CHECK(Remains::living(remains.materials) == 0);
    CHECK(Remains::living(remains.textures) == 0);
  }
}

TEST_CASE("tables of textures and skies go with them", "[memory]") {
  RenderHost host(2);
  EmbreeScene uploaded(host, {});
  Remains remains;
  RenderScene::Kept most;
  for (int i = 0; i < kVisits; ++i) {
    const Visit visit(i, remains);
    uploaded.take(visit.world.scene);
    const RenderScene::Kept kept = uploaded.kept();
    most.meshes = std::max(most.meshes, kept.meshes);
    most.materials = std::max(most.materials, kept.materials);
    most.textures = std::max(most.textures, kept.textures);
    most.skies = std::max(most.skies, kept.skies);
  }
  CHECK(most.meshes == 4);
  CHECK(most.materials == 5);  // with that of meshes without one
  CHECK(most.textures <= 8);   // a pane's is known until the sky is looked at again
  CHECK(most.skies <= 2);
}

TEST_CASE("what an asset cache keeps is made ready once", "[memory]") {
  RenderHost host(2);
  EmbreeScene uploaded(host, {});
  Remains remains;
  const auto cached = std::make_unique<const Visit>(0, remains);
  uploaded.take(cached->world.scene);
  const std::size_t textures = uploaded.kept().textures;
  TestWorld other;
  other.add(test::dome(1.0f));
  uploaded.take(other.scene);
  CHECK(uploaded.kept().meshes == 0);
  CHECK(uploaded.kept().textures == textures);
  CHECK(uploaded.kept().skies == 2);
}

TEST_CASE("roughness drawn for every capture leaves no tables behind", "[memory][long]") {
  RenderHost host(2);
  EmbreeScene uploaded(host, {});
  std::size_t most = 0;
  for (int capture = 0; capture < 30; ++capture) {
    TestWorld world;
    for (int i = 0; i < 100; ++i) {
      Material material;
      material.roughness = 0.1f + 0.00029f * float(100 * capture + i);
      world.add("tile", make_plane(0.1, 0.1), material, at(0.2 * i, 0, 0));
    }
    world.add(test::dome(1.0f));
    uploaded.take(world.scene);
    most = std::max(most, uploaded.kept().albedo_rows);
  }
  CHECK(most > 100);
  CHECK(most < 1500);
}

}  // namespace diorama
