// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/host.h"
#include "diorama/params.h"
#include "diorama/reader.h"

namespace diorama {

/// Opens folders of MOT Challenge sequences, right below the dataset or one folder deeper. Of
/// others than our writer's each frame of each sequence is a capture, each sequence a clip; lines
/// that say 0 where ours say 1 are no objects, and classes are called by their numbers. The id of
/// an instance is its track.
class MotReader final : public Reader {
 public:
  struct Params {
    void visit(ParamVisitor&) {}
  };

  MotReader(Params, Host& host) : host_(host) {}

  std::vector<std::string> patterns() const override;
  Recognition recognise(const std::filesystem::path& folder) const override;
  std::unique_ptr<const StoredDataset> open(const std::filesystem::path& folder) const override;

 private:
  const Host& host_;
};

}  // namespace diorama
