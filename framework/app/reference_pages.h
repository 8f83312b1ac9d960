// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "framework/app/job_schema.h"

/// Reference pages from what the program and its components say of themselves.
namespace diorama {

/// One option or argument of a command, as its help shows it.
struct OptionPage {
  std::string name;  ///< "--seed N", "JOB".
  std::string help;
  std::vector<std::string> flags{};  ///< "--seed".
  std::string value{};               ///< "N"; empty when none follows.
  bool is_argument = false;          ///< May stand without a flag.
};

struct CommandPage {
  std::string name;  ///< "diorama plugins describe"; the first page is the program's.
  std::string help;
  std::vector<OptionPage> options;
};

/// A file to be written: a path below the output folder and its text.
struct PageFile {
  std::string path;
  std::string text;
};

/// Markdown (`reference/`) and man pages (`man1/`, `man5/`, `man7/`): one for the program, one for
/// job files, one for each component. The same input gives the same text.
std::vector<PageFile> reference_pages(const std::vector<CommandPage>& commands,
                                      const std::vector<ParamSpec>& job,
                                      const std::vector<DescribedComponent>& components,
                                      const std::string& version);

}  // namespace diorama
