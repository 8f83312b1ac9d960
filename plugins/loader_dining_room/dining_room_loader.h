// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "diorama/host.h"
#include "diorama/loader.h"
#include "diorama/params.h"

namespace diorama::dining_room {

/// Serves "dining_room:<seed>". The room is named and structured as Infinigen's exporter does it,
/// so that rules written for exported rooms fit generated ones too.
class DiningRoomLoader final : public Loader {
 public:
  struct Params {
    std::uint64_t first_seed = 1;
    int count = 1;
    void visit(ParamVisitor& v) {
      v.param("first_seed", first_seed, {"Seed of the first room; the others follow by one."});
      v.param("count", count, {"How many rooms.", "", 1, 1000000});
    }
  };

  DiningRoomLoader(Params params, Host& host);

  std::vector<std::string> claims() const override;
  std::vector<std::string> assets() const override;
  void load(std::string_view asset, Scene& scene, NodeId root) override;

 private:
  Params params_;
  Host& host_;
};

}  // namespace diorama::dining_room
