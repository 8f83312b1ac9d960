// SPDX-License-Identifier: Apache-2.0
// What exposure, readout and aperture do to pictures, by closed forms.
#include <algorithm>
#include <cmath>

#include "diorama/geometry.h"
#include "embree_renderer.h"
#include "support/catch.h"
#include "support/render_host/render_host.h"
#include "test_world.h"

namespace diorama {
namespace {

using test::at;
using test::RenderHost;
using test::TestWorld;

constexpr int kWidth = 96;
constexpr int kHeight = 64;
constexpr double kFocal = 80.0;  // pixels
constexpr double kDepth = 4.0;   // metres

Material glowing() {
  Material material;
  material.base_color.setZero();
  material.specular = 0.0f;
  material.emission.setOnes();
  return material;
}

/// A glowing half plane that ends at the middle of the picture, `kDepth` away; pixels show how much
/// of them it covers.
struct Edge {
  TestWorld world;
  NodeId rig;  ///< Carries the camera.
  NodeId camera;
  NodeId body;

  Edge() {
    // x of the camera is -y of the base node.
    rig = world.scene.create(world.base, "rig");
    const NodeId made =
        world.add_camera(kWidth, kHeight, kFocal, Vec3(-kDepth, 0, 0), Vec3(0, 0, 0));
    camera = world.scene.create(rig, "camera");
    world.scene.edit(camera).camera = world.scene[made].camera;
    world.scene.set_pose(camera, world.scene[made].parent_from_node);
    world.scene.erase(made);
    Camera& lens = *world.scene.edit(camera).camera;
    lens.fy = kFocal;
    lens.cx = 0.5 * kWidth;
    lens.cy = 0.5 * kHeight;
    body = world.scene.create(world.base, "body");
    world.scene.edit(body).rigid_body = RigidBody{};
    const NodeId plate = world.scene.create(body, "plate");
    world.scene.edit(plate).mesh = std::make_shared<const Mesh>(make_box(Vec3(0.001, 10, 10)));
    world.scene.edit(plate).materials = {std::make_shared<const Material>(glowing())};
    world.scene.set_pose(plate, at(0, 5, 0));
  }
  Camera& lens() { return *world.scene.edit(camera).camera; }
  /// In the camera's axes.
  Vec3 in_world(const Vec3& direction) const {
    return world.scene.world_from_node(camera).linear() * direction;
  }
  Image<Vec3f> picture(int samples = 64) { return render(kColorHdr, samples); }
  template <class Pixel>
  Image<Pixel> render(Channel<Pixel> channel, int samples, int threads = 2) {
    RenderHost host(threads);
    EmbreeRenderer::Params params;
    params.samples = samples;
    params.denoise = false;
    EmbreeRenderer renderer(params, host);
    renderer.prepare(world.scene);
    return renderer.render({camera, {std::string(channel.name)}, 7}).get(channel);
  }
};

/// Mean of a column, from the first row to the last one.
double column(const Image<Vec3f>& image, int x, int from = 0, int to = kHeight) {
  double sum = 0.0;
  for (int y = from; y < to; ++y) sum += double(image.at(x, y).y());
  return sum / (to - from);
}

/// Covered pixels of a row, from the left.
double covered(const Image<Vec3f>& image, int y) {
  double sum = 0.0;
  for (int x = 0; x < kWidth; ++x) sum += double(image.at(x, y).y());
  return sum;
}

/// A moving edge becomes a ramp as wide as it moves.
void check_ramp(const Image<Vec3f>& image, double width_px) {
  for (int x = 2; x < kWidth - 2; ++x) {
    // Over a pixel's width the ramp's corners are rounded: leave them out.
    const double off = x + 0.5 - 0.5 * kWidth;
    if (std::abs(std::abs(off) - 0.5 * width_px) < 1.0) continue;
    const double expected = std::clamp(0.5 - off / width_px, 0.0, 1.0);
    CAPTURE(x);
    CHECK(column(image, x) == Approx(expected).margin(0.01));
  }
}

}  // namespace

TEST_CASE("a moving edge is blurred over the way it goes", "[renderer][shutter][long]") {
  Edge edge;
  edge.lens().exposure_time_s = 0.02;
  // 20 px = focal * v * t / depth
  const double speed = 20.0 * kDepth / kFocal / 0.02;
  edge.world.scene.edit(edge.body).rigid_body->linear_velocity = edge.in_world(Vec3(speed, 0.3, 0));
  check_ramp(edge.picture(), 20.0);
}

TEST_CASE("a moving camera blurs like moving things do", "[renderer][shutter][long]") {
  const double speed = 20.0 * kDepth / kFocal / 0.02;
  SECTION("by its own velocity") {
    Edge edge;
    edge.lens().exposure_time_s = 0.02;
    edge.lens().linear_velocity = edge.in_world(Vec3(-speed, 0, 0));
    check_ramp(edge.picture(), 20.0);
  }
  SECTION("on a body that moves") {
    Edge edge;
    edge.lens().exposure_time_s = 0.02;
    edge.world.scene.edit(edge.rig).rigid_body = RigidBody{};
    edge.world.scene.edit(edge.rig).rigid_body->linear_velocity = edge.in_world(Vec3(-speed, 0, 0));
    check_ramp(edge.picture(), 20.0);
  }
  SECTION("by panning") {
    Edge edge;
    edge.lens().exposure_time_s = 0.02;
    // Near the axis a turn by a moves the picture by focal * a.
    edge.lens().angular_velocity = edge.in_world(Vec3(0, 10.0 / kFocal / 0.02, 0));
    check_ramp(edge.picture(), 10.0);
  }
}

TEST_CASE("a rolling shutter leans what moves", "[renderer][shutter][long]") {
  Edge edge;
  edge.lens().readout_time_s = 0.03;
  const double speed = 20.0 * kDepth / kFocal / 0.03;
  edge.world.scene.edit(edge.body).rigid_body->linear_velocity = edge.in_world(Vec3(speed, 0, 0));
  const Image<Vec3f> image = edge.picture();
  for (int y = 0; y < kHeight; ++y) {
    const double row_shift = 20.0 * ((y + 0.5) / kHeight - 0.5);
    CAPTURE(y);
    CHECK(covered(image, y) == Approx(0.5 * kWidth + row_shift).margin(0.15));
  }
}

TEST_CASE("a whole turn smears a bar over its circle", "[renderer][shutter][long]") {
  TestWorld world;
  const NodeId camera = world.add_camera(64, 64, 60.0, Vec3(-kDepth, 0, 0), Vec3(0, 0, 0));
  Camera& lens = *world.scene.edit(camera).camera;
  lens.fy = 60.0;
  lens.cx = lens.cy = 32.0;
  lens.exposure_time_s = 0.1;
  const double half_bar = 0.1;
  const NodeId bar = world.add("bar", make_box(Vec3(0.001, 6.0, 2 * half_bar)), glowing());
  RigidBody spinning;
  const Vec3 axis = world.scene.world_from_node(world.base).linear() * Vec3::UnitX();
  spinning.angular_velocity = 2.0 * kPi / 0.1 * axis;
  world.scene.edit(bar).rigid_body = spinning;
  RenderHost host(2);
  EmbreeRenderer::Params params;
  params.samples = 256;
  params.denoise = false;
  EmbreeRenderer renderer(params, host);
  renderer.prepare(world.scene);
  const Image<Vec3f> image =
      renderer.render({camera, {std::string(kColorHdr.name)}, 3}).get(kColorHdr);
  for (const double radius : {8.0, 16.0, 26.0}) {
    double sum = 0.0;
    int count = 0;
    for (int y = 0; y < 64; ++y) {
      for (int x = 0; x < 64; ++x) {
        const double r = std::hypot(x + 0.5 - 32.0, y + 0.5 - 32.0);
        if (std::abs(r - radius) > 1.0) continue;
        // The share of the turn for which the bar, of two arms, covers the point.
        const double metres = r * kDepth / 60.0;
        sum += double(image.at(x, y).y()) / (2.0 * std::asin(half_bar / metres) / kPi);
        ++count;
      }
    }
    CAPTURE(radius);
    CHECK(sum / count == Approx(1.0).margin(0.02));
  }
}

TEST_CASE("labels show the moment whatever the shutter does", "[renderer][shutter]") {
  Edge still;
  Edge moving;
  moving.lens().exposure_time_s = 0.02;
  moving.lens().readout_time_s = 0.01;
  moving.lens().angular_velocity = Vec3(1, 2, 3);
  RigidBody& body = *moving.world.scene.edit(moving.body).rigid_body;
  body.linear_velocity = Vec3(3, 2, 1);
  body.angular_velocity = Vec3(3, 0, 1);
  CHECK(moving.render(kLeafId, 1) == still.render(kLeafId, 1));
  CHECK(moving.render(kDistanceToCamera, 1) == still.render(kDistanceToCamera, 1));
  CHECK(moving.render(kNormals, 1) == still.render(kNormals, 1));
  CHECK_FALSE(moving.picture(4) == still.picture(4));
}

TEST_CASE("without an exposure time velocities do not matter", "[renderer][shutter]") {
  Edge still;
  Edge moving;
  moving.lens().linear_velocity = Vec3(1, 2, 3);
  moving.world.scene.edit(moving.body).rigid_body->linear_velocity = Vec3(3, 2, 1);
  CHECK(moving.picture(4) == still.picture(4));
}

TEST_CASE("blurred pictures are the same for any threads and after other scenes",
          "[renderer][shutter]") {
  Edge edge;
  edge.lens().exposure_time_s = 0.02;
  RigidBody& body = *edge.world.scene.edit(edge.body).rigid_body;
  body.linear_velocity = Vec3(3, 2, 1);
  body.angular_velocity = Vec3(300, 5, 1);  // nearly a whole turn
  const Image<Vec3f> first = edge.render(kColorHdr, 4, 1);
  CHECK(edge.render(kColorHdr, 4, 4) == first);

  RenderHost host(3);
  EmbreeRenderer::Params params;
  params.samples = 4;
  params.denoise = false;
  EmbreeRenderer renderer(params, host);
  for (const double speed : {0.0, 9.0, 3.0}) {
    edge.world.scene.edit(edge.body).rigid_body->linear_velocity.x() = speed;
    renderer.prepare(edge.world.scene);
  }
  CHECK(renderer.render({edge.camera, {std::string(kColorHdr.name)}, 7}).get(kColorHdr) == first);
}

TEST_CASE("an open aperture leaves what is in focus sharp, and nothing else",
          "[renderer][shutter]") {
  Edge edge;
  edge.lens().focal_length_mm = 100.0;
  edge.lens().f_stop = 1.4;
  const auto softest = [&](double focus_m) {
    edge.lens().focus_distance_m = focus_m;
    const Image<Vec3f> image = edge.picture(4);
    double most = 0.0;
    for (int x = 0; x < kWidth; ++x) {
      if (std::abs(x + 0.5 - 0.5 * kWidth) < 1.0) continue;  // pixels that the edge itself divides
      const double expected = x < kWidth / 2 ? 1.0 : 0.0;
      most = std::max(most, std::abs(column(image, x) - expected));
    }
    return most;
  };
  CHECK(softest(kDepth) < 1e-6);
  // 80 px * (0.1 m / 1.4) * |1 / 0.5 - 1 / 4| are 10 px.
  CHECK(softest(0.5) > 0.2);
}

TEST_CASE("a light out of focus becomes the circle that the thin lens says",
          "[renderer][shutter][long]") {
  for (const double focus : {2.0, 8.0}) {
    TestWorld world;
    const double radius = 0.01;
    world.add("dot", make_sphere(radius, 48), glowing());
    const NodeId camera =
        world.add_camera(kWidth, kHeight, 600.0, Vec3(-kDepth, 0, 0), Vec3(0, 0, 0));
    Camera& lens = *world.scene.edit(camera).camera;
    lens.fy = 600.0;
    lens.cx = 0.5 * kWidth;
    lens.cy = 0.5 * kHeight;
    lens.focal_length_mm = 100.0;
    lens.f_stop = 1.4;
    lens.focus_distance_m = focus;
    RenderHost host(2);
    EmbreeRenderer::Params params;
    params.samples = 512;
    params.denoise = false;
    EmbreeRenderer renderer(params, host);
    renderer.prepare(world.scene);
    const Image<Vec3f> image =
        renderer.render({camera, {std::string(kColorHdr.name)}, 3}).get(kColorHdr);
    double sum = 0.0, variance = 0.0;
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const double off = x + 0.5 - 0.5 * kWidth;
        sum += double(image.at(x, y).y());
        variance += double(image.at(x, y).y()) * off * off;
      }
    }
    // Discs of diameter d have the variance d^2 / 16 along an axis, pixels 1 / 12.
    const double circle = 600.0 * (0.1 / 1.4) * std::abs(1.0 / focus - 1.0 / kDepth);
    const double dot = 600.0 * 2.0 * radius / kDepth;
    const double expected = (circle * circle + dot * dot) / 16.0 + 1.0 / 12.0;
    CAPTURE(focus, circle);
    CHECK(variance / sum == Approx(expected).epsilon(0.04));
  }
}

}  // namespace diorama
