// SPDX-License-Identifier: Apache-2.0
#include "diorama/writer.h"

#include <algorithm>
#include <cstring>
#include <iterator>

namespace diorama {

std::optional<ClipFrame> clip_frame(std::span<const DatasetClip> clips, int capture) {
  const auto behind = std::ranges::upper_bound(clips, capture, {}, &DatasetClip::first);
  if (behind == clips.begin()) return std::nullopt;
  const DatasetClip& clip = *std::prev(behind);
  const int frame = capture - clip.first;
  if (frame >= clip.count) return std::nullopt;
  return ClipFrame{int(behind - clips.begin()) - 1, frame, clip.count, clip.fps};
}

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
