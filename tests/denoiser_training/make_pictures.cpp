// SPDX-License-Identifier: Apache-2.0
// Renders what the denoiser is trained on and judged by: films of the same views with few and with
// many paths, independent of each other. See README.md beside this file for the format.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "channels.h"
#include "embree_support/path_starts.h"
#include "gpu_path_tracer.h"
#include "gpu_picture.h"
#include "gpu_scene.h"
#include "half_floats.h"
#include "path_device.h"
#include "picture_film.h"
#include "renderer_support/denoiser.h"
#include "renderer_support/film.h"
#include "renderer_support/sample_plan.h"
#include "support/render_host/render_host.h"
#include "training_scenes.h"

namespace {

using namespace diorama;
using namespace diorama::training;

/// What a film is traced with.
struct Pass {
  int samples = 1;
  bool is_real_time = false;       ///< Through the pixels' centres, half of the bounces.
  bool ends_in_cache = true;       ///< As the paths of denoised pictures do.
  bool has_virtual_lights = true;  ///< As all but quick pictures.
  bool reuses_paths = false;       ///< As pictures with `denoise: false`, by the processor.
};

/// Traces the paths of one scene, on the processor or on a GPU.
class Tracer {
 public:
  /// `device`: null for the processor.
  Tracer(const EmbreeScene& meshes, const std::shared_ptr<const PathDevice>& device, Isa isa,
         Host& host)
      : meshes_(meshes), isa_(isa), host_(host) {
    if (!device) return;
    on_device_.emplace(*device, host);
    on_device_->scene.take(meshes.render_scene());
  }

  Film trace(const View& view, const Pass& pass, int max_bounces, std::uint64_t seed) {
    PathSettings settings{max_bounces, 0.0f, false};
    if (pass.is_real_time) {
      settings.starts_at_centres = true;
      settings.indirect_share = 0.5f;
    }
    settings.ends_in_cache = pass.ends_in_cache && max_bounces > 1;
    if (pass.is_real_time || settings.ends_in_cache) settings.continuation = kShortContinuation;
    settings.has_virtual_lights = pass.has_virtual_lights && !pass.is_real_time && max_bounces > 0;
    settings.reuses_paths = pass.reuses_paths && max_bounces > 0 && !view.has_shutter();
    const int width = view.camera().width;
    const int height = view.camera().height;
    SamplePlan::Limits limits{pass.samples};
    if (settings.reuses_paths) PixelTiles::of_picture(width, height).set_blocks(limits);
    SamplePlan plan(width, height, limits, seed);
    PictureCounts counts;
    if (on_device_) {
      trace_picture(on_device_->tracer, on_device_->scene, meshes_, view, settings, isa_, plan,
                    host_, counts);
      return on_device_->tracer.film();
    }
    TraceSettings here{settings};
    HitImage hits;
    if (settings.starts_at_centres) {
      Frame frame;
      SeenMeshes seen;
      fill_channels(frame, {}, meshes_, view, seen, &hits, host_);
      here.first_hits = &hits;
    }
    return picture_film(meshes_, view, here, isa_, plan, host_, counts);
  }

 private:
  struct OnDevice {
    OnDevice(const PathDevice& device, Host& host) : scene(device, host), tracer(device, host) {}
    GpuScene scene;
    GpuPathTracer tracer;
  };

