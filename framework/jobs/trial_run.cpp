// SPDX-License-Identifier: Apache-2.0
#include "framework/jobs/trial_run.h"

#include <sys/resource.h>

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <cstdio>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <string_view>
#include <thread>
#include <utility>

#include "diorama/error.h"
#include "framework/host/machine_limits.h"
#include "framework/jobs/assemble.h"
#include "framework/jobs/assemble_job.h"
#include "framework/jobs/run_in_memory.h"

namespace diorama {
namespace {

constexpr const char* kWriterType = "trial_pictures";
constexpr const char* kSamples = "samples";

// Components are made by name: a process has one trial that keeps pictures at a time.
std::vector<TrialPicture>* kept_pictures = nullptr;
std::mutex kept_mutex;

class KeepPictures {
 public:
  explicit KeepPictures(std::vector<TrialPicture>& pictures) { kept_pictures = &pictures; }
  ~KeepPictures() { kept_pictures = nullptr; }
  KeepPictures(const KeepPictures&) = delete;
  KeepPictures& operator=(const KeepPictures&) = delete;
};

/// Stands behind the job's own writers.
class TrialWriter final : public Writer {
 public:
  struct Params {
    void visit(ParamVisitor&) {}
  };
  TrialWriter(Params, Host& host) : host_(host) {}
  NameSet needs() const override { return {std::string(kColor.name)}; }
  void write(const Capture& capture, CaptureFiles&) const override {
    for (const Frame& frame : capture.frames) {
      const Image<Rgba8>& color = frame.get(kColor);
      const ImageView view{color.pixels().data(), color.width(), color.height(), 4, 8};
      TrialPicture picture{capture.index, capture.phase, frame.camera_name,
                           host_.encode_image(view, ImageFormat::Png)};
      const std::lock_guard lock(kept_mutex);
      kept_pictures->push_back(std::move(picture));
    }
  }

 private:
  Host& host_;
};

void register_trial_writer(Registrar& registrar) {
  add<TrialWriter>(registrar, kWriterType, "Keeps the pictures of a trial.");
}

std::optional<int> whole_number(const Value& value) {
  int number = 0;
  const char* const end = value.scalar.data() + value.scalar.size();
  const auto [stop, error] = std::from_chars(value.scalar.data(), end, number);
  if (value.kind != Value::Kind::Scalar || error != std::errc() || stop != end) return std::nullopt;
  return number;
}

/// The job's samples per pixel where they are more than `most`, which the job then has. What is
/// wrong in the job is for assemble_job() to say.
std::optional<int> limit_samples(Value& job, int most, Registry& registry) {
  Value* renderer = job.find("renderer");
  const Value* const type = renderer ? renderer->find("type") : nullptr;
  const std::string name = type ? type->scalar : kDefaultRenderer;
  if (!registry.has(ComponentKind::Renderer, name)) return std::nullopt;
  if (renderer && renderer->kind != Value::Kind::Map) return std::nullopt;
  const std::vector<ParamSpec> specs = registry.describe(ComponentKind::Renderer, name);
  const auto spec = std::ranges::find(specs, kSamples, &ParamSpec::key);
  if (spec == specs.end()) return std::nullopt;
  const Value* const given = renderer ? renderer->find(kSamples) : nullptr;
  const std::optional<int> samples = whole_number(given ? *given : spec->default_value);
  if (!samples || *samples <= most) return std::nullopt;
  if (!renderer) renderer = &job.set("renderer", Value::make_map());
  renderer->set(kSamples, Value::integer(most));
  return samples;
}

std::set<int> chosen_captures(const TrialOptions& options, const CapturePlan& plan) {
  const int count = options.is_within_visit ? plan.visit(0).capture_count : plan.capture_count();
  std::set<int> chosen(options.captures.begin(), options.captures.end());
  for (const int capture : chosen) {
    if (capture >= 0 && capture < plan.capture_count()) continue;
    throw Error(ErrorKind::Usage, "--capture " + std::to_string(capture) +
                                      ": the job has captures 0 to " +
                                      std::to_string(plan.capture_count() - 1));
  }
  if (!chosen.empty()) return chosen;
  const int steps = std::max(1, options.spread - 1);
  for (int i = 0; i <= steps; ++i) {
    chosen.insert(int(std::int64_t(count - 1) * i / steps));
  }
  return chosen;
}

/// How many visits have one of them. Visits that nothing settles in count, too.
int count_visits(const std::set<int>& captures, const CapturePlan& plan) {
  std::set<int> visits;
  const int per_visit = plan.visit(0).capture_count;  // of all but the last
  for (const int capture : captures) visits.insert(capture / per_visit);
  return int(visits.size());
}

double seconds_of(const RunSummary& summary, std::string_view phase) {
  const auto found = summary.seconds.find(std::string(phase));
  return found == summary.seconds.end() ? 0.0 : found->second;
}

/// What more samples would add to a picture that takes `rendering_s`. `report` is of one picture,
/// and pictures differ: it says which share of them are paths. Without it all are.
double more_paths_s(const RenderReport& report, double rendering_s, double factor) {
  double all = 0.0;
  double paths = 0.0;
  for (const auto& [phase, seconds] : report.seconds) {
    all += seconds;
    if (phase == "paths") paths = seconds;
  }
  const double share = paths > 0.0 ? paths / all : 1.0;
  return share * rendering_s * (factor - 1.0);
}

/// The most that this process has had.
double peak_memory_bytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return double(usage.ru_maxrss) * 1024.0;
}

/// What other programs take from this one, from here on.
class OtherPrograms {
 public:
  /// Processors that they leave to it.
  std::optional<double> processors_left() const {
    const std::optional<ProcessorTime> time = processor_time();
    if (!began_ || !time || time->all_s - began_->all_s <= 0.0) return std::nullopt;
    const double others = time->busy_s - began_->busy_s - (cpu_seconds() - own_began_s_);
    const double share = std::clamp(others / (time->all_s - began_->all_s), 0.0, 1.0);
    return (1.0 - share) * std::thread::hardware_concurrency();
  }

