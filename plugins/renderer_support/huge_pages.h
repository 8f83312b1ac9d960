// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <memory>
#include <type_traits>

#include "spare_pages.h"

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
    std::size_t size = count * sizeof(Value);
    Value* const values = static_cast<Value*>(SparePages::take(size));
    values_ = {values, Give{size}};
  }

  Value* data() const { return values_.get(); }
  std::size_t size() const { return count_; }

 private:
  struct Give {
    std::size_t size = 0;  // bytes of the block
    void operator()(Value* values) const { SparePages::give(values, size); }
  };
  std::unique_ptr<Value[], Give> values_;
  std::size_t count_ = 0;
};

}  // namespace diorama
