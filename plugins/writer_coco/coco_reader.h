// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/reader.h"

namespace diorama {

/// Opens COCO folders: annotations/instances_SPLIT.json (else what JSON files hold images and
/// annotations), with pictures in images/SPLIT, SPLIT, images or beside the file. Images that name
/// capture and camera, as our writer's do, are put together again; any other image is a capture.
/// Masks may be run lengths or polygons. The id of an instance is its track_id, if any, plus 1
/// where others than our writer may count tracks from 0. Annotation files are walked through once
/// and then read piece by piece: memory grows by some tens of bytes per image and annotation.
class CocoReader final : public Reader {
 public:
  struct Params {
    void visit(ParamVisitor&) {}
  };

  CocoReader(Params, Host& host) : host_(host) {}

  std::vector<std::string> patterns() const override;
  Recognition recognise(const std::filesystem::path& folder) const override;
  std::unique_ptr<const StoredDataset> open(const std::filesystem::path& folder) const override;

 private:
  const Host& host_;
};

}  // namespace diorama
