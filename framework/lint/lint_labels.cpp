// SPDX-License-Identifier: Apache-2.0
// Formats with one small label file per picture: YOLO, KITTI, Pascal VOC.
#include <charconv>
#include <cmath>
#include <iterator>
#include <regex>
#include <sstream>

#include "framework/lint/lint_formats.h"

namespace diorama::lint {
namespace {

constexpr const char* kMissing = "nothing is missing";
constexpr const char* kRange = "labels lie in the image";
constexpr const char* kFields = "every file can be read";

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

/// Throws when a word is no number.
std::vector<double> numbers_of(const std::vector<std::string>& words, std::size_t first) {
  std::vector<double> numbers;
  for (std::size_t i = first; i < words.size(); ++i) {
    double value = 0.0;
    const char* end = words[i].data() + words[i].size();
    const auto result = std::from_chars(words[i].data(), end, value);
    if (result.ec != std::errc() || result.ptr != end) {
      throw std::runtime_error("'" + words[i] + "' is not a number");
    }
    numbers.push_back(value);
  }
  return numbers;
}

std::vector<std::string> words_of(const std::string& line) {
  std::istringstream in(line);
  return {std::istream_iterator<std::string>(in), {}};
}

/// The file with one of the picture endings; empty when there is none.
std::string picture_file(const Dataset& dataset, const std::string& stem) {
  for (const char* ending : {".png", ".jpg", ".jpeg"}) {
    if (dataset.has(stem + ending)) return stem + ending;
  }
  return {};
}

std::string stem_of(const std::string& file) { return std::filesystem::path(file).stem().string(); }

struct YoloTask {
  std::string name;
  int classes = 0;
};

YoloTask read_yolo_task(Dataset& dataset) {
  YoloTask task;
  if (const auto page = dataset.json("dataset.json")) {
    dataset.reading("dataset.json", [&] {
      task.name = page->at("conventions").at("task").get<std::string>();
      task.classes = int(page->at("classes").size());
    });
  }
  return task;
}

void check_yolo_line(Dataset& dataset, const std::string& file, const std::string& line,
                     const YoloTask& task) {
  const auto numbers = numbers_of(words_of(line), 0);
  if (numbers.empty()) throw std::runtime_error("an empty line");
  dataset.check(numbers[0] >= 0 && numbers[0] < task.classes && numbers[0] == int(numbers[0]),
                "ids within the label map", file,
                "class " + std::to_string(numbers[0]) + " of " + std::to_string(task.classes));
  const std::size_t fields = numbers.size() - 1;
  const bool has_right_count = task.name == "detect"    ? fields == 4
                               : task.name == "obb"     ? fields == 8
                               : task.name == "segment" ? fields >= 6 && fields % 2 == 0
                                                        : fields == 4 + 27;
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
  if (task.name != "detect" && task.name != "pose") return;
  for (std::size_t axis = 1; axis <= 2; ++axis) {
    const double half = 0.5 * numbers.at(axis + 2);
    dataset.check(half > 0.0 && numbers[axis] - half >= -2e-6 && numbers[axis] + half <= 1 + 2e-6,
                  kRange, file, "a box reaches beyond the image");
  }
}

struct KittiImage {
  Picture picture;
  Mat3 camera = Mat3::Identity();
  std::optional<Picture> depth;
};

Mat3 read_kitti_camera(const std::string& text) {
  for (const std::string& line : lines_of(text)) {
    if (!line.starts_with("P2: ")) continue;
    const auto p = numbers_of(words_of(line), 1);
    Mat3 camera;
    for (int i = 0; i < 9; ++i) camera(i / 3, i % 3) = p.at(std::size_t(4 * (i / 3) + i % 3));
    return camera;
  }
  throw std::runtime_error("has no line P2");
}

/// The fifteen fields of a label line but the first.
struct KittiLabel {
  PixelBox box;
  double truncation;
  Vec3 size;  ///< Length, height, width.
  Vec3 location;
  double rotation_y;
};

KittiLabel read_kitti_label(const std::vector<std::string>& words) {
  const auto v = numbers_of(words, 1);
  return {{int(v[3]), int(v[4]), int(v[5]), int(v[6])},
          v[0],
          {v[9], v[7], v[8]},
          {v[10], v[11], v[12]},
          v[13]};
}

/// Corners of the upright box, in the camera's space.
std::vector<Vec3> kitti_corners(const KittiLabel& label) {
  const double c = std::cos(label.rotation_y);
  const double s = std::sin(label.rotation_y);
  std::vector<Vec3> corners;
  for (int i = 0; i < 8; ++i) {
    const Vec3 share((i & 1) != 0 ? 0.5 : -0.5, (i & 2) != 0 ? -1.0 : 0.0,
                     (i & 4) != 0 ? 0.5 : -0.5);
    const Vec3 local = share.cwiseProduct(label.size);
    corners.push_back(label.location + Vec3(c * local.x() + s * local.z(), local.y(),
                                            c * local.z() - s * local.x()));
  }
  return corners;
}

void check_kitti_depth(Dataset& dataset, const std::string& file, const std::string& who,
                       const PixelBox& box, const std::vector<Vec3>& corners,
                       const Picture& depth) {
  double near = kInfinity;
  double far = 0.0;
  for (const Vec3& corner : corners) {
    near = std::min(near, corner.z());
    far = std::max(far, corner.z());
  }
  std::size_t inside = 0;
  for (int y = box.y_min; y < box.y_max; ++y) {
    for (int x = box.x_min; x < box.x_max; ++x) {
      const double z = depth.at(x, y) / 256.0;
      if (z >= near - 0.01 && z <= far + 0.01) ++inside;
    }
  }
  dataset.check(inside > 0, "depth back-projects", file,
                who + ": no depth in its box lies between " + std::to_string(near) + " and " +
                    std::to_string(far) + " m");
}

void check_kitti_line(Dataset& dataset, const std::string& file, const std::string& line,
                      const KittiImage& image) {
  const auto words = words_of(line);
  if (words.size() != 15) {
    throw std::runtime_error("a line of " + std::to_string(words.size()) + " fields, not 15");
  }
  const std::string& who = words[0];
  const KittiLabel label = read_kitti_label(words);
  const PixelBox& box = label.box;
  const bool is_inside =
      !box.is_empty() && box == box.clipped(image.picture.width, image.picture.height);
  dataset.check(is_inside, kRange, file, who + ": its box reaches beyond the image");
  dataset.check(label.truncation >= 0.0 && label.truncation <= 1.0, "visible <= amodal", file,
                who + ": truncation " + words[1]);
  const auto corners = kitti_corners(label);
  Eigen::AlignedBox2d projected;
  for (const Vec3& corner : corners) {
    if (corner.z() <= 0.01) return;
    projected.extend((image.camera * corner).hnormalized());
  }
  const bool holds =
      projected.min().x() <= box.x_min + 1.1 && projected.min().y() <= box.y_min + 1.1 &&
      projected.max().x() >= box.x_max - 1.1 && projected.max().y() >= box.y_max - 1.1;
  dataset.check(holds, "pose and camera reproject onto the mask", file,
                who + ": the projection of its 3-D box does not hold its 2-D box");
  if (image.depth && is_inside) {
    check_kitti_depth(dataset, file, who, box, corners, *image.depth);
  }
}

void lint_kitti_image(Dataset& dataset, const std::string& stem) {
  const std::string picture = picture_file(dataset, "training/image_2/" + stem);
  dataset.check(!picture.empty(), kMissing, "training/image_2/" + stem, "the picture is missing");
  if (picture.empty()) return;
  KittiImage image;
  const auto decoded = dataset.picture(picture);
  const std::string calib = "training/calib/" + stem + ".txt";
  const std::string labels = "training/label_2/" + stem + ".txt";
  const auto calib_text = dataset.text(calib);
  const auto label_text = dataset.text(labels);
  if (!decoded || !calib_text || !label_text) return;
  image.picture = *decoded;
  dataset.reading(calib, [&] { image.camera = read_kitti_camera(*calib_text); });
  if (const std::string depth = "training/depth_2/" + stem + ".png"; dataset.has(depth)) {
    image.depth = dataset.picture(depth);
    if (image.depth && !image.depth->has_size_of(image.picture)) {
      dataset.find("counts agree between files", depth, "has another size than the picture");
      image.depth.reset();
    }
  }
  dataset.reading(labels, [&] {
    for (const std::string& line : lines_of(*label_text)) {
      check_kitti_line(dataset, labels, line, image);
    }
  });
}

std::string xml_text(const std::string& xml, const char* name) {
  std::smatch found;
  const std::string tag(name);
  if (!std::regex_search(xml, found, std::regex("<" + tag + ">([^<]*)</" + tag + ">"))) {
    throw std::runtime_error("has no element <" + tag + ">");
  }
  return found[1];
}

void lint_voc_image(Dataset& dataset, const std::string& stem) {
  const std::string file = "Annotations/" + stem + ".xml";
  const auto xml = dataset.text(file);
  if (!xml) return;
  dataset.reading(file, [&] {
    if (!xml->ends_with("</annotation>\n")) throw std::runtime_error("is cut short");
    const std::string picture_name = "JPEGImages/" + xml_text(*xml, "filename");
    const auto picture = dataset.picture(picture_name);
    const int width = std::stoi(xml_text(*xml, "width"));
    const int height = std::stoi(xml_text(*xml, "height"));
    dataset.check(picture && picture->width == width && picture->height == height,
                  "counts agree between files", picture_name, "size differs from " + file);
    const std::string masks_file = "SegmentationObject/" + stem + ".png";
    std::map<std::uint32_t, Extent> masks;
    const bool has_masks = xml_text(*xml, "segmented") == "1";
    if (has_masks) {
      if (const auto masks_picture = dataset.picture(masks_file)) masks = extents(*masks_picture);
      dataset.picture("SegmentationClass/" + stem + ".png");
    }
    std::uint32_t place = 0;
    for (std::size_t at = xml->find("<object>"); at != std::string::npos;
         at = xml->find("<object>", at + 1)) {
      const std::string object = xml->substr(at, xml->find("</object>", at) - at);
      // VOC counts pixels from 1 and includes the last one.
      const PixelBox box{std::stoi(xml_text(object, "xmin")) - 1,
                         std::stoi(xml_text(object, "ymin")) - 1,
                         std::stoi(xml_text(object, "xmax")), std::stoi(xml_text(object, "ymax"))};
      ++place;
      if (!has_masks) continue;
      dataset.check(masks.contains(place) && masks.at(place).box == box, "box = extent of mask",
                    file,
                    "object " + std::to_string(place) + ": box " + box_text(box) +
                        ", its pixels extend over " +
                        (masks.contains(place) ? box_text(masks.at(place).box) : "nothing"));
    }
  });
}

}  // namespace

void lint_yolo(Dataset& dataset) {
  const YoloTask task = read_yolo_task(dataset);
  std::size_t count = 0;
  for (const std::string& file : dataset.files()) {
    const auto folder = std::filesystem::path(file).parent_path().filename().string();
    if (file.starts_with("images/")) {
      dataset.picture(file);
      const std::string label = "labels/" + folder + "/" + stem_of(file) + ".txt";
      dataset.check(dataset.has(label), kMissing, label, "the labels of " + file + " are missing");
    } else if (file.starts_with("labels/")) {
      ++count;
      const std::string stem = "images/" + folder + "/" + stem_of(file);
      dataset.check(!picture_file(dataset, stem).empty(), kMissing, stem,
                    "the picture of " + file + " is missing");
      const auto text = dataset.text(file);
      if (!text) continue;
      dataset.reading(file, [&] {
        for (const std::string& line : lines_of(*text)) check_yolo_line(dataset, file, line, task);
      });
    }
  }
  dataset.check(count > 0, kMissing, "labels", "there are no labels");
}

void lint_kitti(Dataset& dataset) {
  const auto list = dataset.text("ImageSets/trainval.txt");
  if (!list) return;
  for (const std::string& stem : lines_of(*list)) lint_kitti_image(dataset, stem);
}

void lint_voc(Dataset& dataset) {
  const auto list = dataset.text("ImageSets/Main/trainval.txt");
  if (!list) return;
  for (const std::string& stem : lines_of(*list)) lint_voc_image(dataset, stem);
}

}  // namespace diorama::lint
