// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "diorama/reader.h"
#include "diorama/writer.h"
#include "reader_support/frame_reading.h"

namespace diorama {

/// A row is where a format keeps one frame; it has members `capture` and `camera`. Sorts rows by
/// both and keeps the first of each. `check(row, known)` is called once a row, `known` being the
/// one that is kept in its place, or null.
template <class Row, class Check>
std::vector<Row> sorted_once(std::vector<Row> rows, Check&& check) {
  std::ranges::stable_sort(rows, {},
                           [](const Row& row) { return std::pair(row.capture, row.camera); });
  std::vector<Row> once;
  once.reserve(rows.size());
  for (Row& row : rows) {
    const bool is_again =
        !once.empty() && once.back().capture == row.capture && once.back().camera == row.camera;
    check(std::as_const(row), is_again ? &std::as_const(once).back() : nullptr);
    if (!is_again) once.push_back(std::move(row));
  }
  return once;
}

/// Rows put together to captures.
template <class Row>
class CaptureRows {
 public:
  template <class Check>
  void set(std::vector<Row> rows, Check&& check) {
    rows_ = sorted_once(std::move(rows), check);
    first_.clear();
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      if (i == 0 || rows_[i].capture != rows_[i - 1].capture) first_.push_back(i);
    }
    first_.push_back(rows_.size());
  }

  /// Numbers of the captures that have rows.
  std::vector<int> captures() const {
    std::vector<int> numbers;
    for (std::size_t i = 0; i + 1 < first_.size(); ++i) numbers.push_back(rows_[first_[i]].capture);
    return numbers;
  }
  /// Of the `capture`th of them, by camera.
  std::span<const Row> of(std::size_t capture) const {
    return std::span(rows_).subspan(first_.at(capture), first_.at(capture + 1) - first_[capture]);
  }
  const std::vector<Row>& all() const { return rows_; }

 private:
  std::vector<Row> rows_;
  std::vector<std::size_t> first_{0};  ///< Per capture, and one behind the last.
};

/// Reads the frames of a capture's rows with `read_frame(row, stored, sources)`; one that gives
/// nothing is left out. `clips`: those of the dataset.
template <class Rows, class ReadFrame>
StoredCapture read_frames(int capture, std::span<const DatasetClip> clips, const Rows& rows,
                          ReadFrame&& read_frame) {
  StoredCapture stored;
  stored.capture.index = capture;
  stored.capture.clip = clip_frame(clips, capture);
  for (const auto& row : rows) {
    FrameSources sources;
    std::optional<Frame> frame = read_frame(row, stored, sources);
    if (!frame) continue;
    stored.capture.frames.push_back(std::move(*frame));
    stored.files.push_back(std::move(sources));
  }
  return stored;
}

}  // namespace diorama
