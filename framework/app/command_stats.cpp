// SPDX-License-Identifier: Apache-2.0
#include "framework/app/command_stats.h"

#include <fstream>
#include <iostream>

#include "diorama/error.h"
#include "framework/app/heap.h"
#include "framework/app/standard_output.h"
#include "framework/datasets/dataset_origin.h"
#include "framework/datasets/dataset_readers.h"
#include "framework/datasets/dataset_stats.h"
#include "framework/jobs/assemble.h"

namespace diorama {

int command_stats(const GlobalOptions& global, const StatsOptions& options, ConsoleLog& log) {
  keep_large_blocks();
  const JobServices services = make_services(global, log.sink());
  DatasetReaders readers(*services.registry, *services.host);
  const FoundDataset found = find_dataset(options.dataset, readers, options.reader);
  const auto dataset = readers.open(found.folder, found.reader);
  DatasetStats stats = dataset_stats(*dataset, *services.host);
  stats.views = views_of_run(found.folder);
  if (options.html.empty()) {
    if (options.as_json) {
      std::cout << stats_json(stats);
    } else {
      print_text(stats_text(stats));
    }
    return 0;
  }
  std::ofstream page(options.html, std::ios::binary);
  page << stats_html(stats, found.folder.filename().string());
  page.close();
  if (!page) throw Error(ErrorKind::Output, options.html.string() + ": cannot be written");
  log.write(LogLevel::Info, "wrote " + options.html.string());
  return 0;
}

}  // namespace diorama
