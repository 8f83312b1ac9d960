// SPDX-License-Identifier: Apache-2.0
// KITTI and Pascal VOC: one small label file per picture.
#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <map>
#include <optional>

#include "framework/config/json_text.h"
#include "framework/lint/label_lines.h"
#include "framework/lint/lint_formats.h"
#include "framework/lint/lint_page.h"
#include "framework/lint/object_checks.h"

namespace diorama::lint {
namespace {

/// Indices into VOC's palette, which deals an index's bits to red, green and blue, the highest
/// first. A gray picture holds them itself.
std::optional<Picture> indices_of(std::optional<Picture> picture) {
  if (!picture || picture->channels < 3) return picture;
  Picture indices{picture->width, picture->height, 1, {}};
  for (int y = 0; y < picture->height; ++y) {
    for (int x = 0; x < picture->width; ++x) {
      std::uint32_t index = 0;
      for (std::uint32_t bit = 0; bit < 8; ++bit) {
        index |= ((picture->at(x, y, int(bit % 3)) >> (7 - bit / 3)) & 1u) << bit;
      }
      indices.samples.push_back(index);
    }
  }
  return indices;
}

struct KittiImage {
  Picture picture;
  Lens lens;
  std::optional<Picture> depth;
};

Lens read_kitti_lens(const std::string& text, const Picture& picture) {
  std::optional<Mat3> camera;
  Json holder = Json::object();
  for (const std::string& line : lines_of(text)) {
    if (line.starts_with("lens_2: ")) holder["lens"] = parse_json(line.substr(8));
    if (!line.starts_with("P2: ")) continue;
    const auto p = numbers_of(words_of(line), 1);
    camera = intrinsics_matrix(p.at(0), p.at(5), p.at(2), p.at(6));
  }
  if (!camera) throw std::runtime_error("has no line P2");
  return lens_of(holder, picture.width, picture.height, *camera);
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

/// From the upright box's own space (length, height, width; the origin in the middle of the bottom
/// face) to the camera's.
Affine kitti_pose(const KittiLabel& label) {
  Affine pose = Affine::Identity();
  pose.linear() = Eigen::AngleAxisd(label.rotation_y, Vec3::UnitY()).toRotationMatrix();
  pose.translation() = label.location;
  return pose;
}

SeenObject kitti_object(const std::string& file, const std::string& who, const KittiLabel& label) {
  SeenObject seen;
  seen.who = who;
  seen.file = file;
  seen.camera_from_local = kitti_pose(label);
  const Vec3 half = 0.5 * label.size;
  seen.bounds = {Vec3(-half.x(), -label.size.y(), -half.z()), Vec3(half.x(), 0.0, half.z())};
  seen.box = label.box;
  seen.slack_px = 1.0;
  return seen;
}

/// Each side of the 2-D box touches the object: some pixel of its outermost row or column lies in
/// the 3-D box.
void check_kitti_sides(Dataset& dataset, const SeenObject& seen, const KittiImage& image) {
  const Affine local_from_camera = seen.camera_from_local.inverse();
  const Vec3 slack = Vec3::Constant(0.01) + 0.01 * seen.bounds.size();
  const auto is_met = [&](int x, int y) {
    const auto ray = image.lens.direction(Vec2(x + 0.5, y + 0.5));
    if (!ray || image.depth->at(x, y) == 0) return false;
    const double z = image.depth->at(x, y) / 256.0;
    const Vec3 p = local_from_camera * (*ray * (z / ray->z()));
    return ((p - seen.bounds.min + slack).array() >= 0.0).all() &&
           ((seen.bounds.max + slack - p).array() >= 0.0).all();
  };
  const PixelBox& b = seen.box;
  std::array<bool, 4> touches{};
  for (int x = b.x_min; x < b.x_max; ++x) {
    touches[0] |= is_met(x, b.y_min);
    touches[1] |= is_met(x, b.y_max - 1);
  }
  for (int y = b.y_min; y < b.y_max; ++y) {
    touches[2] |= is_met(b.x_min, y);
    touches[3] |= is_met(b.x_max - 1, y);
  }
  const bool holds = touches[0] && touches[1] && touches[2] && touches[3];
  dataset.check(holds, kBackProject, seen.file,
                seen.who + ": by the depth, a side of its 2-D box " + box_text(b) +
                    " does not touch its 3-D box");
}

void check_kitti_line(Dataset& dataset, const std::string& file, const std::string& line,
                      const KittiImage& image) {
  const auto words = words_of(line);
  if (words.size() != 15) {
    throw std::runtime_error("a line of " + std::to_string(words.size()) + " fields, not 15");
  }
  const KittiLabel label = read_kitti_label(words);
  const PixelBox& box = label.box;
  const bool is_inside =
      !box.is_empty() && box == box.clipped(image.picture.width, image.picture.height);
  dataset.check(is_inside, kRange, file, words[0] + ": its box reaches beyond the image");
  dataset.check(label.truncation >= 0.0 && label.truncation <= 1.0, "visible <= amodal", file,
                words[0] + ": truncation " + words[1]);
  const SeenObject seen = kitti_object(file, words[0], label);
  check_reprojection(dataset, image.lens, seen);
  if (image.depth && is_inside) check_kitti_sides(dataset, seen, image);
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
  dataset.reading(calib, [&] { image.lens = read_kitti_lens(*calib_text, image.picture); });
  if (const std::string depth = "training/depth_2/" + stem + ".png"; dataset.has(depth)) {
    image.depth = dataset.picture(depth);
    if (image.depth && !image.depth->has_size_of(image.picture)) {
      dataset.find("counts agree between files", depth, "has another size than the picture");
      image.depth.reset();
    }
  }
  dataset.reading(labels, [&] {
    for (const std::string& line : whole_lines_of(*label_text)) {
      check_kitti_line(dataset, labels, line, image);
    }
  });
}

std::string unescaped(std::string text) {
  for (const auto& [entity, c] : {std::pair{"&lt;", "<"}, {"&gt;", ">"}, {"&amp;", "&"}}) {
    for (std::size_t at = text.find(entity); at != std::string::npos;
         at = text.find(entity, at + 1)) {
      text.replace(at, std::strlen(entity), c);
    }
  }
  return text;
}

std::string xml_text(const std::string& xml, const char* name) {
  const std::string open = "<" + std::string(name) + ">";
  const std::string close = "</" + std::string(name) + ">";
  for (std::size_t at = xml.find(open); at != std::string::npos; at = xml.find(open, at + 1)) {
    const std::size_t begin = at + open.size();
    const std::size_t end = xml.find('<', begin);
    if (xml.compare(std::min(end, xml.size()), close.size(), close) == 0) {
      return xml.substr(begin, end - begin);
    }
  }
  throw std::runtime_error("has no element " + open);
}

/// Pixels of two pictures of one size that have `first` in one: the values of the other.
std::set<std::uint32_t> values_below(const Picture& objects, std::uint32_t first,
                                     const Picture& classes) {
  std::set<std::uint32_t> values;
  for (int y = 0; y < objects.height; ++y) {
    for (int x = 0; x < objects.width; ++x) {
      if (objects.packed(x, y) == first) values.insert(classes.packed(x, y));
    }
  }
  return values;
}

/// What the lists of the classes say of a picture: 1, 0 where it shows difficult ones only, or -1.
using VocMarks = std::vector<int>;

/// The part that a class has in the names of its lists.
std::vector<std::string> voc_list_names(const std::vector<std::string>& classes) {
  std::vector<std::string> names;
  for (std::string name : classes) {
    for (char& c : name) {
      const auto byte = static_cast<unsigned char>(c);
      if (byte < 0x80 && !std::isalnum(byte) && c != '-' && c != '.') c = '_';
    }
    const std::string plain = name;
    for (int number = 2; std::ranges::count(names, name) > 0; ++number) {
      name = plain + "_" + std::to_string(number);
    }
    names.push_back(name);
  }
  return names;
}

void check_voc_lists(Dataset& dataset, const DatasetPage& page,
                     const std::vector<VocMarks>& marks) {
  const std::vector<std::string> names = voc_list_names(page.classes);
  for (std::size_t i = 0; i < names.size(); ++i) {
    std::map<std::string, std::vector<std::string>> lines;
    for (std::size_t picture = 0; picture < page.pictures.size(); ++picture) {
      const PlannedPicture& planned = page.pictures[picture];
      const int mark = marks[picture][i];
      const std::string line = planned.stem + (mark < 0 ? " " : "  ") + std::to_string(mark);
      lines[planned.split].push_back(line);
      lines["trainval"].push_back(line);
    }
    for (const char* part : {"train", "val", "trainval"}) {
      check_lines(dataset, "ImageSets/Main/" + names[i] + "_" + part + ".txt", lines[part]);
    }
  }
}

VocMarks lint_voc_image(Dataset& dataset, const std::string& stem,
                        const std::vector<std::string>& classes) {
  VocMarks marks(classes.size(), -1);
  const std::string file = "Annotations/" + stem + ".xml";
  const auto xml = dataset.text(file);
  if (!xml) return marks;
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
    std::optional<Picture> objects, class_ids;
    if (xml_text(*xml, "segmented") == "1") {
      objects = indices_of(dataset.picture(masks_file));
      class_ids = indices_of(dataset.picture("SegmentationClass/" + stem + ".png"));
    }
    const bool has_masks = objects && class_ids && picture && objects->has_size_of(*class_ids) &&
                           objects->has_size_of(*picture);
    dataset.check(has_masks || !objects, "counts agree between files", masks_file,
                  "picture, objects and classes differ in size");
    if (has_masks) masks = extents(*objects);
    masks.erase(0);
    std::uint32_t place = 0;
    for (std::size_t at = xml->find("<object>"); at != std::string::npos;
         at = xml->find("<object>", at + 1)) {
      const std::string object = xml->substr(at, xml->find("</object>", at) - at);
      // VOC counts pixels from 1 and includes the last one.
      const PixelBox box{std::stoi(xml_text(object, "xmin")) - 1,
                         std::stoi(xml_text(object, "ymin")) - 1,
                         std::stoi(xml_text(object, "xmax")), std::stoi(xml_text(object, "ymax"))};
      ++place;
      const auto name = std::ranges::find(classes, unescaped(xml_text(object, "name")));
      if (name != classes.end()) {
        int& mark = marks[std::size_t(name - classes.begin())];
        mark = std::max(mark, xml_text(object, "difficult") == "1" ? 0 : 1);
      }
      if (!has_masks) continue;
      dataset.check(masks.contains(place) && masks.at(place).box == box, "box = extent of mask",
                    file,
                    "object " + std::to_string(place) + ": box " + box_text(box) +
                        ", its pixels extend over " +
                        (masks.contains(place) ? box_text(masks.at(place).box) : "nothing"));
      masks.erase(place);
      const auto index = std::uint32_t(name - classes.begin()) + 1;
      dataset.check(values_below(*objects, place, *class_ids) == std::set{index},
                    "pixels partition into instances", file,
                    "object " + std::to_string(place) +
                        ": SegmentationClass shows another class on its pixels");
    }
    dataset.check(masks.empty(), "ids within the label map", masks_file,
                  std::to_string(masks.size()) + " values have no object in " + file);
  });
  return marks;
}

}  // namespace

