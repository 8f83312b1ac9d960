// SPDX-License-Identifier: Apache-2.0
#include "diorama/writer.h"

#include <cstring>

namespace diorama {

DatasetFiles::~DatasetFiles() = default;
CaptureFiles::~CaptureFiles() = default;
Writer::~Writer() = default;

void DatasetFiles::add_text(std::string_view path, std::string_view text) {
  std::vector<std::byte> bytes(text.size());
  if (!text.empty()) std::memcpy(bytes.data(), text.data(), text.size());
  add(path, std::move(bytes));
}

void DatasetFiles::append_text(std::string_view path, std::string_view text) {
  append(path, std::as_bytes(std::span(text)));
}

void Writer::begin(const DatasetInfo&, DatasetFiles&) {}
void Writer::finish(const RecordReader&, DatasetFiles&) {}

}  // namespace diorama
