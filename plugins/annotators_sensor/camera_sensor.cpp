// SPDX-License-Identifier: Apache-2.0
#include "camera_sensor.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>
#include <vector>

#include "lens_effects.h"
#include "stored_lens.h"

namespace diorama {
namespace {

constexpr std::array kExposures{"auto", "manual"};
constexpr double kMiddleGrey = 0.18;

double luminance(const Vec3f& rgb) {
  return 0.2126 * double(rgb.x()) + 0.7152 * double(rgb.y()) + 0.0722 * double(rgb.z());
}

/// Brings the median of what is lit to middle grey, `stops` brighter, but leaves no more than
/// `burnt_share` of it above white; 1 and its stops for a picture without light.
double metered(const Image<Vec3f>& light, double stops, double burnt_share) {
  const double factor = std::exp2(stops);
  std::vector<double> lit;
  for (const Vec3f& pixel : light.pixels()) {
    const double l = luminance(pixel);
    if (l > 0.0 && std::isfinite(l)) lit.push_back(l);
  }
  if (lit.empty()) return factor;
  const auto middle = lit.begin() + std::ptrdiff_t(lit.size() / 2);
  std::nth_element(lit.begin(), middle, lit.end());
  const double exposure = kMiddleGrey / *middle * factor;
  const auto burnt = std::size_t(burnt_share * double(lit.size()));
  if (burnt >= lit.size()) return exposure;
  const auto brightest = lit.end() - 1 - std::ptrdiff_t(burnt);
  std::nth_element(lit.begin(), brightest, lit.end());
  return std::min(exposure, 1.0 / *brightest);
}

/// Photons come by themselves: their count follows the law of Poisson, which from 30 on is all but
/// normal. `noise` is the spread of what is added when the count is read.
double counted(double mean, double noise, Rng& rng) {
  if (mean >= 30.0) return mean + std::sqrt(mean + noise * noise) * rng.normal();
  const double none = std::exp(-mean);
  int count = 0;
  for (double product = rng.uniform(); product > none; product *= rng.uniform()) ++count;
  return count + noise * rng.normal();
}

std::vector<std::uint8_t> bytes_by_code(int largest_code) {
  std::vector<std::uint8_t> bytes(std::size_t(largest_code) + 1);
  for (std::size_t code = 0; code < bytes.size(); ++code) {
    const float linear = float(double(code) / largest_code);
    bytes[code] = std::uint8_t(std::lround(255.0f * srgb_from_linear(linear)));
  }
  return bytes;
}

/// Gaussian blur; outside of the picture is its edge.
Image<Vec3f> blurred(const Image<Vec3f>& picture, double sigma_px, Host& host) {
  const int reach = std::max(1, int(std::ceil(3.0 * sigma_px)));
  std::vector<float> weights;
  float sum = 0.0f;
  for (int i = -reach; i <= reach; ++i) {
    weights.push_back(float(std::exp(-0.5 * i * i / (sigma_px * sigma_px))));
    sum += weights.back();
  }
  for (float& weight : weights) weight /= sum;
  const int width = picture.width(), height = picture.height();
  Image<Vec3f> lines(width, height, Vec3f::Zero());
  Image<Vec3f> both(width, height, Vec3f::Zero());
  host.parallel_for(std::size_t(height), [&](std::size_t y) {
    const auto from = picture.row(int(y));
    const auto to = lines.row(int(y));
    for (int i = -reach; i <= reach; ++i) {
      const float weight = weights[std::size_t(i + reach)];
      for (int x = 0; x < width; ++x) {
        to[std::size_t(x)] += weight * from[std::size_t(std::clamp(x + i, 0, width - 1))];
      }
    }
  });
  host.parallel_for(std::size_t(height), [&](std::size_t y) {
    const auto to = both.row(int(y));
    for (int i = -reach; i <= reach; ++i) {
      const float weight = weights[std::size_t(i + reach)];
      const auto from = lines.row(std::clamp(int(y) + i, 0, height - 1));
      for (std::size_t x = 0; x < to.size(); ++x) to[x] += weight * from[x];
    }
  });
  return both;
}

/// What the software of a camera does to encoded pictures.
struct Software {
  double smoothing_px = 0.0;
  double contrast = 0.0;
  double saturation = 1.0;
  double sharpening = 0.0;

