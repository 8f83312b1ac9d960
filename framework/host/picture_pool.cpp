// SPDX-License-Identifier: Apache-2.0
#include "framework/host/picture_pool.h"

#include <algorithm>
#include <utility>

namespace diorama {

std::shared_ptr<const Texture> PicturePool::get(std::span<const std::byte> bytes,
                                                std::string_view name, const Decode& decode) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  Key key(name, bytes.size(), std::hash<std::string_view>{}(text));
  {
    const std::lock_guard lock(mutex_);
    const auto known = pictures_.find(key);
    if (known != pictures_.end()) {
      if (auto picture = known->second.lock()) return picture;
    }
  }
  // Outside the lock: threads decode side by side.
  auto picture = decode();
  const std::lock_guard lock(mutex_);
  if (pictures_.size() >= next_sweep_) {
    std::erase_if(pictures_, [](const auto& entry) { return entry.second.expired(); });
    next_sweep_ = std::max<std::size_t>(64, 2 * pictures_.size());
  }
  pictures_[std::move(key)] = picture;
  return picture;
}

}  // namespace diorama
