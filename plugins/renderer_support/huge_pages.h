// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/mman.h>

#include <cstddef>
#include <cstdlib>
#include <memory>
#include <new>
#include <type_traits>

namespace diorama {

/// Room for many numbers or plain structures, in huge pages where the system has some: to map small
/// ones takes as long as a pass over them. Without values until they are written.
template <class Value>
class HugePages {
 public:
  static_assert(std::is_trivially_destructible_v<Value>);
  HugePages() = default;
  explicit HugePages(std::size_t count) : count_(count) {
    if (count == 0) return;
    constexpr std::size_t kHugePage = std::size_t(1) << 21;
    const std::size_t size = (count * sizeof(Value) + kHugePage - 1) / kHugePage * kHugePage;
    values_.reset(static_cast<Value*>(std::aligned_alloc(kHugePage, size)));
    if (!values_) throw std::bad_alloc();
    madvise(values_.get(), size, MADV_HUGEPAGE);
  }

  Value* data() const { return values_.get(); }
  std::size_t size() const { return count_; }

 private:
  struct Free {
    void operator()(Value* values) const { std::free(values); }
  };
  std::unique_ptr<Value[], Free> values_;
  std::size_t count_ = 0;
};

}  // namespace diorama
