// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string_view>

namespace diorama {

/// A tar archive that goes to `out` piece by piece: POSIX ustar, plain files of mode 644, owner and
/// time 0, so that the same files give the same bytes. Archives without their ends may be put
/// together, and are one.
class TarArchive {
 public:
  using Out = std::function<void(std::span<const std::byte>)>;
  explicit TarArchive(Out out) : out_(std::move(out)) {}

  /// The parts are one after the other the file's content. Throws Error(Output) when the name is
  /// longer than 100 bytes or the file larger than 8 GiB.
  void add(std::string_view name, std::span<const std::span<const std::byte>> parts);
  void add(std::string_view name, std::span<const std::byte> content);
  void add(std::string_view name, std::string_view content);
  void end();
  /// That went out so far.
  std::uint64_t bytes() const { return bytes_; }

 private:
  void put(std::span<const std::byte> bytes);

  Out out_;
  std::uint64_t bytes_ = 0;
};

}  // namespace diorama
