// SPDX-License-Identifier: Apache-2.0
//
// The readers of datasets' files. The first byte of an input chooses the reader, the rest is the
// file. Refusing is fine; crashing, hanging, taking much memory and exceptions of other kinds are
// findings.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>
#include <string>

#include "framework/config/clean_text.h"
#include "framework/config/json_text.h"
#include "plugins/reader_support/channel_arrays.h"
#include "plugins/reader_support/listed_boxes.h"
#include "plugins/reader_support/npy_array.h"
#include "plugins/reader_support/stored_files.h"
#include "plugins/writer_hdf5/hdf5_view.h"
#include "plugins/writer_imagefolder/metadata_lines.h"
#include "plugins/writer_webdataset/tar_walk.h"

namespace {

using namespace diorama;

/// What is refused as one kind of picture may be another.
template <class Body>
void tried(Body&& body) {
  try {
    body();
  } catch (const std::runtime_error&) {
    return;
  }
}

void read_array(const StoredArray& array) {
  if (array.count() * array.item_size > array.data.size()) std::abort();
  tried([&] { (void)image_of_array(array); });
  tried([&] { (void)ids_of_array(array); });
  tried([&] { (void)floats_of_array(array); });
  tried([&] { (void)color_of_array(array); });
}

void read_hdf5(const std::string& file) {
  const Hdf5View view(file);
  for (const std::string& name : view.names()) {
    tried([&] { (void)view.shape(name); });
    tried([&] { read_array(view.read(name)); });
    tried([&] { (void)view.text(name); });
  }
}

void read_tar(const std::string& file) {
  std::istringstream in(file);
  TarWalk walk(in, file.size());
  std::size_t size = 0;
  while (const auto member = walk.next()) size += walk.content(*member).size();
  if (size > file.size()) std::abort();
}

void read_json(const std::string& text) {
  const nlohmann::json json = parse_json(text);
  const nlohmann::json copy = json;
  if (copy.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace).empty()) std::abort();
  const Json stored = parse_stored_json(text);
  (void)listed_boxes(stored, {"a", "b"});
}

void read_rows(const std::string& text) {
  const auto fields = csv_fields(text);
  if (fields.size() > text.size() + 1) std::abort();
  (void)json_of_csv(std::vector<std::string>(fields.size(), "a"), text);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string file(reinterpret_cast<const char*>(data) + 1, size - 1);
  try {
    switch (data[0] % 7) {
      case 0:
      case 4:
        read_array(parse_array(file));
        break;
      case 1:
        read_hdf5(file);
        break;
      case 2:
        read_tar(file);
        break;
      case 3:
        read_json(file);
        break;
      case 5:
        read_rows(file);
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
