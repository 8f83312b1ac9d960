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

/// What a host must know of a component before it makes one; words separated by blanks.
struct Listing {
  const char* claims = "";  ///< Loaders: what claims() returns.
  const char* needs = "";   ///< Annotators: what needs() returns with the default parameters ...
  /// ... and what provides() does: at least one name, or "*" where only the parameters tell.
  const char* provides = "";
};

/// One component type, as data. Everything a host needs to list, check and make it. What it points
/// at must stay until the process ends: literals, or what the library keeps for ever.
struct ComponentInfo {
  ComponentKind kind;
  const char* type;  ///< Key in job files.
  const char* help;  ///< One sentence.
  Listing listing;
  const void* context;  ///< Handed to both functions: what tells types apart that share them.
  std::vector<ParamSpec> (*describe)(const void* context);
  /// Reads `params` (keys in `also_known` are the host's); diagnostics are collected, and no
  /// component is made when there are any (null).
  std::unique_ptr<Component> (*make)(const void* context, const Value& params,
                                     const std::string& path,
                                     std::span<const std::string_view> also_known,
                                     Diagnostics& diagnostics, Host& host);
};

class DIORAMA_SDK_API Registrar {
 public:
  virtual ~Registrar();
  virtual void add(const ComponentInfo& info) = 0;
};

namespace detail {

/// `make_params(context)` gives the parameters with their defaults.
template <class T, class MakeParams>
ComponentInfo info_of(const char* type, const char* help, const Listing& listing,
                      const void* context, MakeParams) {
  auto describe = [](const void* about) {
    auto params = MakeParams()(about);
    ParamLister lister;
    params.visit(lister);
    return lister.take();
  };
  auto make = [](const void* about, const Value& map, const std::string& path,
                 std::span<const std::string_view> also_known, Diagnostics& diagnostics,
                 Host& host) -> std::unique_ptr<Component> {
    auto params = MakeParams()(about);
    const std::size_t before = diagnostics.messages().size();
    ParamReader reader(map, path, diagnostics);
    params.visit(reader);
    reader.finish(also_known);
    if (diagnostics.messages().size() != before) return nullptr;
    return std::make_unique<T>(std::move(params), host);
  };
  return {T::kKind, type, help, listing, context, describe, make};
}

}  // namespace detail

/// Registers T, which has `struct Params` with visit() and is constructed as T(Params, Host&).
template <class T>
void add(Registrar& registrar, const char* type, const char* help, const Listing& listing = {}) {
  const auto make_params = [](const void*) { return typename T::Params(); };
  registrar.add(detail::info_of<T>(type, help, listing, nullptr, make_params));
}

/// Registers one of many types that share a class and are known at run time only, such as scripts
/// in a folder; the library says DIORAMA_LEARNS_TYPES(). Params are constructed from `context`, may
/// remember it and declare other parameters for each. Strings and context must live for ever.
template <class T, class Context>
void add(Registrar& registrar, const char* type, const char* help, const Listing& listing,
         const Context& context) {
  const auto make_params = [](const void* about) {
    return typename T::Params(*static_cast<const Context*>(about));
  };
  registrar.add(detail::info_of<T>(type, help, listing, &context, make_params));
}

}  // namespace diorama

/// The facts that the host checks. Plain bytes without pointers: the same struct stands in the ELF
/// section ".diorama_plugin", which the host reads from the file before it loads any code.
/// `magic`, `descriptor_size` and `abi` keep their places for ever.
struct DioramaPluginDescriptor {
  char magic[8];  // "DIORAMA" and NUL
  std::uint32_t descriptor_size;
  std::uint32_t abi;      // DIORAMA_SDK_ABI
  std::uint64_t layout;   // diorama::abi::kLayout
  std::uint64_t headers;  // DIORAMA_HEADERS_DIGEST
  char abi_tag[160];      // DIORAMA_ABI_TAG
  char name[64];
  char version[32];
  char licence[64];  // SPDX expression
  char build[96];    // compiler, for messages only
};

