// SPDX-License-Identifier: Apache-2.0
#include "renderer_support/denoiser.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>
#include <vector>

#include "diorama/rng.h"
#include "renderer_support/network_filter.h"
#include "renderer_support/plane_filter.h"
#include "renderer_support/spare_pages.h"
#include "renderer_support/view_transform.h"
#include "support/catch.h"
#include "support/render_host/render_host.h"

namespace diorama {
namespace {

const Vec3f kEye(1.5f, 1.5f, 0.6f);

/// Two walls meeting in the middle column, lit 1 and 3, with a fine stripe pattern as colour, and
/// noise of relative size `noise` in the means of eight paths.
Film noisy_corner(double noise) {
  constexpr int kPaths = 8;
  constexpr float kPixel = 0.03f;  // metres
  Film film(65, 40, FilmPixel{});
  Rng rng(21);
  for (int y = 0; y < film.height(); ++y) {
    for (int x = 0; x < film.width(); ++x) {
      const bool is_left = x < 32;
      const float along = kPixel * float(is_left ? 32 - x : x - 32);
      PathSample sample;
      sample.has_surface = true;
      sample.albedo = Vec3f::Constant((x / 2) % 2 ? 0.8f : 0.2f);
      sample.normal = is_left ? Vec3f::UnitX() : Vec3f::UnitY();
      sample.position = Vec3f(is_left ? 0.0f : along, is_left ? along : 0.0f, kPixel * float(y));
      PixelSum sum;
      for (int i = 0; i < kPaths; ++i) {
        const double skewed = -std::log(1.0 - rng.uniform()) - 1.0;
        const double light = (is_left ? 1.0 : 3.0) * (1.0 + noise * std::sqrt(kPaths) * skewed);
        sample.scattered = sample.albedo * float(light);
        sum.add(sample);
      }
      film.at(x, y) = sum.mean();
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
  const double after = error(denoised(noisy_corner(0.3), {kEye}, Isa::Sse2, host), truth);
  CHECK(after < 0.08 * before);
}

TEST_CASE("a picture without noise stays as it is", "[denoiser]") {
  test::RenderHost host(1);
  CHECK(error(denoised(noisy_corner(0.0), {kEye}, Isa::Sse2, host), undenoised(noisy_corner(0.0))) <
        1e-6);
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

TEST_CASE("smooth edges of a lamp do not make what is around brighter", "[denoiser]") {
  // Every pixel of the lamp's rim has a share of it by chance, as few paths find it.
  Rng rng(6);
  Film film = wall(96, 96, 2, [&](int, int) { return float(rng.uniform(0.2, 1.8)); });
  for (int y = 0; y < film.height(); ++y) {
    for (int x = 0; x < film.width(); ++x) {
      const double away = std::hypot(x - 48, y - 48);
      const double share = std::clamp(5.5 - away, 0.0, 1.0);
      if (share == 0.0) continue;
      const float lamp =
          share == 1.0 ? 1.0f : 0.5f * float((rng.uniform() < share) + (rng.uniform() < share));
      FilmPixel& pixel = film.at(x, y);
      pixel.seen = Vec3f::Constant(lamp * 800.0f);
      pixel.scattered *= 1.0f - lamp;
      pixel.variance *= (1.0f - lamp) * (1.0f - lamp);
      pixel.albedo *= 1.0f - lamp;
      pixel.surface_share *= 1.0f - lamp;
    }
  }
  test::RenderHost host(2);
  const Image<Vec3f> clean = denoised(std::move(film), {Vec3f(1.0f, 1.0f, 3.0f)}, Isa::Sse2, host);
  double sum = 0.0;
  int count = 0;
  for (int y = 0; y < clean.height(); ++y) {
    for (int x = 0; x < clean.width(); ++x) {
      if (std::hypot(x - 48, y - 48) < 8.0) continue;
      sum += double(clean.at(x, y).x());
      ++count;
    }
  }
  CHECK(sum / count == Approx(1.0).epsilon(0.01));
}

TEST_CASE("edges of pictures of many paths stay as sharp as they are", "[denoiser]") {
  // Boxes side by side, dark beside bright, of all kinds: the network is as sure there as it can
  // be.
  constexpr int kBox = 6;
  constexpr int kPaths = 256;
  constexpr float kNoise = 0.02f;  // of the mean of a pixel's paths
  Film film(96, 72, FilmPixel{});
  Image<Vec3f> clean(film.width(), film.height(), Vec3f::Zero());
  for (int y = 0; y < film.height(); ++y) {
    for (int x = 0; x < film.width(); ++x) {
      const int box = x / kBox + 100 * (y / kBox);
      Rng own = Rng(5).fork(std::to_string(box));
      Rng rng = Rng(6).fork(std::to_string(x + 1000 * y));
      FilmPixel& pixel = film.at(x, y);
      pixel.count = float(kPaths);
      pixel.surface_share = 1.0f;
      for (int k = 0; k < 3; ++k) pixel.albedo[k] = float(own.uniform(0.03, 0.8));
      pixel.normal = own.uniform_rotation().cast<float>() * Vec3f::UnitZ();
      pixel.position = Vec3f(0.01f * float(x), 0.01f * float(y), float(own.uniform(0.5, 2.0)));
      const Vec3f light = float(std::exp(own.uniform(-4.0, 1.0))) * pixel.albedo;
      clean.at(x, y) = light;
      const float deviation = kNoise * luminance(light);
      pixel.scattered = light * (1.0f + kNoise * float(rng.normal()));
      pixel.variance = deviation * deviation;
      pixel.brightest = 4.0f * luminance(light);
    }
  }
  test::RenderHost host(2);
  const Image<Vec3f> image = denoised(std::move(film), {kEye}, isa_by_name(best_isa_name()), host);
  double squares = 0.0;
  for (std::size_t i = 0; i < image.pixels().size(); ++i) {
    const double wanted = double(luminance(clean.pixels()[i]));
    squares += std::pow(double(luminance(image.pixels()[i])) / wanted - 1.0, 2);
  }
  const double relative = std::sqrt(squares / double(image.pixels().size()));
  CAPTURE(relative);
  CHECK(relative < 0.12);
}

TEST_CASE("one chance find among quiet neighbours is tamed", "[denoiser]") {
  test::RenderHost host(1);
  // Planes know it by its neighbours, the network by the limit of a path.
  for (const bool is_quick : {false, true}) {
    Film film = noisy_corner(0.05);
    FilmPixel& find = film.at(20, 20);
    find.scattered *= 500.0f;
    find.variance = find.scattered.x() * find.scattered.x();
    find.brightest = 8.0f * find.scattered.x();
    const DenoiseSettings settings{kEye, is_quick ? 0.0f : 10.0f, is_quick};
    const Image<Vec3f> clean = denoised(std::move(film), settings, Isa::Sse2, host);
    for (int y = 12; y < 28; ++y) {
      for (int x = 12; x < 28; ++x) CHECK(clean.at(x, y).x() < 1.5f);
    }
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
  CHECK(double(clean.at(20, 20).x()) == Approx(expected).epsilon(5e-3));
  CHECK(double(clean.at(30, 20).x()) == Approx(20.05).epsilon(0.1));
  CHECK(clean.at(50, 20).x() < 0.2f);
}

TEST_CASE("sources seen directly pass, untouched by planes", "[denoiser]") {
  test::RenderHost host(1);
  const Vec3f light(70.0f, 60.0f, 50.0f);
  for (const bool is_quick : {false, true}) {
    for (const int reach : {0, 1}) {
      Film film = noisy_corner(0.2);
      FilmPixel source;
      source.count = film.at(5, 6).count;
      source.seen = light;
      for (int y = 6 - reach; y <= 6 + reach; ++y) {
        for (int x = 5 - reach; x <= 5 + reach; ++x) film.at(x, y) = source;
      }
      const DenoiseSettings settings{kEye, 0.0f, is_quick};
      const Image<Vec3f> picture = denoised(std::move(film), settings, Isa::Sse2, host);
      // The network may soften what is as small as a pixel.
      INFO("quick " << is_quick << ", reach " << reach);
      if (is_quick || reach > 0) {
        CHECK((picture.at(5, 6) - light).norm() < (is_quick ? 1e-4f : 3.0f));
      }
      Vec3f sum = Vec3f::Zero();
      for (int y = 2; y <= 10; ++y) {
        for (int x = 1; x <= 9; ++x) sum += picture.at(x, y);
      }
      const float sources = float((2 * reach + 1) * (2 * reach + 1));
      CHECK(sum.x() > (is_quick ? 1.0f : 0.9f) * sources * light.x());
      CHECK(sum.x() < 1.1f * (sources * light.x() + 81.0f));
    }
  }
}

namespace {

/// Films that differ from pixel to pixel in all that the network sees.
Film rough_film(int width, int height, int paths) {
  Film film(width, height, FilmPixel{});
  Rng rng(13);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      PixelSum sum;
      for (int i = 0; i < paths; ++i) {
        PathSample sample;
        sample.has_surface = x % 200 < 2 * y + 20;
        sample.albedo =
            sample.has_surface ? Vec3f(0.2f, x % 7 < 3 ? 0.6f : 0.3f, 0.5f) : Vec3f::Zero();
        sample.normal = x + y < 60 ? Vec3f::UnitZ() : Vec3f::UnitX();
        sample.position = 0.03f * Vec3f(float(x), float(y), 0.0f);
        if (sample.has_surface) {
          sample.scattered =
              sample.albedo * float(rng.uniform() < 0.3 ? rng.uniform(0.0, 8.0) : 0.1);
        } else {
          sample.seen = Vec3f(3.0f, 4.0f, 5.0f);
        }
        sum.add(sample);
      }
      film.at(x, y) = sum.mean();
    }
  }
  return film;
}

Image<Vec3f> denoised_by(int threads, const Film& film, bool is_quick = false,
                         Isa isa = Isa::Sse2) {
  Film copy(film.width(), film.height());
  std::ranges::copy(film.pixels(), copy.pixels().begin());
  test::RenderHost host(threads);
  return denoised(std::move(copy), {Vec3f(0.5f, -0.4f, 2.0f), 4.0f, is_quick}, isa, host);
}

bool is_same(const Image<Vec3f>& a, const Image<Vec3f>& b) {
  return std::memcmp(a.pixels().data(), b.pixels().data(), a.pixels().size_bytes()) == 0;
}

}  // namespace

TEST_CASE("denoised pictures are the same bytes for any number of threads", "[denoiser]") {
  const Film film = rough_film(117, 75, 3);
  for (const bool is_quick : {false, true}) {
    const Image<Vec3f> one = denoised_by(1, film, is_quick);
    CHECK(is_same(one, denoised_by(2, film, is_quick)));
    CHECK(is_same(one, denoised_by(5, film, is_quick)));
  }
}

TEST_CASE("memory of the last picture is used again and leaves no trace", "[denoiser]") {
  constexpr std::size_t kNumbers = std::size_t(1) << 19;  // of a huge page
  const Film film = rough_film(117, 75, 3);
  const Image<Vec3f> planes = denoised_by(2, film, true);
  const Image<Vec3f> network = denoised_by(2, film, false);
  const auto spare_pages = SparePages::shared();
  {
    std::vector<HugePages<float>> last;
    for (int i = 0; i < 24; ++i) {
      last.emplace_back(kNumbers);
      std::fill_n(last.back().data(), kNumbers, std::numeric_limits<float>::quiet_NaN());
    }
  }
  CHECK(std::isnan(HugePages<float>(kNumbers).data()[kNumbers - 1]));
  CHECK(is_same(planes, denoised_by(2, film, true)));
  CHECK(is_same(network, denoised_by(2, film, false)));
}

TEST_CASE("instruction sets agree but for rounding", "[denoiser]") {
  const Film film = rough_film(61, 50, 4);
  const Image<Vec3f> plain = denoised_by(2, film);
  const Image<Vec3f> best = denoised_by(2, film, false, isa_by_name(best_isa_name()));
  CHECK(error(plain, best) < 1e-8);
}

TEST_CASE("pictures of any size can be denoised", "[denoiser]") {
  for (const auto& [width, height] : {std::pair{1, 1}, {3, 2}, {1, 40}, {33, 31}, {64, 1}}) {
    const Image<Vec3f> clean = denoised_by(2, rough_film(width, height, 2));
    CHECK(clean.width() == width);
    CHECK(clean.height() == height);
    for (const Vec3f& pixel : clean.pixels()) {
      CHECK(pixel.allFinite());
      CHECK(pixel.minCoeff() >= 0.0f);
    }
  }
  test::RenderHost host(1);
  CHECK(denoised(Film(), {}, Isa::Sse2, host).pixels().empty());
}

TEST_CASE("what is no number spoils no picture of the network", "[denoiser]") {
  constexpr float kInf = std::numeric_limits<float>::infinity();
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  Film film = rough_film(48, 40, 4);
  film.at(10, 12).scattered = Vec3f(kNan, kInf, -kInf);
  film.at(30, 12).albedo = Vec3f(kNan, 0.0f, kInf);
  film.at(10, 30).normal = Vec3f::Constant(kNan);
  film.at(20, 30).position = Vec3f::Constant(kInf);
  film.at(30, 30).variance = kNan;
  film.at(31, 30).brightest = kInf;
  film.at(5, 5).seen = Vec3f::Constant(kNan);
  film.at(6, 5).count = kNan;
  film.at(7, 5).surface_share = kNan;
  film.at(9, 5).scattered = Vec3f::Constant(1e38f);
  test::RenderHost host(2);
  const Image<Vec3f> clean =
      filtered_by_network(film, undenoised(film), {Vec3f(0.5f, -0.4f, 2.0f), 4.0f},
                          quiet_exposure(film), Isa::Sse2, host);
  for (const Vec3f& pixel : clean.pixels()) CHECK(pixel.allFinite());
}

TEST_CASE("a large picture, denoised in tiles, has no seams", "[denoiser]") {
  // Two tiles side by side, which meet at column 1024: there the picture jumps no more than nearby.
  constexpr int kWidth = 1400;
  const Film film = rough_film(kWidth, 40, 2);
  const Image<Vec3f> whole = denoised_by(2, film);
  const auto column_steps = [&](int x) {
    double sum = 0.0;
    for (int y = 0; y < 40; ++y) sum += double((whole.at(x, y) - whole.at(x - 1, y)).norm());
    return sum;
  };
  double around = 0.0;
  for (int x = 990; x < 1060; ++x) around = std::max(around, x == 1024 ? 0.0 : column_steps(x));
  CHECK(column_steps(1024) <= around);
}

TEST_CASE("what is seen by chance is averaged over pixels that see so, too", "[denoiser]") {
  // Glass on the right of column 8, where one path of four goes to a white wall, and one pixel
  // whose paths all came to nothing; stripes beside it.
  const auto film_of = [](float count) {
    Film film(20, 12, FilmPixel{});
    for (int y = 0; y < film.height(); ++y) {
      for (int x = 0; x < film.width(); ++x) {
        FilmPixel& pixel = film.at(x, y);
        const bool is_glass = x >= 8;
        const bool is_odd = (x + 2 * y) % 4 == 0;
        pixel.count = count;
        pixel.albedo = Vec3f::Constant(is_glass ? (is_odd ? 0.9f : 0.1f) : 0.1f * float(x % 3));
        pixel.normal = Vec3f::UnitX();
        pixel.position = Vec3f(float(is_odd), 0.0f, 0.0f);
        pixel.surface_share = 1.0f;
        pixel.chance_share = is_glass ? 1.0f : 0.0f;
      }
    }
    // Three pixels lit around a hole where one path of four found the light, where all did, and
    // one alone.
    for (int v = 8; v < 11; ++v) {
      for (int u = 9; u < 12; ++u)
        film.at(u, v).seen = Vec3f::Constant(v == 9 && u == 10 ? 0.0f : 8.0f);
      for (int u = 9; u < 12; ++u) film.at(u, v).surface_share = 0.75f;
      for (int u = 14; u < 17; ++u) film.at(u, v).seen = film.at(u - 5, v).seen;
      for (int u = 14; u < 17; ++u) film.at(u, v).surface_share = v == 9 && u == 15 ? 1.0f : 0.0f;
    }
    film.at(18, 4).seen = Vec3f::Constant(8.0f);
    FilmPixel& lost = film.at(12, 3);
    lost.albedo = lost.normal = lost.position = Vec3f::Zero();
    lost.surface_share = 0.0f;
    return film;
  };
  test::RenderHost host(2);
  const Film before = film_of(4.0f);
  Film film = film_of(4.0f);
  average_chances(film, host);
  for (int y = 0; y < film.height(); ++y) {
    for (int x = 0; x < 8; ++x) CHECK(film.at(x, y).albedo == before.at(x, y).albedo);
  }
  CHECK(film.at(10, 9).seen.x() == Approx(8.0f * 12.0f / 16.0f));
  CHECK(film.at(15, 9).seen.x() == 0.0f);
  CHECK(film.at(18, 4).seen.x() == 8.0f);
  CHECK(film.at(17, 4).seen.x() == 0.0f);
  // Of 5 x 5 pixels the closer ones weigh more: of 81 shares this one that saw the wall has 9, two
  // in its column have 3 each, four in the rows beside 2 each.
  CHECK(film.at(16, 2).position.x() == Approx(23.0 / 81.0));
  CHECK(film.at(16, 2).albedo.x() == Approx(0.1 + 0.8 * 23.0 / 81.0));
  CHECK(film.at(12, 3).surface_share == Approx(1.0f - 9.0f / 81.0f));
  CHECK(film.at(12, 3).normal.x() == Approx(1.0f));
  CHECK(film.at(12, 3).albedo.x() > 0.15f);
  // Enough paths speak for themselves.
  Film many = film_of(128.0f);
  average_chances(many, host);
  CHECK(many.at(16, 2).albedo == before.at(16, 2).albedo);
}

TEST_CASE("the network takes from planes what they do well", "[denoiser]") {
  // A shadow's edge on one wall, of which no plane tells, with little noise and with much.
  for (const double noise : {0.03, 1.0}) {
    Rng rng(3);
    const auto shadow = [&](int paths) {
      return wall(96, 64, paths, [&](int x, int) {
        const double skewed = paths > 1 ? -std::log(1.0 - rng.uniform()) - 1.0 : 0.0;
        return float((x < 40 ? 0.2 : 1.0) * (1.0 + noise * skewed));
      });
    };
    const Image<Vec3f> truth = undenoised(shadow(1));
    const Film film = shadow(8);
    test::RenderHost host(2);
    const DenoiseSettings settings{Vec3f(1.0f, 0.6f, 3.0f)};
    const double planes = error(filtered_on_planes(film, settings, Isa::Sse2, host), truth);
    const double noisy = error(undenoised(film), truth);
    Film copy(film.width(), film.height());
    std::ranges::copy(film.pixels(), copy.pixels().begin());
    const double both = error(denoised(std::move(copy), settings, Isa::Sse2, host), truth);
    INFO("planes " << planes << ", noisy " << noisy << ", both " << both);
    CHECK(both < 1.2 * planes + 0.15 * noisy);
    if (noise < 0.5) continue;
    // What another filter got wrong is seen to be wrong.
    const Image<Vec3f> grey(film.width(), film.height(), Vec3f::Constant(0.6f));
    const double misled = error(
        filtered_by_network(film, grey, settings, quiet_exposure(film), Isa::Sse2, host), truth);
    CHECK(misled < 0.3 * error(grey, truth));
  }
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

TEST_CASE("dark middle tones burn no more than a tenth of a picture", "[exposure]") {
  // So many hundredths of a dark picture are lit, so many times as bright.
  const auto exposed = [](int percent, float brighter) {
    Image<Vec3f> picture(50, 20, Vec3f::Constant(0.02f));
    for (int i = 0; i < 10 * percent; ++i) {
      picture.pixels()[std::size_t(i)] = Vec3f::Constant(0.02f * brighter);
    }
    return automatic_exposure(picture) * 0.02;
  };
  // Of 30 hundredths 20 are among the middle 80.
  CHECK(exposed(30, 5.0f) == Approx(0.18 / std::pow(5.0, 0.25)));
  CHECK(exposed(30, 20.0f) == Approx(1.0 / 20.0));
  CHECK(exposed(20, 16.0f) == Approx(1.0 / 16.0));
  // What takes less than a tenth may burn, and what is far brighter, too.
  CHECK(exposed(9, 20.0f) == Approx(0.18));
  CHECK(exposed(20, 1e5f) == Approx(0.18 / std::pow(1e5, 0.125) / 3.0));
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
