// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "diorama/host.h"
#include "diorama/writer.h"
#include "framework/pipeline/capture_plan.h"
#include "framework/pipeline/job.h"

namespace diorama {

/// The files that an asset consists of, see Loader::files().
using AssetFiles = std::function<std::vector<std::filesystem::path>(const std::string& asset)>;

/// What writers are told before the first capture. `resolved` is the text of the resolved job;
/// `drawn_assets` are those that randomizers choose from; their files are read on `host`'s threads.
/// Throws Error(Asset) when a file of an asset cannot be read.
DatasetInfo describe_dataset(const Job& job, const CapturePlan& plan, std::string resolved,
                             std::string program_version,
                             std::vector<std::pair<std::string, std::string>> plugin_versions,
                             const std::vector<std::string>& drawn_assets,
                             const AssetFiles& files_of,
                             const std::optional<std::filesystem::path>& assets_root, Host& host);

/// The text of dataset.json: conventions, seed, resolved job, plugin versions, and the hashes of
/// all files of the assets that the job uses. Holds nothing that depends on the machine or the
/// time: same job, same text.
std::string dataset_json(const DatasetInfo& info, const Job& job);

/// The asset as a job would name it: files below the assets root without the root.
std::string asset_name(std::string_view asset,
                       const std::optional<std::filesystem::path>& assets_root);

/// The plan for people: captures, environments, spawned objects with labels and gravity,
/// randomizers with their ranges, cameras, writers, parameters as the job gives them. Stable, so
/// that tests can pin it.
std::string plan_text(const CapturePlan& plan, const Job& job,
                      const std::optional<std::filesystem::path>& assets_root);

}  // namespace diorama
