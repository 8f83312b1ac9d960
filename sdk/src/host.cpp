// SPDX-License-Identifier: Apache-2.0
#include "diorama/host.h"

namespace diorama {

Stopped::Stopped() : Error(ErrorKind::Internal, "stopped before its end") {}
Stopped::~Stopped() = default;

Host::~Host() = default;

bool Host::stop_requested() const { return false; }

void Host::stop_if_asked() const {
  if (stop_requested()) throw Stopped();
}

}  // namespace diorama