  /// How many times longer all takes: what threads waited for a processor, in proportion to what
  /// they worked. Threads wait for each other, too; the machine as a whole has no more to give than
  /// the others take.
  double slowed(double processors_left) const {
    double working = 0.0;
    double waiting = 0.0;
    for (const auto& [thread, time] : thread_times()) {
      const auto before = threads_began_.find(thread);
      const ThreadTime from = before == threads_began_.end() ? ThreadTime{} : before->second;
      working += time.working_s - from.working_s;
      waiting += time.waiting_s - from.waiting_s;
    }
    if (working <= 0.0 || processors_left <= 0.0) return 1.0;
    const double most = std::thread::hardware_concurrency() / processors_left;
    return std::clamp(1.0 + waiting / working, 1.0, most);
  }

 private:
  std::optional<ProcessorTime> began_ = processor_time();
  double own_began_s_ = cpu_seconds();
  std::map<std::string, ThreadTime> threads_began_ = thread_times();
};

Estimate estimate_of(const RunSummary& summary, const CapturePlan& plan, int visits,
                     const RenderReport& report, double samples_factor) {
  Estimate estimate;
  estimate.captures = plan.capture_count();
  estimate.visits = plan.visit_count();
  const double captures = std::max(1, summary.captures);
  double per_visit = 0.0;
  double per_capture = 0.0;
  for (const auto& [phase, seconds] : summary.seconds) {
    (phase == "loading" || phase == "simulating" ? per_visit : per_capture) += seconds;
  }
  const double cameras = std::max(1, summary.cameras);
  const double picture_s = seconds_of(summary, "rendering") / captures / cameras;
  estimate.visit_s = per_visit / visits;
  estimate.capture_s =
      per_capture / captures + cameras * more_paths_s(report, picture_s, samples_factor);
  estimate.bytes = double(summary.bytes_written) / captures * estimate.captures;
  return estimate;
}

/// Whether they kept threads of the trial from working.
bool is_beside_others(const Trial& trial) {
  constexpr double kBusy = 0.8;
  return trial.processors_left && *trial.processors_left < kBusy * trial.threads;
}

/// "40 s", "4 min", "3.5 h", "2.1 days".
std::string long_duration_text(double seconds) {
  char text[32];
  if (seconds < 90.0) {
    std::snprintf(text, sizeof text, "%.*f s", seconds < 9.95 ? 1 : 0, seconds);
  } else if (seconds < 90.0 * 60.0) {
    std::snprintf(text, sizeof text, "%.0f min", seconds / 60.0);
  } else if (seconds < 36.0 * 3600.0) {
    std::snprintf(text, sizeof text, "%.1f h", seconds / 3600.0);
  } else {
    std::snprintf(text, sizeof text, "%.1f days", seconds / 86400.0);
  }
  return text;
}

std::string size_text(double bytes) {
  char text[32];
  if (bytes < 0.9995e6) {
    std::snprintf(text, sizeof text, "%.0f kB", bytes * 1e-3);
  } else if (bytes < 999.5e6) {
    std::snprintf(text, sizeof text, "%.*f MB", bytes < 9.95e6 ? 1 : 0, bytes * 1e-6);
  } else {
    std::snprintf(text, sizeof text, "%.1f GB", bytes * 1e-9);
  }
  return text;
}

}  // namespace

