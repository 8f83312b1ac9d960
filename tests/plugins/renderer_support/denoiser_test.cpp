// SPDX-License-Identifier: Apache-2.0
#include "renderer_support/denoiser.h"

#include <cmath>
#include <limits>
#include <utility>

#include "diorama/rng.h"
#include "renderer_support/view_transform.h"
#include "support/catch.h"
#include "support/render_host/render_host.h"

namespace diorama {
namespace {

/// Two walls meeting in the middle column, lit 1 and 3, with a fine stripe pattern as colour and
/// noise of relative size `noise`.
Film noisy_corner(double noise) {
  Film film(65, 40, FilmPixel{});
  Rng rng(21);
  for (int y = 0; y < film.height(); ++y) {
    for (int x = 0; x < film.width(); ++x) {
      FilmPixel& p = film.at(x, y);
      const bool is_left = x < 32;
      const float light = is_left ? 1.0f : 3.0f;
      p.albedo = Vec3f::Constant((x / 2) % 2 ? 0.8f : 0.2f);
      p.normal = is_left ? Vec3f::UnitX() : Vec3f::UnitY();
      p.position = is_left ? Vec3f(0, float(32 - x), float(y)) : Vec3f(float(x - 32), 0, float(y));
      const float spread = float(noise) * light;
      p.scattered = p.albedo * std::max(0.0f, light + spread * float(rng.normal()));
      p.variance = std::pow(spread * p.albedo.x(), 2.0f);
      p.surface_share = 1.0f;
    }
  }
  return film;
}

/// A grey wall of `paths` a pixel; `light(x, path)` is what each path brings.
template <class Light>
Film wall(int width, int height, int paths, Light&& light) {
  Film film(width, height, FilmPixel{});
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      PixelSum sum;
      for (int i = 0; i < paths; ++i) {
        PathSample sample;
        sample.has_surface = true;
        sample.albedo = Vec3f::Constant(0.5f);
        sample.normal = Vec3f::UnitZ();
        sample.position = 0.02f * Vec3f(float(x), float(y), 0.0f);
        sample.scattered = Vec3f::Constant(light(x, i));
        sum.add(sample);
      }
      film.at(x, y) = sum.mean();
    }
  }
  return film;
}

double mean(const Image<Vec3f>& image) {
  double total = 0.0;
  for (const Vec3f& pixel : image.pixels()) total += double(pixel.x());
  return total / double(image.pixels().size());
}

double error(const Image<Vec3f>& image, const Image<Vec3f>& truth) {
  double sum = 0.0;
  for (std::size_t i = 0; i < image.pixels().size(); ++i) {
    sum += double((image.pixels()[i] - truth.pixels()[i]).squaredNorm());
  }
  return sum / double(image.pixels().size());
}

}  // namespace

TEST_CASE("noise goes, pattern and corner stay", "[denoiser]") {
  test::RenderHost host(2);
  const Image<Vec3f> truth = undenoised(noisy_corner(0.0));
  const double before = error(undenoised(noisy_corner(0.3)), truth);
  const double after =
      error(denoised(noisy_corner(0.3), {Vec3f(30, 30, 20)}, Isa::Sse2, host), truth);
  CHECK(after < 0.08 * before);
}

TEST_CASE("a picture without noise stays as it is", "[denoiser]") {
  test::RenderHost host(1);
  CHECK(error(denoised(noisy_corner(0.0), {Vec3f(30, 30, 20)}, Isa::Sse2, host),
              undenoised(noisy_corner(0.0))) < 1e-6);
}

TEST_CASE("pictures of few paths keep their light, however skewed its noise", "[denoiser]") {
  test::RenderHost host(2);
  Rng rng(5);
  Film film = wall(160, 120, 4, [&](int, int) {
    // Mostly in shadow, seldom bright: the mean is 1.
    const double u = rng.uniform(0.0, 1.0);
    return u < 0.6 ? 0.0f : float(-std::log((1.0 - u) / 0.4)) / 0.4f;
  });
  const double before = mean(undenoised(film));
  CHECK(before == Approx(1.0).epsilon(0.02));
  CHECK(mean(denoised(std::move(film), {Vec3f(1.6f, 1.2f, 3.0f)}, Isa::Sse2, host)) ==
        Approx(before).epsilon(0.005));
}

TEST_CASE("one chance find among quiet neighbours is tamed", "[denoiser]") {
  test::RenderHost host(1);
  Film film = noisy_corner(0.05);
  film.at(20, 20).scattered *= 500.0f;
  film.at(20, 20).variance *= 250000.0f;
  const Image<Vec3f> clean = denoised(std::move(film), {Vec3f(30, 30, 20)}, Isa::Sse2, host);
  for (int y = 12; y < 28; ++y) {
    for (int x = 12; x < 28; ++x) CHECK(clean.at(x, y).x() < 1.5f);
  }
}

TEST_CASE("single paths of extreme light make no dots, and their light is kept", "[denoiser]") {
  // A wall lit 1, one path of two hundred a thousand times as bright: more than one to a
  // neighbourhood, so that they vouch for each other.
  Rng rng(9);
  Film film = wall(160, 112, 16, [&](int, int) {
    const bool is_extreme = rng.uniform() < 0.0002;
    return is_extreme ? 1000.0f : float(rng.uniform(0.5, 1.5));
  });
  const auto brightest = [](const Image<Vec3f>& image) {
    float most = 0.0f;
    for (const Vec3f& pixel : image.pixels()) most = std::max(most, pixel.x());
    return most;
  };
  const double before = mean(undenoised(film));
  CHECK(brightest(undenoised(film)) > 50.0f);
  test::RenderHost host(2);
  DenoiseSettings settings{Vec3f(1.6f, 1.1f, 3.0f)};
  settings.brightest_path = 4.0f;
  const Image<Vec3f> clean = denoised(std::move(film), settings, Isa::Sse2, host);
  CHECK(brightest(clean) < 2.0f);
  CHECK(mean(clean) == Approx(before).epsilon(0.02));
}

