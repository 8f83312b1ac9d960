// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <functional>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "diorama/image.h"
#include "diorama/math.h"
#include "framework/lint/lint_report.h"

/// How lint reads: every reader reports what it cannot read as a finding and returns nothing.
namespace diorama::lint {

/// Decoded samples of a picture.
struct Picture {
  int width = 0;
  int height = 0;
  int channels = 0;
  std::vector<std::uint32_t> samples;  ///< 8 or 16 bit, interleaved.

  /// Throws std::runtime_error outside of the picture.
  std::uint32_t at(int x, int y, int c = 0) const {
    if (x < 0 || x >= width || y < 0 || y >= height) {
      throw std::runtime_error("a picture is smaller than others say");
    }
    return samples[(std::size_t(y) * std::size_t(width) + std::size_t(x)) * std::size_t(channels) +
                   std::size_t(c)];
  }
};

/// One column of a structured array, or a plain one.
struct NpyArray {
  std::string descr;
  std::vector<std::size_t> shape;
  std::size_t item_size = 0;
  std::vector<std::byte> data;

  std::size_t count() const;  ///< Elements.
  /// Throws std::runtime_error beyond the end.
  template <class T>
  T value(std::size_t offset) const {
    T result{};
    if (offset > data.size() || sizeof result > data.size() - offset) {
      throw std::runtime_error("an array is smaller than others say");
    }
    std::memcpy(&result, data.data() + offset, sizeof result);
    return result;
  }
};

class Dataset {
 public:
  Dataset(std::filesystem::path root, LintReport& report);

  const std::filesystem::path& root() const { return root_; }
  /// Relative paths of all files, sorted; those of the host's own bookkeeping are left out.
  const std::vector<std::string>& files() const { return files_; }
  bool has(const std::string& file) const;
  /// Counts a comparison; when `holds` is false the message becomes a finding.
  void check(bool holds, const char* rule, const std::string& file, const std::string& message);
  void find(const char* rule, const std::string& file, const std::string& message);

  std::optional<std::string> text(const std::string& file);
  std::optional<Picture> picture(const std::string& file);
  /// Runs `body`; what it throws becomes a finding about `file`.
  void reading(const std::string& file, const std::function<void()>& body);

 private:
  std::filesystem::path root_;
  LintReport& report_;
  std::vector<std::string> files_;
};

/// Bytes of an array by its shape and size of elements. Throws std::runtime_error when that cannot
/// be, as a file holds `most` bytes of it at most.
std::size_t checked_size(const NpyArray& array, std::size_t most);

/// Throws std::runtime_error that says what is wrong.
NpyArray parse_npy(const std::string& bytes);
Picture parse_picture(const std::string& bytes, const std::string& name);

std::string box_text(const PixelBox& box);  ///< "[3, 5, 10, 12)".

}  // namespace diorama::lint
