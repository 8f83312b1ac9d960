// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

#include "framework/app/options.h"
#include "framework/host/console_log.h"

namespace diorama {

struct ViewOptions {
  std::string dataset;     ///< A dataset's folder, or the output of a run.
  std::string other;       ///< The same, to compare with; empty: none.
  double tolerance = 0.0;  ///< Of comparisons, as DiffOptions has it.
  std::string reader;      ///< Type; empty: the one that knows the folder.
  int port = 0;            ///< 0: one that is free.
  bool opens_browser = true;
  int idle_minutes = 30;  ///< 0: never ends by itself.
};

/// `diorama view DATASET [OTHER]`: serves a page that shows it, to browsers of this machine, until
/// nobody asked for some time or a signal comes. Returns 0; throws Error(Usage) when there is no
/// dataset.
int command_view(const GlobalOptions& global, const ViewOptions& options, ConsoleLog& log);

struct ReportOptions {
  std::string dataset;
  std::string reader;
  std::filesystem::path output;
  std::size_t captures = 100;  ///< At most, spread over the dataset.
  bool has_all_overlays = false;
};

/// `diorama report DATASET -o DIR`: the same page as files.
int command_report(const GlobalOptions& global, const ReportOptions& options, ConsoleLog& log);

}  // namespace diorama
