// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/reader.h"

namespace diorama {

/// Opens tar shards of WebDataset, right in the folder or one level below. Members that follow each
/// other with one name up to the first dot are a sample; what stands behind the dot says what a
/// member is: png, jpg ... (or image.png, rgb.jpg) a picture, json what our writer says or objects
/// with `bbox`, cls or json's label a class, NAME.npy an array. Samples of our own writer say
/// capture and camera in their names; any other is a capture. Opening goes from header to header;
/// some tens of bytes per sample are kept. Shards may be packed by gzip: opening unpacks them once,
/// and remembers places from which it goes on for a sample (32 MiB of memory at most).
class WebDatasetReader final : public Reader {
 public:
  struct Params {
    void visit(ParamVisitor&) {}
  };

  WebDatasetReader(Params, Host& host) : host_(host) {}

  std::vector<std::string> patterns() const override;
  Recognition recognise(const std::filesystem::path& folder) const override;
  std::unique_ptr<const StoredDataset> open(const std::filesystem::path& folder) const override;

 private:
  const Host& host_;
};

}  // namespace diorama
