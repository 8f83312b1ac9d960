// SPDX-License-Identifier: Apache-2.0
#include "package.h"

#include <libdeflate.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <optional>

#include "error.h"

namespace diorama::usd {
namespace {

// Records of the zip format (APPNOTE 6.3).
constexpr std::uint32_t kLocalHeader = 0x04034B50;
constexpr std::uint32_t kDirectoryEntry = 0x02014B50;
constexpr std::uint32_t kEndOfDirectory = 0x06054B50;
constexpr std::uint64_t kLocalHeaderSize = 30;
constexpr std::uint64_t kDirectoryEntrySize = 46;
constexpr std::uint64_t kEndOfDirectorySize = 22;
constexpr std::uint64_t kMaxComment = 65535;
constexpr std::uint32_t kStored = 0;
constexpr std::uint32_t kDeflated = 8;
constexpr std::uint32_t kEncrypted = 1;
// No deflate stream expands by more.
constexpr std::uint64_t kMaxExpansion = 1032;

class ZipBytes {
 public:
  ZipBytes(const std::string& file, std::span<const std::byte> bytes)
      : file_(file), bytes_(bytes) {}

  template <class T>
  T at(std::uint64_t offset) const {
    check(offset, sizeof(T));
    T value;
    std::memcpy(&value, bytes_.data() + offset, sizeof(T));
    return value;
  }
  std::string text(std::uint64_t offset, std::uint64_t size) const {
    check(offset, size);
    return std::string(reinterpret_cast<const char*>(bytes_.data()) + offset, size);
  }
  void check(std::uint64_t offset, std::uint64_t size) const {
    if (offset > bytes_.size() || size > bytes_.size() - offset) {
      throw format_error_at(
          file_, "the package ends within a record of " + std::to_string(size) + " bytes", offset);
    }
  }
  std::uint64_t size() const { return bytes_.size(); }

 private:
  const std::string& file_;
  std::span<const std::byte> bytes_;
};

// The record may be followed by a comment, in which its mark may stand again: the one whose comment
// ends with the file comes first.
std::uint64_t find_end_of_directory(const ZipBytes& zip, const std::string& file) {
  std::optional<std::uint64_t> found;
  if (zip.size() >= kEndOfDirectorySize) {
    const std::uint64_t last = zip.size() - kEndOfDirectorySize;
    const std::uint64_t first = last > kMaxComment ? last - kMaxComment : 0;
    for (std::uint64_t at = last + 1; at-- > first;) {
      if (zip.at<std::uint32_t>(at) != kEndOfDirectory) continue;
      if (at + zip.at<std::uint16_t>(at + 20) == last) return at;
      if (!found) found = at;
    }
  }
  if (!found) throw format_error_at(file, "the package has no directory", zip.size());
  return *found;
}

}  // namespace

Package::Package(std::string file, ByteView bytes)
    : file_(std::move(file)), view_(std::move(bytes)) {
  read_directory();
}

void Package::read_directory() {
  const ZipBytes zip(file_, view_.bytes);
  const std::uint64_t end = find_end_of_directory(zip, file_);
  const auto count = zip.at<std::uint16_t>(end + 10);
  std::uint64_t at = zip.at<std::uint32_t>(end + 16);
  for (int i = 0; i < count; ++i) {
    if (zip.at<std::uint32_t>(at) != kDirectoryEntry) {
      throw format_error_at(file_, "the package directory is damaged", at);
    }
    Member member;
    member.flags = zip.at<std::uint16_t>(at + 8);
    member.method = zip.at<std::uint16_t>(at + 10);
    member.compressed_size = zip.at<std::uint32_t>(at + 20);
    member.size = zip.at<std::uint32_t>(at + 24);
    const auto name_size = zip.at<std::uint16_t>(at + 28);
    const auto extra_size = zip.at<std::uint16_t>(at + 30);
    const auto comment_size = zip.at<std::uint16_t>(at + 32);
    member.header = zip.at<std::uint32_t>(at + 42);
    member.name = zip.text(at + kDirectoryEntrySize, name_size);
    at += kDirectoryEntrySize + name_size + extra_size + comment_size;
    if (!member.name.ends_with('/')) members_.push_back(std::move(member));
  }
  if (members_.empty()) throw format_error_at(file_, "the package is empty", end);
}

const Package::Member* Package::find(const std::string& name) const {
  const auto found = std::find_if(members_.begin(), members_.end(),
                                  [&](const Member& member) { return member.name == name; });
  return found == members_.end() ? nullptr : &*found;
}

ByteView Package::read(const std::string& name) const {
  const Member* member = find(name);
  if (!member) throw FormatError(file_ + ": the package has no member " + name);
  const ZipBytes zip(file_, view_.bytes);
  const std::uint64_t at = member->header;
  if (zip.at<std::uint32_t>(at) != kLocalHeader) {
    throw format_error_at(file_, "member " + name + " has no header", at);
  }
  if (member->flags & kEncrypted) {
    throw format_error_at(file_, "member " + name + " is encrypted", at);
  }
  // The directory may pad differently, so only the member's own header knows where its data begin.
  const std::uint64_t data =
      at + kLocalHeaderSize + zip.at<std::uint16_t>(at + 26) + zip.at<std::uint16_t>(at + 28);
  zip.check(data, member->compressed_size);
  if (member->method == kStored) return view_.part(data, member->compressed_size);
  if (member->method != kDeflated) {
    throw format_error_at(
        file_, "member " + name + " uses compression method " + std::to_string(member->method), at);
  }
  if (member->size > member->compressed_size * kMaxExpansion + 64) {
    throw format_error_at(
        file_, "member " + name + " claims to unpack to " + std::to_string(member->size) + " bytes",
        at);
  }
  auto unpacked = std::make_shared<std::vector<std::byte>>(member->size);
  const std::unique_ptr<libdeflate_decompressor, void (*)(libdeflate_decompressor*)> inflater(
      libdeflate_alloc_decompressor(), &libdeflate_free_decompressor);
  const auto result = libdeflate_deflate_decompress(inflater.get(), view_.bytes.data() + data,
                                                    member->compressed_size, unpacked->data(),
                                                    unpacked->size(), nullptr);
  if (result != LIBDEFLATE_SUCCESS) {
    throw format_error_at(file_, "member " + name + " cannot be unpacked", data);
  }
  const std::span<const std::byte> bytes(*unpacked);
  return {std::move(unpacked), bytes};
}

bool is_package(std::span<const std::byte> bytes) {
  std::uint32_t magic = 0;
  if (bytes.size() < sizeof(magic)) return false;
  std::memcpy(&magic, bytes.data(), sizeof(magic));
  return magic == kLocalHeader;
}

}  // namespace diorama::usd
