// SPDX-License-Identifier: Apache-2.0
#include "framework/plugins/on_demand_library.h"

#include <dlfcn.h>

#include <mutex>

#include "diorama/error.h"
#include "framework/plugins/plugin_search.h"

namespace diorama {
namespace {

struct Owner {
  std::mutex mutex;
  std::filesystem::path program;
};

Owner& owner() {
  static Owner the_owner;
  return the_owner;
}

std::filesystem::path owning_program() {
  const std::lock_guard lock(owner().mutex);
  return owner().program.empty() ? program_file() : owner().program;
}

}  // namespace

std::filesystem::path on_demand_folder(const std::filesystem::path& program) {
  const std::filesystem::path plugins = bundled_plugin_folder(program);
  return plugins.filename() == "plugins" ? plugins.parent_path() / "on_demand"
                                         : plugins.parent_path();
}

void use_on_demand_libraries_of(const std::filesystem::path& program) {
  const std::lock_guard lock(owner().mutex);
  owner().program = program;
}

void* on_demand_function(const std::string& name, const char* function) {
  const std::filesystem::path file = on_demand_folder(owning_program()) / (name + ".so");
  void* const library = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE);
  void* const found = library ? dlsym(library, function) : nullptr;
  if (found) return found;
  const char* const reason = dlerror();
  throw Error(ErrorKind::Plugin,
              file.string() +
                  ": cannot be loaded: " + (reason ? reason : "it is not what it should be") +
                  "; install all packages of Diorama that are needed, of one version");
}

}  // namespace diorama