TEST_CASE("the limit of a path lets light pass that many paths bring", "[denoiser]") {
  // A spot ten times as bright as the limit, a pixel's paths of which half meet it at the edge.
  Film film = wall(64, 48, 8, [](int x, int path) {
    return x < 30 || (x == 30 && path % 2 == 0) ? 40.0f : 0.1f;
  });
  const double expected = double(film.at(20, 47).scattered.x());
  test::RenderHost host(1);
  DenoiseSettings settings{Vec3f(0.6f, 0.5f, 3.0f)};
  settings.brightest_path = 4.0f;
  const Image<Vec3f> clean = denoised(std::move(film), settings, Isa::Sse2, host);
  CHECK(double(clean.at(20, 20).x()) == Approx(expected).epsilon(1e-3));
  CHECK(double(clean.at(30, 20).x()) == Approx(20.05).epsilon(0.1));
  CHECK(clean.at(50, 20).x() < 0.2f);
}

TEST_CASE("sources seen directly pass untouched", "[denoiser]") {
  test::RenderHost host(1);
  Film film = noisy_corner(0.2);
  film.at(5, 6) = FilmPixel{};
  film.at(5, 6).seen = Vec3f(70.0f, 60.0f, 50.0f);
  CHECK(
      (denoised(std::move(film), {Vec3f(30, 30, 20)}, Isa::Sse2, host).at(5, 6) - Vec3f(70, 60, 50))
          .norm() < 1e-4f);
}

TEST_CASE("a large picture is exposed like a small one of the same", "[exposure]") {
  const auto shaded = [](int x, int y) {
    return Vec3f::Constant(float(0.5 + 0.4 * std::sin(0.07 * x) * std::cos(0.05 * y)));
  };
  Image<Vec3f> small(200, 150, Vec3f::Zero());
  Image<Vec3f> large(1400, 1050, Vec3f::Zero());
  for (int y = 0; y < large.height(); ++y) {
    for (int x = 0; x < large.width(); ++x) large.at(x, y) = shaded(x / 7, y / 7);
  }
  for (int y = 0; y < small.height(); ++y) {
    for (int x = 0; x < small.width(); ++x) small.at(x, y) = shaded(x, y);
  }
  CHECK(automatic_exposure(large) == Approx(automatic_exposure(small)).epsilon(0.002));
}

TEST_CASE("exposure does not depend on the scale of the light", "[exposure]") {
  Image<Vec3f> picture(40, 30, Vec3f::Zero());
  Rng rng(2);
  for (Vec3f& p : picture.pixels()) p = Vec3f::Constant(float(rng.uniform(0.05, 0.4)));
  const double plain = automatic_exposure(picture);
  CHECK(plain > 0.3);
  CHECK(plain < 3.0);
  Image<Vec3f> grossly_lit = picture;
  for (Vec3f& p : grossly_lit.pixels()) p *= 20000.0f;
  CHECK(automatic_exposure(grossly_lit) == Approx(plain / 20000.0));
  // A lamp in a twentieth of the picture changes little.
  for (int i = 0; i < 60; ++i) picture.pixels()[std::size_t(i)] = Vec3f::Constant(1e6f);
  CHECK(automatic_exposure(picture) == Approx(plain).epsilon(0.15));
  CHECK(automatic_exposure(Image<Vec3f>(4, 3, Vec3f::Zero())) == 1.0);
}

TEST_CASE("the standard view is sRGB, the filmic one never clips abruptly", "[exposure]") {
  test::RenderHost host(2);
  Image<Vec3f> ramp(256, 1, Vec3f::Zero());
  for (int i = 0; i < 256; ++i)
    ramp.at(i, 0) = Vec3f::Constant(linear_from_srgb(float(i) / 255.0f));
  const Image<Rgba8> standard = displayed(ramp, 1.0, ViewTransform::Standard, host);
  for (int i = 0; i < 256; ++i) {
    CHECK(int(standard.at(i, 0)[0]) == i);
    CHECK(int(standard.at(i, 0)[3]) == 255);
  }
  CHECK(int(displayed(ramp, 8.0, ViewTransform::Standard, host).at(255, 0)[1]) == 255);
  const Image<Rgba8> filmic = displayed(ramp, 2.0, ViewTransform::Filmic, host);
  for (int i = 1; i < 256; ++i) CHECK(filmic.at(i, 0)[0] >= filmic.at(i - 1, 0)[0]);
  CHECK(int(filmic.at(255, 0)[0]) < 255);
}

TEST_CASE("any radiance can be shown, even what is no number", "[exposure]") {
  test::RenderHost host(1);
  constexpr float kInf = std::numeric_limits<float>::infinity();
  Image<Vec3f> odd(3, 1, Vec3f::Constant(kInf));
  odd.at(1, 0) = Vec3f::Constant(1e30f);
  odd.at(2, 0) = Vec3f::Constant(std::numeric_limits<float>::quiet_NaN());
  for (const ViewTransform transform : {ViewTransform::Standard, ViewTransform::Filmic}) {
    const Image<Rgba8> shown = displayed(odd, 1.0, transform, host);
    CHECK(shown.at(0, 0) == Rgba8{255, 255, 255, 255});
    CHECK(shown.at(1, 0) == Rgba8{255, 255, 255, 255});
    CHECK(shown.at(2, 0) == Rgba8{0, 0, 0, 255});
  }
}

}  // namespace diorama
