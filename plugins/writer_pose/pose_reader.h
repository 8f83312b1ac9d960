// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/reader.h"

namespace diorama {

/// Opens folders of Replicator's PoseWriter, in its three layouts: a JSON file of objects beside
/// each picture, in one folder or in one per camera. The camera of a render product "rp_NAME" is
/// NAME; in one folder cameras take turns as metadata.txt says, or a run's dataset.json there or
/// above, else each picture is a capture. Datasets with the reference's swapped camera poses
/// are told by looking at them, and read by their own rules. DOPE's layout holds neither sizes nor
/// scales, so no 3-D boxes.
class PoseReader final : public Reader {
 public:
  struct Params {
    void visit(ParamVisitor&) {}
  };

  PoseReader(Params, Host& host) : host_(host) {}

  std::vector<std::string> patterns() const override;
  Recognition recognise(const std::filesystem::path& folder) const override;
  std::unique_ptr<const StoredDataset> open(const std::filesystem::path& folder) const override;

 private:
  const Host& host_;
};

}  // namespace diorama
