// SPDX-License-Identifier: Apache-2.0
#include "camera_sensor.h"

#include <cmath>
#include <set>
#include <utility>

#include "lens_effects.h"
#include "sensor_frames.h"
#include "stored_lens.h"
#include "support/catch.h"

using namespace diorama;
using namespace diorama::test;

namespace {

struct Moments {
  double mean = 0.0;
  double variance = 0.0;
};

/// Of the electrons that a photosite counts, over many readings.
Moments electrons(const Photosite& site, double mean_electrons) {
  constexpr int kReadings = 400000;
  Rng rng(11);
  double sum = 0.0, squares = 0.0;
  for (int i = 0; i < kReadings; ++i) {
    const int code = site.code(mean_electrons / site.full_well, rng);
    const double count = site.full_well * code / site.largest_code;
    sum += count;
    squares += count * count;
  }
  const double mean = sum / kReadings;
  return {mean, squares / kReadings - mean * mean};
}

CameraSensor::Params plain_params() {
  CameraSensor::Params params;
  params.vignetting = 0.0;
  params.shot_noise = false;
  params.read_noise_electrons = 0.0;
  params.bits = 16;
  return params;
}

Image<Rgba8> picture_of(const CameraSensor::Params& params, Frame frame) {
  PlainHost host;
  CameraSensor(params, host).annotate(Scene(), frame);
  return frame.get(kColor);
}

Frame grey_frame(float radiance) {
  const Camera camera = Camera::from_lens(64, 48, 24.0, 20.955);
  Frame frame = frame_of(camera);
  frame.set(kColorHdr, Image<Vec3f>(64, 48, Vec3f::Constant(radiance)));
  return frame;
}

double spread(const Image<Rgba8>& picture) {
  double sum = 0.0, squares = 0.0;
  for (const Rgba8& pixel : picture.pixels()) {
    sum += pixel[1];
    squares += double(pixel[1]) * pixel[1];
  }
  const double count = double(picture.pixels().size());
  return std::sqrt(squares / count - sum * sum / (count * count));
}

}  // namespace

TEST_CASE("light falls off with the fourth power of the cosine", "[camera_sensor]") {
  PlainHost host;
  const Camera camera = Camera::from_lens(80, 60, 18.0, 36.0);
  const Image<Vec3f> white(80, 60, Vec3f::Ones());
  for (const double strength : {1.0, 0.5}) {
    const Image<Vec3f> seen = through_lens(white, camera, {strength, 0.0, 0.0}, host);
    for (const auto& [x, y] : {std::pair{40, 30}, {0, 0}, {79, 0}, {10, 59}, {0, 30}}) {
      const double off_x = (x + 0.5 - 40.0) / 40.0;  // focal length: half the sensor's width
      const double off_y = (y + 0.5 - 30.0) / 40.0;
      const double cosine2 = 1.0 / (1.0 + off_x * off_x + off_y * off_y);
      CHECK(double(seen.at(x, y).y()) == Approx(std::pow(cosine2, 2.0 * strength)).epsilon(1e-5));
    }
  }
}

TEST_CASE("colours are imaged at their own scale", "[camera_sensor]") {
  PlainHost host;
  const Camera camera = Camera::from_lens(200, 150, 24.0, 20.955);  // half a diagonal: 125 px
  // Brightness that tells the place.
  const auto place = [](double x, double y) { return 0.01 * x + y; };
  const auto image = image_of<Vec3f>(
      camera, [&](int x, int y) { return Vec3f::Constant(float(place(x + 0.5, y + 0.5))); });
  const Image<Vec3f> seen = through_lens(image, camera, {0.0, 3.0, -2.0}, host);
  const Vec2 axis(100.0, 75.0);
  for (const auto& [x, y] : {std::pair{160, 75}, {100, 20}, {30, 140}, {180, 9}}) {
    const Vec2 pixel(x + 0.5, y + 0.5);
    const Vec2 red = axis + (pixel - axis) / (1.0 + 3.0 / 125.0);
    const Vec2 blue = axis + (pixel - axis) / (1.0 - 2.0 / 125.0);
    CHECK(double(seen.at(x, y).x()) == Approx(place(red.x(), red.y())).margin(1e-4));
    CHECK(double(seen.at(x, y).y()) == Approx(place(pixel.x(), pixel.y())).margin(1e-4));
    CHECK(double(seen.at(x, y).z()) == Approx(place(blue.x(), blue.y())).margin(1e-4));
  }
}

