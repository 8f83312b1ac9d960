// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>

#include "framework/view/dataset_view.h"

namespace diorama {

/// What was written.
struct ReportSize {
  std::size_t captures = 0;
  std::size_t files = 0;
  std::uintmax_t bytes = 0;
};

/// Writes the page of a view, with what it shows, as files that a browser opens without a server.
/// The folder must be free. Depth, normals and flow are several times as large as all the rest, and
/// only there with `has_all_overlays`. Throws Error(Output).
ReportSize write_report(DatasetView& view, const std::filesystem::path& folder,
                        bool has_all_overlays);

}  // namespace diorama
