// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>

#include "diorama/image.h"
#include "diorama/writer.h"

namespace diorama {

/// An HDF5 file that is made in memory, compressed as it grows. Data sets are in chunks of whole
/// rows and carry no times, so the same content gives the same bytes. Only one thread of the
/// process may be between the constructor and the end of the destructor: Debian's HDF5 is not built
/// for threads. Throws Error(Output) that names the data set when the library fails.
class Hdf5File {
 public:
  Hdf5File();
  ~Hdf5File();
  Hdf5File(const Hdf5File&) = delete;
  Hdf5File& operator=(const Hdf5File&) = delete;

  enum class Number { U8, U16, U32, F32, F64 };
  /// Rows from `first` on, as they lie one after the other; valid until the next call.
  using Rows = std::function<const void*(std::size_t first, std::size_t count)>;

  /// Asks for some rows at a time, so that what is converted never exists as a whole.
  void add(const char* name, Number number, std::span<const std::size_t> shape, const Rows& rows);
  void add(const char* name, std::span<const std::size_t> shape, const double* data);
  /// With a third extent where a pixel has several numbers.
  void add(const char* name, const AnyImage& image);
  void add_text(const char* name, std::string_view text);
  /// Ends the file and puts it at the end of one that grows in a dataset.
  void append_to(DatasetFiles& files, std::string_view path);

 private:
  std::int64_t file_;
};

}  // namespace diorama
