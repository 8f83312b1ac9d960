// SPDX-License-Identifier: Apache-2.0
#include "embree_renderer.h"

#include <pmmintrin.h>
#include <xmmintrin.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>

#include "channels.h"
#include "view_transform.h"

namespace diorama {
namespace {

constexpr std::array kModes{"path_traced", "real_time", "preview"};
constexpr std::array kExposures{"auto", "fixed"};
constexpr std::array kViewTransforms{"standard", "filmic"};
constexpr std::array kIsas{"auto", "sse2", "sse4.2", "avx", "avx2", "avx512"};

constexpr int kTile = 16;  // pixels

/// Numbers too small to matter count as zero while it lives: they are slow otherwise.
class FlushDenormals {
 public:
  FlushDenormals() : before_(_mm_getcsr()) {
    _MM_SET_FLUSH_ZERO_MODE(_MM_FLUSH_ZERO_ON);
    _MM_SET_DENORMALS_ZERO_MODE(_MM_DENORMALS_ZERO_ON);
  }
  ~FlushDenormals() { _mm_setcsr(before_); }
  FlushDenormals(const FlushDenormals&) = delete;
  FlushDenormals& operator=(const FlushDenormals&) = delete;

 private:
  unsigned before_;
};

class Stopwatch {
 public:
  explicit Stopwatch(double& seconds) : seconds_(seconds), start_(Clock::now()) {}
  ~Stopwatch() { seconds_ = std::chrono::duration<double>(Clock::now() - start_).count(); }
  Stopwatch(const Stopwatch&) = delete;
  Stopwatch& operator=(const Stopwatch&) = delete;

 private:
  using Clock = std::chrono::steady_clock;
  double& seconds_;
  Clock::time_point start_;
};

}  // namespace

void EmbreeRenderer::Params::visit(ParamVisitor& v) {
  v.choice("mode", mode, kModes,
           {"path_traced: all light paths; real_time: few samples and one bounce, always denoised; "
            "preview: direct light only, denoised."});
  v.param("samples", samples, {"Light paths per pixel.", "", 1, 1 << 20});
  v.param("max_bounces", max_bounces,
          {"How often light may be scattered after the first surface.", "", 0, 64});
  v.param("denoise", denoise, {"Remove noise from the colour channels (never from labels)."});
  v.param(
      "caustics", caustics,
      {"Follow light focused by glass and mirrors; noisy. Off: glass lets light pass straight."});
  v.param("clamp", clamp, {"Largest luminance of one indirect contribution; 0: none.", "", 0.0});
  v.choice("exposure", exposure, kExposures,
           {"auto: by the picture's middle tones; fixed: exposure_ev alone."});
  v.param("exposure_ev", exposure_ev,
          {"Stops added to the exposure; with fixed, 0 leaves radiance as it is.", "EV", -40, 40});
  v.choice("view_transform", view_transform, kViewTransforms,
           {"From exposed light to the picture: standard clips, filmic rolls highlights off."});
  v.choice("isa", isa, kIsas, {"Instruction set of the ray tracing kernels."});
}

EmbreeRenderer::EmbreeRenderer(Params params, Host& host)
    : params_(std::move(params)), host_(host), meshes_(host, params_.isa) {
  if (params_.mode == "path_traced") return;
  params_.denoise = true;
  params_.max_bounces = std::min(params_.max_bounces, params_.mode == "real_time" ? 1 : 0);
}

NameSet EmbreeRenderer::provides() const {
  NameSet names = geometry_channels();
  names.emplace(kColor.name);
  names.emplace(kColorHdr.name);
  return names;
}

void EmbreeRenderer::do_prepare(const Scene& scene) {
  meshes_.take(scene);
  if (meshes_.lights().is_empty()) {
    host_.log(LogLevel::Warning, "the scene has no light: pictures will be black");
  }
}

Film EmbreeRenderer::trace(const View& view, std::uint64_t seed) {
  const TraceSettings settings{params_.max_bounces, float(params_.clamp), params_.caustics};
  const PathTracer tracer(meshes_, view, table_, settings);
  const int width = view.camera().width;
  const int height = view.camera().height;
  Film film(width, height, FilmPixel{});
  const int columns = (width + kTile - 1) / kTile;
  const int rows = (height + kTile - 1) / kTile;
  std::atomic<std::uint64_t> rays{0};
  std::atomic<std::uint64_t> shadow_rays{0};
  host_.parallel_for(std::size_t(columns * rows), [&](std::size_t tile) {
    const FlushDenormals flush;
    std::uint64_t tile_rays = 0;
    std::uint64_t tile_shadow_rays = 0;
    const int x_begin = int(tile) % columns * kTile;
    const int y_begin = int(tile) / columns * kTile;
    for (int y = y_begin; y < std::min(height, y_begin + kTile); ++y) {
      for (int x = x_begin; x < std::min(width, x_begin + kTile); ++x) {
        PixelSum sum;
        for (int s = 0; s < params_.samples; ++s) {
          const PathSample sample = tracer.trace(x, y, std::uint32_t(s), seed);
          tile_rays += sample.rays;
          tile_shadow_rays += sample.shadow_rays;
          sum.add(sample);
        }
        film.at(x, y) = sum.mean();
      }
    }
    rays += tile_rays;
    shadow_rays += tile_shadow_rays;
  });
  counts_.rays = rays;
  counts_.shadow_rays = shadow_rays;
  counts_.paths = film.pixels().size() * std::uint64_t(params_.samples);
  return film;
}

void EmbreeRenderer::put_colors(Frame& frame, const RenderRequest& request, const View& view) {
  Film film;
  {
    const Stopwatch watch(counts_.trace_s);
    film = trace(view, request.seed);
  }
  Image<Vec3f> hdr;
  {
    const Stopwatch watch(counts_.denoise_s);
    hdr = params_.denoise ? denoised(film, view.position(), host_) : undenoised(film);
  }
  const double base = params_.exposure == "auto" ? automatic_exposure(hdr) : 1.0;
  frame.exposure = base * std::exp2(params_.exposure_ev);
  if (request.channels.contains(kColor.name)) {
    const bool is_filmic = params_.view_transform == "filmic";
    frame.set(kColor, displayed(hdr, frame.exposure,
                                is_filmic ? ViewTransform::Filmic : ViewTransform::Standard));
  }
  if (request.channels.contains(kColorHdr.name)) frame.set(kColorHdr, std::move(hdr));
}

Frame EmbreeRenderer::do_render(const Scene& scene, const RenderRequest& request) {
  const View view(scene, request.camera);
  Frame frame;
  counts_ = {};
  {
    const Stopwatch watch(counts_.channels_s);
    fill_channels(frame, request.channels, meshes_, view, host_);
  }
  const bool wants_color =
      request.channels.contains(kColor.name) || request.channels.contains(kColorHdr.name);
  if (wants_color) put_colors(frame, request, view);
  return frame;
}

std::vector<CoverageMask> EmbreeRenderer::do_cover(const Scene& scene, NodeId camera,
                                                   std::span<const LabelledInstance> instances) {
  return coverage(meshes_, View(scene, camera), instances, host_);
}

}  // namespace diorama
