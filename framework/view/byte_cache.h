// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>

namespace diorama {

/// Values by key up to a number of bytes; those that were not asked for the longest go first.
/// Several threads may call it.
template <class Value>
class ByteCache {
 public:
  explicit ByteCache(std::size_t most_bytes) : most_(most_bytes) {}

  /// Null when it is not there.
  std::shared_ptr<const Value> find(std::string_view key) {
    const std::lock_guard lock(mutex_);
    const auto found = places_.find(key);
    if (found == places_.end()) return nullptr;
    entries_.splice(entries_.begin(), entries_, found->second);
    return entries_.front().value;
  }

  /// Larger ones than all that there is room for are not kept.
  void add(const std::string& key, std::shared_ptr<const Value> value, std::size_t bytes) {
    const std::lock_guard lock(mutex_);
    if (bytes > most_ || places_.contains(key)) return;
    entries_.push_front({key, std::move(value), bytes});
    places_.emplace(key, entries_.begin());
    for (used_ += bytes; used_ > most_; entries_.pop_back()) {
      used_ -= entries_.back().bytes;
      places_.erase(entries_.back().key);
    }
  }

 private:
  struct Entry {
    std::string key;
    std::shared_ptr<const Value> value;
    std::size_t bytes = 0;
  };
  std::mutex mutex_;
  std::size_t most_;
  std::size_t used_ = 0;
  std::list<Entry> entries_;  ///< The last used first.
  std::map<std::string, typename std::list<Entry>::iterator, std::less<>> places_;
};

}  // namespace diorama
