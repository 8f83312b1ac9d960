// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "diorama/reader.h"

namespace diorama {

/// Checks what must hold in the frames of any format, as far as they hold it, and adds to the log:
/// sizes, finite numbers, boxes and masks, whole objects and their visible parts, who hides whom,
/// 3-D boxes against pixels and depth, the two kinds of depth, directions of normals, motion in
/// clips. Formulas of lenses are lint's own, not those that wrote the data. Several threads may
/// call it.
void check_frames(const StoredInfo& info, StoredCapture& stored);

/// What must hold between the captures of one dataset: an object's labels stay, and no
/// capture shows the pixels of another one whose labels differ. Remembers a few numbers per capture
/// and object. Captures come in order, from one thread.
class CaptureComparison {
 public:
  /// `is_own`: one of our writers made it. Tracks of others may change their classes.
  CaptureComparison(const StoredInfo& info, bool is_own) : info_(info), is_own_(is_own) {}
  void add(const StoredCapture& stored, ReadLog& log);

 private:
  struct KnownObject {
    int capture = 0;
    Labels labels;
  };
  struct KnownPicture {
    int capture = 0;
    std::uint64_t labels = 0;
  };
  void compare_objects(const StoredCapture& stored, std::size_t frame, ReadLog& log);
  void compare_tracks(const StoredCapture& stored, std::size_t frame, ReadLog& log);
  void compare_pixels(const StoredCapture& stored, std::size_t frame, ReadLog& log);

  const StoredInfo& info_;
  bool is_own_;
  int clip_ = -1;
  std::map<std::uint32_t, KnownObject> tracks_;     ///< Of that clip.
  std::map<std::string, KnownObject> objects_;      ///< By node path.
  std::map<std::uint64_t, KnownPicture> pictures_;  ///< By digest.
};

/// The file in which something of a frame stands, or ".".
std::string file_of(const StoredCapture& stored, std::size_t frame, std::string_view held);

/// To what the format rounds it; 0 for what is exact.
double step_of(const StoredInfo& info, std::string_view held);

}  // namespace diorama
