// SPDX-License-Identifier: Apache-2.0
#include "framework/host/stoppable.h"

namespace diorama {
namespace {

thread_local const std::atomic<bool>* flag = nullptr;

}  // namespace

Stoppable::Stoppable(const std::atomic<bool>& stop) : before_(flag) { flag = &stop; }

Stoppable::~Stoppable() { flag = before_; }

const std::atomic<bool>* Stoppable::flag_of_this_thread() { return flag; }

}  // namespace diorama
