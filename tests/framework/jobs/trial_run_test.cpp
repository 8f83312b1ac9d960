// SPDX-License-Identifier: Apache-2.0
#include "framework/jobs/trial_run.h"

#include "support/catch.h"

using namespace diorama;

TEST_CASE("An estimate says on what it rests", "[preview]") {
  Trial trial;
  trial.captures = 3;
  trial.visits = 2;
  trial.samples = 4;
  trial.job_samples = 32;
  trial.threads = 2;
  trial.estimate = {.captures = 100,
                    .visits = 20,
                    .visit_s = 3.0,
                    .capture_s = 2.0,
                    .bytes = 4e6,
                    .memory_bytes = 5e8,
                    .visits_at_a_time = 2};
  const std::string quiet =
      "estimate from 3 captures in 2 visits with 4 of 32 samples: 100 captures in 4 min or less on "
      "2 threads, the disk not counted (20 visits of 3.0 s, 2.0 s a capture), 4.0 MB on disk, 500 "
      "MB of memory for 2 visits at a time\n";
  CHECK(estimate_text(trial) == quiet);
  trial.processors = 2;
  trial.processors_left = 1.9;
  CHECK(estimate_text(trial) == quiet);
  // What was measured beside others is no measure of the machine.
  trial.processors_left = 0.62;
  trial.slowed = 2.5;
  const std::string busy = estimate_text(trial);
  CHECK_THAT(busy, ContainsSubstring(": 100 captures in about 4 min on 2 threads"));
  CHECK(
      busy.ends_with("other programs left 0.6 of 2 processors to it, which that does not count: "
                     "with no more it takes 11 min or less\n"));
  trial.slowed = 1.0;
  trial.threads = 1;
  trial.processors_left = 0.9;
  CHECK(estimate_text(trial).ends_with("at a time\n"));
}