/// One component as the library file lists it, in the ELF section ".diorama_components": the host
/// lists components, finds loaders and chooses annotators without loading the library and all that
/// it links.
struct DioramaComponentEntry {
  std::uint32_t kind;  // diorama::ComponentKind, or kDioramaLearnsTypes
  std::uint32_t reserved;
  char type[56];
  char help[256];
  char claims[256];  // as in diorama::Listing
  char needs[256];
  char provides[256];
};
static_assert(sizeof(DioramaComponentEntry) % 64 == 0, "entries follow each other without gaps");

/// Kind of the entry that stands for types that only the library's code knows.
inline constexpr std::uint32_t kDioramaLearnsTypes = 0xFFFFFFFFu;

/// Registers T and lists it in the library file. Goes into the body of DIORAMA_PLUGIN.
#define DIORAMA_ADD(T, TYPE, HELP)                                         \
  do {                                                                     \
    static_assert(T::kKind != diorama::ComponentKind::Annotator,           \
                  "annotators are registered with DIORAMA_ADD_ANNOTATOR"); \
    DIORAMA_DETAIL_ADD(T, TYPE, HELP, "", "", "");                         \
  } while (false)
/// The same for a loader; CLAIMS is what its claims() returns, separated by blanks: ".obj .ply".
#define DIORAMA_ADD_LOADER(T, TYPE, HELP, CLAIMS) DIORAMA_DETAIL_ADD(T, TYPE, HELP, CLAIMS, "", "")
/// The same for an annotator; NEEDS and PROVIDES are what its needs() and provides() return with
/// the default parameters, separated by blanks: "leaf_id position".
#define DIORAMA_ADD_ANNOTATOR(T, TYPE, HELP, NEEDS, PROVIDES) \
  DIORAMA_DETAIL_ADD(T, TYPE, HELP, "", NEEDS, PROVIDES)
/// Says that the library also registers types that it learns at run time. It is then loaded
/// whenever components are listed, which costs what its libraries cost.
#define DIORAMA_LEARNS_TYPES()                                    \
  do {                                                            \
    DIORAMA_DETAIL_LIST(kDioramaLearnsTypes, "", "", "", "", ""); \
  } while (false)

#define DIORAMA_DETAIL_LIST(KIND, ...)                                     \
  __attribute__((section(".diorama_components"),                           \
                 used)) static const DioramaComponentEntry diorama_entry { \
    KIND, 0, __VA_ARGS__                                                   \
  }
#define DIORAMA_DETAIL_ADD(T, TYPE, HELP, CLAIMS, NEEDS, PROVIDES)                     \
  do {                                                                                 \
    DIORAMA_DETAIL_LIST(std::uint32_t(T::kKind), TYPE, HELP, CLAIMS, NEEDS, PROVIDES); \
    diorama::add<T>(registrar, TYPE, HELP, {CLAIMS, NEEDS, PROVIDES});                 \
  } while (false)

/// The same for a reader; PATTERNS is what its patterns() returns: "data.yaml labels/*.txt".
#define DIORAMA_ADD_READER(T, TYPE, HELP, PATTERNS) DIORAMA_ADD_LOADER(T, TYPE, HELP, PATTERNS)

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
#define DIORAMA_PLUGIN(NAME, VERSION, LICENCE)                                          \
  __attribute__((section(".diorama_plugin"),                                            \
                 used)) static const DioramaPluginDescriptor diorama_plugin_descriptor{ \
      "DIORAMA",                                                                        \
      sizeof(DioramaPluginDescriptor),                                                  \
      DIORAMA_SDK_ABI,                                                                  \
      diorama::abi::kLayout,                                                            \
      DIORAMA_HEADERS_DIGEST,                                                           \
      DIORAMA_ABI_TAG,                                                                  \
      NAME,                                                                             \
      VERSION,                                                                          \
      LICENCE,                                                                          \
      DIORAMA_DETAIL_COMPILER};                                                         \
  static void diorama_register(diorama::Registrar& registrar);                          \
  extern "C" DIORAMA_SDK_API const DioramaPlugin* diorama_plugin() {                    \
    static const DioramaPlugin plugin{&diorama_plugin_descriptor, &diorama_register};   \
    return &plugin;                                                                     \
  }                                                                                     \
  static void diorama_register([[maybe_unused]] diorama::Registrar& registrar)
