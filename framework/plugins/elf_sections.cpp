// SPDX-License-Identifier: Apache-2.0
#include "framework/plugins/elf_sections.h"

#include <elf.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <system_error>

#include "diorama/error.h"
#include "framework/host/regular_file.h"

namespace diorama {
namespace {

#if defined(__x86_64__)
constexpr unsigned kMachine = EM_X86_64;
constexpr const char* kMachineName = "x86-64";
#elif defined(__aarch64__)
constexpr unsigned kMachine = EM_AARCH64;
constexpr const char* kMachineName = "AArch64";
#elif defined(__riscv) && __riscv_xlen == 64
constexpr unsigned kMachine = EM_RISCV;
constexpr const char* kMachineName = "RISC-V 64";
#elif defined(__powerpc64__)
constexpr unsigned kMachine = EM_PPC64;
constexpr const char* kMachineName = "PowerPC 64";
#else
#error "name this processor's ELF machine number here"
#endif

// A section that a plugin describes itself with is far smaller.
constexpr std::uint64_t kMaxSectionBytes = std::uint64_t(1) << 20;

std::string machine_name(unsigned machine) {
  switch (machine) {
    case EM_386:
      return "x86 (32 bit)";
    case EM_X86_64:
      return "x86-64";
    case EM_ARM:
      return "ARM (32 bit)";
    case EM_AARCH64:
      return "AArch64";
    case EM_RISCV:
      return "RISC-V";
    case EM_PPC64:
      return "PowerPC 64";
    default:
      return "ELF machine " + std::to_string(machine);
  }
}

/// Reads pieces of one file, each checked against the file's size.
class ElfFile {
 public:
  explicit ElfFile(const std::filesystem::path& file) : file_(file) {
    errno = 0;
    stream_ = open_regular_file(file);
    if (!stream_ && errno == EINVAL) {
      refuse("is no regular file; a plugin is an ELF file that ends in .so");
    }
    if (!stream_) {
      const int reason = errno;
      refuse("cannot be opened: " + std::system_category().message(reason) +
             "; check the rights of the file and its folder");
    }
    stream_.seekg(0, std::ios::end);
    size_ = std::uint64_t(std::max<std::streamoff>(stream_.tellg(), 0));
  }

  template <class T>
  T read(std::uint64_t offset) {
    T value;
    read_bytes(offset, &value, sizeof value);
    return value;
  }

  std::vector<std::byte> read_block(std::uint64_t offset, std::uint64_t size) {
    if (size > kMaxSectionBytes) refuse_damaged();
    std::vector<std::byte> bytes(size);
    read_bytes(offset, bytes.data(), size);
    return bytes;
  }

  [[noreturn]] void refuse(const std::string& reason) const {
    throw Error(ErrorKind::Plugin, file_.string() + ": " + reason);
  }
  [[noreturn]] void refuse_damaged() const {
    refuse("the file is damaged or cut off (" + std::to_string(size_) +
           " bytes); build or install it again");
  }

 private:
  void read_bytes(std::uint64_t offset, void* to, std::uint64_t size) {
    if (offset > size_ || size > size_ - offset) refuse_damaged();
    if (size == 0) return;
    stream_.seekg(std::streamoff(offset));
    stream_.read(static_cast<char*>(to), std::streamsize(size));
    if (!stream_) refuse("cannot be read; check the disk");
  }

  std::filesystem::path file_;
  std::ifstream stream_;
  std::uint64_t size_ = 0;
};

Elf64_Ehdr read_header(ElfFile& file) {
  const auto ident = file.read<std::array<unsigned char, EI_NIDENT>>(0);
  if (std::memcmp(ident.data(), ELFMAG, SELFMAG) != 0) {
    file.refuse(
        "is no shared library (no ELF mark at its begin); a plugin is an ELF file that ends "
        "in .so");
  }
  if (ident[EI_CLASS] != ELFCLASS64) {
    file.refuse("is built for 32 bit, this program needs 64 bit; build it for this machine");
  }
  const int here = std::endian::native == std::endian::little ? ELFDATA2LSB : ELFDATA2MSB;
  if (ident[EI_DATA] != here) {
    file.refuse("is built for the other byte order; build it for this machine");
  }
  const auto header = file.read<Elf64_Ehdr>(0);
  if (header.e_machine != kMachine) {
    file.refuse("is built for " + machine_name(header.e_machine) + ", this program needs " +
                kMachineName + "; build it for this machine");
  }
  if (header.e_type != ET_DYN) file.refuse("is an ELF file, but no shared library");
  if (header.e_shentsize != sizeof(Elf64_Shdr)) file.refuse_damaged();
  return header;
}

}  // namespace

std::map<std::string, std::vector<std::byte>, std::less<>> read_elf_sections(
    const std::filesystem::path& path, const std::vector<std::string_view>& names) {
  ElfFile file(path);
  const Elf64_Ehdr header = read_header(file);
  std::vector<Elf64_Shdr> sections;
  const std::vector<std::byte> table =
      file.read_block(header.e_shoff, std::uint64_t(header.e_shnum) * sizeof(Elf64_Shdr));
  sections.resize(header.e_shnum);
  if (!table.empty()) std::memcpy(sections.data(), table.data(), table.size());
  if (header.e_shstrndx >= sections.size()) file.refuse_damaged();

  const Elf64_Shdr& text = sections[header.e_shstrndx];
  const std::vector<std::byte> strings = file.read_block(text.sh_offset, text.sh_size);
  std::map<std::string, std::vector<std::byte>, std::less<>> found;
  for (const Elf64_Shdr& section : sections) {
    if (section.sh_name >= strings.size()) file.refuse_damaged();
    const char* begin = reinterpret_cast<const char*>(strings.data()) + section.sh_name;
    const std::string_view name(begin, strnlen(begin, strings.size() - section.sh_name));
    if (std::find(names.begin(), names.end(), name) == names.end()) continue;
    if (section.sh_type == SHT_NOBITS) file.refuse_damaged();
    if (!found.emplace(name, file.read_block(section.sh_offset, section.sh_size)).second) {
      file.refuse("holds the section " + std::string(name) + " twice");
    }
  }
  return found;
}

}  // namespace diorama
