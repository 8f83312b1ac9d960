// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <stdexcept>

#include "framework/lint/lint_formats.h"
#include "framework/lint/object_checks.h"
#include "framework/lint/replicator_files.h"

namespace diorama::lint {
namespace {

constexpr const char* kMissing = "nothing is missing";
constexpr const char* kRead = "every file can be read";
constexpr const char* kIds = "ids within the label map";
constexpr const char* kPartition = "pixels partition into instances";
constexpr const char* kBox = "box = extent of mask";
constexpr const char* kAmodal = "visible <= amodal";

struct Box3d {
  Aabb local;
  Affine world_from_local;
};

/// All that one camera wrote of one capture, as far as it is there.
struct FrameData {
  std::optional<Picture> instances;
  std::string instances_file;
  std::map<std::string, std::uint32_t> id_of_path;  ///< Of Picture::packed().
  std::map<std::string, PixelBox> tight;
  std::map<std::string, PixelBox> loose;
  std::map<std::string, Box3d> cuboids;
  std::string cuboids_file;
  std::optional<ReplicatorCamera> camera;
};

/// "(1, 2, 3, 4)" or "12" as Picture::packed() gives it.
std::uint32_t id_of_key(const std::string& key) {
  if (!key.starts_with('(')) {
    std::uint32_t id = 0;
    const char* end = key.data() + key.size();
    const auto [rest, failed] = std::from_chars(key.data(), end, id);
    if (failed != std::errc() || rest != end) {
      throw std::runtime_error("'" + key + "' is neither a colour nor an id");
    }
    return id;
  }
  std::array<unsigned, 4> c{};
  if (std::sscanf(key.c_str(), "(%3u, %3u, %3u, %3u)", &c[0], &c[1], &c[2], &c[3]) != 4) {
    throw std::runtime_error("'" + key + "' is neither a colour nor an id");
  }
  return c[0] | (c[1] << 8) | (c[2] << 16) | (c[3] << 24);
}

class BasicLint {
 public:
  explicit BasicLint(Dataset& dataset) : dataset_(dataset), files_(dataset) {}

  void run() {
    check_counts();
    for (const std::string& product : files_.products()) {
      for (const std::string& number : files_.numbers()) lint_frame(product, number);
    }
  }

 private:
  void check_counts() {
    // Of files that have little to do with each other most are missing; nobody reads such a list.
    const std::size_t expected =
        files_.kinds().size() * files_.products().size() * files_.numbers().size();
    if (expected > 1000 + 100 * dataset_.files().size()) {
      throw std::runtime_error("its files are not those of one dataset");
    }
    for (const std::string& kind : files_.kinds()) {
      for (const std::string& product : files_.products()) {
        for (const std::string& number : files_.numbers()) {
          const bool is_there = !files_.path(product, number, kind).empty();
          dataset_.check(is_there, kMissing, product.empty() ? "." : product,
                         kind + " of frame " + number + " is missing; other frames have it");
        }
      }
    }
    if (files_.numbers().empty()) return;
    const std::string& last = *files_.numbers().rbegin();
    std::uint64_t number = 0;
    const bool is_number =
        std::from_chars(last.data(), last.data() + last.size(), number).ec == std::errc();
    dataset_.check(is_number && files_.numbers().size() == number + 1, kMissing, ".",
                   "frames end with number " + last + ", but there are " +
                       std::to_string(files_.numbers().size()));
  }

