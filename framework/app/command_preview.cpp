// SPDX-License-Identifier: Apache-2.0
#include "framework/app/command_preview.h"

#include <cstdio>
#include <iostream>
#include <system_error>

#include "diorama/error.h"
#include "framework/app/standard_output.h"
#include "framework/config/clean_text.h"
#include "framework/host/replace_file.h"
#include "framework/jobs/job_file.h"
#include "framework/jobs/trial_run.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

std::string file_name(const TrialPicture& picture) {
  char number[16];
  std::snprintf(number, sizeof number, "%06d", picture.capture);
  return std::string(number) + "_" + picture.phase + "_" + picture.camera + ".png";
}

}  // namespace

int command_preview(const GlobalOptions& global, const PreviewOptions& options, ConsoleLog& log) {
  TrialOptions trial_options;
  trial_options.captures = options.captures;
  trial_options.max_samples = options.samples;
  trial_options.keeps_pictures = true;
  const Value job = load_job(options.job, log.sink());
  const Trial trial = run_trial(global, job, trial_options, log.sink());
  std::error_code error;
  fs::create_directories(options.folder, error);
  if (error) {
    throw Error(ErrorKind::Output,
                "cannot create " + options.folder.string() + ": " + error.message());
  }
  for (const TrialPicture& picture : trial.pictures) {
    const fs::path file = options.folder / file_name(picture);
    replace_file(file, picture.png);
    std::cout << printable(file.string()) << "\n";
  }
  print_text(estimate_text(trial));
  return 0;
}

}  // namespace diorama
