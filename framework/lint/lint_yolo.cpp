// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <optional>

#include "framework/lint/label_lines.h"
#include "framework/lint/label_polygons.h"
#include "framework/lint/lint_formats.h"
#include "framework/lint/lint_page.h"
#include "framework/lint/object_checks.h"

namespace diorama::lint {
namespace {

constexpr const char* kPartition = "pixels partition into instances";
constexpr std::size_t kKeypointNumbers = 27;  // nine points: x, y, visibility

struct YoloTask {
  std::string name;
  std::size_t classes = 0;
};

/// data.yaml has a line per class, in order.
void check_yolo_names(Dataset& dataset, const std::vector<std::string>& classes) {
  const auto yaml = dataset.text("data.yaml");
  if (!yaml) return;
  std::string names = "names:\n";
  for (std::size_t i = 0; i < classes.size(); ++i) {
    names += "  " + std::to_string(i) + ": " +
             Json(classes[i]).dump(-1, ' ', true, Json::error_handler_t::replace) + "\n";
  }
  dataset.check(yaml->ends_with(names), "ids within the label map", "data.yaml",
                "its names are not the classes of dataset.json");
}

/// The edges of a box lie between pixels.
void check_whole_pixels(Dataset& dataset, const std::string& file,
                        const std::vector<double>& numbers, const Picture& picture) {
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const double size = axis == 0 ? picture.width : picture.height;
    const double low = size * (numbers.at(axis + 1) - 0.5 * numbers.at(axis + 3));
    const double slack = 2e-6 * size;
    dataset.check(std::abs(low - std::round(low)) <= slack, "box = extent of mask", file,
                  "an edge of a box is at " + std::to_string(low) + " px, not between two pixels");
  }
}

/// Where all corners of the 3-D box are in the image, they surround the 2-D box.
void check_yolo_keypoints(Dataset& dataset, const std::string& file,
                          const std::vector<double>& numbers, const Picture& picture) {
  Eigen::AlignedBox2d corners;
  for (std::size_t i = 5; i + 2 < numbers.size(); i += 3) {
    if (numbers[i + 2] == 0.0) return;
    corners.extend(Vec2(numbers[i] * picture.width, numbers[i + 1] * picture.height));
  }
  check_surrounded(dataset, file, "a line's box",
                   Vec2(numbers[1] * picture.width, numbers[2] * picture.height),
                   Vec2(numbers[3] * picture.width, numbers[4] * picture.height), corners);
}

/// A keypoint in pixels; nothing for one outside of the image.
std::optional<Vec2> keypoint(const std::vector<double>& numbers, std::size_t index,
                             const Picture& picture) {
  const std::size_t at = 5 + 3 * index;
  if (numbers[at + 2] == 0.0) return std::nullopt;
  return Vec2(numbers[at] * picture.width, numbers[at + 1] * picture.height);
}

/// The diagonals of a box meet in its middle, in every picture of it. Leaves a tenth for what a
/// lens bends.
void check_yolo_diagonals(Dataset& dataset, const std::string& file,
                          const std::vector<double>& numbers, const Picture& picture) {
  const auto middle = keypoint(numbers, 0, picture);
  if (!middle) return;
  for (std::size_t corner = 1; corner <= 4; ++corner) {
    const auto a = keypoint(numbers, corner, picture);
    const auto b = keypoint(numbers, 9 - corner, picture);
    if (!a || !b) continue;
    const Vec2 along = *b - *a;
    const double share = (*middle - *a).dot(along) / std::max(along.squaredNorm(), 1e-12);
    const Vec2 nearest = *a + std::clamp(share, 0.0, 1.0) * along;
    dataset.check((*middle - nearest).norm() <= 0.5 + 0.1 * along.norm(), kReproject, file,
                  "the diagonal of keypoints " + std::to_string(corner) + " and " +
                      std::to_string(9 - corner) + " does not meet the box's middle");
  }
}

/// What is outside of the image has no place, everything else a visibility of 1 or 2.
void check_yolo_flags(Dataset& dataset, const std::string& file,
                      const std::vector<double>& numbers) {
  for (std::size_t i = 5; i + 2 < numbers.size(); i += 3) {
    const double flag = numbers[i + 2];
    const bool is_known = flag == 0.0 || flag == 1.0 || flag == 2.0;
    const bool has_place = numbers[i] != 0.0 || numbers[i + 1] != 0.0;
    dataset.check(is_known && (flag != 0.0 || !has_place), kRange, file,
                  "keypoint " + std::to_string((i - 5) / 3) + ": visibility " +
                      std::to_string(flag) + " does not fit its place");
  }
}

std::vector<Vec2> points_of(const std::vector<double>& numbers, const Picture& picture) {
  std::vector<Vec2> points;
  for (std::size_t i = 1; i + 1 < numbers.size(); i += 2) {
    points.emplace_back(numbers[i] * picture.width, numbers[i + 1] * picture.height);
  }
  return points;
}

/// A polygon runs between pixels and holds some.
void check_yolo_polygon(Dataset& dataset, const std::string& file,
                        const std::vector<double>& numbers, const Picture& picture,
                        PolygonMasks& masks) {
  const double slack = 2e-6 * std::max(picture.width, picture.height);
  const std::vector<Vec2> points = points_of(numbers, picture);
  for (const Vec2& point : points) {
    const Vec2 corner(std::round(point.x()), std::round(point.y()));
    if ((point - corner).cwiseAbs().maxCoeff() <= slack) continue;
    dataset.find(kPartition, file,
                 "a corner of a polygon is at " + std::to_string(point.x()) + ", " +
                     std::to_string(point.y()) + " px, not between pixels");
    return;
  }
  dataset.check(masks.add(points) > 0, kPartition, file, "a polygon holds no pixel");
}

/// The four corners are those of a rectangle, and go round it.
void check_yolo_rectangle(Dataset& dataset, const std::string& file,
                          const std::vector<double>& numbers, const Picture& picture) {
  const std::vector<Vec2> p = points_of(numbers, picture);
  const double slack = 4e-6 * std::max(picture.width, picture.height);
  const Vec2 u = p[1] - p[0];
  const Vec2 v = p[3] - p[0];
  const bool is_closed = (p[0] + p[2] - p[1] - p[3]).norm() <= slack;
  const bool is_right = std::abs(u.dot(v)) <= slack * (u.norm() + v.norm());
  dataset.check(is_closed && is_right, kFields, file,
                "the corners of a rotated box are not those of a rectangle");
  dataset.check(std::min(u.norm(), v.norm()) >= 0.5, kFields, file,
                "a rotated box is thinner than a pixel");
}

void check_yolo_line(Dataset& dataset, const std::string& file, const std::string& line,
                     const YoloTask& task, const Picture& picture, PolygonMasks& masks) {
  const auto numbers = numbers_of(words_of(line), 0);
  if (numbers.empty()) throw std::runtime_error("an empty line");
  dataset.check(
      numbers[0] >= 0 && numbers[0] < double(task.classes) && numbers[0] == std::floor(numbers[0]),
      "ids within the label map", file,
      "class " + std::to_string(numbers[0]) + " of " + std::to_string(task.classes));
  const std::size_t fields = numbers.size() - 1;
  const bool has_right_count = task.name == "detect"    ? fields == 4
                               : task.name == "obb"     ? fields == 8
                               : task.name == "segment" ? fields >= 6 && fields % 2 == 0
                                                        : fields == 4 + kKeypointNumbers;
  dataset.check(has_right_count, kFields, file,
                std::to_string(fields) + " numbers do not fit the task " + task.name);
  // The corners of a rotated box may lie a little outside.
  const double slack = task.name == "obb" ? 0.5 : 1e-6;
  for (std::size_t i = 1; i < numbers.size(); ++i) {
    const bool is_flag = task.name == "pose" && i > 4 && (i - 5) % 3 == 2;
    const double high = is_flag ? 2.0 : 1.0 + slack;
    dataset.check(numbers[i] >= -slack && numbers[i] <= high, kRange, file,
                  "the value " + std::to_string(numbers[i]) + " lies outside the image");
  }
  if (!has_right_count) return;
  if (task.name == "segment") return check_yolo_polygon(dataset, file, numbers, picture, masks);
  if (task.name == "obb") return check_yolo_rectangle(dataset, file, numbers, picture);
  for (std::size_t axis = 1; axis <= 2; ++axis) {
    const double half = 0.5 * numbers.at(axis + 2);
    dataset.check(half > 0.0 && numbers[axis] - half >= -2e-6 && numbers[axis] + half <= 1 + 2e-6,
                  kRange, file, "a box reaches beyond the image");
  }
  check_whole_pixels(dataset, file, numbers, picture);
  if (task.name != "pose") return;
  check_yolo_flags(dataset, file, numbers);
  check_yolo_keypoints(dataset, file, numbers, picture);
  check_yolo_diagonals(dataset, file, numbers, picture);
}

}  // namespace

void lint_yolo(Dataset& dataset) {
  const DatasetPage page = lint_page(dataset);
  check_yolo_names(dataset, page.classes);
  const YoloTask task{page.conventions.value("task", ""), page.classes.size()};
  for (const PlannedPicture& planned : page.pictures) {
    const std::string stem = planned.split + "/" + planned.stem;
    const std::string picture = picture_file(dataset, "images/" + stem);
    dataset.check(!picture.empty(), kMissing, "images/" + stem, "the picture is missing");
    const auto decoded = picture.empty() ? std::nullopt : dataset.picture(picture);
    const std::string labels = "labels/" + stem + ".txt";
    const auto text = dataset.text(labels);
    if (!text || !decoded) continue;
    PolygonMasks masks(decoded->width, decoded->height);
    dataset.reading(labels, [&] {
      for (const std::string& line : whole_lines_of(*text)) {
        check_yolo_line(dataset, labels, line, task, *decoded, masks);
      }
    });
    if (task.name != "segment") continue;
    const int contested = masks.contested();
    dataset.check(contested == 0, kPartition, labels,
                  std::to_string(contested) + " pixels belong to two polygons");
  }
}

}  // namespace diorama::lint
