// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "reader_support/capture_rows.h"
#include "reader_support/dataset_page.h"
#include "reader_support/stored_files.h"

namespace diorama {

/// A picture of a format with one small label file for each.
struct ListedPicture {
  std::string stem;          ///< File name without ending.
  std::string ending;        ///< Of the picture: ".png"; empty: there is no picture.
  std::uint32_t folder = 0;  ///< Place in a list of the reader's own.
  std::int32_t capture = 0;
  std::uint32_t camera = 0;
};

/// The pictures of such a dataset, put together to captures.
class PictureList {
 public:
  /// Capture and camera that a name of our own writer says; nothing for other names.
  using NumberOf = std::function<std::optional<std::pair<int, int>>(const std::string& stem)>;

  /// With a page, names say capture and camera; names that say none, or one twice, are findings.
  /// Without one, each picture in order is a capture by the camera "camera".
  void set(std::vector<ListedPicture> pictures, const std::optional<DatasetPage>& page,
           const NumberOf& number_of, const std::vector<std::string>& folders, StoredFiles& files);

  const std::vector<std::string>& cameras() const { return cameras_; }
  std::vector<int> captures() const { return rows_.captures(); }
  /// The pictures of a capture, by camera.
  std::span<const ListedPicture> pictures(std::size_t capture) const { return rows_.of(capture); }
  const std::vector<ListedPicture>& all() const { return rows_.all(); }

 private:
  CaptureRows<ListedPicture> rows_;
  std::vector<std::string> cameras_;
};

/// "000012_cam_0" of the page's cameras.
std::optional<std::pair<int, int>> capture_and_camera(const DatasetPage& page,
                                                      const std::string& stem);

/// Stem and ending of each picture in a folder, sorted.
std::vector<ListedPicture> pictures_in(const std::filesystem::path& folder, std::uint32_t place);

/// True for endings that pictures have, in any case.
bool is_picture_ending(std::string ending);

}  // namespace diorama
