// SPDX-License-Identifier: Apache-2.0
#include "loader_dining_room/dining_room_loader.h"

#include <charconv>

#include "loader_dining_room/dining_room.h"

namespace diorama::dining_room {
namespace {
constexpr std::string_view kScheme = "dining_room:";

std::uint64_t seed_of(std::string_view asset) {
  const std::string_view digits = asset.substr(kScheme.size());
  std::uint64_t seed = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), seed);
  if (error != std::errc() || end != digits.data() + digits.size()) {
    throw Error(ErrorKind::Asset, std::string(asset) +
                                      ": expected dining_room:SEED with a seed in "
                                      "[0, 18446744073709551615], found '" +
                                      std::string(digits) + "'");
  }
  return seed;
}
}  // namespace

DiningRoomLoader::DiningRoomLoader(Params params, Host& host) : params_(params), host_(host) {}

std::vector<std::string> DiningRoomLoader::claims() const { return {std::string(kScheme)}; }

std::vector<std::string> DiningRoomLoader::assets() const {
  std::vector<std::string> rooms;
  for (int i = 0; i < params_.count; ++i) {
    rooms.push_back(std::string(kScheme) + std::to_string(params_.first_seed + std::uint64_t(i)));
  }
  return rooms;
}

void DiningRoomLoader::load(std::string_view asset, Scene& scene, NodeId root) {
  build_dining_room(seed_of(asset), host_, scene, root);
}

}  // namespace diorama::dining_room
