// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <istream>
#include <limits>
#include <optional>
#include <string>

namespace diorama {

/// Headers and contents fill whole blocks of so many bytes.
inline constexpr std::size_t kTarBlock = 512;

/// A plain file in a tar archive.
struct TarMember {
  std::string name;
  std::uint64_t header = 0;  ///< Where its headers begin, those of long names included.
  std::uint64_t begin = 0;   ///< Of its content.
  std::uint64_t size = 0;
};

/// Goes through a tar archive from header to header; contents are passed over. Understands ustar,
/// and the long names and sizes of pax and GNU tar. Links, folders and devices are left out.
class TarWalk {
 public:
  /// The size of an archive of which only reading tells it.
  static constexpr std::uint64_t kAnySize = std::numeric_limits<std::int64_t>::max();

  /// `size` is that of the whole archive. `in` must outlive the object.
  TarWalk(std::istream& in, std::uint64_t size, std::uint64_t at = 0)
      : in_(in), size_(size), at_(at) {}

  /// Nothing at the end. Throws std::runtime_error that says what is damaged, and where.
  std::optional<TarMember> next();
  /// The content of a member of this archive. Throws std::runtime_error above 1 GiB.
  std::string content(const TarMember& member);

 private:
  std::string bytes(std::uint64_t begin, std::uint64_t size);
  /// What the records of a pax header say of name and size.
  void read_pax(const std::string& records);

  std::istream& in_;
  std::uint64_t size_;
  std::uint64_t at_;
  std::string long_name_;
  std::optional<std::uint64_t> long_size_;
};

}  // namespace diorama