  void lint_frame(const std::string& product, const std::string& number) {
    const auto path = [&](const char* kind) { return files_.path(product, number, kind); };
    FrameData data;
    if (const auto file = path("camera_params.json"); !file.empty()) {
      if (const auto json = dataset_.json(file)) {
        dataset_.reading(file, [&] { data.camera = camera_of(*json); });
      }
    }
    for (const char* kind :
         {"rgb.png", "rgb.jpg", "rgb.jpeg", "rgb.exr", "normals.png", "distance_to_camera.png",
          "distance_to_image_plane.png", "sensor_depth.png"}) {
      if (const auto file = path(kind); !file.empty()) check_size(data, file);
    }
    read_instances(data, path("instance_segmentation.png"),
                   path("instance_segmentation_mapping.json"));
    check_semantics(path("semantic_segmentation.png"), path("semantic_segmentation_labels.json"),
                    data, path("instance_segmentation_semantics_mapping.json"));
    check_ids(path("instance_id_segmentation.png"), path("instance_id_segmentation_mapping.json"));
    data.tight = read_boxes_2d(path("bounding_box_2d_tight.npy"),
                               path("bounding_box_2d_tight_prim_paths.json"),
                               path("bounding_box_2d_tight_labels.json"));
    data.loose = read_boxes_2d(path("bounding_box_2d_loose.npy"),
                               path("bounding_box_2d_loose_prim_paths.json"),
                               path("bounding_box_2d_loose_labels.json"));
    data.cuboids_file = path("bounding_box_3d.npy");
    read_boxes_3d(data, path("bounding_box_3d_prim_paths.json"),
                  path("bounding_box_3d_labels.json"));
    check_boxes(data, path("bounding_box_2d_tight.npy"), path("bounding_box_2d_loose.npy"));
    check_cuboids(data);
    check_distances(data, path("distance_to_camera.npy"), path("distance_to_image_plane.npy"));
    check_sensor_depth(data, path("sensor_depth.npy"));
    check_rows(path("occlusion.npy"), 12, 8);
    check_points(path("pointcloud.npy"), product, number);
    if (const auto file = path("motion_vectors.npy"); !file.empty()) dataset_.npy(file);
  }

  void check_size(const FrameData& data, const std::string& file) {
    const auto picture = dataset_.picture(file);
    if (!picture || !data.camera) return;
    dataset_.check(
        picture->width == data.camera->lens.width && picture->height == data.camera->lens.height,
        "counts agree between files", file,
        "is " + std::to_string(picture->width) + " x " + std::to_string(picture->height) +
            ", camera_params say " + std::to_string(data.camera->lens.width) + " x " +
            std::to_string(data.camera->lens.height));
  }

  /// Every value of the picture must have a key.
  std::map<std::uint32_t, Json> read_map(const std::optional<Picture>& picture,
                                         const std::string& picture_file,
                                         const std::string& json_file) {
    std::map<std::uint32_t, Json> map;
    if (json_file.empty()) return map;
    const auto json = dataset_.json(json_file);
    if (!json) return map;
    dataset_.reading(json_file, [&] {
      for (const auto& [key, value] : json->items()) map.emplace(id_of_key(key), value);
    });
    if (!picture) return map;
    for (const auto& [value, extent] : extents(*picture)) {
      dataset_.check(map.contains(value), kIds, picture_file,
                     std::to_string(extent.count) + " pixels from " + box_text(extent.box) +
                         " have a value that " + json_file + " does not list");
    }
    return map;
  }

  void read_instances(FrameData& data, const std::string& file, const std::string& mapping) {
    if (file.empty()) return;
    data.instances_file = file;
    data.instances = dataset_.picture(file);
    for (const auto& [id, path] : read_map(data.instances, file, mapping)) {
      if (path.is_string() && path.get<std::string>().starts_with('/')) {
        data.id_of_path.emplace(path.get<std::string>(), id);
      }
    }
  }

  void check_ids(const std::string& file, const std::string& mapping) {
    if (!file.empty()) read_map(dataset_.picture(file), file, mapping);
  }

