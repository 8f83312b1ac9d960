// SPDX-License-Identifier: Apache-2.0
#include "framework/plugins/plugin_library.h"

#include <dlfcn.h>

#include <algorithm>
#include <boost/dll/shared_library.hpp>
#include <cfenv>
#include <cstring>
#include <limits>
#include <set>
#include <utility>

#include "framework/plugins/plugin_call.h"

namespace diorama {
namespace {

constexpr const char* kEntry = "diorama_plugin";

[[noreturn]] void refuse(const PluginFile& file, const std::string& reason) {
  throw Error(ErrorKind::Plugin, file.file.string() + ": " + reason);
}

bool is_type_name(std::string_view type) {
  if (type.empty() || type.size() > 64) return false;
  return std::all_of(type.begin(), type.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
           c == '-';
  });
}

/// Takes what a plugin registers; checks each entry as it comes.
class Collector final : public Registrar {
 public:
  explicit Collector(const PluginFile& file) : file_(file) {}

  void add(const ComponentInfo& info) override {
    if (std::uint8_t(info.kind) > std::uint8_t(ComponentKind::Reader)) {
      refuse(file_, "registers a component of an unknown kind");
    }
    if (!info.type || !is_type_name(info.type)) {
      refuse(file_, "registers a " + std::string(kind_name(info.kind)) + " with the name '" +
                        (info.type ? info.type : "") +
                        "'; names have 1 to 64 letters, digits, '_' and '-'");
    }
    if (!info.help || !info.describe || !info.make) {
      refuse(file_, "registers '" + std::string(info.type) + "' without help or functions");
    }
    const Listing& listing = info.listing;
    if (!listing.claims || !listing.needs || !listing.provides) {
      refuse(file_, "registers '" + std::string(info.type) + "' with a listing that is null");
    }
    if (info.kind == ComponentKind::Annotator && !*listing.provides) {
      refuse(file_, "registers annotator '" + std::string(info.type) +
                        "' without what it provides; register it with DIORAMA_ADD_ANNOTATOR");
    }
    if (!seen_.emplace(info.kind, info.type).second) {
      refuse(file_,
             "registers " + std::string(kind_name(info.kind)) + " '" + info.type + "' twice");
    }
    components_.push_back(info);
  }

  std::vector<ComponentInfo> take() { return std::move(components_); }

 private:
  const PluginFile& file_;
  std::vector<ComponentInfo> components_;
  std::set<std::pair<ComponentKind, std::string>> seen_;
};

/// A plugin whose list says something else than its code is refused: jobs were checked by the list.
void compare_with_list(const PluginFile& file, const std::vector<ComponentInfo>& components) {
  const auto same_type = [](const ListedComponent& component) {
    return [&component](const ListedComponent& other) {
      return other.kind == component.kind && other.type == component.type;
    };
  };
  const auto called = [](const ListedComponent& component) {
    return std::string(kind_name(component.kind)) + " '" + component.type + "'";
  };
  std::vector<ListedComponent> made;
  for (const ComponentInfo& info : components) made.push_back(listed(info));
  for (const ListedComponent& entry : file.components) {
    const auto found = std::ranges::find_if(made, same_type(entry));
    if (found == made.end()) {
      refuse(file,
             "lists " + called(entry) + " but does not register it; register it with DIORAMA_ADD");
    }
    if (*found != entry) {
      refuse(file,
             "registers " + called(entry) +
                 " with another help, other claims, needs or channels than it lists; register "
                 "it with DIORAMA_ADD");
    }
  }
  if (file.learns_types) return;
  for (const ListedComponent& component : made) {
    if (std::ranges::any_of(file.components, same_type(component))) continue;
    refuse(file, "registers " + called(component) +
                     " but does not list it; register it with DIORAMA_ADD, or say "
                     "DIORAMA_LEARNS_TYPES()");
  }
}

bool keeps_tiny_numbers() {
  const volatile double least = std::numeric_limits<double>::min();
  return least / 2.0 != 0.0;
}

}  // namespace

struct PluginLibrary::Handle {
  boost::dll::shared_library library;
};

PluginLibrary::PluginLibrary(const PluginFile& file) : handle_(std::make_unique<Handle>()) {
  // RTLD_NODELETE: code that threads, deleters and exceptions may still need is never unmapped.
  const auto mode = static_cast<boost::dll::load_mode::type>(
      boost::dll::load_mode::rtld_now | boost::dll::load_mode::rtld_local | RTLD_NODELETE);
  const AtWork at_work(file.file.string());
  // Libraries that are linked with -ffast-math make the process flush tiny numbers to zero.
  std::fenv_t arithmetic;
  std::fegetenv(&arithmetic);
  // Boost's error code says "bad file descriptor" for everything; dlerror knows the reason, but
  // Boost consumes it into the exception's text only.
  try {
    handle_->library.load(file.file, mode);
  } catch (const std::exception& error) {
    refuse(file, std::string("cannot be loaded: ") + error.what() +
                     "; install what is missing or build the plugin again");
  }
  const bool is_exact = keeps_tiny_numbers();
  std::fesetenv(&arithmetic);
  if (!is_exact) {
    refuse(file,
           "makes the whole process round tiny numbers to zero, which changes datasets; build it "
           "without -ffast-math");
  }
  if (!handle_->library.has(kEntry)) {
    refuse(file, std::string("has no entry function '") + kEntry +
                     "'; plugins are made with DIORAMA_PLUGIN");
  }
  const auto& entry = handle_->library.get<const DioramaPlugin*()>(kEntry);
  const DioramaPlugin* plugin = call_component(file.file.string(), [&] { return entry(); });
  if (!plugin || !plugin->descriptor || !plugin->register_components) {
    refuse(file, "its entry function returns nothing");
  }
  if (std::memcmp(plugin->descriptor, &file.descriptor, sizeof file.descriptor) != 0) {
    refuse(file,
           "its descriptor in memory differs from the one in the file; it is not what it "
           "claims to be");
  }
  Collector collector(file);
  try {
    plugin->register_components(collector);
  } catch (const Error& error) {
    const std::string text = error.what();
    const std::string front = file.file.string() + ": ";
    throw Error(ErrorKind::Plugin,
                text.starts_with(front) ? text : front + "registration failed: " + text);
  } catch (const std::exception& error) {
    refuse(file, std::string("registration failed: ") + error.what());
  } catch (...) {
    refuse(file, "registration failed: it threw something that is no std::exception");
  }
  components_ = collector.take();
  compare_with_list(file, components_);
}

PluginLibrary::~PluginLibrary() = default;
PluginLibrary::PluginLibrary(PluginLibrary&&) noexcept = default;

}  // namespace diorama
