// SPDX-License-Identifier: Apache-2.0
#include "framework/config/json_text.h"
#include "framework/lint/lint_formats.h"
#include "framework/lint/lint_page.h"
#include "framework/lint/object_checks.h"
#include "framework/lint/tar_reader.h"

namespace diorama::lint {
namespace {

/// One camera's picture: the members whose names begin with its key.
class Sample {
 public:
  Sample(Dataset& dataset, const std::string& file, const std::string& key,
         const std::map<std::string, std::string>& members)
      : dataset_(dataset), file_(file), key_(key), members_(members) {}

  void run() {
    const Json json = parse_json(member(".json"));
    width_ = json.at("width").get<int>();
    height_ = json.at("height").get<int>();
    const std::string ending = members_.contains(key_ + ".png") ? ".png" : ".jpg";
    const Picture picture = parse_picture(member(ending), key_ + ending);
    check_size(ending, picture.width, picture.height);
    const Json& k = json.at("intrinsics");
    const Mat3 intrinsics = intrinsics_matrix(k.at(0).get<double>(), k.at(1).get<double>(),
                                              k.at(2).get<double>(), k.at(3).get<double>());
    lens_ = lens_of(json, width_, height_, intrinsics);
    Affine world_from_camera;
    world_from_camera.matrix() = matrix4_of(json.at("world_from_camera"));
    camera_from_world_ = flipped_axes() * world_from_camera.inverse();
    if (members_.contains(key_ + ".depth.npy")) {
      depth_ = parse_npy(member(".depth.npy"));
      const bool is_map = depth_->shape.size() == 2 && depth_->descr == "'<f4'";
      check_size(".depth.npy", is_map ? int(depth_->shape[1]) : 0,
                 is_map ? int(depth_->shape[0]) : 0);
    }
    if (members_.contains(key_ + ".instances.png")) check_masks(json.at("objects"));
  }

 private:
  const std::string& member(const std::string& ending) const {
    const auto found = members_.find(key_ + ending);
    if (found == members_.end()) throw std::runtime_error(key_ + ending + " is not in the shard");
    return found->second;
  }

  void check_size(const std::string& ending, int width, int height) {
    const bool holds = width == width_ && height == height_;
    dataset_.check(holds, "counts agree between files", file_,
                   key_ + ending + " has another size than its json says");
    if (!holds) throw std::runtime_error(key_ + ": its files differ in size");
  }

  void check_masks(const Json& objects) {
    const Picture ids = parse_picture(member(".instances.png"), key_ + ".instances.png");
    check_size(".instances.png", ids.width, ids.height);
    auto masks = extents(ids);
    masks.erase(0);
    std::uint32_t place = 0;
    for (const Json& object : objects) {
      const std::string who = key_ + ": object " + std::to_string(++place);
      const auto& b = object.at("box");
      const PixelBox box{b.at(0).get<int>(), b.at(1).get<int>(), b.at(2).get<int>(),
                         b.at(3).get<int>()};
      const auto mask = masks.find(place);
      dataset_.check(mask != masks.end() && mask->second.box == box, "box = extent of mask", file_,
                     who + " has the box " + box_text(box));
      if (mask == masks.end()) continue;
      dataset_.check(object.at("visible_px").get<std::int64_t>() == mask->second.count,
                     "area = count", file_,
                     who + " has " + std::to_string(mask->second.count) +
                         " pixels, its json says " + object.at("visible_px").dump());
      check_pose(object, who, ids, place, mask->second.box);
      masks.erase(mask);
    }
    dataset_.check(
        masks.empty(), "ids within the label map", file_,
        key_ + ".instances.png has " + std::to_string(masks.size()) + " values without an object");
  }

  void check_pose(const Json& object, const std::string& who, const Picture& ids,
                  std::uint32_t place, const PixelBox& box) {
    Affine world_from_node;
    world_from_node.matrix() = matrix4_of(object.at("world_from_node"));
    SeenObject seen;
    seen.who = who;
    seen.file = file_;
    seen.camera_from_local = camera_from_world_ * world_from_node;
    seen.bounds = {vec3_of(object.at("bounds_min")), vec3_of(object.at("bounds_max"))};
    seen.box = box;
    seen.has = [&](int x, int y) { return ids.at(x, y) == place; };
    check_reprojection(dataset_, lens_, seen);
    if (!depth_) return;
    const auto value = [this](int x, int y) {
      return double(depth_->value<float>(4 * std::size_t(y * width_ + x)));
    };
    check_depth(dataset_, lens_, seen, {file_, false, 0.0, value});
  }

  Dataset& dataset_;
  const std::string& file_;
  std::string key_;
  const std::map<std::string, std::string>& members_;
  int width_ = 0;
  int height_ = 0;
  Lens lens_;
  Affine camera_from_world_ = Affine::Identity();
  std::optional<NpyArray> depth_;
};

}  // namespace

void lint_webdataset(Dataset& dataset) {
  std::map<std::string, std::set<std::string>> keys_of_shard;
  std::map<std::string, std::vector<std::string>> shards_of_split;
  for (const PlannedPicture& picture : lint_page(dataset).pictures) {
    const std::string shard = "shards/" + picture.stem.substr(0, picture.stem.find('_')) + ".tar";
    keys_of_shard[shard].insert(picture.stem);
    if (picture.camera == 0) shards_of_split[picture.split].push_back(shard);
  }
  for (const char* split : {"train", "val"}) {
    check_lines(dataset, std::string(split) + ".txt", shards_of_split[split]);
  }
  for (const auto& [file, keys] : keys_of_shard) {
    const auto tar = dataset.text(file);
    if (!tar) continue;
    dataset.reading(file, [&] {
      const auto members = read_tar(*tar);
      for (const std::string& key : keys) Sample(dataset, file, key, members).run();
    });
  }
}

}  // namespace diorama::lint