  /// Each instance has one label set, and the semantic picture shows it wherever the instance is.
  void check_semantics(const std::string& file, const std::string& labels_file,
                       const FrameData& data, const std::string& semantics_file) {
    if (file.empty()) return;
    const auto picture = dataset_.picture(file);
    const auto labels = read_map(picture, file, labels_file);
    if (!picture || !data.instances || semantics_file.empty()) return;
    const auto semantics = read_map(data.instances, data.instances_file, semantics_file);
    const Picture& ids = *data.instances;
    if (ids.width != picture->width || ids.height != picture->height) {
      dataset_.find(kPartition, file, "has another size than " + data.instances_file);
      return;
    }
    std::set<std::pair<std::uint32_t, std::uint32_t>> pairs;
    for (int y = 0; y < ids.height; ++y) {
      for (int x = 0; x < ids.width; ++x) pairs.emplace(ids.packed(x, y), picture->packed(x, y));
    }
    for (const auto& [instance, semantic] : pairs) {
      const auto ours = semantics.find(instance);
      const auto theirs = labels.find(semantic);
      if (ours == semantics.end() || theirs == labels.end()) continue;
      dataset_.check(
          ours->second == theirs->second, kPartition, file,
          "an instance of " + ours->second.dump() + " is shown as " + theirs->second.dump());
    }
  }

  std::vector<std::string> read_paths(const std::string& file, std::size_t rows,
                                      const std::string& array_file) {
    std::vector<std::string> paths;
    if (file.empty()) return paths;
    const auto json = dataset_.json(file);
    if (!json) return paths;
    dataset_.reading(file, [&] { paths = json->get<std::vector<std::string>>(); });
    dataset_.check(
        paths.size() == rows, "counts agree between files", array_file,
        "has " + std::to_string(rows) + " rows, " + file + " has " + std::to_string(paths.size()));
    paths.resize(rows);
    return paths;
  }

  /// The array, when its rows have the right size; checks semantic ids and occlusion ratios.
  std::optional<NpyArray> read_rows(const std::string& file, const std::string& labels_file,
                                    std::size_t row_size, std::size_t ratio_offset) {
    if (file.empty()) return std::nullopt;
    auto array = dataset_.npy(file);
    if (!array) return std::nullopt;
    if (array->item_size != row_size) {
      dataset_.find(kRead, file,
                    "has rows of " + std::to_string(array->item_size) + " bytes instead of " +
                        std::to_string(row_size));
      return std::nullopt;
    }
    const auto labels = labels_file.empty() ? std::nullopt : dataset_.json(labels_file);
    for (std::size_t row = 0; row < array->count(); ++row) {
      const float ratio = array->value<float>(row * row_size + ratio_offset);
      dataset_.check(ratio == -1.0f || (ratio >= 0.0f && ratio <= 1.0f), kAmodal, file,
                     "row " + std::to_string(row) + ": occlusion ratio " + std::to_string(ratio));
      if (!labels) continue;
      const std::string id = std::to_string(array->value<std::uint32_t>(row * row_size));
      dataset_.check(labels->contains(id), kIds, file,
                     "row " + std::to_string(row) + ": " + labels_file + " has no id " + id);
    }
    return array;
  }

  void check_rows(const std::string& file, std::size_t row_size, std::size_t ratio_offset) {
    read_rows(file, "", row_size, ratio_offset);
  }

  std::map<std::string, PixelBox> read_boxes_2d(const std::string& file, const std::string& paths,
                                                const std::string& labels) {
    std::map<std::string, PixelBox> boxes;
    const auto array = read_rows(file, labels, 24, 20);
    if (!array) return boxes;
    const auto names = read_paths(paths, array->count(), file);
    for (std::size_t row = 0; row < names.size(); ++row) {
      const auto number = [&](std::size_t at) { return array->value<std::int32_t>(24 * row + at); };
      // The file names the last pixel.
      boxes[names[row]] = {number(4), number(8), number(12) + 1, number(16) + 1};
    }
    return boxes;
  }

