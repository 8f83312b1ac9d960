// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/reader.h"

namespace diorama {

/// Opens KITTI object folders: label_2, image_2, calib and, where there is one, depth_2, all below
/// training/ or at the top. The world is the camera's space; 3-D boxes are the upright ones of the
/// labels, in the space of camera 2. Lines of the class DontCare are areas without labels, no
/// objects; a sixteenth field, the score of a detector, is passed over.
///
/// Of tracking folders (label_02, image_02) sequences are clips, at the benchmark's 10 frames per
/// second where nobody says another rate; the id of an instance is its track, plus 1 where others
/// than our writer count tracks from 0.
class KittiReader final : public Reader {
 public:
  struct Params {
    void visit(ParamVisitor&) {}
  };

  KittiReader(Params, Host& host) : host_(host) {}

  std::vector<std::string> patterns() const override;
  Recognition recognise(const std::filesystem::path& folder) const override;
  std::unique_ptr<const StoredDataset> open(const std::filesystem::path& folder) const override;

 private:
  const Host& host_;
};

}  // namespace diorama
