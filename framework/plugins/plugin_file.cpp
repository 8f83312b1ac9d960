// SPDX-License-Identifier: Apache-2.0
#include "framework/plugins/plugin_file.h"

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <string_view>

#include "framework/plugins/elf_sections.h"

namespace diorama {
namespace {

constexpr std::string_view kDescriptorSection = ".diorama_plugin";
constexpr std::string_view kComponentSection = ".diorama_components";
constexpr std::string_view kMagic{"DIORAMA\0", 8};
// The part of the descriptor that keeps its place for ever: magic, size, ABI number.
constexpr std::size_t kFixedPart = 16;

std::string hexadecimal(std::uint64_t digest) {
  char digits[17];
  std::snprintf(digits, sizeof digits, "%016llx", static_cast<unsigned long long>(digest));
  return digits;
}

class Gate {
 public:
  explicit Gate(const std::filesystem::path& file) : file_(file.string()) {}
  [[noreturn]] void refuse(const std::string& reason) const {
    throw Error(ErrorKind::Plugin, file_ + ": " + reason);
  }

  DioramaPluginDescriptor check(const std::vector<std::byte>& section) const {
    if (section.size() < kFixedPart) refuse("its plugin descriptor is cut off; build it again");
    DioramaPluginDescriptor found{};
    std::memcpy(&found, section.data(), std::min(section.size(), sizeof found));
    if (std::string_view(found.magic, sizeof found.magic) != kMagic) {
      refuse("its plugin descriptor does not begin with 'DIORAMA'; it is no Diorama plugin");
    }
    check_abi(found.abi);
    if (found.descriptor_size != sizeof found || section.size() != sizeof found) {
      refuse("its plugin descriptor has " + std::to_string(section.size()) + " bytes (it says " +
             std::to_string(found.descriptor_size) + "), ABI " + std::to_string(DIORAMA_SDK_ABI) +
             " has " + std::to_string(sizeof found) +
             "; one DIORAMA_PLUGIN per library, built with "
             "the SDK of this program");
    }
    check_toolchain(found);
    return found;
  }

  std::string text(const char* field, std::size_t size, const char* what) const {
    const std::string_view text(field, strnlen(field, size));
    if (text.size() == size) refuse(std::string("its ") + what + " does not end");
    for (const char c : text) {
      if (c < 0x20 || c > 0x7E) {
        refuse(std::string("its ") + what + " holds characters that are not printable ASCII");
      }
    }
    return std::string(text);
  }

 private:
  void check_abi(std::uint32_t abi) const {
    if (abi == DIORAMA_SDK_ABI) return;
    const bool is_older = abi < DIORAMA_SDK_ABI;
    refuse("is built for plugin ABI " + std::to_string(abi) + ", this program needs " +
           std::to_string(DIORAMA_SDK_ABI) +
           (is_older ? "; build the plugin again with the SDK of this program"
                     : "; install a newer Diorama or a plugin built for this one"));
  }

  void check_toolchain(const DioramaPluginDescriptor& found) const {
    const std::string tag = text(found.abi_tag, sizeof found.abi_tag, "ABI tag");
    if (tag != DIORAMA_ABI_TAG) {
      refuse("is built with another toolchain or other settings\n  found:    " + tag +
             "\n  required: " DIORAMA_ABI_TAG
             "\n  Build it with the compiler and the SDK that this program was built with.");
    }
    if (found.layout != abi::kLayout) {
      refuse("its types have another memory layout (digest " + std::to_string(found.layout) +
             ", this program needs " + std::to_string(abi::kLayout) +
             "); link diorama::sdk, which sets the needed definitions, and do not change "
             "EIGEN_MAX_ALIGN_BYTES");
    }
    if (found.headers != DIORAMA_HEADERS_DIGEST) {
      refuse("is built with other headers of plugin ABI " + std::to_string(DIORAMA_SDK_ABI) +
             " (digest " + hexadecimal(found.headers) + ", this program needs " +
             hexadecimal(DIORAMA_HEADERS_DIGEST) +
             "); build the plugin again with the headers that belong to this program");
    }
  }

  std::string file_;
};

std::vector<std::string> words(std::string_view text) {
  std::vector<std::string> words;
  while (!text.empty()) {
    const std::size_t space = text.find(' ');
    if (space != 0) words.emplace_back(text.substr(0, space));
    text.remove_prefix(space == std::string_view::npos ? text.size() : space + 1);
  }
  return words;
}

void read_list(const Gate& gate, const std::vector<std::byte>& section, PluginFile& plugin) {
  if (section.size() % sizeof(DioramaComponentEntry) != 0) {
    gate.refuse("its list of components is damaged; build it again");
  }
  for (std::size_t at = 0; at < section.size(); at += sizeof(DioramaComponentEntry)) {
    DioramaComponentEntry entry;
    std::memcpy(&entry, section.data() + at, sizeof entry);
    if (entry.kind == kDioramaLearnsTypes) {
      plugin.learns_types = true;
      continue;
    }
    if (entry.kind > std::uint32_t(ComponentKind::Reader)) {
      gate.refuse("its list of components holds the unknown kind " + std::to_string(entry.kind));
    }
    const auto text = [&](const auto& field, const char* what) {
      return gate.text(field, sizeof field, what);
    };
    plugin.components.push_back({ComponentKind(entry.kind), text(entry.type, "component type"),
                                 text(entry.help, "component help"),
                                 words(text(entry.claims, "list of claims")),
                                 words(text(entry.needs, "list of needs")),
                                 words(text(entry.provides, "list of what is provided"))});
  }
}

}  // namespace

PluginFile read_plugin_file(const std::filesystem::path& file) {
  const Gate gate(file);
  const auto sections = read_elf_sections(file, {kDescriptorSection, kComponentSection});
  const auto descriptor = sections.find(kDescriptorSection);
  if (descriptor == sections.end()) {
    gate.refuse("is a shared library, but no Diorama plugin (no section " +
                std::string(kDescriptorSection) + "); plugins are made with DIORAMA_PLUGIN");
  }
  PluginFile plugin;
  plugin.file = file;
  plugin.descriptor = gate.check(descriptor->second);
  const DioramaPluginDescriptor& found = plugin.descriptor;
  plugin.name = gate.text(found.name, sizeof found.name, "name");
  plugin.version = gate.text(found.version, sizeof found.version, "version");
  plugin.licence = gate.text(found.licence, sizeof found.licence, "licence");
  gate.text(found.build, sizeof found.build, "build text");
  if (plugin.name.empty()) gate.refuse("its name is empty; give DIORAMA_PLUGIN a name");
  const auto components = sections.find(kComponentSection);
  plugin.learns_types = components == sections.end();
  if (!plugin.learns_types) read_list(gate, components->second, plugin);
  return plugin;
}

ListedComponent listed(const ComponentInfo& info) {
  const Listing& listing = info.listing;
  return {info.kind,
          info.type,
          info.help,
          words(listing.claims),
          words(listing.needs),
          words(listing.provides)};
}

}  // namespace diorama
