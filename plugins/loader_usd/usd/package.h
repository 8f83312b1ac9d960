// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "mapped_file.h"

namespace diorama::usd {

/// A usdz package: a zip archive read in place. Members that are stored stay in the package's
/// memory; deflated ones, which the format forbids but files hold, are unpacked when asked for.
class Package {
 public:
  /// Reads the directory. `file` names the package in messages. Throws FormatError.
  Package(std::string file, ByteView bytes);

  /// The first member, which is the root layer.
  const std::string& first() const { return members_.front().name; }
  bool contains(const std::string& member) const { return find(member) != nullptr; }
  /// Throws FormatError when the member is missing or damaged.
  ByteView read(const std::string& member) const;

 private:
  struct Member {
    std::string name;
    std::uint32_t method = 0;
    std::uint32_t flags = 0;
    std::uint64_t compressed_size = 0;
    std::uint64_t size = 0;
    std::uint64_t header = 0;
  };
  const Member* find(const std::string& name) const;
  void read_directory();

  std::string file_;
  ByteView view_;
  std::vector<Member> members_;
};

/// Whether the bytes begin as a zip archive does.
bool is_package(std::span<const std::byte> bytes);

}  // namespace diorama::usd
