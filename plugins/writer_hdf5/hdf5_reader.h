// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/reader.h"

namespace diorama {

/// Opens folders of HDF5 files with the data set names of BlenderProc, one picture each, right in
/// the folder or one level below. What a file lacks is not held. Without our writer's cam_K and
/// world_from_camera the camera is that of `cam_states`, else none; distances of 0 and above 1e9
/// are nothing, normals are in the camera's axes. Files of our own writer say capture and camera in
/// their names; any other is a capture, by the order of the numbers in their names.
class Hdf5Reader final : public Reader {
 public:
  struct Params {
    void visit(ParamVisitor&) {}
  };

  Hdf5Reader(Params, Host& host) : host_(host) {}

  std::vector<std::string> patterns() const override;
  Recognition recognise(const std::filesystem::path& folder) const override;
  std::unique_ptr<const StoredDataset> open(const std::filesystem::path& folder) const override;

 private:
  const Host& host_;
};

}  // namespace diorama
