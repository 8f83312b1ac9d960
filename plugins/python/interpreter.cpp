// SPDX-License-Identifier: Apache-2.0
#include "python/interpreter.h"

#include <dlfcn.h>

#include <filesystem>
#include <mutex>

#include "diorama/headers_digest.h"

namespace py = pybind11;
namespace fs = std::filesystem;

namespace diorama {
namespace {

/// Of the package of this build: beside the plugins of a build tree, else where Debian's
/// interpreter has its packages, below the same root. Empty: the interpreter has to find it.
fs::path package_folder() {
  Dl_info info{};
  if (dladdr(reinterpret_cast<const void*>(&start_python), &info) == 0) return {};
  const fs::path here = fs::absolute(info.dli_fname).parent_path();
  for (const char* place :
       {"../python", "../../python3/dist-packages", "../../../python3/dist-packages"}) {
    const fs::path folder = (here / place).lexically_normal();
    std::error_code ignored;
    if (fs::exists(folder / "diorama/plugins.py", ignored)) return folder;
  }
  return {};
}

/// Plugins are loaded with symbols of their own, but modules of Debian's Python find those of the
/// interpreter among the global ones.
void make_symbols_global() {
  Dl_info info{};
  if (dladdr(reinterpret_cast<const void*>(&Py_InitializeFromConfig), &info) == 0) return;
  dlopen(info.dli_fname, RTLD_NOLOAD | RTLD_NOW | RTLD_GLOBAL);
}

void initialize() {
  make_symbols_global();
  PyConfig config;
  PyConfig_InitPythonConfig(&config);
  // Ctrl-C is the program's.
  config.install_signal_handlers = 0;
  // Whose packages are meant, whatever python3 the PATH has first.
  PyStatus status = PyConfig_SetString(&config, &config.program_name, DIORAMA_PYTHON_PROGRAM);
  if (PyStatus_Exception(status) == 0) status = Py_InitializeFromConfig(&config);
  PyConfig_Clear(&config);
  if (PyStatus_Exception(status) != 0) {
    throw Error(ErrorKind::Plugin, std::string("the Python interpreter does not start: ") +
                                       (status.err_msg != nullptr ? status.err_msg : "no reason"));
  }
  const fs::path folder = package_folder();
  if (!folder.empty()) py::module_::import("sys").attr("path").attr("insert")(0, folder.string());
  PyEval_SaveThread();
}

}  // namespace

void start_python() {
  static std::mutex mutex;
  const std::lock_guard lock(mutex);
  if (Py_IsInitialized() == 0) initialize();
  const py::gil_scoped_acquire python;
  try {
    const py::object native = py::module_::import("diorama").attr("_diorama");
    if (native.attr("HEADERS").cast<std::uint64_t>() != DIORAMA_HEADERS_DIGEST) {
      throw Error(ErrorKind::Plugin,
                  "the Python package " + native.attr("__file__").cast<std::string>() +
                      " is of another build of Diorama; install python3-diorama of this one");
    }
    plugins_module();
  } catch (const py::error_already_set& error) {
    throw Error(ErrorKind::Plugin,
                std::string("the Python package diorama (python3-diorama, with python3-numpy) "
                            "cannot be imported: ") +
                    error.what());
  }
}

py::module_ plugins_module() { return py::module_::import("diorama.plugins"); }

std::string message_of(const py::error_already_set& error, const std::string& file) {
  // Python itself does so only where Python code catches it.
  if (error.trace()) PyException_SetTraceback(error.value().ptr(), error.trace().ptr());
  try {
    return plugins_module().attr("_say")(error.value(), file).cast<std::string>();
  } catch (const py::error_already_set&) {
    return file + ": " + error.what();
  }
}

}  // namespace diorama