  bool does_nothing() const {
    return smoothing_px <= 0.0 && contrast == 0.0 && saturation == 1.0 && sharpening <= 0.0;
  }
};

/// An S-shaped curve that holds black, white and the middle: darker below, brighter above.
Vec3f toned(const Vec3f& encoded, const Software& software) {
  const Vec3f v = (encoded / 255.0f).cwiseMax(0.0f).cwiseMin(1.0f);
  const Vec3f curve = v.cwiseProduct(v).cwiseProduct(Vec3f::Constant(3.0f) - 2.0f * v);
  const Vec3f bent = v + float(software.contrast) * (curve - v);
  const Vec3f grey = Vec3f::Constant(float(luminance(bent)));
  return 255.0f * (grey + float(software.saturation) * (bent - grey));
}

void finish(Image<Rgba8>& picture, const Software& software, Host& host) {
  constexpr double kSharpeningRadius_px = 1.0;
  if (software.does_nothing()) return;
  Image<Vec3f> smooth(picture.width(), picture.height(), Vec3f::Zero());
  for (std::size_t i = 0; i < smooth.pixels().size(); ++i) {
    const Rgba8& pixel = picture.pixels()[i];
    smooth.pixels()[i] = Vec3f(pixel[0], pixel[1], pixel[2]);
  }
  if (software.smoothing_px > 0.0) smooth = blurred(smooth, software.smoothing_px, host);
  if (software.contrast != 0.0 || software.saturation != 1.0) {
    for (Vec3f& pixel : smooth.pixels()) pixel = toned(pixel, software);
  }
  const bool sharpens = software.sharpening > 0.0;
  const Image<Vec3f> soft = sharpens ? blurred(smooth, kSharpeningRadius_px, host) : smooth;
  host.parallel_for(std::size_t(picture.height()), [&](std::size_t y) {
    const auto from = smooth.row(int(y));
    const auto low = soft.row(int(y));
    const auto to = picture.row(int(y));
    for (std::size_t x = 0; x < to.size(); ++x) {
      const Vec3f pixel = from[x] + float(software.sharpening) * (from[x] - low[x]);
      for (std::size_t k = 0; k < 3; ++k) {
        const float value = std::clamp(pixel[Eigen::Index(k)], 0.0f, 255.0f);
        to[x][k] = std::uint8_t(std::lround(value));
      }
    }
  });
}

}  // namespace

int Photosite::code(double fill, Rng& rng) const {
  // Far above the well nothing changes any more; not a number counts as dark.
  const double mean = fill > 0.0 ? std::min(fill, 4.0) * full_well : 0.0;
  const double electrons =
      has_shot_noise ? counted(mean, read_noise, rng) : mean + read_noise * rng.normal();
  const double share = std::clamp(electrons / full_well, 0.0, 1.0);
  return int(std::lround(share * largest_code));
}

void CameraSensor::Params::visit(ParamVisitor& v) {
  v.choice(
      "exposure", exposure, kExposures,
      {"auto: the median of the picture becomes 18 % grey; manual: by iso, exposure_time_s and "
       "f_stop."});
  v.param("exposure_ev", exposure_ev,
          {"Stops added to the exposure, drawn for every picture.", "EV", -40, 40});
  v.param("burnt_share", burnt_share,
          {"auto: exposure is taken back until no larger share of the picture is brighter than "
           "white, as phones do; 1: never.",
           "", 0, 1});
  v.param(
      "warmth_ev", warmth_ev,
      {"Stops by which a wrong white balance makes red stronger and blue weaker.", "EV", -4, 4});
  v.param("iso", iso,
          {"Sensitivity; the well counts as full at full_well_electrons * 100 / iso.", "", 1, 1e7});
  v.param("exposure_time_s", exposure_time_s,
          {"Exposure time for manual exposure; blur is the camera's own exposure_time_s.", "s",
           1e-6, 3600});
  v.param(
      "f_stop", f_stop,
      {"Aperture for manual exposure; depth of field is the camera's own f_stop.", "", 0.1, 1000});
  v.param("vignetting", vignetting,
          {"Light falls off as cos(angle off the axis)^(4 vignetting); 1: as in a simple lens.", "",
           0, 10});
  v.param("red_shift_px", red_shift_px,
          {"How much farther out red is imaged half a diagonal from the axis.", "px", -100, 100});
  v.param("blue_shift_px", blue_shift_px,
          {"How much farther out blue is imaged half a diagonal from the axis.", "px", -100, 100});
  v.param("shot_noise", shot_noise, {"Photons are counted one by one."});
  v.param("full_well_electrons", full_well_electrons,
          {"Electrons that fill one colour of one pixel at ISO 100.", "", 1, 1e9});
  v.param("read_noise_electrons", read_noise_electrons,
          {"Standard deviation of what reading a pixel adds.", "", 0, 1e6});
  v.param("bits", bits, {"Of the numbers that the sensor gives.", "", 1, 16});
  v.param("smoothing_px", smoothing_px,
          {"Noise reduction: standard deviation of a blur of the encoded picture.", "px", 0, 20});
  v.param("contrast", contrast,
          {"Share of an S-shaped curve, 3 v^2 - 2 v^3 of the encoded picture, that replaces it.",
           "", 0, 1.5});
  v.param("saturation", saturation,
          {"Factor of the difference from grey of the encoded picture.", "", 0, 4});
  v.param("sharpening", sharpening,
          {"Share of the difference from a blur of 1 px that is added to the encoded picture.", "",
           0, 10});
}

CameraSensor::CameraSensor(Params params, Host& host) : params_(std::move(params)), host_(host) {}

NameSet CameraSensor::needs() const { return {std::string(kColorHdr.name)}; }

NameSet CameraSensor::provides() const { return {std::string(kColor.name)}; }

// ISO 12232, saturation-based speed: the luminance that fills the well is 78 / (q S) N^2 / t, with
// q = 0.65 for what a lens lets through.
double CameraSensor::manual_exposure() const {
  const double brightest =
      78.0 / (0.65 * params_.iso) * params_.f_stop * params_.f_stop / params_.exposure_time_s;
  return 1.0 / brightest;
}

Photosite CameraSensor::photosite() const {
  return {params_.full_well_electrons * 100.0 / params_.iso, params_.read_noise_electrons,
          params_.shot_noise, (1 << params_.bits) - 1};
}

void CameraSensor::do_annotate(const Scene&, Frame& frame) const {
  const LensEffects lens{params_.vignetting, params_.red_shift_px, params_.blue_shift_px};
  const Image<Vec3f> light =
      through_lens(frame.get(kColorHdr), stored_lens(frame.camera), lens, host_);
  const Rng rng = Rng(frame.seed).fork("camera_sensor");
  const auto drawn = [&](const Distribution& what, std::string_view name) {
    Rng stream = rng.fork(name);
    return what.draw(stream);
  };
  const double stops = drawn(params_.exposure_ev, "exposure_ev");
  frame.exposure = params_.exposure == "auto" ? metered(light, stops, params_.burnt_share)
                                              : manual_exposure() * std::exp2(stops);
  const double warmth = std::exp2(drawn(params_.warmth_ev, "warmth_ev"));
  const std::array<double, 3> gains{frame.exposure * warmth, frame.exposure,
                                    frame.exposure / warmth};

  const Photosite site = photosite();
  const std::vector<std::uint8_t> bytes = bytes_by_code(site.largest_code);
  Image<Rgba8> picture(light.width(), light.height(), Rgba8{0, 0, 0, 255});
  host_.parallel_for(std::size_t(light.height()), [&](std::size_t y) {
    Rng row_rng = rng.fork(std::uint64_t(y));
    const auto from = light.row(int(y));
    const auto to = picture.row(int(y));
    for (std::size_t x = 0; x < to.size(); ++x) {
      for (std::size_t k = 0; k < 3; ++k) {
        const double fill = double(from[x][Eigen::Index(k)]) * gains[k];
        to[x][k] = bytes[std::size_t(site.code(fill, row_rng))];
      }
    }
  });
  const Software software{
      drawn(params_.smoothing_px, "smoothing_px"), drawn(params_.contrast, "contrast"),
      drawn(params_.saturation, "saturation"), drawn(params_.sharpening, "sharpening")};
  finish(picture, software, host_);
  frame.set(kColor, std::move(picture));
}

}  // namespace diorama
