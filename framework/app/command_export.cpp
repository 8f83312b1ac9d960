// SPDX-License-Identifier: Apache-2.0
#include "framework/app/command_export.h"

#include "framework/export/scene_export.h"
#include "framework/jobs/assemble.h"

namespace diorama {

int command_export(const GlobalOptions& global, const ExportCommandOptions& options,
                   ConsoleLog& log) {
  const Log console = log.sink();
  const JobServices services = make_services(global, console);
  Scene scene;
  const NodeId root = services.host->load_asset(options.asset, scene, scene.root());
  export_scene(scene, root, options.file, {!options.without_physics}, *services.host);
  return 0;
}

}  // namespace diorama
