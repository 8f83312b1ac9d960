// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/reader.h"

namespace diorama {

/// Opens Pascal VOC folders: Annotations, JPEGImages (else what `folder` says, or beside the
/// annotations), ImageSets/Main, SegmentationObject and SegmentationClass, in gray or in VOC's
/// palette. Where objects and pictures are paired by place, the n-th object has the value n.
class VocReader final : public Reader {
 public:
  struct Params {
    void visit(ParamVisitor&) {}
  };

  VocReader(Params, Host& host) : host_(host) {}

  std::vector<std::string> patterns() const override;
  Recognition recognise(const std::filesystem::path& folder) const override;
  std::unique_ptr<const StoredDataset> open(const std::filesystem::path& folder) const override;

 private:
  const Host& host_;
};

}  // namespace diorama
