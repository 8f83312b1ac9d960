// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "diorama/abi_layout.h"
#include "diorama/component.h"
#include "diorama/host.h"
#include "diorama/params.h"

namespace diorama {

/// One component type, as data. Everything a host needs to list, check and make it.
struct ComponentInfo {
  ComponentKind kind;
  const char* type;  ///< Key in job files.
  const char* help;  ///< One sentence.
  std::vector<ParamSpec> (*describe)();
  /// Reads `params` (keys in `also_known` are the host's); complaints are collected, and no component
  /// is made when there are any (null).
  std::unique_ptr<Component> (*make)(const Value& params, const std::string& path,
                                     std::span<const std::string_view> also_known,
                                     Complaints& complaints, Host& host);
};

class DIORAMA_SDK_API Registrar {
 public:
  virtual ~Registrar();
  virtual void add(const ComponentInfo& info) = 0;
};

/// Registers T, which has `struct Params` with visit() and is constructed as T(Params, Host&). The
/// strings must be literals.
template <class T>
void add(Registrar& registrar, const char* type, const char* help) {
  using Params = typename T::Params;
  auto describe = [] {
    Params params;
    ParamLister lister;
    params.visit(lister);
    return lister.take();
  };
  auto make = [](const Value& map, const std::string& path,
                 std::span<const std::string_view> also_known, Complaints& complaints,
                 Host& host) -> std::unique_ptr<Component> {
    Params params;
    const std::size_t before = complaints.messages().size();
    ParamReader reader(map, path, complaints);
    params.visit(reader);
    reader.finish(also_known);
    if (complaints.messages().size() != before) return nullptr;
    return std::make_unique<T>(std::move(params), host);
  };
  registrar.add({T::kKind, type, help, describe, make});
}

}  // namespace diorama

/// The facts that the host checks. Plain bytes without pointers: the same struct stands in the ELF
/// section ".diorama_plugin", which the host reads from the file before it loads any code.
/// `magic`, `descriptor_size` and `abi` keep their places for ever.
struct DioramaPluginDescriptor {
  char magic[8];  // "DIORAMA" and NUL
  std::uint32_t descriptor_size;
  std::uint32_t abi;       // DIORAMA_SDK_ABI
  std::uint64_t layout;    // diorama::abi::kLayout
  char abi_tag[160];       // DIORAMA_ABI_TAG
  char name[64];
  char version[32];
  char licence[64];        // SPDX expression
  char build[96];          // compiler, for messages only
};

/// One component as the library file lists it, in the ELF section ".diorama_components": the host
/// lists components and finds loaders without loading the library and all that it links.
struct DioramaComponentEntry {
  std::uint32_t kind;
  std::uint32_t reserved;
  char type[56];
  char help[256];
  char claims[256];  // loaders: endings and schemes, separated by blanks
};
static_assert(sizeof(DioramaComponentEntry) % 64 == 0, "entries follow each other without gaps");

/// Registers T and lists it in the library file. Goes into the body of DIORAMA_PLUGIN.
#define DIORAMA_ADD(T, TYPE, HELP) DIORAMA_ADD_LOADER(T, TYPE, HELP, "")
/// The same for a loader; CLAIMS is what its claims() returns, separated by blanks: ".obj .ply".
#define DIORAMA_ADD_LOADER(T, TYPE, HELP, CLAIMS)                                               \
  do {                                                                                          \
    __attribute__((section(".diorama_components"), used)) static const DioramaComponentEntry    \
        diorama_entry{std::uint32_t(T::kKind), 0, TYPE, HELP, CLAIMS};                          \
    diorama::add<T>(registrar, TYPE, HELP);                                                     \
  } while (false)

/// What the entry function returns.
struct DioramaPlugin {
  const DioramaPluginDescriptor* descriptor;
  void (*register_components)(diorama::Registrar&);
};

/// Makes a library a plugin; followed by the body of the registration function:
///
///     DIORAMA_PLUGIN("randomizers_core", "1.0.0", "Apache-2.0") {
///       DIORAMA_ADD(ScatterPoses, "scatter_poses", "Places nodes at random.");
///     }
#define DIORAMA_PLUGIN(NAME, VERSION, LICENCE)                                                  \
  __attribute__((section(".diorama_plugin"), used)) static const DioramaPluginDescriptor        \
      diorama_plugin_descriptor{"DIORAMA",           sizeof(DioramaPluginDescriptor),           \
                                DIORAMA_SDK_ABI,     diorama::abi::kLayout,                     \
                                DIORAMA_ABI_TAG,     NAME,                                      \
                                VERSION,             LICENCE,                                   \
                                "g++ " __VERSION__};                                            \
  static void diorama_register(diorama::Registrar& registrar);                                  \
  extern "C" DIORAMA_SDK_API const DioramaPlugin* diorama_plugin() {                            \
    static const DioramaPlugin plugin{&diorama_plugin_descriptor, &diorama_register};           \
    return &plugin;                                                                             \
  }                                                                                             \
  static void diorama_register([[maybe_unused]] diorama::Registrar& registrar)
