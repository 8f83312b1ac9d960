// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <string_view>
#include <tuple>

#include "diorama/material.h"

namespace diorama {

/// Pictures that somebody still has: what assets share, and all times of an animated one do, is
/// decoded once. Any thread may ask.
class PicturePool {
 public:
  using Decode = std::function<std::shared_ptr<const Texture>()>;

  /// What was made of the same bytes under the same name, else what `decode` makes now.
  std::shared_ptr<const Texture> get(std::span<const std::byte> bytes, std::string_view name,
                                     const Decode& decode);

 private:
  using Key =
      std::tuple<std::string, std::size_t, std::size_t>;  ///< Name, size, hash of the bytes.

  std::mutex mutex_;
  std::map<Key, std::weak_ptr<const Texture>> pictures_;
  std::size_t next_sweep_ = 64;
};

}  // namespace diorama
