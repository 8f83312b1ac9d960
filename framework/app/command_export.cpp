// SPDX-License-Identifier: Apache-2.0
#include "framework/app/command_export.h"

#include "framework/app/assemble.h"
#include "framework/export/scene_export.h"

namespace diorama {

int command_export(const GlobalOptions& global, const ExportCommandOptions& options,
                   ConsoleLog& log) {
  const Log console = log.sink();
  const std::unique_ptr<Registry> registry = make_registry(global, console);
  warn_of_rejected(*registry, console);
  const std::unique_ptr<HostServices> host = make_host(*registry, global, std::nullopt, console);
  Scene scene;
  const NodeId root = host->load_asset(options.asset, scene, scene.root());
  export_scene(scene, root, options.file, {!options.without_physics}, *host);
  return 0;
}

}  // namespace diorama
