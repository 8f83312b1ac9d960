// SPDX-License-Identifier: Apache-2.0
#include "loader_support/missing_pictures.h"

#include <algorithm>

namespace diorama::loader_support {

void MissingPictures::add(const std::string& picture, const std::string& what,
                          const std::string& material) {
  const auto [entry, is_new] = missing_.try_emplace(picture, Missing{what, {}});
  if (is_new) order_.push_back(picture);
  std::vector<std::string>& users = entry->second.materials;
  if (material.empty() || std::ranges::find(users, material) != users.end()) return;
  users.push_back(material);
}

std::vector<std::string> MissingPictures::lines() const {
  std::vector<std::string> result;
  for (const std::string& picture : order_) {
    const auto& [what, users] = missing_.at(picture);
    std::string line = what;
    for (std::size_t i = 0; i < users.size(); ++i) {
      line += i > 0 ? ", " : users.size() == 1 ? " (material " : " (materials ";
      line += '\'' + users[i] + '\'';
    }
    if (!users.empty()) line += ')';
    result.push_back(std::move(line));
  }
  return result;
}

}  // namespace diorama::loader_support
