// SPDX-License-Identifier: Apache-2.0
#include "framework/app/command_status.h"

#include <iostream>

#include "framework/app/command_run.h"
#include "framework/app/exit_codes.h"
#include "framework/app/standard_output.h"
#include "framework/output/dataset_status.h"

namespace diorama {

int command_status(const StatusOptions& options) {
  LocalFileSystem file_system;
  const DatasetStatus status = read_status(file_system, options.dataset, options.verify);
  if (options.as_json) {
    std::cout << status_json(status);
  } else {
    print_text(status_text(status, options.dataset));
  }
  return status.is_finished && status.faults.empty() ? 0 : kDatasetIncomplete;
}

int command_finish(const GlobalOptions& global, const std::filesystem::path& dataset,
                   ConsoleLog& log) {
  LocalFileSystem file_system;
  const DatasetStatus status = read_status(file_system, dataset, false);
  if (status.is_finished) {
    log.write(LogLevel::Info, dataset.string() + ": finished already");
    return 0;
  }
  if (!status.missing.empty()) {
    print_text(status_text(status, dataset));
    return kDatasetIncomplete;
  }
  return finish_dataset(global, status, log);
}

}  // namespace diorama
