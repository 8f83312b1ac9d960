// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/reader.h"

namespace diorama {

/// Opens folders of Replicator's DataVisualizationWriter. Pictures with boxes drawn over them give
/// no data back: frames have their size alone, and a frame without objects has no picture. What is
/// there is checked.
class DataVisualizationReader final : public Reader {
 public:
  struct Params {
    void visit(ParamVisitor&) {}
  };

  DataVisualizationReader(Params, Host& host) : host_(host) {}

  std::vector<std::string> patterns() const override;
  Recognition recognise(const std::filesystem::path& folder) const override;
  std::unique_ptr<const StoredDataset> open(const std::filesystem::path& folder) const override;

 private:
  const Host& host_;
};

}  // namespace diorama
