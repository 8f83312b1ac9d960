// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <pybind11/pybind11.h>

#include <string>
#include <utility>

#include "diorama/host.h"

namespace diorama {

/// Starts the interpreter unless the process has one, and imports diorama.plugins of the package of
/// the same build. Any thread, any number of times. Throws Error(Plugin).
void start_python();

/// The module diorama.plugins. With the interpreter's lock held.
pybind11::module_ plugins_module();

/// "stack.py:31: ZeroDivisionError: division by zero". With the lock held.
std::string message_of(const pybind11::error_already_set& error, const std::string& file);

/// What the package `diorama` takes out by held() of framework/python/capsule.h. With the lock
/// held.
template <class T>
pybind11::capsule capsule_of(T& object, const char* name) {
  return pybind11::capsule(static_cast<const void*>(&object), name);
}

/// Calls with the lock held. What Python throws becomes Error(Plugin) with file and line; Stopped
/// passes as such.
template <class Call>
auto call_python(const std::string& file, Host& host, Call&& call) {
  const pybind11::gil_scoped_acquire lock;
  try {
    return std::forward<Call>(call)();
  } catch (const pybind11::error_already_set& error) {
    host.stop_if_asked();
    throw Error(ErrorKind::Plugin, message_of(error, file));
  } catch (const pybind11::cast_error& error) {
    throw Error(ErrorKind::Plugin, file + ": " + error.what());
  }
}

/// A Python object that any thread may let go.
class SharedObject {
 public:
  SharedObject() = default;
  explicit SharedObject(pybind11::object object) : object_(std::move(object)) {}
  SharedObject(SharedObject&&) = default;
  SharedObject& operator=(SharedObject&&) = default;
  ~SharedObject() {
    if (!object_) return;
    const pybind11::gil_scoped_acquire lock;
    object_ = {};
  }
  const pybind11::object& get() const { return object_; }

 private:
  pybind11::object object_;
};

}  // namespace diorama