TEST_CASE("noise has the variance of counted photons and of reading", "[camera_sensor]") {
  const int codes = (1 << 16) - 1;
  for (const double mean : {8.0, 29.0, 31.0, 200.0, 1500.0}) {
    const Moments shot = electrons({2000.0, 0.0, true, codes}, mean);
    CHECK(shot.mean == Approx(mean).epsilon(0.003));
    CHECK(shot.variance == Approx(mean).epsilon(0.02));
  }
  const Moments both = electrons({2000.0, 6.0, true, codes}, 100.0);
  CHECK(both.variance == Approx(100.0 + 36.0).epsilon(0.02));
  const Moments read = electrons({2000.0, 6.0, false, codes}, 100.0);
  CHECK(read.variance == Approx(36.0).epsilon(0.02));
  // Coarse numbers add the variance of rounding.
  const Moments coarse = electrons({2000.0, 60.0, false, 40}, 1000.0);
  CHECK(coarse.variance == Approx(3600.0 + 50.0 * 50.0 / 12.0).epsilon(0.02));
}

TEST_CASE("what overflows the well is cut off", "[camera_sensor]") {
  Rng rng(1);
  const Photosite site{1000.0, 2.0, true, 4095};
  CHECK(site.code(1e30, rng) == 4095);
  CHECK(site.code(-1.0, rng) < 40);
  CHECK(site.code(std::nan(""), rng) < 40);
}

TEST_CASE("exposure follows ISO 12232 or the picture's median", "[camera_sensor]") {
  PlainHost host;
  CameraSensor::Params params = plain_params();
  params.exposure = "manual";
  params.iso = 100.0;
  params.f_stop = 16.0;
  params.exposure_time_s = 1.0 / 125.0;
  // 78 / (0.65 * 100) * 16^2 * 125
  CHECK(1.0 / CameraSensor(params, host).manual_exposure() == Approx(38400.0));
  const auto manual = picture_of(params, grey_frame(38400.0f * 0.5f));
  CHECK(int(manual.at(7, 5)[0]) == 188);  // sRGB of a half
  params.exposure_ev = 1.0;
  CHECK(int(picture_of(params, grey_frame(38400.0f * 0.5f)).at(7, 5)[0]) == 255);

  CameraSensor::Params metering = plain_params();
  for (const float light : {1e-3f, 1.0f, 1e5f}) {
    CHECK(int(picture_of(metering, grey_frame(light)).at(3, 3)[2]) == 118);  // sRGB of 0.18
  }
  CHECK(int(picture_of(metering, grey_frame(0.0f)).at(3, 3)[2]) == 0);
}

TEST_CASE("exposure is taken back where too much would burn", "[camera_sensor]") {
  Frame frame = grey_frame(1.0f);  // 48 rows; the lower 12 are ten times as bright
  Image<Vec3f> light = frame.get(kColorHdr);
  for (int y = 36; y < 48; ++y) {
    for (int x = 0; x < 64; ++x) light.at(x, y) = Vec3f::Constant(10.0f);
  }
  frame.set(kColorHdr, light);
  const auto grey_with = [&](double burnt_share) {
    Frame copy = grey_frame(1.0f);
    copy.set(kColorHdr, light);
    CameraSensor::Params params = plain_params();
    params.burnt_share = burnt_share;
    return int(picture_of(params, std::move(copy)).at(3, 3)[1]);
  };
  CHECK(grey_with(1.0) == 118);   // the median is 18 % grey
  CHECK(grey_with(0.26) == 118);  // a quarter may burn
  CHECK(grey_with(0.24) == 89);   // it may not: it becomes white, and grey a tenth of it
}

TEST_CASE("a wrong white balance moves red and blue apart", "[camera_sensor]") {
  CameraSensor::Params params = plain_params();
  params.warmth_ev = 0.5;
  const Rgba8 pixel = picture_of(params, grey_frame(1.0f)).at(3, 3);
  CHECK(int(pixel[0]) == 138);  // sRGB of 0.18 * 2^0.5
  CHECK(int(pixel[1]) == 118);
  CHECK(int(pixel[2]) == 100);
}

TEST_CASE("what is drawn is drawn for every picture", "[camera_sensor]") {
  CameraSensor::Params params = plain_params();
  params.exposure_ev = Distribution(Range{-1.0, 1.0});
  std::set<int> seen;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Frame frame = grey_frame(1.0f);
    frame.seed = seed;
    seen.insert(int(picture_of(params, std::move(frame)).at(3, 3)[1]));
  }
  CHECK(seen.size() > 10);
  CHECK(*seen.begin() >= 85);    // sRGB of 0.09
  CHECK(*seen.rbegin() <= 162);  // of 0.36
}

