// SPDX-License-Identifier: Apache-2.0
#include "path_renderer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <future>
#include <vector>

#include "diorama/error.h"
#include "path_starts.h"
#include "renderer_support/learning_paths.h"
#include "renderer_support/oidn_denoiser.h"
#include "renderer_support/sample_plan.h"
#include "renderer_support/stopwatch.h"
#include "renderer_support/view_transform.h"

namespace diorama {
namespace {

constexpr std::array kModes{"path_traced", "real_time", "preview"};
#ifdef DIORAMA_HAS_OIDN
constexpr std::array kDenoisers{"own", "oidn"};
#endif
constexpr std::array kExposures{"auto", "fixed"};
constexpr std::array kViewTransforms{"standard", "filmic"};
constexpr std::array kSphereLights{"sphere", "disk"};
constexpr std::array kPrincipled{"layered", "blender"};

// A fifth more error for three quarters of the time (measured on six rooms at one path).
constexpr float kRealTimeIndirectShare = 0.5f;

}  // namespace

void PictureParams::visit(ParamVisitor& v) {
  v.choice("mode", mode, kModes,
           {"path_traced: all light paths; real_time: few samples and one bounce, always denoised; "
            "preview: direct light only, denoised."});
  v.param(
      "samples", samples,
      {"Light paths per pixel; with an error target or a time budget the most.", "", 1, 1 << 20});
  v.param("error_target", error_target,
          {"Where a pixel's standard error over its brightness falls below this, sampling ends "
           "(judged before denoising, for blocks of 8 x 8 pixels); 0: never.",
           "", 0.0});
  v.param(
      "time_budget_s", time_budget_s,
      {"Wall time for the paths of one picture, after which sampling ends; pictures then differ "
       "from run to run; 0: no limit.",
       "s", 0.0});
  v.param("max_bounces", max_bounces,
          {"How often light may be scattered after the first surface.", "", 0, 64});
  v.param("denoise", denoise, {"Remove noise from the colour channels (never from labels)."});
#ifdef DIORAMA_HAS_OIDN
  v.choice("denoiser", denoiser, kDenoisers,
           {"own: the plugin's; oidn: Open Image Denoise, whose pictures depend on its version."});
#endif
  v.param(
      "caustics", caustics,
      {"Follow light focused by glass and mirrors; noisy. Off: glass lets light pass straight."});
  v.param("clamp", clamp, {"Largest luminance of one indirect contribution; 0: none.", "", 0.0});
  v.param(
      "radiance_cache", radiance_cache,
      {"Denoised path_traced pictures: let paths end at their second surface with light that some "
       "further ones found around there, which count for their pixels, too; far less noise and "
       "time for indirect light that is blurred a little."});
  v.param("virtual_lights", virtual_lights,
          {"Pictures of path_traced: connect paths with bright places on surfaces where lamps "
           "light few of them, so that light that is scattered several times has less noise."});
  v.param("path_reuse", path_reuse,
          {"Pictures of path_traced without denoiser: let paths of pixels around use each other's "
           "second surfaces, so that fewer of them go on; in rooms half of the time for the same "
           "noise. By the processor."});
  v.param(
      "firefly_limit", firefly_limit,
      {"Denoised pictures: how bright one path may be, over a few times the other paths around, "
       "where 1 is white in a well exposed picture; what it brings beyond is spread over its "
       "surroundings. Beyond 16 paths per pixel it grows with their number; 0: no limit.",
       "", 0.0});
  v.choice("exposure", exposure, kExposures,
           {"auto: by the picture's middle tones; fixed: exposure_ev alone."});
  v.param("exposure_ev", exposure_ev,
          {"Stops added to the exposure; with fixed, 0 leaves radiance as it is.", "EV", -40, 40});
  v.choice("view_transform", view_transform, kViewTransforms,
           {"From exposed light to the picture: standard clips, filmic rolls highlights off."});
  v.choice("sphere_lights", sphere_lights, kSphereLights,
           {"sphere: as the scene says; disk: like disks that turn to every point they light, as "
            "Blender's point lights do."});
  v.choice("principled", principled, kPrincipled,
           {"layered: layers share the light and lose none of it; blender: as Blender 3.4's "
            "Principled BSDF, which adds reflections to a whole diffuse base."});
  v.choice("isa", isa, kIsaNames,
           {"Instruction set of the kernels, by default the best of this machine; pictures "
            "are the same bytes within one."});
}

PathRenderer::PathRenderer(PictureParams params, Host& host)
    : params_(std::move(params)),
      host_(host),
      isa_(isa_by_name(params_.isa)),
      meshes_(host, {kIsaNames[std::size_t(isa_)],
                     {params_.sphere_lights == "disk", params_.principled == "blender"}}) {
  if (params_.mode == "path_traced") return;
  params_.denoise = true;
  params_.max_bounces = std::min(params_.max_bounces, params_.mode == "real_time" ? 1 : 0);
}

NameSet PathRenderer::provides() const {
  NameSet names = geometry_channels();
  names.emplace(kColor.name);
  names.emplace(kColorHdr.name);
  return names;
}

RenderReport PathRenderer::report() const {
  const EmbreeScene::Times& prepared = meshes_.times();
  RenderReport report;
  report.paths = counts_.paths;
  report.rays = counts_.rays + counts_.shadow_rays;
  report.seconds = {{"materials and meshes", prepared.shading_s},
                    {"ray tracing structure", prepared.tree_s},
                    {"light tables", prepared.lights_s}};
  if (counts_.paths > 0) {
    report.seconds = {{"labels and geometry", counts_.channels_s},
                      {"paths", counts_.trace_s},
                      {"denoising", counts_.denoise_s}};
  }
  return report;
}

std::size_t PathRenderer::working_bytes(const Camera& camera, const NameSet& channels) const {
  const std::size_t pixels = std::size_t(camera.width) * std::size_t(camera.height);
  std::size_t colors = 0;
  if (channels.contains(kColor.name) || channels.contains(kColorHdr.name)) {
    colors = traced_bytes(pixels);
    std::size_t learning = 0;
    if (ends_in_cache()) {
      learning = std::size_t(SamplePlan::most_learning_paths(pixels, params_.samples));
      colors += learning * sizeof(LearningPaths::Path);
    }
    if (filters_film_elsewhere()) {
      colors += pixels * sizeof(Vec3f);
    } else {
      // What paths took is gone when noise is removed.
      colors += pixels * sizeof(FilmPixel);
      colors = params_.denoise
                   ? std::max(colors, denoiser_bytes(camera.width, camera.height, is_quick()))
                   : colors + pixels * sizeof(Vec3f);
    }
    // Before there is a film: what was found, in order, and at most a cell for each.
    colors = std::max(colors, learning * LearningPaths::kBytes);
    if (params_.mode == "real_time" && params_.samples == 1) {
      colors += pixels * sizeof(RayHit);
    } else if (!traces_elsewhere()) {
      colors -= std::min(colors, pixels * geometry_bytes_per_pixel(channels));  // Come after it.
    }
  }
  return pixels * (sizeof(std::uint32_t) + sizeof(float)) + colors;  // SeenMeshes
}

void PathRenderer::do_prepare(const Scene& scene) {
  counts_ = {};
  seen_by_ = {};
  meshes_.take(scene, [&] { prepare_paths(); });
  if (meshes_.lights().is_empty()) {
    host_.log(LogLevel::Warning, "the scene has no light: pictures will be black");
  }
}

/// What the view's camera sees at the pixels' centres.
const SeenMeshes& PathRenderer::seen(const View& view, NodeId camera) {
  if (seen_by_ != camera) {
    Frame frame;
    fill_channels(frame, {}, meshes_, view, seen_, nullptr, host_);
    seen_by_ = camera;
  }
  return seen_;
}

/// Whether every path starts where the ray through its pixel's centre does.
bool PathRenderer::starts_at_centres(const View& view) const {
  const bool sees_one_moment = !view.has_shutter() && !view.has_aperture();
  return params_.mode == "real_time" && params_.samples == 1 && sees_one_moment;
}

const HitImage& PathRenderer::first_hits(const View& view) {
  if (first_hits_.is_empty()) {
    Frame frame;
    fill_channels(frame, {}, meshes_, view, seen_, &first_hits_, host_);
    seen_by_ = rendered_by_;
  }
  return first_hits_;
}

PathSettings PathRenderer::path_settings(const View& view) const {
  PathSettings settings{params_.max_bounces, float(params_.clamp), params_.caustics};
  if (params_.mode == "real_time") settings.indirect_share = kRealTimeIndirectShare;
  settings.starts_at_centres = starts_at_centres(view);
  settings.ends_in_cache = ends_in_cache();
  if (is_quick() || ends_in_cache()) settings.continuation = kShortContinuation;
  settings.has_virtual_lights = has_virtual_lights();
  settings.reuses_paths = params_.path_reuse && can_reuse_paths() && !params_.denoise &&
                          params_.clamp <= 0.0 && params_.max_bounces > 0 && !view.has_shutter();
  return settings;
}

Image<Vec3f> PathRenderer::without_noise(Film film, const View& view) {
#ifdef DIORAMA_HAS_OIDN
  if (params_.denoiser == "oidn") return oidn_denoised(film, host_);
#endif
  DenoiseSettings settings{view.position()};
  settings.is_quick = is_quick();
  if (params_.firefly_limit > 0.0) {
    settings.brightest_path = float(params_.firefly_limit / quiet_exposure(film));
  }
  return denoised(std::move(film), settings, isa_, host_);
}

Image<Vec3f> PathRenderer::trace_quickly(const View&, const PathSettings&, SamplePlan&, double) {
  throw Error(ErrorKind::Internal, "this renderer filters its pictures here");
}

/// What the camera sees, without noise where that is wanted.
Image<Vec3f> PathRenderer::light(const View& view, std::uint64_t seed) {
  const PathSettings settings = path_settings(view);
  SamplePlan::Limits limits{params_.samples, params_.error_target, params_.time_budget_s};
  if (settings.reuses_paths) {
    PixelTiles::of_picture(view.camera().width, view.camera().height).set_blocks(limits);
  }
  SamplePlan plan(view.camera().width, view.camera().height, limits, seed);
  if (filters_film_elsewhere()) return trace_quickly(view, settings, plan, params_.firefly_limit);
  Film film;
  {
    const Stopwatch watch(counts_.trace_s);
    film = trace(view, settings, plan);
    first_hits_ = {};
  }
  const Stopwatch watch(counts_.denoise_s);
  return params_.denoise ? without_noise(std::move(film), view) : undenoised(film);
}

void PathRenderer::put_colors(Frame& frame, const RenderRequest& request, Image<Vec3f> hdr) {
  const double base = params_.exposure == "auto" ? automatic_exposure(hdr) : 1.0;
  frame.exposure = base * std::exp2(params_.exposure_ev);
  if (request.channels.contains(kColor.name)) {
    const bool is_filmic = params_.view_transform == "filmic";
    frame.set(kColor,
              displayed(hdr, frame.exposure,
                        is_filmic ? ViewTransform::Filmic : ViewTransform::Standard, host_));
  }
  if (request.channels.contains(kColorHdr.name)) frame.set(kColorHdr, std::move(hdr));
}

Frame PathRenderer::do_render(const Scene& scene, const RenderRequest& request) {
  const View view(scene, request.camera);
  Frame frame;
  counts_ = {};
  first_hits_ = {};
  rendered_by_ = request.camera;
  const bool wants_color =
      request.channels.contains(kColor.name) || request.channels.contains(kColorHdr.name);
  const NameSet known = geometry_channels();
  const bool wants_labels = std::any_of(known.begin(), known.end(), [&](const auto& name) {
    return request.channels.contains(name);
  });
  const auto make_labels = [&](HitImage* hits) {
    if (!wants_labels) return;
    const Stopwatch watch(counts_.channels_s);
    fill_channels(frame, request.channels, meshes_, view, seen_, hits, host_);
    seen_by_ = request.camera;
  };
  if (!wants_color) {
    make_labels(nullptr);
  } else if (traces_elsewhere()) {
    // Paths leave the processor idle: it makes the labels meanwhile.
    std::future<Image<Vec3f>> hdr =
        std::async(std::launch::async, [&] { return light(view, request.seed); });
    make_labels(nullptr);
    put_colors(frame, request, hdr.get());
  } else if (starts_at_centres(view)) {
    make_labels(&first_hits_);
    put_colors(frame, request, light(view, request.seed));
  } else {
    // Labels need not be held while the colours take most memory.
    put_colors(frame, request, light(view, request.seed));
    make_labels(nullptr);
  }
  return frame;
}

std::vector<CoverageMask> PathRenderer::do_cover(const Scene& scene, NodeId camera,
                                                 std::span<const LabelledInstance> instances,
                                                 bool with_distances) {
  const View view(scene, camera);
  return coverage(meshes_, view, seen(view, camera), instances, with_distances, isa_, host_);
}

std::vector<std::uint8_t> PathRenderer::do_see(const Scene& scene, NodeId camera,
                                               std::span<const Vec3> points_world) {
  return seen_points(meshes_, scene.world_from_node(camera).translation(), points_world, host_);
}

}  // namespace diorama
