// SPDX-License-Identifier: Apache-2.0
//
// The readers of datasets' files. The first byte of an input chooses the reader, the rest is the
// file. Refusing is fine; crashing, hanging, taking much memory and exceptions of other kinds are
// findings.
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>

#include "framework/config/clean_text.h"
#include "framework/config/json_text.h"
#include "framework/lint/dataset_files.h"
#include "framework/lint/hdf5_reader.h"
#include "framework/lint/lens.h"
#include "framework/lint/tar_reader.h"

namespace {

using namespace diorama;

void read_array(const lint::NpyArray& array) {
  // Whoever loops over the elements finds them.
  const std::size_t count = array.count();
  std::size_t sum = 0;
  for (std::size_t i = 0; i < count; ++i) {
    sum += std::size_t(array.value<std::byte>(i * array.item_size + array.item_size - 1));
  }
  if (sum > array.data.size() * 255) std::abort();
}

void read_json(const std::string& text) {
  const nlohmann::json json = parse_json(text);
  const nlohmann::json copy = json;
  if (copy.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace).empty()) std::abort();
  const lint::Lens lens = lint::lens_of(json, 64, 48, Mat3::Identity());
  (void)lens.pixel({0.1, 0.2, 1.0});
  (void)lens.direction({3.0, 4.0});
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string file(reinterpret_cast<const char*>(data) + 1, size - 1);
  try {
    switch (data[0] % 5) {
      case 0:
        read_array(lint::parse_npy(file));
        break;
      case 1:
        for (const auto& [name, array] : lint::read_hdf5(file)) read_array(array);
        break;
      case 2:
        lint::read_tar(file);
        break;
      case 3:
        read_json(file);
        break;
      default:
        if (!is_clean_name(clean_name(file))) std::abort();
        if (utf8_length(printable(file)) == 0 && !file.empty()) std::abort();
    }
  } catch (const std::runtime_error&) {
    return 0;
  } catch (const nlohmann::json::exception&) {
    return 0;
  }
  return 0;
}
