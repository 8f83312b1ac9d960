// SPDX-License-Identifier: Apache-2.0
#include "framework/app/command_docs.h"

#include <fstream>
#include <iostream>
#include <system_error>

#include "framework/app/command_schema.h"
#include "framework/app/completion_scripts.h"
#include "framework/jobs/assemble.h"
#include "framework/pipeline/job.h"

namespace diorama {

int command_docs(const GlobalOptions& global, const std::vector<CommandPage>& commands,
                 const std::filesystem::path& folder, ConsoleLog& log) {
  const std::unique_ptr<Registry> registry = make_registry(global, log.sink());
  warn_of_rejected(*registry, log.sink());
  std::vector<PageFile> pages = reference_pages(
      commands, job_specs(), describe_all(*registry, log.sink()), program_version());
  for (PageFile& script : completion_scripts(commands)) pages.push_back(std::move(script));
  for (const PageFile& page : pages) {
    const std::filesystem::path file = folder / page.path;
    std::error_code failed;
    std::filesystem::create_directories(file.parent_path(), failed);
    std::ofstream stream(file, std::ios::binary);
    stream << page.text;
    stream.close();
    if (!stream) {
      throw Error(ErrorKind::Output,
                  file.string() + ": cannot be written" +
                      (failed ? ": " + failed.message() : "; check the rights of the folder"));
    }
  }
  std::cout << pages.size() << " files in " << folder.string() << "\n";
  return 0;
}

}  // namespace diorama
