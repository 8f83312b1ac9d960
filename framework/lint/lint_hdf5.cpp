// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "framework/config/json_text.h"
#include "framework/lint/hdf5_reader.h"
#include "framework/lint/lint_formats.h"
#include "framework/lint/lint_page.h"
#include "framework/lint/object_checks.h"

namespace diorama::lint {
namespace {

using Arrays = std::map<std::string, NpyArray>;

/// One file: one picture and its labels.
class Hdf5Picture {
 public:
  Hdf5Picture(Dataset& dataset, const std::string& file, Arrays arrays)
      : dataset_(dataset), file_(file), arrays_(std::move(arrays)) {}

  void run(const std::vector<std::string>& classes) {
    const NpyArray& colors = array("colors", "|u1", 3);
    height_ = colors.shape[0];
    width_ = colors.shape[1];
    check_size("instance_segmaps", "<u2", 2);
    check_size("category_id_segmaps", "<u2", 2);
    if (arrays_.contains("depth")) check_size("depth", "<f4", 2);
    if (arrays_.contains("normals")) check_normals();
    const NpyArray& k = array("cam_K", "<f8", 2);
    const Mat3 intrinsics =
        intrinsics_matrix(number(k, 0), number(k, 4), number(k, 2), number(k, 5));
    const Json camera{{"lens", parse_json(text("lens"))}};
    lens_ = lens_of(camera, int(width_), int(height_), intrinsics);
    Affine world_from_camera = Affine::Identity();
    for (std::size_t i = 0; i < 16; ++i) {
      world_from_camera.matrix()(Eigen::Index(i / 4), Eigen::Index(i % 4)) =
          number(array("world_from_camera", "<f8", 2), i);
    }
    camera_from_world_ = flipped_axes() * world_from_camera.inverse();
    check_objects(parse_json(text("instance_attribute_maps")), classes);
  }

 private:
  const NpyArray& array(const std::string& name, const char* type, std::size_t rank) const {
    const auto found = arrays_.find(name);
    if (found == arrays_.end()) throw std::runtime_error("has no data set '" + name + "'");
    if (found->second.descr != type || found->second.shape.size() != rank) {
      throw std::runtime_error("'" + name + "' is " + found->second.descr + " of rank " +
                               std::to_string(found->second.shape.size()) + ", not " + type +
                               " of rank " + std::to_string(rank));
    }
    return found->second;
  }
  static double number(const NpyArray& array, std::size_t i) { return array.value<double>(8 * i); }
  std::string text(const std::string& name) const {
    const auto found = arrays_.find(name);
    if (found == arrays_.end()) throw std::runtime_error("has no data set '" + name + "'");
    const auto& data = found->second.data;
    return {reinterpret_cast<const char*>(data.data()), data.size()};
  }

  void check_size(const char* name, const char* type, std::size_t rank) {
    const NpyArray& found = array(name, type, rank);
    const bool holds = found.shape[0] == height_ && found.shape[1] == width_;
    dataset_.check(holds, "counts agree between files", file_,
                   std::string(name) + " has another size than colors");
    if (!holds) throw std::runtime_error("its pictures differ in size");
  }

  /// (n + 1) / 2 of a unit vector, or of zero where nothing was hit.
  void check_normals() {
    check_size("normals", "<f4", 3);
    const NpyArray& normals = array("normals", "<f4", 3);
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < width_ * height_; ++i) {
      Vec3f n;
      for (std::size_t k = 0; k < 3; ++k) {
        n[Eigen::Index(k)] = 2.0f * normals.value<float>(4 * (3 * i + k)) - 1.0f;
      }
      if (n.norm() > 1e-3f && std::abs(n.norm() - 1.0f) > 1e-3f) ++wrong;
    }
    dataset_.check(wrong == 0, "normals have unit length", file_,
                   std::to_string(wrong) + " normals have another length");
  }

  std::uint16_t pixel(const char* name, int x, int y) const {
    return arrays_.at(name).value<std::uint16_t>(2 * (std::size_t(y) * width_ + std::size_t(x)));
  }

  void check_objects(const Json& objects, const std::vector<std::string>& classes) {
    std::map<std::uint32_t, Extent> masks;
    std::map<std::uint32_t, std::set<int>> categories;
    for (int y = 0; y < int(height_); ++y) {
      for (int x = 0; x < int(width_); ++x) {
        const std::uint32_t id = pixel("instance_segmaps", x, y);
        masks[id].add(x, y);
        categories[id].insert(pixel("category_id_segmaps", x, y));
      }
    }
    masks.erase(0);
    dataset_.check(
        categories[0].size() <= 1 && (categories[0].empty() || categories[0].contains(0)),
        "pixels partition into instances", file_,
        "category_id_segmaps marks pixels that belong to no instance");
    for (const Json& object : objects) {
      const auto id = object.at("idx").get<std::uint32_t>();
      const auto category = object.at("category_id").get<std::size_t>();
      const std::string who = object.at("name").get<std::string>();
      dataset_.check(category >= 1 && category <= classes.size() &&
                         classes[category - 1] == object.at("class").get<std::string>(),
                     "ids within the label map", file_, who + ": its class is not in the list");
      dataset_.check(masks.contains(id), "area = count", file_, who + ": has no pixel");
      if (!masks.contains(id)) continue;
      dataset_.check(categories[id] == std::set<int>{int(category)},
                     "pixels partition into instances", file_,
                     who + ": category_id_segmaps shows another class on its pixels");
      check_pose(object, id, masks.at(id).box);
      masks.erase(id);
    }
    dataset_.check(masks.empty(), "ids within the label map", file_,
                   std::to_string(masks.size()) +
                       " values of instance_segmaps are not in instance_attribute_maps");
  }

  void check_pose(const Json& object, std::uint32_t id, const PixelBox& box) {
    SeenObject seen;
    seen.who = object.at("name").get<std::string>();
    seen.file = file_;
    Affine world_from_node;
    world_from_node.matrix() = matrix4_of(object.at("world_from_node"));
    seen.camera_from_local = camera_from_world_ * world_from_node;
    seen.bounds = {vec3_of(object.at("bounds_min")), vec3_of(object.at("bounds_max"))};
    seen.box = box;
    seen.has = [&](int x, int y) { return pixel("instance_segmaps", x, y) == id; };
    check_reprojection(dataset_, lens_, seen);
    if (!arrays_.contains("depth")) return;
    const NpyArray& depth = arrays_.at("depth");
    const DepthMap map{
        file_, false, 0.0, [&](int x, int y) {
          return double(depth.value<float>(4 * (std::size_t(y) * width_ + std::size_t(x))));
        }};
    check_depth(dataset_, lens_, seen, map);
  }

  Dataset& dataset_;
  const std::string& file_;
  Arrays arrays_;
  std::size_t width_ = 0;
  std::size_t height_ = 0;
  Lens lens_;
  Affine camera_from_world_ = Affine::Identity();
};

}  // namespace

void lint_hdf5(Dataset& dataset) {
  const DatasetPage page = lint_page(dataset);
  for (const PlannedPicture& picture : page.pictures) {
    const std::string file = picture.split + "/" + picture.stem + ".hdf5";
    const auto content = dataset.text(file);
    if (!content) continue;
    dataset.reading(file,
                    [&] { Hdf5Picture(dataset, file, read_hdf5(*content)).run(page.classes); });
  }
}

}  // namespace diorama::lint
