// SPDX-License-Identifier: Apache-2.0
#include "framework/jobs/run_in_memory.h"

#include "framework/output/memory_file_system.h"
#include "framework/output/output_store.h"

namespace diorama {

RunSummary run_in_memory(JobAssembly& assembly, HostServices& host, const RunOptions& options) {
  OutputFolders folders = output_folders(assembly.job);
  folders.base = "/memory";
  MemoryFileSystem memory;
  OutputStore store(memory, folders, assembly.plan.capture_count(), {});
  return Pipeline(assembly.job, assembly.plan, assembly.components, host, store, options)
      .run(assembly.dataset, assembly.dataset_json);
}

}  // namespace diorama
