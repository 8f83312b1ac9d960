// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/reader.h"

namespace diorama {

/// Opens folders of Replicator's BasicWriter, in all three layouts and with colours or raw ids. The
/// camera of a render product "rp_NAME" is NAME. Objects are told apart by their paths; ids in the
/// frames are the reader's own where pictures show colours. Of visibility the format holds shares,
/// so counts of pixels follow from them and are exact only where an object is in sight.
class BasicReader final : public Reader {
 public:
  struct Params {
    void visit(ParamVisitor&) {}
  };

  BasicReader(Params, Host& host) : host_(host) {}

  std::vector<std::string> patterns() const override;
  Recognition recognise(const std::filesystem::path& folder) const override;
  std::unique_ptr<const StoredDataset> open(const std::filesystem::path& folder) const override;

 private:
  const Host& host_;
};

}  // namespace diorama
