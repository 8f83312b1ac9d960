// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "diorama/host.h"
#include "diorama/writer.h"
#include "framework/host/host_services.h"
#include "framework/pipeline/capture_memory.h"
#include "framework/pipeline/capture_plan.h"
#include "framework/pipeline/job.h"
#include "framework/pipeline/pipeline.h"
#include "framework/plugins/registry.h"

namespace diorama {

/// A job ready to run. Components must not outlive the registry and the host.
struct JobAssembly {
  Job job;
  Value resolved;  ///< See resolved_job().
  JobComponents components;
  CapturePlan plan;
  DatasetInfo dataset;
  std::string dataset_json;
};

/// Gives the parameters of the registry's components to resolved_job().
DescribeComponent describe_from(Registry& registry);

/// Reads the job, makes its components to check their parameters and returns it with every default.
/// Assets need not be there: what a component misses becomes a warning. All diagnostics come in one
/// Error(Config).
Value check_job(const Value& job, Registry& registry, Host& host);

/// A plan needs no description of the dataset, for which every file of every asset is read. A trial
/// has one that names no files. For the tables that writers make of records, there are no renderer,
/// physics or annotators besides, as these open devices.
enum class AssembleFor { Plan, Tables, Trial, Run };

/// Reads the job, makes its components, lists its assets, plans its captures and resolves what its
/// writers need. The host gets the job's loaders. Nothing is loaded or written. All diagnostics
/// about the file come in one Error (Config); then Error(Plugin), Error(Asset) as found. For a run
/// there are sets of components for `visits_in_flight` visits at a time; 0: for
/// default_visits_in_flight(). Never for more than the job has.
JobAssembly assemble_job(const Value& job, Registry& registry, HostServices& host,
                         const std::optional<std::filesystem::path>& assets_root,
                         const std::string& program_version, AssembleFor purpose,
                         int visits_in_flight = 0);

/// How many visits a run of it makes at a time when so many are asked for; 0: as
/// default_visits_in_flight() says.
int visits_at_a_time(const JobAssembly& assembly, const HostServices& host, int asked = 0);

/// Of the job's cameras and what its writers need.
CaptureMemory memory_of(const JobAssembly& assembly);

/// Where the dataset goes.
OutputFolders output_folders(const Job& job);

}  // namespace diorama