  void read_boxes_3d(FrameData& data, const std::string& paths, const std::string& labels) {
    const auto array = read_rows(data.cuboids_file, labels, 96, 92);
    if (!array) return;
    const auto names = read_paths(paths, array->count(), data.cuboids_file);
    for (std::size_t row = 0; row < names.size(); ++row) {
      const auto number = [&](int i) {
        return double(array->value<float>(96 * row + 4 + 4 * std::size_t(i)));
      };
      Box3d box;
      box.local.min = Vec3(number(0), number(1), number(2));
      box.local.max = Vec3(number(3), number(4), number(5));
      // For row vectors in the file.
      for (int i = 0; i < 16; ++i) box.world_from_local.matrix()(i % 4, i / 4) = number(6 + i);
      data.cuboids[names[row]] = box;
    }
  }

  void check_boxes(const FrameData& data, const std::string& tight, const std::string& loose) {
    if (data.instances && !tight.empty()) {
      const auto masks = extents(*data.instances);
      for (const auto& [path, id] : data.id_of_path) {
        const auto mask = masks.find(id);
        const auto box = data.tight.find(path);
        if (mask == masks.end()) continue;
        dataset_.check(box != data.tight.end() && box->second == mask->second.box, kBox, tight,
                       path + ": its pixels extend over " + box_text(mask->second.box) + ", " +
                           (box == data.tight.end() ? "but it has no box"
                                                    : "its box is " + box_text(box->second)));
      }
      for (const auto& [path, box] : data.tight) {
        dataset_.check(
            data.id_of_path.contains(path), kBox, tight,
            path + ": has the box " + box_text(box) + ", but no pixel in " + data.instances_file);
      }
    }
    if (tight.empty() || loose.empty()) return;
    for (const auto& [path, inner] : data.tight) {
      const auto outer = data.loose.find(path);
      const bool holds = outer != data.loose.end() && outer->second.x_min <= inner.x_min &&
                         outer->second.y_min <= inner.y_min && outer->second.x_max >= inner.x_max &&
                         outer->second.y_max >= inner.y_max;
      dataset_.check(holds, kAmodal, loose,
                     path + ": the tight box " + box_text(inner) + " is not inside the loose one");
    }
  }

  SeenObject seen_object(const FrameData& data, const std::string& path,
                         const Box3d& cuboid) const {
    SeenObject seen;
    seen.who = path;
    seen.file = data.cuboids_file;
    seen.camera_from_local = data.camera->camera_from_world * cuboid.world_from_local;
    seen.bounds = cuboid.local;
    return seen;
  }

  void check_cuboids(const FrameData& data) {
    if (!data.camera) return;
    for (const auto& [path, cuboid] : data.cuboids) {
      SeenObject seen = seen_object(data, path, cuboid);
      for (const auto* boxes : {&data.tight, &data.loose}) {
        const auto box = boxes->find(path);
        if (box == boxes->end()) continue;
        seen.box = box->second;
        check_reprojection(dataset_, data.camera->lens, seen);
      }
    }
  }

  void check_distances(const FrameData& data, const std::string& ray_file,
                       const std::string& plane_file) {
    const auto ray = ray_file.empty() ? std::nullopt : dataset_.npy(ray_file);
    const auto plane = plane_file.empty() ? std::nullopt : dataset_.npy(plane_file);
    if (!data.camera) return;
    const std::vector<std::size_t> shape{std::size_t(data.camera->lens.height),
                                         std::size_t(data.camera->lens.width)};
    for (const auto& [array, file] : {std::pair(&ray, &ray_file), std::pair(&plane, &plane_file)}) {
      if (!*array) continue;
      if ((*array)->shape != shape || (*array)->item_size != 4) {
        dataset_.find("counts agree between files", *file, "has another size than the camera");
        return;
      }
    }
    if (ray && plane) check_distance_kinds(data.camera->lens, *ray, *plane, ray_file);
    if (ray) check_surfaces(data, *ray, ray_file, true);
    if (plane) check_surfaces(data, *plane, plane_file, false);
  }

