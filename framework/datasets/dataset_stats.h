// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "diorama/host.h"
#include "diorama/reader.h"

namespace diorama {

/// How many values fell into each of equal intervals of [low, high]; what lies beyond counts in the
/// first or last one.
class Histogram {
 public:
  Histogram(double low, double high, std::size_t bins) : low_(low), high_(high), counts_(bins, 0) {}

  void add(double value);
  std::int64_t total() const { return total_; }
  double low() const { return low_; }
  double high() const { return high_; }
  const std::vector<std::int64_t>& counts() const { return counts_; }
  double mean() const { return total_ == 0 ? 0.0 : sum_ / double(total_); }
  double least() const { return least_; }
  double most() const { return most_; }

 private:
  double low_;
  double high_;
  std::vector<std::int64_t> counts_;
  std::int64_t total_ = 0;
  double sum_ = 0.0;
  double least_ = std::numeric_limits<double>::infinity();
  double most_ = -std::numeric_limits<double>::infinity();
};

inline constexpr std::size_t kHeatColumns = 16;
inline constexpr std::size_t kHeatRows = 12;
inline constexpr std::size_t kAzimuths = 12;   ///< Of 30 degrees, from the object's x axis.
inline constexpr std::size_t kElevations = 6;  ///< Of 30 degrees, from below to above.

/// What is counted of the objects of one class. A histogram is empty where the format does not hold
/// what it needs.
struct ClassStats {
  std::int64_t objects = 0;          ///< With a box in a picture.
  std::int64_t pictures = 0;         ///< In which there is one.
  Histogram box_side{0.0, 1.0, 10};  ///< Square root of the box's share of the picture.
  Histogram visible{0.0, 1.0, 10};   ///< 1 - occlusion.
  Histogram truncation{0.0, 1.0, 10};
  Histogram distance_m{0.0, 10.0, 20};  ///< From the camera to the middle of the object's box.
  /// Where on the sphere round the object its camera stands, in the object's axes.
  std::array<std::array<std::int64_t, kAzimuths>, kElevations> views{};
  /// Where in the picture the middles of boxes lie, from the top left.
  std::array<std::array<std::int64_t, kHeatColumns>, kHeatRows> places{};
};

/// Its label of the taxonomy `class`, else the first one; empty without labels.
std::string class_of(const Instance& instance);

/// From where a camera sees an object, in the object's axes; radians.
struct SeenFrom {
  double distance_m = 0.0;  ///< From the camera to the middle of the object's box.
  double azimuth = 0.0;     ///< From the x axis, -pi to pi.
  double elevation = 0.0;   ///< -pi/2 to pi/2.
};
/// Mean of a picture's sRGB values, 0 to 1.
double mean_brightness(const Image<Rgba8>& image);

/// Nothing where the dataset holds no poses.
std::optional<SeenFrom> seen_from(const StoredInfo& info, const Frame& frame,
                                  const Instance& instance);

/// Pictures that one should look at, the first of them by name.
struct SuspiciousPictures {
  static constexpr std::size_t kMostNames = 20;
  std::int64_t count = 0;
  std::vector<std::string> names;  ///< "capture 3, cam_0".
};

struct DatasetStats {
  std::string format;
  NameSet holds;
  std::int64_t captures = 0;
  std::int64_t pictures = 0;
  std::map<std::string, std::int64_t> pictures_by_camera;
  std::map<std::string, std::int64_t> pictures_by_split;
  std::map<std::string, std::int64_t> pictures_by_size;  ///< "640 x 480".
  std::map<std::string, ClassStats> classes;             ///< By name; "" without a label.
  Histogram objects_per_picture{0.0, 50.0, 50};
  Histogram brightness{0.0, 1.0, 20};  ///< Mean of a picture, sRGB encoded.
  /// "no object", "black", "burnt", "one colour", "something close before the camera", "moving".
  std::map<std::string, SuspiciousPictures> suspicious;
  std::int64_t findings = 0;  ///< Of the reader; lint says which.
  /// Text of views.json, how views came about; empty when the dataset has none. Filled by callers.
  std::string views;
};

/// Goes through all captures on the host's threads. Memory does not depend on how many there are.
DatasetStats dataset_stats(const StoredDataset& dataset, Host& host);

/// Tables for people.
std::string stats_text(const DatasetStats& stats);
std::string stats_json(const DatasetStats& stats);
/// A page that needs no other file.
std::string stats_html(const DatasetStats& stats, const std::string& title);

}  // namespace diorama