Trial run_trial(const GlobalOptions& global, const Value& given, const TrialOptions& options,
                const Log& log) {
  Trial trial;
  Value job = given;
  const JobServices services = make_job_services(global, job, log, register_trial_writer);
  if (const auto samples = limit_samples(job, options.max_samples, *services.registry)) {
    trial.samples = options.max_samples;
    trial.job_samples = *samples;
  }
  if (options.keeps_pictures) {
    Value writer = Value::make_map();
    writer.set("type", Value::text(kWriterType));
    Value* writers = job.find("writers");
    if (!writers || writers->kind == Value::Kind::Null) {
      writers = &job.set("writers", Value::make_list());
    }
    if (writers->kind == Value::Kind::List) writers->list.push_back(std::move(writer));
  }
  JobAssembly assembly = assemble_job(job, *services.registry, *services.host, services.assets_root,
                                      program_version(), AssembleFor::Trial, 1);
  RunOptions run;
  run.only = chosen_captures(options, assembly.plan);
  trial.captures = int(run.only->size());
  const KeepPictures keep(trial.pictures);
  const double before_visits = peak_memory_bytes();
  const OtherPrograms others;
  const RunSummary summary = run_in_memory(assembly, *services.host, run);
  std::ranges::sort(trial.pictures, {}, [](const TrialPicture& picture) {
    return std::pair(picture.capture, std::string_view(picture.camera));
  });
  trial.threads = services.host->thread_count();
  trial.processors_left = others.processors_left();
  if (is_beside_others(trial)) trial.slowed = others.slowed(*trial.processors_left);
  trial.processors = int(std::thread::hardware_concurrency());
  trial.visits = count_visits(*run.only, assembly.plan);
  const double factor = trial.samples > 0 ? double(trial.job_samples) / trial.samples : 1.0;
  trial.estimate = estimate_of(summary, assembly.plan, trial.visits,
                               assembly.components.sets.front().renderer->report(), factor);
  trial.estimate.visit_s /= trial.slowed;
  trial.estimate.capture_s /= trial.slowed;
  // Each visit has a scene and components of its own. What visits leave to others, as pictures of
  // assets, is about as much as one of its own: those of a trial one after the other count, too.
  trial.estimate.visits_at_a_time =
      visits_at_a_time(assembly, *services.host, options.visits_in_flight);
  const double more = double(trial.estimate.visits_at_a_time) / trial.visits;
  trial.estimate.memory_bytes =
      before_visits + std::max(1.0, more) * (peak_memory_bytes() - before_visits);
  return trial;
}

std::string estimate_text(const Trial& trial) {
  const Estimate& estimate = trial.estimate;
  const auto counted = [](int count, const char* what) {
    return std::to_string(count) + " " + what + (count == 1 ? "" : "s");
  };
  std::string text = "estimate from " + counted(trial.captures, "capture") + " in " +
                     counted(trial.visits, "visit");
  if (trial.samples > 0) {
    text += " with " + std::to_string(trial.samples) + " of " + std::to_string(trial.job_samples) +
            " samples";
  }
  // Visits overlap, which makes it less; what others took is not known as well.
  const std::string time = long_duration_text(estimate.seconds());
  text += ": " + counted(estimate.captures, "capture") + " in " +
          (trial.slowed > 1.0 ? "about " + time : time + " or less") + " on " +
          counted(trial.threads, "thread") + ", the disk not counted";
  text += " (" + counted(estimate.visits, "visit") + " of " + long_duration_text(estimate.visit_s) +
          ", " + long_duration_text(estimate.capture_s) + " a capture), ";
  text += size_text(estimate.bytes) + " on disk, " + size_text(estimate.memory_bytes) +
          " of memory for " + counted(estimate.visits_at_a_time, "visit") + " at a time\n";
  if (is_beside_others(trial)) {
    char said[160];
    std::snprintf(
        said, sizeof said,
        "other programs left %.1f of %d processors to it, which that does not count: with "
        "no more it takes %s or less\n",
        *trial.processors_left, trial.processors,
        long_duration_text(estimate.seconds() * trial.slowed).c_str());
    text += said;
  }
  return text;
}

}  // namespace diorama