  /// A measurement, not a label: only its form can be wrong.
  void check_sensor_depth(const FrameData& data, const std::string& file) {
    const auto array = file.empty() ? std::nullopt : dataset_.npy(file);
    if (!array || array->item_size != 4) return;
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < array->count(); ++i) {
      const float z = array->value<float>(4 * i);
      if (!(z >= 0.0f && std::isfinite(z))) ++wrong;
    }
    dataset_.check(wrong == 0, kRead, file,
                   std::to_string(wrong) + " values are neither a depth nor 0 for none");
    if (!data.camera) return;
    const std::vector<std::size_t> shape{std::size_t(data.camera->lens.height),
                                         std::size_t(data.camera->lens.width)};
    dataset_.check(array->shape == shape, "counts agree between files", file,
                   "has another size than the camera");
  }

  /// The two kinds differ by the angle of the ray.
  void check_distance_kinds(const Lens& lens, const NpyArray& ray, const NpyArray& plane,
                            const std::string& file) {
    std::size_t wrong = 0;
    for (int y = 0; y < lens.height; ++y) {
      for (int x = 0; x < lens.width; ++x) {
        const std::size_t at = 4 * std::size_t(y * lens.width + x);
        const double d = ray.value<float>(at);
        const double z = plane.value<float>(at);
        const auto direction = lens.direction(Vec2(x + 0.5, y + 0.5));
        if (std::isfinite(d) != std::isfinite(z)) {
          ++wrong;
        } else if (std::isfinite(d) && direction &&
                   std::abs(z - d * direction->normalized().z()) > 1e-4 + 1e-4 * d) {
          ++wrong;
        }
      }
    }
    dataset_.check(wrong == 0, kBackProject, file,
                   std::to_string(wrong) +
                       " pixels do not agree with distance_to_image_plane and the camera's rays");
  }

  /// Surface points of an instance lie in its 3-D box.
  void check_surfaces(const FrameData& data, const NpyArray& array, const std::string& file,
                      bool is_along_ray) {
    if (!data.instances) return;
    const Lens& lens = data.camera->lens;
    if (data.instances->width != lens.width || data.instances->height != lens.height) {
      dataset_.find("counts agree between files", data.instances_file,
                    "has another size than the camera");
      return;
    }
    const auto masks = extents(*data.instances);
    const DepthMap depth{file, is_along_ray, 0.0, [&](int x, int y) {
                           return double(array.value<float>(4 * std::size_t(y * lens.width + x)));
                         }};
    for (const auto& [path, cuboid] : data.cuboids) {
      const auto id = data.id_of_path.find(path);
      const auto mask = id == data.id_of_path.end() ? masks.end() : masks.find(id->second);
      if (mask == masks.end()) continue;
      SeenObject seen = seen_object(data, path, cuboid);
      seen.box = mask->second.box;
      seen.has = [&](int x, int y) { return data.instances->packed(x, y) == id->second; };
      check_depth(dataset_, lens, seen, depth);
    }
  }

  void check_points(const std::string& file, const std::string& product,
                    const std::string& number) {
    if (file.empty()) return;
    const auto points = dataset_.npy(file);
    if (!points || points->shape.empty()) return;
    for (const char* kind : {"pointcloud_rgb.npy", "pointcloud_normals.npy",
                             "pointcloud_semantic.npy", "pointcloud_instance.npy"}) {
      const std::string other = files_.path(product, number, kind);
      const auto array = other.empty() ? std::nullopt : dataset_.npy(other);
      if (!array || array->shape.empty()) continue;
      dataset_.check(array->shape[0] == points->shape[0], "counts agree between files", other,
                     "has " + std::to_string(array->shape[0]) + " entries for " +
                         std::to_string(points->shape[0]) + " points");
    }
  }

  Dataset& dataset_;
  ReplicatorFiles files_;
};

}  // namespace

void lint_basic(Dataset& dataset) { BasicLint(dataset).run(); }

}  // namespace diorama::lint
