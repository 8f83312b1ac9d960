// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "diorama/config.h"
#include "framework/host/log.h"
#include "framework/jobs/job_options.h"
#include "framework/pipeline/pipeline.h"

namespace diorama {

/// A few captures of a job, made in memory and thrown away: what a run will look like and take.
struct TrialOptions {
  std::vector<int> captures;  ///< Empty: `spread` of them over the job, from first to last.
  int spread = 3;
  bool is_within_visit = false;  ///< Spread over the first visit only.
  int max_samples = 4;           ///< Paths per pixel at most, where the renderer has `samples`.
  bool keeps_pictures = false;
  int visits_in_flight = 0;  ///< Of the run that is estimated; see visits_at_a_time().
};

struct TrialPicture {
  int capture = 0;
  std::string phase;
  std::string camera;
  std::vector<std::byte> png;
};

/// What the whole job will take on this machine, as far as a trial tells.
struct Estimate {
  int captures = 0;
  int visits = 0;
  double visit_s = 0.0;       ///< Loading and simulating.
  double capture_s = 0.0;     ///< With all of the job's samples.
  double bytes = 0.0;         ///< On the disk.
  double memory_bytes = 0.0;  ///< With so many visits at a time.
  int visits_at_a_time = 1;

  double seconds() const { return visits * visit_s + captures * capture_s; }
};

struct Trial {
  std::vector<TrialPicture> pictures;  ///< By capture and camera.
  int captures = 0;                    ///< That were made.
  int visits = 1;                      ///< They are of.
  int samples = 0;                     ///< Traced per pixel; 0: as many as the job says.
  int job_samples = 0;                 ///< The job's, where it says more.
  int threads = 1;
  /// What other programs left meanwhile; nothing when that is not known.
  std::optional<double> processors_left;
  int processors = 0;
  double slowed = 1.0;  ///< How many times longer it took beside them.
  Estimate estimate;    ///< Without them.
};

/// `job` is native. Nothing is written. Throws Error(Usage) for captures that the job has not, and
/// as assemble_job() and Pipeline::run() do.
Trial run_trial(const GlobalOptions& global, const Value& job, const TrialOptions& options,
                const Log& log);

/// What the job will take, and on what that rests: "estimate from 2 captures in 1 visit: 24
/// captures in 4 min or less ...". A line more where others kept the machine busy.
std::string estimate_text(const Trial& trial);

}  // namespace diorama
