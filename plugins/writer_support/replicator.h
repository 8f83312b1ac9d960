// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "diorama/frame.h"
#include "diorama/params.h"
#include "diorama/writer.h"

/// Names and files that the Replicator writers have in common.
namespace diorama {

/// "rp_cam_0".
std::string render_product_name(const Frame& frame);

/// `number` with at least `padding` digits.
std::string padded(int number, int padding);
/// `padding`, or more where the numbers 0 ... count - 1 need it, so that names sort like numbers.
int grown_padding(int padding, int count);

/// Adds metadata.txt; with the names of cameras that take turns in one folder, which the reference
/// does not say.
void add_replicator_metadata(std::string_view writer, std::string_view version,
                             const DatasetInfo& dataset, DatasetFiles& files,
                             const std::vector<std::string>& cameras = {});

/// Parameters of Replicator writers that stand for places which Diorama does not write to. They may
/// be given as null, as generated files have them.
struct RemoteOutput {
  std::optional<std::string> s3_bucket;
  std::optional<std::string> s3_region;
  std::optional<std::string> s3_endpoint;
  std::optional<std::string> backend;

  void visit(ParamVisitor& v);
  /// Throws Error(Config) when one of them is set.
  void check() const;
};

}  // namespace diorama
