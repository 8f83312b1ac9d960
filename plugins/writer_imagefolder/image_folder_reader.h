// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/reader.h"

namespace diorama {

/// Opens image folders of Hugging Face Datasets: metadata.jsonl or metadata.csv beside the
/// pictures, or one folder of pictures per class, both right in the folder or in one folder per
/// split. Objects are read from `objects` with bbox and categories, else the picture is of a class
/// (label, class ...) or of its folder's. Pictures of our own writer say capture and camera in
/// their names; any other is a capture. Metadata are walked through once and then read line by
/// line.
class ImageFolderReader final : public Reader {
 public:
  struct Params {
    void visit(ParamVisitor&) {}
  };

  ImageFolderReader(Params, Host& host) : host_(host) {}

  std::vector<std::string> patterns() const override;
  Recognition recognise(const std::filesystem::path& folder) const override;
  std::unique_ptr<const StoredDataset> open(const std::filesystem::path& folder) const override;

 private:
  const Host& host_;
};

}  // namespace diorama
