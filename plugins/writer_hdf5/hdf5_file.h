// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "diorama/image.h"

namespace diorama {

/// An HDF5 file in memory. Data sets are compressed and carry no times, so the same content gives
/// the same bytes. Only one thread of the process may be between the constructor and the end of the
/// destructor: Debian's HDF5 is not built for threads. Throws Error(Output) that names the data set
/// when the library fails.
class Hdf5File {
 public:
  Hdf5File();
  ~Hdf5File();
  Hdf5File(const Hdf5File&) = delete;
  Hdf5File& operator=(const Hdf5File&) = delete;

  void add(const char* name, std::span<const std::size_t> shape, const std::uint8_t* data);
  void add(const char* name, std::span<const std::size_t> shape, const std::uint16_t* data);
  void add(const char* name, std::span<const std::size_t> shape, const float* data);
  void add(const char* name, std::span<const std::size_t> shape, const double* data);
  /// With a third extent where a pixel has several numbers.
  void add(const char* name, const AnyImage& image);
  void add_text(const char* name, std::string_view text);
  std::vector<std::byte> bytes();

 private:
  std::int64_t file_;
};

}  // namespace diorama
