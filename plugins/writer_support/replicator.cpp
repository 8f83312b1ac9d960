// SPDX-License-Identifier: Apache-2.0
#include "writer_support/replicator.h"

#include <algorithm>

#include "diorama/error.h"
#include "writer_support/python_json.h"

namespace diorama {

std::string render_product_name(const Frame& frame) { return "rp_" + frame.camera_name; }

std::string padded(int number, int padding) {
  std::string text = std::to_string(number);
  const auto width = std::size_t(std::max(padding, 0));
  if (text.size() < width) text.insert(0, width - text.size(), '0');
  return text;
}

int grown_padding(int padding, int count) {
  return std::max(padding, int(std::to_string(std::max(count - 1, 0)).size()));
}

void add_replicator_metadata(std::string_view writer, std::string_view version,
                             const DatasetInfo& dataset, DatasetFiles& files,
                             const std::vector<std::string>& cameras) {
  // The colon inside the last key is what readers of such files know.
  Json metadata{{"name", writer}, {"version", version}, {"replicator_global_seed:", dataset.seed}};
  if (!cameras.empty()) metadata["cameras"] = cameras;
  files.add_text("metadata.txt", python_json(metadata));
}

void RemoteOutput::visit(ParamVisitor& v) {
  v.param("s3_bucket", s3_bucket, {"Accepted as null only: files go to the output folder."});
  v.param("s3_region", s3_region, {"Accepted as null only: files go to the output folder."});
  v.param("s3_endpoint", s3_endpoint, {"Accepted as null only: files go to the output folder."});
  v.param("backend", backend, {"Accepted as null only: files go to the output folder."});
}

void RemoteOutput::check() const {
  for (const auto& [name, value] : {std::pair{"s3_bucket", &s3_bucket},
                                    {"s3_region", &s3_region},
                                    {"s3_endpoint", &s3_endpoint},
                                    {"backend", &backend}}) {
    if (!*value) continue;
    throw Error(ErrorKind::Config, std::string(name) + ": found '" + **value +
                                       "'; files go to the output folder only, remove the key");
  }
}

}  // namespace diorama