void lint_kitti(Dataset& dataset) {
  const DatasetPage page = lint_page(dataset);
  std::vector<std::string> stems, depths;
  std::map<std::string, std::vector<std::string>> split;
  for (const PlannedPicture& picture : page.pictures) {
    const std::string number = std::to_string(picture.capture * page.cameras + picture.camera);
    const std::size_t digits =
        std::max<std::size_t>(6, std::to_string(page.pictures.size() - 1).size());
    stems.push_back(std::string(digits - number.size(), '0') + number);
    split[picture.split].push_back(stems.back());
    depths.push_back("training/depth_2/" + stems.back() + ".png");
  }
  check_lines(dataset, "ImageSets/train.txt", split["train"]);
  check_lines(dataset, "ImageSets/val.txt", split["val"]);
  check_lines(dataset, "ImageSets/trainval.txt", stems);
  check_all_or_none(dataset, depths);
  for (const std::string& stem : stems) lint_kitti_image(dataset, stem);
}

void lint_voc(Dataset& dataset) {
  const DatasetPage page = lint_page(dataset);
  std::vector<std::string> stems;
  std::map<std::string, std::vector<std::string>> split;
  for (const PlannedPicture& picture : page.pictures) {
    stems.push_back(picture.stem);
    split[picture.split].push_back(picture.stem);
  }
  check_lines(dataset, "labels.txt", page.classes);
  for (const std::string kind : {"Main", "Segmentation"}) {
    const std::string folder = "ImageSets/" + kind + "/";
    check_all_or_none(dataset, {folder + "train.txt", folder + "val.txt", folder + "trainval.txt"});
    if (kind == "Segmentation" && !dataset.has(folder + "trainval.txt")) continue;
    check_lines(dataset, folder + "train.txt", split["train"]);
    check_lines(dataset, folder + "val.txt", split["val"]);
    check_lines(dataset, folder + "trainval.txt", stems);
  }
  std::vector<VocMarks> marks;
  for (const std::string& stem : stems) {
    marks.push_back(lint_voc_image(dataset, stem, page.classes));
  }
  check_voc_lists(dataset, page, marks);
}

}  // namespace diorama::lint
