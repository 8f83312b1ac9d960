// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "diorama/host.h"
#include "diorama/reader.h"

/// How readers read files: what is wrong with one becomes a finding about it.
namespace diorama {

using Json = nlohmann::ordered_json;

// Rules that every format knows; findings of one rule are counted together.
inline constexpr const char* kMissing = "nothing is missing";
inline constexpr const char* kReadable = "every file can be read";
inline constexpr const char* kCounts = "counts agree between files";
inline constexpr const char* kOnce = "nothing is there twice";
inline constexpr const char* kIds = "ids within the label map";
inline constexpr const char* kBox = "box = extent of mask";
inline constexpr const char* kPartition = "pixels partition into instances";
inline constexpr const char* kAmodal = "visible <= amodal";
inline constexpr const char* kInImage = "labels lie in the image";

/// Opens a file of a dataset; not good when it is a pipe or a device, for which a reader would
/// wait.
std::ifstream open_stored(const std::filesystem::path& file);

/// Whole content of a file of at most `most` bytes. Throws std::runtime_error that says why not.
std::string read_whole_file(const std::filesystem::path& file,
                            std::uintmax_t most = std::uintmax_t(1) << 30);

/// Throws std::exception for texts that are no JSON, or nest deeper than 100: copies of a tree walk
/// down by recursion.
Json parse_stored_json(std::string_view text);

/// Cuts off what is behind the point, as get() does. Throws std::exception for what is no number,
/// and for numbers that the type cannot hold: with those get() does what it likes.
template <class Whole>
Whole whole_number(const Json& value) {
  bool fits = true;
  if (value.is_number_float()) {
    const double number = value.get<double>();
    fits = number > double(std::numeric_limits<Whole>::min()) - 1.0 &&
           number < double(std::numeric_limits<Whole>::max()) + 1.0;
  } else if (value.is_number_unsigned()) {
    fits = std::in_range<Whole>(value.get<std::uint64_t>());
  } else if (value.is_number_integer()) {
    fits = std::in_range<Whole>(value.get<std::int64_t>());
  }
  if (!fits) throw std::runtime_error(value.dump() + " is beyond reason");
  return value.get<Whole>();
}

/// Decoded samples of a picture.
struct StoredPicture {
  std::shared_ptr<const Texture> texture;

  int width() const { return texture->width; }
  int height() const { return texture->height; }
  int channels() const { return texture->channels; }
  /// 8 or 16 bits.
  std::uint32_t at(int x, int y, int c = 0) const;
  /// Gray becomes three equal channels; missing alpha is 255.
  Image<Rgba8> color() const;
};

/// Reads the files of one capture or of a dataset's front matter, from one thread.
class StoredFiles {
 public:
  /// All arguments must outlive the object. Findings name this capture and camera.
  StoredFiles(const std::filesystem::path& root, const Host& host, ReadLog& log,
              std::optional<int> capture = std::nullopt, std::string camera = {})
      : root_(root), host_(host), log_(log), capture_(capture), camera_(std::move(camera)) {}

  const std::filesystem::path& root() const { return root_; }
  const Host& host() const { return host_; }
  bool has(const std::string& file) const;

  /// Counts a comparison; when it does not hold there is a finding.
  void check(bool holds, const char* rule, const std::string& file, const std::string& object,
             const std::string& found, const std::string& expected = {});
  void find(const char* rule, const std::string& file, const std::string& object,
            const std::string& found, const std::string& expected = {});

  std::optional<std::string> text(const std::string& file);
  std::optional<Json> json(const std::string& file);
  std::optional<StoredPicture> picture(const std::string& file);
  /// The same; a picture of another size is a finding.
  std::optional<StoredPicture> picture_of_size(const std::string& file, int width, int height,
                                               const std::string& says);
  /// Runs `body`; what it throws, a JSON access or a number, becomes a finding about `file`.
  void reading(const std::string& file, const std::function<void()>& body);

 private:
  const std::filesystem::path& root_;
  const Host& host_;
  ReadLog& log_;
  std::optional<int> capture_;
  std::string camera_;
};

/// Names of the plain files (or folders) right below `folder`, sorted; none when it is not there.
std::vector<std::string> names_in(const std::filesystem::path& folder, bool of_folders = false);

/// Where a file may lie below a dataset's folder that says where it was on somebody's disk,
/// likeliest first: "data\\images\\1.png", "/home/me/images/1.png" and "../images/1.png" may all be
/// "images/1.png", or "1.png". None leads out of the folder.
std::vector<std::string> possible_places(std::string said);

/// "[3, 5, 10, 12)".
std::string box_text(const PixelBox& box);

}  // namespace diorama
