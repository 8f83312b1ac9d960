// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

namespace diorama {

/// What one picture after the other is made with, and may be dear to make: as many as were needed
/// at a time, however many threads take turns. Thread-safe.
template <class T>
class IdleObjects {
 public:
  /// An object for one user, which goes back when that ends.
  class Lease {
   public:
    explicit Lease(IdleObjects& from) : from_(from), object_(from.take()) {}
    ~Lease() { from_.give(std::move(object_)); }
    Lease(const Lease&) = delete;
    Lease& operator=(const Lease&) = delete;
    T* operator->() { return object_.get(); }

   private:
    IdleObjects& from_;
    std::unique_ptr<T> object_;
  };

 private:
  std::unique_ptr<T> take() {
    const std::lock_guard lock(mutex_);
    if (idle_.empty()) {
      idle_.reserve(++made_);  // so that give() cannot fail
      return std::make_unique<T>();
    }
    std::unique_ptr<T> object = std::move(idle_.back());
    idle_.pop_back();
    return object;
  }
  void give(std::unique_ptr<T> object) {
    const std::lock_guard lock(mutex_);
    idle_.push_back(std::move(object));
  }

  std::mutex mutex_;
  std::vector<std::unique_ptr<T>> idle_;
  std::size_t made_ = 0;
};

}  // namespace diorama
