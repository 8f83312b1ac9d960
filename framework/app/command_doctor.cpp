// SPDX-License-Identifier: Apache-2.0
#include "framework/app/command_doctor.h"

#include <array>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <limits>
#include <optional>
#include <set>
#include <sstream>

#include "diorama/renderer.h"
#include "framework/app/cli.h"
#include "framework/app/standard_output.h"
#include "framework/host/machine_limits.h"
#include "framework/jobs/assemble.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

/// A kind of which a job usually needs one, and the package that brings it.
struct NeededPlugin {
  ComponentKind kind;
  const char* package;
};
constexpr std::array kNeededPlugins{NeededPlugin{ComponentKind::Loader, "diorama-plugin-usd"},
                                    NeededPlugin{ComponentKind::Physics, "diorama-plugin-bullet"},
                                    NeededPlugin{ComponentKind::Randomizer, "diorama-plugins-core"},
                                    NeededPlugin{ComponentKind::Renderer, "diorama-plugin-embree"},
                                    NeededPlugin{ComponentKind::Writer, "diorama-plugins-writers"}};

std::string line_of(const char* file, const std::string& key) {
  std::ifstream stream(file);
  for (std::string line; std::getline(stream, line);) {
    if (!line.starts_with(key)) continue;
    const std::size_t start = line.find_first_not_of(" \t:", key.size());
    return start == std::string::npos ? std::string() : line.substr(start);
  }
  return "unknown";
}

std::string memory_text(std::uint64_t bytes) {
  if (bytes == std::numeric_limits<std::uint64_t>::max()) return "unknown";
  char text[32];
  std::snprintf(text, sizeof text, "%.1f GiB", double(bytes) / double(1 << 30));
  return text;
}

class Doctor {
 public:
  Doctor(const GlobalOptions& global, ConsoleLog& log)
      : global_(global), registry_(make_registry(global, log.sink())) {}

  int examine() {
    show_program();
    show_machine();
    show_plugins();
    show_renderers();
    show_assets();
    if (problems_ == 0) {
      std::cout << "\nnothing is missing\n";
      return 0;
    }
    std::cout << "\n" << problems_ << (problems_ == 1 ? " problem\n" : " problems\n");
    return exit_code(ErrorKind::Plugin);
  }

 private:
  void problem(const std::string& text) {
    print_text("  ! " + text + "\n");
    ++problems_;
  }

  void show_program() const {
    std::ostringstream text;
    text << "program\n  version " << program_version() << "\n  file " << global_.program.string()
         << "\n  plugin ABI " << DIORAMA_SDK_ABI << "\n  ABI tag " << DIORAMA_ABI_TAG
         << "\n  layout digest " << abi::kLayout << "\n  compiler g++ " << __VERSION__ << "\n";
    print_text(text.str());
  }

  void show_machine() const {
    std::ostringstream text;
    text << "machine\n  processor " << line_of("/proc/cpuinfo", "model name") << "\n  threads "
         << ThreadPool::available_threads() << "\n  memory " << memory_text(total_memory()) << ", "
         << memory_text(available_memory()) << " of it available\n";
#if defined(__x86_64__)
    text << "  vector units sse2" << (__builtin_cpu_supports("sse4.2") ? " sse4.2" : "")
         << (__builtin_cpu_supports("avx") ? " avx" : "")
         << (__builtin_cpu_supports("avx2") ? " avx2" : "")
         << (__builtin_cpu_supports("avx512f") ? " avx512f" : "") << "\n";
#endif
    print_text(text.str());
  }

  void show_plugins() {
    std::cout << "plugin folders\n";
    for (const SearchLevel& level : registry_->levels()) {
      for (const fs::path& folder : level.folders) {
        std::error_code failed;
        print_text("  " + folder.string() + " (" + level.name +
                   (fs::is_directory(folder, failed) ? ")\n" : ", not there)\n"));
      }
    }
    for (const RejectedPlugin& rejected : registry_->rejected()) problem(rejected.reason);
    std::cout << "plugins\n";
    std::set<std::string> seen;
    for (const ComponentEntry& entry : registry_->components()) load(entry, seen);
    for (const NeededPlugin& need : kNeededPlugins) {
      if (has_plugin(need.kind)) continue;
      problem("no " + std::string(kind_name(need.kind)) + " plugin; install " + need.package +
              " or name its folder with --plugin-dir");
    }
  }

  void load(const ComponentEntry& entry, std::set<std::string>& seen) {
    if (entry.file.empty() || !seen.insert(entry.file.string()).second) return;
    try {
      registry_->describe(entry.kind, entry.type);
      print_text("  " + entry.plugin + " " + entry.version + ", " + entry.file.string() + "\n");
    } catch (const Error& error) {
      problem(error.what());
    }
  }

  /// Starts each as a job would: only then is it known whether what it needs of the machine
  /// (devices, drivers) is there. One that does not start is no problem where another one does.
  void show_renderers() {
    std::string said;
    const auto log = [&](LogLevel level, std::string_view text) {
      if (level == LogLevel::Info) said += ": " + std::string(text);
    };
    std::unique_ptr<HostServices> host;
    try {
      host = make_host(*registry_, global_, std::nullopt, log);
    } catch (const Error&) {
      return;  // show_assets() says why
    }
    std::cout << "renderers\n";
    std::size_t started = 0;
    for (const std::string& type : registry_->types(ComponentKind::Renderer)) {
      said.clear();
      try {
        Value parameters = Value::make_map();
        parameters.set("type", Value::text(type));
        Diagnostics diagnostics;
        const std::vector<std::string_view> known{"type"};
        const auto renderer =
            registry_->make<Renderer>(parameters, "renderer", known, diagnostics, *host);
        diagnostics.raise();
        print_text("  " + type + " starts" + said + "\n");
        ++started;
      } catch (const Error& error) {
        print_text("  " + type + " does not start: " + error.what() + "\n");
      }
    }
    if (started == 0) problem("no renderer starts on this machine");
  }

  bool has_plugin(ComponentKind kind) const {
    for (const ComponentEntry& entry : registry_->components()) {
      if (entry.kind == kind && !entry.file.empty()) return true;
    }
    return false;
  }

  void show_assets() {
    std::cout << "assets\n";
    const fs::path samples = sample_pack_folder(global_.program);
    try {
      const std::optional<fs::path> root = choose_assets_root(
          global_.assets_root, std::getenv("DIORAMA_ASSETS_ROOT"), std::nullopt, samples);
      if (root) {
        print_text("  root " + root->string() + "\n");
        return;
      }
      problem("no assets root: the sample pack is not at " + samples.string() +
              "; install diorama-samples, or name a folder with --assets-root or "
              "DIORAMA_ASSETS_ROOT");
    } catch (const Error& error) {
      problem(error.what());
    }
  }

  const GlobalOptions& global_;
  std::unique_ptr<Registry> registry_;
  int problems_ = 0;
};

}  // namespace

int command_doctor(const GlobalOptions& global, ConsoleLog& log) {
  return Doctor(global, log).examine();
}

}  // namespace diorama
