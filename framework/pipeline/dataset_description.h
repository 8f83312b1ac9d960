// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "diorama/writer.h"
#include "framework/pipeline/capture_plan.h"
#include "framework/pipeline/job.h"

namespace diorama {

/// What writers are told before the first capture. `resolved` is the text of the resolved job.
DatasetInfo describe_dataset(const Job& job, const CapturePlan& plan, std::string resolved,
                             std::string program_version,
                             std::vector<std::pair<std::string, std::string>> plugin_versions);

/// The text of dataset.json: conventions, seed, resolved job, plugin versions, and a hash of the
/// file of every asset that the job uses. Holds nothing that depends on the machine or the time:
/// same job, same text. Throws Error(Asset) when an asset cannot be read.
std::string dataset_json(const DatasetInfo& info, const Job& job, const CapturePlan& plan,
                         const std::optional<std::filesystem::path>& assets_root);

/// The asset as a job would name it: files below the assets root without the root.
std::string asset_name(std::string_view asset,
                       const std::optional<std::filesystem::path>& assets_root);

/// The plan for people: captures, environments, spawned objects with labels and gravity,
/// randomizers with their ranges, cameras, writers, parameters as the job gives them. Stable, so
/// that tests can pin it.
std::string plan_text(const CapturePlan& plan, const Job& job,
                      const std::optional<std::filesystem::path>& assets_root);

}  // namespace diorama
