// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstring>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace diorama {

/// An array of NumPy's .npy format, versions 1 to 3: little-endian numbers in C order, plain or as
/// records.
struct StoredArray {
  struct Field {
    std::string name;  ///< Empty for a plain array.
    std::string type;  ///< "<f4", "|u1".
    std::size_t offset = 0;
    std::size_t count = 1;  ///< Numbers: 16 for a 4 x 4 matrix.
  };
  std::vector<Field> fields;
  std::vector<std::size_t> shape;
  std::size_t item_size = 0;
  std::string data;

  std::size_t count() const;  ///< Elements.
  /// Null when there is none.
  const Field* field(std::string_view name) const;
  bool is_plain(std::string_view type) const {
    return fields.size() == 1 && fields[0].name.empty() && fields[0].type == type;
  }
  /// The `i`-th number of a field of an element. T must have the field's size.
  template <class T>
  T value(std::size_t element, const Field& of, std::size_t i = 0) const {
    T result{};
    std::memcpy(&result, data.data() + element * item_size + of.offset + i * sizeof result,
                sizeof result);
    return result;
  }
};

/// Throws std::runtime_error that says what is damaged or not understood. Allocates no more than
/// the file has.
StoredArray parse_array(std::string bytes);

}  // namespace diorama
