// SPDX-License-Identifier: Apache-2.0
#include "framework/app/command_preview.h"

#include <unistd.h>

#include <cstdio>
#include <iostream>
#include <string>

#include "framework/app/standard_output.h"
#include "framework/config/clean_text.h"
#include "framework/host/replace_file.h"
#include "framework/jobs/job_file.h"
#include "framework/jobs/trial_run.h"
#include "framework/output/file_system.h"

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
  LocalFileSystem file_system;
  require_writable(file_system, options.folder, std::to_string(::getpid()));
  const Trial trial = run_trial(global, job, trial_options, log.sink());
  file_system.make_folders(options.folder);
  for (const TrialPicture& picture : trial.pictures) {
    const fs::path file = options.folder / file_name(picture);
    replace_file(file, picture.png);
    std::cout << printable(file.string()) << "\n";
  }
  print_text(estimate_text(trial));
  return 0;
}

}  // namespace diorama
