// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "diorama/reader.h"

namespace diorama {

/// What can be filtered by, of every capture of a dataset: a few numbers per object that a picture
/// shows. Grows while captures are read; may be asked by several threads meanwhile.
class CaptureIndex {
 public:
  /// One capture reduced to what is kept. Numbers that the format does not hold are kUnknown.
  static constexpr std::int32_t kUnknown = -1000;
  struct Object {
    std::string name;                    ///< See class_of().
    std::int32_t visible = kUnknown;     ///< Percent of the pixels that it would cover.
    std::int32_t truncation = kUnknown;  ///< Percent of it outside of the picture.
    std::int32_t box_side = 0;           ///< Per mille: root of the box's share of the picture.
    std::int32_t distance = kUnknown;    ///< Centimetres.
    std::int32_t elevation = kUnknown;   ///< Degrees, of the camera as seen from the object.
    std::int32_t azimuth = kUnknown;     ///< Degrees, from the object's x axis.
  };
  struct Picture {
    std::int32_t camera = 0;  ///< Place in StoredInfo::camera_names.
    int width = 0;
    int height = 0;
    std::vector<Object> objects;
  };
  struct Entry {
    int visit = 0;
    std::string phase;
    std::string environment;
    std::string split;
    std::int32_t findings = 0;     ///< Of the reader.
    std::int32_t clip = kUnknown;  ///< ClipFrame::clip.
    std::vector<Picture> pictures;
  };

  /// What entry_of() needs of a capture: no pictures where boxes stand in tables.
  static NameSet wanted(const StoredInfo& info);
  static Entry entry_of(const StoredInfo& info, const StoredCapture& stored);

  /// Captures come in the order of StoredInfo::captures.
  void add(const Entry& entry);
  /// Brightness of the next capture's pictures, percent or kUnknown each; after its entry, whose
  /// pictures count.
  void add_brightness(const std::vector<std::int32_t>& pictures);
  std::size_t size() const;
  std::size_t brightness_size() const;  ///< Of captures, too.
  /// JSON of up to `most` captures from place `from` on, as columns of whole numbers: see
  /// web/src/data.ts.
  std::string json(std::size_t from, std::size_t most) const;
  /// The same of the pictures' brightness, which takes longer to find.
  std::string brightness_json(std::size_t from, std::size_t most) const;

  /// All that it holds, for another object of the same build on this machine.
  std::string bytes() const;
  /// Becomes the index whose bytes() these are, of so many captures; false, and it stays empty,
  /// when they are not. Must be empty.
  bool take_bytes(std::string_view bytes, std::size_t captures);

 private:
  using Column = std::vector<std::int32_t>;
  /// Texts that occur, by number.
  class Names {
   public:
    std::int32_t number(const std::string& name);
    const std::vector<std::string>& list() const { return list_; }
    bool has(const Column& numbers) const;

   private:
    std::map<std::string, std::int32_t> numbers_;
    std::vector<std::string> list_;
  };

  template <class Self, class Act>
  static void each_names(Self& self, Act&& act);
  template <class Self, class Act>
  static void each_column(Self& self, Act&& act);
  bool fits_together(std::size_t captures) const;

  mutable std::mutex mutex_;
  Names classes_, phases_, environments_, splits_;
  Column visit_, phase_, environment_, split_, findings_, clip_;  ///< Per capture.
  std::vector<std::size_t> first_picture_{0};                     ///< Per capture, and the end.
  Column camera_, width_, height_;                                ///< Per picture.
  std::vector<std::size_t> first_object_{0};                      ///< Per picture, and the end.
  Column brightness_;                         ///< Per picture, of the first captures.
  std::vector<std::size_t> first_bright_{0};  ///< Per capture in it, and the end.
  Column class_, visible_, truncation_, box_side_, distance_, elevation_,
      azimuth_;  ///< Per object.
};

}  // namespace diorama