TEST_CASE("software takes noise away and sharpens edges", "[camera_sensor]") {
  CameraSensor::Params params = plain_params();
  params.shot_noise = true;
  params.iso = 6400.0;
  const double noisy = spread(picture_of(params, grey_frame(1.0f)));
  params.smoothing_px = 1.0;
  // A Gaussian blur leaves 1 / (2 sqrt(pi) sigma) of independent noise.
  CHECK(spread(picture_of(params, grey_frame(1.0f))) == Approx(0.2821 * noisy).epsilon(0.1));

  Frame edge = grey_frame(1.0f);
  Image<Vec3f> light = edge.get(kColorHdr);
  for (int y = 0; y < 48; ++y) {
    for (int x = 32; x < 64; ++x) light.at(x, y) = Vec3f::Constant(2.0f);
  }
  edge.set(kColorHdr, light);
  CameraSensor::Params plain = plain_params();
  plain.sharpening = 1.0;
  const Image<Rgba8> sharp = picture_of(plain, std::move(edge));
  const int dark = sharp.at(3, 9)[0], bright = sharp.at(60, 9)[0];
  // A blur of 1 px has 0.2420 + 0.0540 + 0.0044 / 2 + ... of an edge on its other side: 0.30.
  CHECK(int(sharp.at(31, 9)[0]) == Approx(dark - 0.30 * (bright - dark)).margin(1.5));
  CHECK(int(sharp.at(32, 9)[0]) == Approx(bright + 0.30 * (bright - dark)).margin(1.5));
  CHECK(int(sharp.at(25, 9)[0]) == dark);
}

TEST_CASE("software darkens what is dark and makes colours stronger", "[camera_sensor]") {
  CameraSensor::Params params = plain_params();
  params.warmth_ev = 0.5;  // 138, 118, 100 before
  params.contrast = 1.0;
  const Rgba8 bent = picture_of(params, grey_frame(1.0f)).at(3, 3);
  CHECK(int(bent[0]) == Approx(143.2).margin(0.6));  // 3 v^2 - 2 v^3 of 138 / 255 ...
  CHECK(int(bent[1]) == Approx(113.1).margin(0.6));
  CHECK(int(bent[2]) == Approx(86.9).margin(0.6));
  params.contrast = 0.5;
  CHECK(int(picture_of(params, grey_frame(1.0f)).at(3, 3)[2]) == Approx(93.4).margin(0.6));

  params.contrast = 0.0;
  params.saturation = 2.0;  // grey is 0.2126 * 138 + 0.7152 * 118 + 0.0722 * 100 = 120.95
  const Rgba8 strong = picture_of(params, grey_frame(1.0f)).at(3, 3);
  CHECK(int(strong[0]) == Approx(155.0).margin(1.0));
  CHECK(int(strong[2]) == Approx(79.0).margin(1.0));
  params.saturation = 0.0;
  const Rgba8 grey = picture_of(params, grey_frame(1.0f)).at(3, 3);
  CHECK(grey[0] == grey[2]);
  CHECK(int(grey[1]) == 121);
}

TEST_CASE("noise doubles with four times the ISO", "[camera_sensor]") {
  CameraSensor::Params params = plain_params();
  params.shot_noise = true;
  params.iso = 400.0;
  const double slow = spread(picture_of(params, grey_frame(1.0f)));
  params.iso = 1600.0;
  CHECK(spread(picture_of(params, grey_frame(1.0f))) == Approx(2.0 * slow).epsilon(0.05));
}

TEST_CASE("pictures depend on the seed and not on the order of work", "[camera_sensor]") {
  BackwardHost backward;
  const CameraSensor::Params params;
  const auto first = picture_of(params, grey_frame(2.0f));
  Frame frame = grey_frame(2.0f);
  CameraSensor(params, backward).annotate(Scene(), frame);
  CHECK(frame.get(kColor) == first);
  frame.seed = 6;
  CameraSensor(params, backward).annotate(Scene(), frame);
  CHECK_FALSE(frame.get(kColor) == first);
}

TEST_CASE("a stored lens stays what it is", "[camera_sensor]") {
  Rng rng(3);
  for (int i = 0; i < 1000; ++i) {
    Camera camera = Camera::from_lens(1 + int(rng.index(4000)), 1 + int(rng.index(4000)),
                                      rng.uniform(4.0, 200.0), rng.uniform(4.0, 40.0));
    camera.cx += rng.uniform(-20.0, 20.0);
    camera.cy += rng.uniform(-20.0, 20.0);
    camera.distortion[2] = rng.uniform(-0.1, 0.1);
    camera.fisheye_max_angle_rad = rng.uniform(0.5, 3.0);
    const Camera once = stored_lens(camera);
    const Camera twice = stored_lens(once);
    CHECK(once.fx == twice.fx);
    CHECK(once.fy == twice.fy);
    CHECK(once.cx == twice.cx);
    CHECK(once.cy == twice.cy);
    CHECK(once.distortion == twice.distortion);
    CHECK(once.fisheye_max_angle_rad == twice.fisheye_max_angle_rad);
    const volatile float stored = float(2.0 * camera.fx / camera.width);
    CHECK(once.fx == 0.5 * camera.width * double(stored));
    CHECK(once.fx == Approx(camera.fx).epsilon(1e-6));
    CHECK(once.cy == Approx(camera.cy).margin(1e-3));
  }
}
