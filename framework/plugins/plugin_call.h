// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <exception>
#include <new>
#include <string>
#include <utility>

#include "diorama/host.h"
#include "framework/plugins/fatal_end.h"

namespace diorama {

/// Calls into a component and puts `who` ("renderer 'embree'") in front of what it throws. An Error
/// keeps its kind; memory shortage and Stopped pass unchanged; any other exception becomes
/// Error(Plugin). Should the process crash or exit in there, its last line names `who`.
template <class Call>
decltype(auto) call_component(const std::string& who, Call&& call) {
  const AtWork at_work(who);
  try {
    return std::forward<Call>(call)();
  } catch (const Stopped&) {
    throw;
  } catch (const Error& error) {
    throw Error(error.kind(), who + ": " + error.what());
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& error) {
    throw Error(ErrorKind::Plugin, who + ": unexpected error: " + error.what());
  } catch (...) {
    throw Error(ErrorKind::Plugin, who + ": threw something that is no std::exception");
  }
}

}  // namespace diorama
