// SPDX-License-Identifier: Apache-2.0
#include <elf.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <memory>

#include "diorama/writer.h"
#include "framework/host/host_services.h"
#include "framework/plugins/registry.h"
#include "support/catch.h"

using namespace diorama;
namespace fs = std::filesystem;

namespace {

std::string read(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

void write(const fs::path& file, const std::string& bytes) {
  std::ofstream(file, std::ios::binary) << bytes;
}

fs::path module(const std::string& name) {
  return fs::path(DIORAMA_FAULTY_PLUGINS) / (name + ".so");
}

/// A plugin folder of its own, always with one good plugin.
class PluginFolder {
 public:
  PluginFolder() {
    std::string pattern = (fs::temp_directory_path() / "diorama_bad_XXXXXX").string();
    path = mkdtemp(pattern.data());
    fs::permissions(path, fs::perms(0755));
    copy("well_behaved", "good.so");
  }
  ~PluginFolder() { fs::remove_all(path); }

  fs::path copy(const std::string& name, const std::string& as) const {
    fs::copy_file(module(name), path / as);
    return path / as;
  }
  PluginSearch search(bool allow_unsafe = false) const {
    return search_plugins({{"--plugin-dir", {path}, true}}, allow_unsafe);
  }
  /// The one reason for which something was refused, without the file in front; the good plugin
  /// goes on working.
  std::string only_reason() const {
    Registry registry(search(), [](LogLevel, std::string_view) {});
    CHECK(registry.has(ComponentKind::Writer, "quiet"));
    CHECK(registry.describe(ComponentKind::Writer, "quiet").size() == 1);
    REQUIRE(registry.rejected().size() == 1);
    const RejectedPlugin& rejected = registry.rejected().front();
    const std::string front = rejected.file.string() + ": ";
    REQUIRE(rejected.reason.starts_with(front));
    return rejected.reason.substr(front.size());
  }

  fs::path path;
};

DioramaPluginDescriptor descriptor_in(const std::string& bytes, std::size_t& at) {
  at = bytes.find(std::string("DIORAMA\0", 8));
  DioramaPluginDescriptor descriptor;
  // The mark also stands where code refers to it; the descriptor is where the size follows.
  for (; at != std::string::npos; at = bytes.find(std::string("DIORAMA\0", 8), at + 1)) {
    if (at + sizeof descriptor > bytes.size()) break;
    std::memcpy(&descriptor, bytes.data() + at, sizeof descriptor);
    if (descriptor.descriptor_size == sizeof descriptor) return descriptor;
  }
  FAIL("no descriptor");
  return descriptor;
}

/// Writes a copy of a module whose descriptor was changed.
template <class Change>
void patch(const std::string& name, const fs::path& to, Change change) {
  std::string bytes = read(module(name));
  std::size_t at = 0;
  DioramaPluginDescriptor descriptor = descriptor_in(bytes, at);
  change(descriptor);
  std::memcpy(bytes.data() + at, &descriptor, sizeof descriptor);
  write(to, bytes);
}

std::string error_of(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

struct FaultyHost {
  PluginFolder folder;
  Registry registry{(folder.copy("faulty_components", "faulty.so"), folder.search()),
                    [](LogLevel, std::string_view) {}};
  HostServices host{registry, {}, [](LogLevel, std::string_view) {}};

  std::unique_ptr<Writer> make(const std::string& type, Diagnostics& diagnostics) {
    Value map = Value::make_map();
    map.set("type", Value::text(type));
    return registry.make<Writer>(map, "writers[0]", {}, diagnostics, host);
  }
  std::string make_error(const std::string& type) {
    return error_of([&] {
      Diagnostics diagnostics;
      make(type, diagnostics);
      diagnostics.raise();
    });
  }
};

}  // namespace

TEST_CASE("a good plugin is listed without being loaded", "[plugins]") {
  const PluginFolder folder;
  const PluginSearch search = folder.search();
  CHECK(search.rejected.empty());
  REQUIRE(search.plugins.size() == 1);
  const PluginFile& plugin = search.plugins.front().plugin;
  CHECK(plugin.name == "well_behaved");
  CHECK(plugin.version == "1.2.3");
  CHECK(plugin.licence == "MIT");
  CHECK_FALSE(plugin.learns_types);
  CHECK(plugin.components == std::vector<ListedComponent>{
                                 {ComponentKind::Writer, "quiet", "Writes nothing.", {}, {}, {}}});
  const Registry registry(search, [](LogLevel, std::string_view) {});
  CHECK(registry.loaded_plugins().empty());
}

TEST_CASE("every truncation of a plugin is refused and nothing is read beyond it", "[plugins]") {
  const PluginFolder folder;
  const std::string bytes = read(module("well_behaved"));
  const fs::path cut = folder.path / "cut.so";
  for (std::size_t size = 0; size < bytes.size(); size += size < 200 ? 1 : 4099) {
    write(cut, bytes.substr(0, size));
    const std::string reason = folder.only_reason();
    if (size < EI_NIDENT) {
      CHECK(reason == "the file is damaged or cut off (" + std::to_string(size) +
                          " bytes); build or install it again");
    }
    CHECK(reason.find("damaged or cut off") != std::string::npos);
  }
}

TEST_CASE("damage in the header and the section table never crashes", "[plugins]") {
  const PluginFolder folder;
  const std::string bytes = read(module("well_behaved"));
  Elf64_Ehdr header;
  std::memcpy(&header, bytes.data(), sizeof header);
  std::vector<std::size_t> places;
  for (std::size_t at = 0; at < sizeof header; ++at) places.push_back(at);
  for (std::size_t at = header.e_shoff; at < bytes.size(); at += 3) places.push_back(at);
  for (const std::size_t at : places) {
    for (const char damage : {'\0', '\xff', '\x7f'}) {
      std::string damaged = bytes;
      damaged[at] = damage;
      write(folder.path / "damaged.so", damaged);
      // Damage in fields that nobody reads leaves a good plugin.
      CHECK_NOTHROW(folder.search());
    }
  }
}

TEST_CASE("files for other machines are refused", "[plugins]") {
  const PluginFolder folder;
  std::string bytes = read(module("well_behaved"));
  Elf64_Ehdr header;
  std::memcpy(&header, bytes.data(), sizeof header);
  const auto write_header = [&] {
    std::memcpy(bytes.data(), &header, sizeof header);
    write(folder.path / "other.so", bytes);
  };
  const auto machine = header.e_machine;
  header.e_machine = machine == EM_AARCH64 ? EM_X86_64 : EM_AARCH64;
  write_header();
  CHECK(folder.only_reason() ==
        (machine == EM_AARCH64
             ? "is built for x86-64, this program needs AArch64; build it for this machine"
             : "is built for AArch64, this program needs x86-64; build it for this machine"));
  header.e_machine = machine;
  header.e_ident[EI_CLASS] = ELFCLASS32;
  write_header();
  CHECK(folder.only_reason() ==
        "is built for 32 bit, this program needs 64 bit; build it for this machine");
  header.e_ident[EI_CLASS] = ELFCLASS64;
  header.e_ident[EI_DATA] = ELFDATA2MSB;
  write_header();
  CHECK(folder.only_reason() == "is built for the other byte order; build it for this machine");
  header.e_ident[EI_DATA] = ELFDATA2LSB;
  header.e_type = ET_REL;
  write_header();
  CHECK(folder.only_reason() == "is an ELF file, but no shared library");
}

TEST_CASE("files that are no plugins are refused", "[plugins]") {
  const PluginFolder folder;
  SECTION("a text") {
    write(folder.path / "text.so", "#!/bin/sh\necho surprise\n");
    CHECK(folder.only_reason() ==
          "is no shared library (no ELF mark at its begin); a plugin is an ELF file that ends in "
          ".so");
  }
  SECTION("another shared library") {
    fs::copy_file(fs::read_symlink("/proc/self/exe"), folder.path / "program.so");
    CHECK(folder.only_reason() ==
          "is a shared library, but no Diorama plugin (no section .diorama_plugin); plugins are "
          "made with DIORAMA_PLUGIN");
  }
  SECTION("a link to nothing") {
    fs::create_symlink("/nowhere/gone.so", folder.path / "gone.so");
    CHECK(folder.only_reason() ==
          "is a symbolic link to a file that is not there; remove it or install its target");
  }
  SECTION("a folder") {
    fs::create_directory(folder.path / "folder.so");
    CHECK(folder.only_reason() == "is no regular file; a plugin is an ELF file that ends in .so");
  }
}

TEST_CASE("a plugin that may not be read is refused", "[plugins]") {
  const PluginFolder folder;
  const fs::path secret = folder.copy("well_behaved", "secret.so");
  fs::permissions(secret, fs::perms::none);
  // Root reads everything; be nobody for a moment.
  const bool is_root = geteuid() == 0;
  if (is_root) REQUIRE(seteuid(65534) == 0);
  const PluginSearch search = folder.search();
  if (is_root) REQUIRE(seteuid(0) == 0);
  REQUIRE(search.rejected.size() == 1);
  CHECK(search.plugins.size() == 1);
  CHECK(search.rejected.front().reason ==
        secret.string() +
            ": cannot be opened: Permission denied; check the rights of the file and its folder");
}

TEST_CASE("plugins for other ABIs are refused before their code can run", "[plugins]") {
  const PluginFolder folder;
  const fs::path file = folder.path / "other.so";
  const std::string here = std::to_string(DIORAMA_SDK_ABI);
  // This one would end the test if it were loaded.
  patch("crashes_when_loaded", file, [](auto& d) { d.abi = DIORAMA_SDK_ABI - 1; });
  CHECK(folder.only_reason() == "is built for plugin ABI " + std::to_string(DIORAMA_SDK_ABI - 1) +
                                    ", this program needs " + here +
                                    "; build the plugin again with the SDK of this program");
  patch("crashes_when_loaded", file, [](auto& d) { d.abi = DIORAMA_SDK_ABI + 1; });
  CHECK(folder.only_reason() == "is built for plugin ABI " + std::to_string(DIORAMA_SDK_ABI + 1) +
                                    ", this program needs " + here +
                                    "; install a newer Diorama or a plugin built for this one");
  patch("crashes_when_loaded", file, [](auto& d) { d.layout ^= 1; });
  CHECK(folder.only_reason().starts_with("its types have another memory layout (digest "));
  patch("crashes_when_loaded", file, [](auto& d) { d.headers = 0x1234abcd; });
  char digest[17];
  std::snprintf(digest, sizeof digest, "%016llx", DIORAMA_HEADERS_DIGEST);
  CHECK(folder.only_reason() ==
        "is built with other headers of plugin ABI " + here +
            " (digest 000000001234abcd, this program needs " + digest +
            "); build the plugin again with the headers that belong to this program");
  patch("crashes_when_loaded", file, [](auto& d) { d.abi_tag[4] = 'X'; });
  const std::string tag = folder.only_reason();
  CHECK(tag.starts_with("is built with another toolchain or other settings\n  found:    sdk=X"));
  CHECK(tag.find("\n  required: " DIORAMA_ABI_TAG "\n") != std::string::npos);
  patch("crashes_when_loaded", file, [](auto& d) { d.magic[0] = 'd'; });
  CHECK(folder.only_reason() ==
        "its plugin descriptor does not begin with 'DIORAMA'; it is no Diorama plugin");
  patch("crashes_when_loaded", file, [](auto& d) { std::memset(d.name, 'n', sizeof d.name); });
  CHECK(folder.only_reason() == "its name does not end");
  patch("crashes_when_loaded", file, [](auto& d) { d.name[0] = '\n'; });
  CHECK(folder.only_reason() == "its name holds characters that are not printable ASCII");
  patch("crashes_when_loaded", file, [](auto& d) { d.name[0] = '\0'; });
  CHECK(folder.only_reason() == "its name is empty; give DIORAMA_PLUGIN a name");
  patch("crashes_when_loaded", file, [](auto& d) { d.descriptor_size += 8; });
  CHECK(folder.only_reason().find("one DIORAMA_PLUGIN per library") != std::string::npos);
}

TEST_CASE("plugins whose code is not what the file says are refused when they are used",
          "[plugins]") {
  const PluginFolder folder;
  SECTION("no entry function") {
    folder.copy("without_entry", "a.so");
    CHECK(folder.only_reason() ==
          "has no entry function 'diorama_plugin'; plugins are made with DIORAMA_PLUGIN");
  }
  SECTION("another descriptor in memory") {
    folder.copy("lies_in_memory", "a.so");
    CHECK(folder.only_reason() ==
          "its descriptor in memory differs from the one in the file; it is not what it claims to "
          "be");
  }
  SECTION("throws while registering") {
    const fs::path file = folder.copy("throws_in_registration", "a.so");
    Registry registry(folder.search(), [](LogLevel, std::string_view) {});
    CHECK(error_of([&] { registry.describe(ComponentKind::Writer, "never"); }) ==
          file.string() + ": registration failed: no licence file");
    CHECK(registry.describe(ComponentKind::Writer, "quiet").size() == 1);
  }
  SECTION("lists what it does not register") {
    const fs::path file = folder.copy("lists_other_components", "a.so");
    Registry registry(folder.search(), [](LogLevel, std::string_view) {});
    CHECK(registry.has(ComponentKind::Writer, "promised"));
    CHECK(error_of([&] { registry.describe(ComponentKind::Writer, "promised"); }) ==
          file.string() +
              ": lists writer 'promised' but does not register it; register it with "
              "DIORAMA_ADD");
  }
}

TEST_CASE("an annotator is what its plugin lists", "[plugins]") {
  const PluginFolder folder;
  const fs::path file = folder.copy("lists_other_channels", "a.so");
  Registry registry(folder.search(), [](LogLevel, std::string_view) {});
  CHECK(registry.entry(ComponentKind::Annotator, "edges").provides ==
        std::vector<std::string>{"corners"});
  CHECK(registry.loaded_plugins().empty());
  CHECK(error_of([&] { registry.describe(ComponentKind::Annotator, "edges"); }) ==
        file.string() +
            ": registers annotator 'edges' with another help, other claims, needs or channels than "
            "it lists; register it with DIORAMA_ADD");
}

TEST_CASE("a library may register types that it learns at run time", "[plugins]") {
  const PluginFolder folder;
  folder.copy("learns_types", "a.so");
  Registry registry(folder.search(), [](LogLevel, std::string_view) {});
  CHECK(registry.rejected().empty());
  CHECK(registry.types(ComponentKind::Writer) ==
        std::vector<std::string>{"fixed", "quiet", "script_a", "script_b"});
  const auto only_param = [&](const char* type) {
    const std::vector<ParamSpec> specs = registry.describe(ComponentKind::Writer, type);
    REQUIRE(specs.size() == 1);
    return specs.front();
  };
  CHECK(only_param("script_a").key == "amount");
  CHECK(only_param("script_b").key == "breadth");
  CHECK(only_param("script_b").min == 4.0);

  HostServices host(registry, {}, [](LogLevel, std::string_view) {});
  Value map = Value::make_map();
  map.set("type", Value::text("script_b"));
  map.set("breadth", Value::integer(7));
  Diagnostics diagnostics;
  const auto writer = registry.make<Writer>(map, "writers[0]", {}, diagnostics, host);
  REQUIRE(writer);
  CHECK(writer->needs() == NameSet{"breadth7"});
  map.set("breadth", Value::integer(3));
  CHECK_FALSE(registry.make<Writer>(map, "writers[0]", {}, diagnostics, host));
  CHECK(diagnostics.messages() ==
        std::vector<std::string>{"writers[0].breadth: expected an integer in [4, 9], found '3'"});
}

TEST_CASE("the same type twice in one folder cannot be used, and both files are named",
          "[plugins]") {
  const PluginFolder folder;
  const fs::path twin = folder.copy("well_behaved", "twin.so");
  Registry registry(folder.search(), [](LogLevel, std::string_view) {});
  const std::string both = "writer 'quiet' is provided by two plugins of the same rank, " +
                           (folder.path / "good.so").string() + " and " + twin.string() +
                           "; remove one of them";
  REQUIRE(registry.rejected().size() == 1);
  CHECK(registry.rejected().front().reason == twin.string() + ": " + both);
  CHECK(error_of([&] { registry.describe(ComponentKind::Writer, "quiet"); }) == both);
}

TEST_CASE("an earlier level wins and says so", "[plugins]") {
  const PluginFolder first;
  const PluginFolder second;
  std::string log;
  Registry registry(search_plugins({{"a", {first.path}, true}, {"b", {second.path}, true}}, false),
                    [&](LogLevel level, std::string_view text) {
                      CHECK(level == LogLevel::Info);
                      log += text;
                    });
  CHECK(registry.rejected().empty());
  CHECK(registry.entry(ComponentKind::Writer, "quiet").file == first.path / "good.so");
  CHECK(log == "writer 'quiet': " + (first.path / "good.so").string() + " comes before " +
                   (second.path / "good.so").string());
}

TEST_CASE("faults of single components name the component", "[plugins]") {
  FaultyHost faulty;
  CHECK(faulty.make_error("throws_in_factory") ==
        "writer 'throws_in_factory': unexpected error: out of pencils");
  CHECK(faulty.make_error("refuses_in_factory") ==
        "writer 'refuses_in_factory': font.ttf: not found");
  CHECK(faulty.make_error("throws_number") ==
        "writer 'throws_number': threw something that is no std::exception");
  const std::string file = (faulty.folder.path / "faulty.so").string();
  CHECK(faulty.make_error("returns_null") ==
        "writer 'returns_null': its factory returned nothing (" + file + ")");
  CHECK(faulty.make_error("not_a_writer") ==
        "writer 'not_a_writer': its factory made something that is no writer (" + file + ")");
  Diagnostics diagnostics;
  const std::unique_ptr<Writer> writer = faulty.make("throws_in_call", diagnostics);
  REQUIRE(writer);
  CHECK(error_of([&] {
          call_component("writer 'throws_in_call'", [&] { return writer->needs(); });
        }) == "writer 'throws_in_call': unexpected error: do not ask");
  CHECK(faulty.make("works", diagnostics));
  CHECK(faulty.make("quiet", diagnostics));
  CHECK(diagnostics.is_empty());
}

TEST_CASE("a folder that everybody may write to is refused unless allowed", "[plugins]") {
  const PluginFolder folder;
  fs::permissions(folder.path, fs::perms(0777));
  const PluginSearch search = folder.search();
  CHECK(search.plugins.empty());
  REQUIRE(search.rejected.size() == 1);
  CHECK(search.rejected.front().reason ==
        folder.path.string() + ": everybody may write to " + folder.path.string() +
            ", so anybody could place code there that runs with your rights; remove that right "
            "(chmod o-w " +
            folder.path.string() + "), or give --allow-unsafe-plugin-dir");
  CHECK(folder.search(true).plugins.size() == 1);
  // Nobody else can exchange our files in there, but everybody can add some.
  fs::permissions(folder.path, fs::perms(01777));
  CHECK(folder.search().plugins.empty());
}

TEST_CASE("files that others may change are refused, and so are those in folders that they may",
          "[plugins]") {
  const PluginFolder folder;
  const auto reasons = [&](const fs::path& in) {
    std::string all;
    for (const RejectedPlugin& rejected :
         search_plugins({{"--plugin-dir", {in}, true}}, false).rejected) {
      all += rejected.reason;
    }
    return all;
  };
  const fs::path inner = folder.path / "a/plugins";
  fs::create_directories(inner);
  const fs::path file = inner / "it.so";
  fs::copy_file(module("well_behaved"), file);
  CHECK(reasons(inner).empty());
  SECTION("the file") {
    fs::permissions(file, fs::perms(0666));
    CHECK(reasons(inner) ==
          file.string() + ": everybody may write to " + file.string() +
              ", so anybody could place code there that runs with your rights; remove that right "
              "(chmod o-w " +
              file.string() + "), or give --allow-unsafe-plugin-dir");
  }
  SECTION("a folder above") {
    fs::permissions(folder.path / "a", fs::perms(0777));
    CHECK(reasons(inner).starts_with(inner.string() + ": everybody may write to " +
                                     (folder.path / "a").string() + ", so anybody"));
    // As in /tmp: what is ours stays ours.
    fs::permissions(folder.path / "a", fs::perms(01777));
    CHECK(reasons(inner).empty());
  }
  SECTION("the folder of a link's target") {
    const fs::path links = folder.path / "links";
    fs::create_directory(links);
    fs::create_symlink(file, links / "linked.so");
    CHECK(reasons(links).empty());
    fs::permissions(inner, fs::perms(0777));
    CHECK(reasons(links).starts_with((links / "linked.so").string() + ": everybody may write to " +
                                     inner.string()));
  }
  if (geteuid() != 0) return;  // the rest needs files of others
  constexpr uid_t kStranger = 12345;
  SECTION("a group of others") {
    REQUIRE(chown(file.c_str(), 0, kStranger) == 0);
    fs::permissions(file, fs::perms(0664));
    CHECK(reasons(inner).starts_with(file.string() + ": group 12345 may write to " + file.string() +
                                     ", so others could"));
    CHECK(reasons(inner).find("(chmod g-w " + file.string() + "), or give") != std::string::npos);
    REQUIRE(chown(file.c_str(), 0, 0) == 0);
    CHECK(reasons(inner).empty());  // root's own group
  }
  SECTION("a file of somebody else") {
    REQUIRE(chown(file.c_str(), kStranger, 0) == 0);
    CHECK(reasons(inner) ==
          file.string() + ": " + file.string() +
              " belongs to user 12345, who could place code there that runs with your rights; take "
              "it over (chown) or copy it to a folder of yours, or give --allow-unsafe-plugin-dir");
  }
  SECTION("a folder of somebody else, above") {
    REQUIRE(chown((folder.path / "a").c_str(), kStranger, 0) == 0);
    CHECK(reasons(inner).find("/a belongs to user 12345, who") != std::string::npos);
  }
  SECTION("a link of somebody else") {
    const fs::path link = folder.path / "link";
    fs::create_symlink(inner, link);
    REQUIRE(lchown(link.c_str(), kStranger, 0) == 0);
    CHECK(reasons(link).find("/link belongs to user 12345, who") != std::string::npos);
  }
}