  const EmbreeScene& meshes_;
  Isa isa_;
  Host& host_;
  std::optional<OnDevice> on_device_;
};

constexpr int kChannels = 19;

/// Of one pixel, and of what the filter by planes made of it; light times `scale`.
std::array<float, kChannels> channels_of(const FilmPixel& p, const Vec3f& by_planes,
                                         const Vec3f& eye, float scale) {
  const float distance = p.surface_share > 0.0f ? (p.position - eye).norm() : 0.0f;
  return {scale * p.seen.x(),
          scale * p.seen.y(),
          scale * p.seen.z(),
          scale * p.scattered.x(),
          scale * p.scattered.y(),
          scale * p.scattered.z(),
          p.albedo.x(),
          p.albedo.y(),
          p.albedo.z(),
          p.normal.x(),
          p.normal.y(),
          p.normal.z(),
          distance,
          scale * std::sqrt(std::max(0.0f, p.variance)),
          scale * p.brightest,
          p.surface_share,
          scale * by_planes.x(),
          scale * by_planes.y(),
          scale * by_planes.z()};
}

/// The whole file at once, so that who reads while we write never meets half of one.
class FilmFile {
 public:
  FilmFile(int width, int height, int films) { put({kMagic, width, height, films, kChannels}); }
  /// Light is stored times `scale`; the film's own exposure is told relative to that.
  void add(const Film& film, const Image<Vec3f>& by_planes, const Pass& pass, const Vec3f& eye,
           float scale) {
    const auto exposure = float(quiet_exposure(film) / double(scale));
    const auto counted = std::int32_t(std::lround(film.at(0, 0).count));  // All pixels alike.
    put({pass.samples, counted, std::bit_cast<std::int32_t>(exposure)});
    std::vector<std::uint16_t> planes(film.pixels().size() * kChannels);
    for (std::size_t i = 0; i < film.pixels().size(); ++i) {
      const auto values = channels_of(film.pixels()[i], by_planes.pixels()[i], eye, scale);
      for (std::size_t k = 0; k < kChannels; ++k) {
        planes[k * film.pixels().size() + i] = half_bits(values[k]);
      }
    }
    bytes_.append(reinterpret_cast<const char*>(planes.data()), 2 * planes.size());
  }
  void write(const std::filesystem::path& file) const {
    const std::filesystem::path temporary = file.string() + ".part";
    std::ofstream out(temporary, std::ios::binary);
    out.write(bytes_.data(), std::streamsize(bytes_.size()));
    out.close();
    if (!out) throw Error(ErrorKind::Output, file.string() + ": cannot be written");
    std::filesystem::rename(temporary, file);
  }

