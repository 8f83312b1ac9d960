// SPDX-License-Identifier: Apache-2.0
#include "framework/lint/dataset_files.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <span>
#include <sstream>

#include "diorama/error.h"
#include "framework/images/image_codecs.h"

namespace diorama::lint {
namespace {

/// Size in bytes of "'<f4'" or of the sum of "[('a', '<u4'), ('m', '<f4', (4, 4))]".
std::size_t item_size_of(const std::string& descr) {
  constexpr std::size_t kMost = 1 << 20;
  std::size_t total = 0;
  for (std::size_t at = descr.find_first_of("<|"); at != std::string::npos;
       at = descr.find_first_of("<|", at + 1)) {
    std::size_t size = 0;
    const char* end = descr.data() + descr.size();
    const char* begin = std::min(descr.data() + at + 2, end);
    const char* rest = std::from_chars(begin, end, size).ptr;
    if (std::string_view(rest, std::size_t(end - rest)).starts_with("', (4, 4)")) {
      size = std::min(size, kMost) * 16;
    }
    total = std::min(total + std::min(size, kMost), kMost);
  }
  if (total == 0 || total == kMost) throw std::runtime_error("has elements of unknown size");
  return total;
}

std::size_t extent_of(std::string_view text) {
  while (!text.empty() && text.front() == ' ') text.remove_prefix(1);
  std::size_t extent = 0;
  const char* end = text.data() + text.size();
  const auto [rest, failed] = std::from_chars(text.data(), end, extent);
  if (failed != std::errc() || rest != end) throw std::runtime_error("has a shape of no numbers");
  return extent;
}

/// Sizes below need no file that holds them.
constexpr std::size_t kSmallArray = 1 << 16;

/// What stands between `before` and `after`.
std::string between(const std::string& text, const std::string& before, const std::string& after) {
  const std::size_t begin = text.find(before);
  const std::size_t end =
      begin == std::string::npos ? begin : text.find(after, begin + before.size());
  if (end == std::string::npos) throw std::runtime_error("npy header without " + before);
  return text.substr(begin + before.size(), end - begin - before.size());
}

}  // namespace

std::size_t NpyArray::count() const {
  std::size_t product = 1;
  for (const std::size_t extent : shape) product *= extent;
  return product;
}

std::size_t checked_size(const NpyArray& array, std::size_t most) {
  // Also where one extent is 0: readers loop over the others.
  std::size_t size = array.item_size;
  bool is_empty = false;
  for (const std::size_t extent : array.shape) {
    is_empty = is_empty || extent == 0;
    const std::size_t factor = std::max<std::size_t>(extent, 1);
    if (size > std::max(most, kSmallArray) / factor) {
      throw std::runtime_error("claims to be larger than its file can be");
    }
    size *= factor;
  }
  return is_empty ? 0 : size;
}

NpyArray parse_npy(const std::string& bytes) {
  if (bytes.size() < 10 || bytes.compare(0, 8, std::string("\x93NUMPY\x01\x00", 8)) != 0) {
    throw std::runtime_error("not an npy file of version 1.0");
  }
  const std::size_t length =
      static_cast<unsigned char>(bytes[8]) + 256u * static_cast<unsigned char>(bytes[9]);
  if (bytes.size() < 10 + length) throw std::runtime_error("ends within its header");
  const std::string header = bytes.substr(10, length);
  NpyArray array;
  array.descr = between(header, "'descr': ", ", 'fortran_order'");
  std::istringstream shape(between(header, "'shape': (", ")"));
  for (std::string extent; std::getline(shape, extent, ',');) {
    if (extent.find_first_not_of(' ') != std::string::npos) {
      array.shape.push_back(extent_of(extent));
    }
  }
  array.item_size = item_size_of(array.descr);
  const std::size_t held = bytes.size() - 10 - length;
  const std::size_t expected = checked_size(array, held);
  if (held != expected) {
    throw std::runtime_error("holds " + std::to_string(held) + " bytes of data, its header says " +
                             std::to_string(expected));
  }
  const auto data = std::as_bytes(std::span(bytes)).last(expected);
  array.data.assign(data.begin(), data.end());
  return array;
}

Picture parse_picture(const std::string& bytes, const std::string& name) {
  const auto texture = decode_image(std::as_bytes(std::span(bytes.data(), bytes.size())), name);
  Picture picture{texture->width, texture->height, texture->channels, {}};
  if (texture->floats.empty()) {
    picture.samples.assign(texture->bytes.begin(), texture->bytes.end());
  } else {
    picture.samples.reserve(texture->floats.size());
    for (const float value : texture->floats) {
      picture.samples.push_back(std::uint32_t(std::lround(double(value) * 65535.0)));
    }
  }
  return picture;
}

Dataset::Dataset(std::filesystem::path root, LintReport& report)
    : root_(std::move(root)), report_(report) {
  for (const auto& entry : std::filesystem::recursive_directory_iterator(
           root_, std::filesystem::directory_options::skip_permission_denied)) {
    if (!entry.is_regular_file()) continue;
    std::string path = entry.path().lexically_relative(root_).generic_string();
    if (path.find(".diorama") == std::string::npos) files_.push_back(std::move(path));
  }
  std::ranges::sort(files_);
}

bool Dataset::has(const std::string& file) const {
  return std::ranges::binary_search(files_, file);
}

void Dataset::check(bool holds, const char* rule, const std::string& file,
                    const std::string& message) {
  ++report_.checks;
  if (!holds) find(rule, file, message);
}

void Dataset::find(const char* rule, const std::string& file, const std::string& message) {
  report_.findings.push_back({rule, file, message});
}

std::optional<std::string> Dataset::text(const std::string& file) {
  // Names come from the dataset's own files: they may lead elsewhere, or to what never ends.
  const std::filesystem::path path = std::filesystem::path(file).lexically_normal();
  const bool is_inside = path.is_relative() && !path.empty() && *path.begin() != "..";
  std::error_code failed;
  std::ifstream in;
  if (is_inside && std::filesystem::is_regular_file(root_ / path, failed)) {
    in.open(root_ / path, std::ios::binary);
  }
  if (!in.is_open()) {
    find("nothing is missing", file, "the file is not there");
    return std::nullopt;
  }
  std::ostringstream content;
  content << in.rdbuf();
  ++report_.files;
  return std::move(content).str();
}

std::optional<Picture> Dataset::picture(const std::string& file) {
  const auto content = text(file);
  if (!content) return std::nullopt;
  try {
    return parse_picture(*content, file);
  } catch (const std::exception& error) {
    // The codecs put the name in front, findings have it anyway.
    const std::string text = error.what();
    const bool is_named = text.starts_with(file + ": ");
    find("every file can be read", file, is_named ? text.substr(file.size() + 2) : text);
    return std::nullopt;
  }
}

void Dataset::reading(const std::string& file, const std::function<void()>& body) {
  try {
    body();
  } catch (const std::exception& error) {
    find("every file can be read", file, error.what());
  }
}

std::string box_text(const PixelBox& box) {
  return "[" + std::to_string(box.x_min) + ", " + std::to_string(box.y_min) + ", " +
         std::to_string(box.x_max) + ", " + std::to_string(box.y_max) + ")";
}

}  // namespace diorama::lint
