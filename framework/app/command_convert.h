// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "framework/app/options.h"
#include "framework/host/console_log.h"

namespace diorama {

struct ConvertOptions {
  std::vector<std::filesystem::path> datasets;  ///< One for convert, several for merge.
  std::vector<std::string> writers;  ///< "TYPE key=value ...", one folder of the output each.
  std::string reader;                ///< Type; empty: the one that knows the folder.
  std::filesystem::path output;
  bool overwrite = false;
};

/// `diorama convert DATASET --writer 'TYPE key=value ...' -o OUT` and `diorama merge A B ...`: what
/// readers give goes to writers, numbered anew, several datasets one after the other. First says
/// what the sources lack and what no writer takes. Memory does not depend on the number of
/// captures. Returns 0; throws Error(Usage) when there is no dataset or the writers need what it
/// does not hold, Error(Config) for writers' parameters, Error(Asset) for damaged files; those end
/// the work, and the output is no whole dataset.
int command_convert(const GlobalOptions& global, const ConvertOptions& options, ConsoleLog& log);

}  // namespace diorama