 private:
  static constexpr std::int32_t kMagic = 0x4D4C4946;  // "FILM"
  void put(const std::vector<std::int32_t>& numbers) {
    bytes_.append(reinterpret_cast<const char*>(numbers.data()), 4 * numbers.size());
  }
  std::string bytes_;
};

struct Options {
  std::filesystem::path out;
  std::filesystem::path judge;
  std::uint64_t first = 1;
  int sets = 1;
  int views = 8;
  int width = 256;
  int height = 192;
  int target_paths = 32;
  int bounces = 6;
  int device = -1;
  bool is_plain_undenoised = false;  ///< As `denoise: false` makes pictures.
  double seconds = 1e9;
  int threads = 1;
};

/// Whether something can be learnt from it: not black, not inside of a thing.
bool is_worthy(const Film& film, const Vec3f& eye) {
  std::size_t lit = 0;
  std::size_t near = 0;
  for (const FilmPixel& p : film.pixels()) {
    lit += luminance(p.scattered) > 0.0f ? 1 : 0;
    near += p.surface_share > 0.0f && (p.position - eye).norm() < 0.25f ? 1 : 0;
  }
  return lit > film.pixels().size() / 20 && near < film.pixels().size() / 2;
}

DenoiseSettings denoise_settings(const Film& film, const View& view) {
  DenoiseSettings settings{view.position()};
  settings.brightest_path = float(4.0 / quiet_exposure(film));
  return settings;
}

/// What the renderer makes of the first `count` films, light times `scale`.
void write_denoised(const std::vector<Film>& films, std::size_t count, const View& view,
                    float scale, bool is_quick, Isa isa, Host& host,
                    const std::filesystem::path& file) {
  std::ofstream out(file, std::ios::binary);
  for (std::size_t k = 0; k < count; ++k) {
    Film film(films[k].width(), films[k].height());
    std::ranges::copy(films[k].pixels(), film.pixels().begin());
    DenoiseSettings settings = denoise_settings(film, view);
    settings.is_quick = is_quick;
    const Image<Vec3f> picture = denoised(std::move(film), settings, isa, host);
    for (int c = 0; c < 3; ++c) {
      for (const Vec3f& pixel : picture.pixels()) {
        const std::uint16_t bits = half_bits(scale * pixel[c]);
        out.write(reinterpret_cast<const char*>(&bits), 2);
      }
    }
  }
}

void render_set(const Set& set, std::uint64_t seed, const Options& options, Host& host) {
  const Isa isa = isa_by_name(best_isa_name());
  EmbreeScene meshes(host, {best_isa_name(), {false, false}});
  meshes.take(set.scene);
  Tracer tracer(meshes, options.device < 0 ? nullptr : shared_path_device(options.device), isa,
                host);
  Rng rng = Rng(seed).fork("passes");
  const bool is_judged = !options.judge.empty();
  for (std::size_t i = 0; i < set.cameras.size(); ++i) {
    const View view(set.scene, set.cameras[i]);
    const double depth = rng.uniform();
    const int bounces = is_judged      ? options.bounces
                        : depth < 0.72 ? 6
                        : depth < 0.8  ? 4
                        : depth < 0.94 ? 1
                                       : 0;
    const bool sees_one_moment = !view.has_shutter() && !view.has_aperture();
    const bool is_real_time = sees_one_moment && bounces < 2;
    std::vector<Pass> passes{{1, is_real_time, !is_real_time}, {2}, {4}, {16}};
    if (is_judged) {
      if (bounces > 1) passes.erase(passes.begin());
      passes.push_back({256});
    } else {
      // Further noise of the same view costs little.
      passes.insert(passes.end(), {{2}, {4}});
      if (rng.chance(0.2)) passes.push_back({rng.chance(0.5) ? 64 : 256});
    }
    // What judges is made as plainly as can be.
    passes.insert(passes.end(), 2, {options.target_paths, false, false, !is_judged});
    std::vector<Film> films;
    std::vector<Film> plain;  // For denoisers that know nothing of caches.
    for (const Pass& pass : passes) {
      const std::uint64_t own_seed = rng.bits();
      films.push_back(tracer.trace(view, pass, bounces, own_seed));
      if (is_judged && plain.size() + 2 < passes.size()) {
        const Pass own{pass.samples, pass.is_real_time, false, options.is_plain_undenoised,
                       options.is_plain_undenoised};
        plain.push_back(tracer.trace(view, own, bounces, own_seed));
      }
      if (films.size() == 2 && !is_judged && !is_worthy(films.back(), view.position())) break;
    }
    if (films.size() < passes.size()) continue;
    const auto scale = float(quiet_exposure(films.back()));
    const std::filesystem::path file_stem = options.out / (set.name + "_" + std::to_string(i));
    if (is_judged) {
      for (const bool is_quick : {false, true}) {
        write_denoised(films, passes.size() - 2, view, scale, is_quick, isa, host,
                       file_stem.string() + (is_quick ? ".planes" : ".own"));
      }
    }
    const auto write = [&](std::vector<Film>& written, const char* suffix) {
      FilmFile file(options.width, options.height, int(written.size()));
      for (std::size_t k = 0; k < written.size(); ++k) {
        // As the renderer's network sees them; the last two are what it is compared with.
        if (k + 2 < films.size()) average_chances(written[k], host);
        const Image<Vec3f> by_planes =
            denoised_on_planes(written[k], denoise_settings(written[k], view), isa, host);
        file.add(written[k], by_planes, passes[k], view.position(), scale);
      }
      file.write(file_stem.string() + suffix);
    };
    write(films, ".films");
    if (is_judged) write(plain, ".plain");
  }
}

void make(const Options& options) {
  test::RenderHost host(options.threads);
  std::filesystem::create_directories(options.out);
  const auto start = std::chrono::steady_clock::now();
  for (int i = 0; i < options.sets; ++i) {
    const double elapsed =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    if (elapsed > options.seconds) break;
    const std::uint64_t seed = options.first + std::uint64_t(i);
    try {
      const Set set =
          options.judge.empty()
              ? training_set(seed, options.views, options.width, options.height, host)
              : judged_set(int(seed), options.width, options.height, options.judge, host);
      render_set(set, seed, options, host);
    } catch (const Error& error) {
      std::fprintf(stderr, "set %d: %s\n", int(seed), error.what());
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app{"Renders pictures to train the denoiser on, or to judge it by"};
  app.add_option("folder", options.out, "Where the films go")->required();
  app.add_option("--judge", options.judge,
                 "Folder with assets_root/ and bench/: the sets to judge by, instead");
  app.add_option("--first", options.first, "Number of the first set");
  app.add_option("--sets", options.sets, "How many sets");
  app.add_option("--views", options.views, "Per set");
  app.add_option("--width", options.width);
  app.add_option("--height", options.height);
  app.add_option("--target-paths", options.target_paths,
                 "Of each of the two films to compare with");
  app.add_option("--bounces", options.bounces, "Of what is judged by; few: as in real time, too");
  app.add_option("--seconds", options.seconds, "No further set is begun after that");
  app.add_option("--threads", options.threads);
  app.add_option("--device", options.device,
                 "Number of the Vulkan device that traces the paths; the processor by default");
  app.add_flag("--as-undenoised", options.is_plain_undenoised,
               "Films for other denoisers are those of pictures with denoise: false")
      ->excludes("--device");
  CLI11_PARSE(app, argc, argv);
  try {
    make(options);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
