// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/reader.h"

namespace diorama {

/// Opens datasets of the BOP benchmark: the whole, a split, or one scene. Tables and pictures that
/// a scene does not have are not held; test images of the benchmark come without poses. An image id
/// of a scene is a capture, cameras that share a scene are told by their suffixes; our writer's
/// page says which scene is which camera. Objects are called by objects.json, else "obj_000005".
/// Lengths become metres, axes ours; without cam_R_w2c the world is the camera's space. Tables are
/// walked through once and then read piece by piece.
class BopReader final : public Reader {
 public:
  struct Params {
    void visit(ParamVisitor&) {}
  };

  BopReader(Params, Host& host) : host_(host) {}

  std::vector<std::string> patterns() const override;
  Recognition recognise(const std::filesystem::path& folder) const override;
  std::unique_ptr<const StoredDataset> open(const std::filesystem::path& folder) const override;

 private:
  const Host& host_;
};

}  // namespace diorama
