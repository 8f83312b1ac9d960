// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/reader.h"

namespace diorama {

/// Opens YOLO folders by the rules of Ultralytics: data.yaml (or dataset.yaml) names classes and
/// the folders or lists of pictures; without one, images/SPLIT, SPLIT/images and images are looked
/// through. A picture's labels lie where "images" in its path is "labels"; a picture without any is
/// one without objects. Lines are boxes, boxes with key points, polygons or rotated boxes. Polygons
/// become masks; of rotated boxes and key points only the upright box is kept.
class YoloReader final : public Reader {
 public:
  struct Params {
    void visit(ParamVisitor&) {}
  };

  YoloReader(Params, Host& host) : host_(host) {}

  std::vector<std::string> patterns() const override;
  Recognition recognise(const std::filesystem::path& folder) const override;
  std::unique_ptr<const StoredDataset> open(const std::filesystem::path& folder) const override;

 private:
  const Host& host_;
};

}  // namespace diorama
