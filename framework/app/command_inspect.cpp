// SPDX-License-Identifier: Apache-2.0
#include "framework/app/command_inspect.h"

#include <iostream>
#include <mutex>

#include "framework/app/standard_output.h"
#include "framework/config/clean_text.h"
#include "framework/inspect/scene_report.h"
#include "framework/jobs/assemble.h"

namespace diorama {

int command_inspect(const GlobalOptions& global, const InspectOptions& options, ConsoleLog& log) {
  std::mutex mutex;
  std::vector<std::string> notes;
  std::vector<std::string> warnings;
  const Log console = log.sink();
  // What the loader says belongs into the report; the host's own messages came before.
  bool is_loading = false;
  const Log collect = [&](LogLevel level, std::string_view message) {
    if (!is_loading) return console(level, message);
    const std::lock_guard lock(mutex);
    (level <= LogLevel::Info ? notes : warnings).emplace_back(message);
  };

  const std::unique_ptr<Registry> registry = make_registry(global, console);
  warn_of_rejected(*registry, console);
  const std::unique_ptr<HostServices> host = make_host(*registry, global, std::nullopt, collect);
  Scene scene;
  is_loading = true;
  const NodeId root = host->load_asset(options.asset, scene, scene.root());
  is_loading = false;

  SceneReport report = report_scene(scene, root, clean_name(options.asset));
  report.notes = std::move(notes);
  report.warnings.insert(report.warnings.begin(), warnings.begin(), warnings.end());
  if (options.as_json) {
    std::cout << report_json(report);
  } else {
    print_text(report_text(report, options.depth));
  }
  return 0;
}

}  // namespace diorama
