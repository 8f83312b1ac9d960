// SPDX-License-Identifier: Apache-2.0
#include "writer_hdf5/hdf5_reader.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "diorama/error.h"
#include "reader_support/camera_json.h"
#include "reader_support/capture_rows.h"
#include "reader_support/channel_arrays.h"
#include "reader_support/clip_list.h"
#include "reader_support/frame_reading.h"
#include "reader_support/picture_list.h"
#include "writer_hdf5/hdf5_view.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

constexpr const char* kFormat = "HDF5";
constexpr const char* kCategories = "category_id_segmaps";
constexpr const char* kObjects = "instance_attribute_maps";
constexpr const char* kSegmentation = "instance_segmaps";
/// What BlenderProc writes where nothing is.
constexpr float kNothingBeyond = 1e9f;

bool is_hdf5_name(const std::string& name) {
  return name.ends_with(".hdf5") || name.ends_with(".h5");
}

/// Numbers in names by their value: "2" before "10".
bool comes_before(const std::string& a, const std::string& b) {
  const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
  std::size_t i = 0;
  std::size_t k = 0;
  while (i < a.size() && k < b.size()) {
    if (!is_digit(a[i]) || !is_digit(b[k])) {
      if (a[i] != b[k]) return a[i] < b[k];
      ++i;
      ++k;
      continue;
    }
    const auto run = [&](const std::string& text, std::size_t& at) {
      while (at < text.size() && text[at] == '0') ++at;
      const std::size_t begin = at;
      while (at < text.size() && is_digit(text[at])) ++at;
      return std::string_view(text).substr(begin, at - begin);
    };
    const std::string_view one = run(a, i);
    const std::string_view other = run(b, k);
    if (one.size() != other.size()) return one.size() < other.size();
    if (one != other) return one < other;
  }
  return a.size() - i != b.size() - k ? a.size() - i < b.size() - k : a < b;
}

class Hdf5Dataset final : public StoredDataset {
 public:
  Hdf5Dataset(fs::path folder, const Host& host) : folder_(std::move(folder)), host_(host) {
    page_ = read_dataset_page(folder_);
    StoredFiles files(folder_, host_, log_);
    folders_ = {""};
    for (const std::string& below : names_in(folder_, true)) folders_.push_back(below + "/");
    std::vector<ListedPicture> listed;
    for (std::uint32_t place = 0; place < folders_.size(); ++place) {
      std::vector<std::string> names = names_in(folder_ / folders_[place]);
      std::erase_if(names, [](const std::string& name) { return !is_hdf5_name(name); });
      std::ranges::sort(names, comes_before);
      for (const std::string& name : names) {
        const fs::path path(name);
        listed.push_back({path.stem().string(), path.extension().string(), place, 0, 0});
      }
    }
    if (listed.empty() && !page_) {
      throw Error(ErrorKind::Asset, folder_.string() + ": holds no HDF5 files");
    }
    pictures_.set(
        std::move(listed), page_,
        [&](const std::string& stem) { return capture_and_camera(*page_, stem); }, folders_, files);
    describe(files);
    note_clips(clips_of(page_), info_);
  }

  const StoredInfo& info() const override { return info_; }
  const ReadLog& log() const override { return log_; }
  StoredCapture read(std::size_t i, const NameSet& wanted) const override;

 private:
  std::string file_of(const ListedPicture& picture) const {
    return folders_[picture.folder] + picture.stem + picture.ending;
  }

  /// What the first file that can be read holds; the others are alike, and what they lack is a
  /// finding where it is read. What objects hold is said by the first file that has some.
  void describe(StoredFiles& files) {
    info_.format = kFormat;
    info_.camera_names = pictures_.cameras();
    info_.captures = pictures_.captures();
    if (page_) info_.classes = page_->classes;
    constexpr std::size_t kMostTries = 20;
    const auto& all = pictures_.all();
    for (std::size_t i = 0; i < std::min(all.size(), kMostTries); ++i) {
      try {
        const Hdf5View view(read_whole_file(files.root() / file_of(all[i])));
        if (!view.has("colors") && !view.has(kSegmentation) && !view.has("depth")) continue;
        describe_by(view);
        break;
      } catch (const std::runtime_error&) {
        continue;
      }
    }
    describe_objects();
    // What passes through segmaps of 8-bit steps or (n + 1) / 2 in 32 bits.
    info_.steps[std::string(kNormals.name)] = 1e-6;
  }

  void describe_by(const Hdf5View& view) {
    const auto hold = [&](const char* set, std::initializer_list<std::string_view> names) {
      if (!view.has(set)) return;
      held_sets_.emplace_back(set);
      info_.holds.insert(names.begin(), names.end());
    };
    hold("colors", {kColor.name});
    hold("depth", {kDistanceToImagePlane.name});
    hold("distance", {kDistanceToCamera.name});
    hold("normals", {kNormals.name});
    hold(kSegmentation, {kInstanceId.name, kHoldsInstances, kHoldsTightBoxes});
    if (view.has(kSegmentation)) hold(kObjects, {kHoldsLabels});
    hold("cam_K", {kHoldsCamera});
    hold("world_from_camera", {kHoldsCameraPose});
    hold("cam_states", {kHoldsCamera, kHoldsCameraPose});
    if (view.has(kCategories)) held_sets_.emplace_back(kCategories);
    if (view.has("lens")) held_sets_.emplace_back("lens");
    // Each further picture is a channel of its own name.
    static const std::set<std::string> kKnown{"colors", "depth", "distance", "normals"};
    for (const std::string& name : view.names()) {
      if (kKnown.contains(name) || std::ranges::count(held_sets_, name) > 0) continue;
      if (name == kInstanceId.name || info_.holds.contains(name)) continue;
      if (!holds_channel(view, name)) continue;
      channels_.push_back(name);
      held_sets_.push_back(name);
      info_.holds.insert(name);
    }
  }

  /// A picture, as the type and the first two extents say.
  static bool holds_channel(const Hdf5View& view, const std::string& name) {
    try {
      const auto& shape = view.shape(name);
      if (shape.size() < 2 || !view.has("colors")) return false;
      const auto& size = view.shape("colors");
      if (size.size() < 2 || shape[0] != size[0] || shape[1] != size[1]) return false;
      return image_of_array(view.read(name)).has_value();
    } catch (const std::runtime_error&) {
      return false;
    }
  }

  void describe_objects() {
    if (std::ranges::count(held_sets_, kObjects) == 0) return;
    constexpr std::size_t kLookedAt = 32;  // from all over
    const auto& all = pictures_.all();
    for (std::size_t i = 0; i < all.size(); i += all.size() / kLookedAt + 1) {
      try {
        const Hdf5View view(read_whole_file(folder_ / file_of(all[i])));
        const Json list = parse_stored_json(view.text(kObjects));
        if (!list.is_array() || list.empty()) continue;
        const Json& first = list[0];
        if (page_) info_.holds.emplace(kHoldsNodePaths);
        if (first.contains("world_from_node")) {
          info_.holds.insert({std::string(kHoldsNodePaths), std::string(kHoldsPoses)});
        }
        if (first.contains("bounds_min")) {
          info_.holds.insert({std::string(kHoldsBounds), std::string(kHoldsBoxes3d)});
        }
        return;
      } catch (const std::runtime_error&) {
        continue;
      } catch (const Json::exception&) {
        continue;
      }
    }
  }

  friend class Hdf5PictureReading;

  fs::path folder_;
  const Host& host_;
  std::optional<DatasetPage> page_;
  std::vector<std::string> folders_;  ///< "" and those below, with '/'.
  PictureList pictures_;
  std::vector<std::string> held_sets_;  ///< Data sets that every file should have.
  std::vector<std::string> channels_;   ///< Those that are channels of their own name.
  StoredInfo info_;
  ReadLog log_;
};

/// Makes one frame of one file.
class Hdf5PictureReading : private FrameReading {
 public:
  Hdf5PictureReading(const Hdf5Dataset& dataset, const ListedPicture& picture,
                     const NameSet& wanted, ReadLog& log)
      : FrameReading(dataset.folder_, dataset.host_, dataset.info_, picture.capture,
                     dataset.pictures_.cameras()[picture.camera], wanted, log),
        dataset_(dataset),
        capture_(picture.capture),
        file_(dataset.file_of(picture)) {}

  std::optional<Frame> read(FrameSources& sources) {
    auto content = files_.text(file_);
    if (!content) return std::nullopt;
    files_.reading(file_, [&] { view_.emplace(std::move(*content)); });
    if (!view_) return std::nullopt;
    for (const std::string& name : dataset_.held_sets_) {
      files_.check(view_->has(name), kMissing, file_, name, "the data set is not there",
                   "other files have it");
    }
    if (!read_size()) return std::nullopt;
    read_camera();
    read_pictures();
    read_objects();
    for (const std::string& name : dataset_.info_.holds) sources.emplace(name, file_);
    return std::move(frame_);
  }

 private:
  bool is_own() const { return view_->has("world_from_camera"); }

  /// Runs `body` for a data set that is there; what it throws is a finding about it.
  void with(const char* name, const std::function<void()>& body) {
    if (!view_->has(name)) return;
    try {
      body();
    } catch (const std::bad_alloc&) {
      throw;
    } catch (const std::exception& error) {
      files_.find(kReadable, file_, name, error.what());
    }
  }

  bool read_size() {
    for (const char* name : {"colors", "depth", "distance", kSegmentation, "normals"}) {
      bool is_known = false;
      with(name, [&] {
        const auto& shape = view_->shape(name);
        constexpr std::size_t kMostExtent = 1 << 20;
        if (shape.size() == 4) {
          throw std::runtime_error("is of several cameras, which is not understood");
        }
        if (shape.size() < 2 || shape.size() > 3 || shape[0] == 0 || shape[1] == 0 ||
            shape[0] > kMostExtent || shape[1] > kMostExtent) {
          throw std::runtime_error("is no picture");
        }
        frame_.camera.height = int(shape[0]);
        frame_.camera.width = int(shape[1]);
        is_known = true;
      });
      if (is_known) return true;
    }
    files_.find(kReadable, file_, "", "holds no picture");
    return false;
  }

  template <class Pixel>
  bool has_size(const char* name, const Image<Pixel>& image) {
    const auto text = [](int w, int h) { return std::to_string(w) + " x " + std::to_string(h); };
    const bool fits =
        image.width() == frame_.camera.width && image.height() == frame_.camera.height;
    files_.check(fits, kCounts, file_, name, "has " + text(image.width(), image.height()),
                 text(frame_.camera.width, frame_.camera.height) + ", as others in the file");
    return fits;
  }

  void read_pictures() {
    if (wants(kColor.name)) {
      with("colors", [&] {
        auto image = color_of_array(view_->read("colors"));
        if (has_size("colors", image)) frame_.set(kColor, std::move(image));
      });
    }
    read_distance("depth", kDistanceToImagePlane);
    read_distance("distance", kDistanceToCamera);
    if (wants(kNormals.name)) with("normals", [&] { read_normals(); });
    for (const std::string& name : dataset_.channels_) {
      if (!wants(name)) continue;
      with(name.c_str(), [&] { set_channel(frame_, name, view_->read(name)); });
    }
  }

  void read_distance(const char* name, const Channel<float>& channel) {
    if (!wants(channel.name)) return;
    with(name, [&] {
      auto image = floats_of_array(view_->read(name));
      if (!has_size(name, image)) return;
      if (!is_own()) {
        for (float& value : image.pixels()) {
          if (value == 0.0f || value > kNothingBeyond) {
            value = std::numeric_limits<float>::infinity();
          }
        }
      }
      frame_.set(channel, std::move(image));
    });
  }

  /// (n + 1) / 2 in the file.
  void read_normals() {
    const StoredArray array = view_->read("normals");
    auto any = image_of_array(array);
    auto* image = any ? std::get_if<Image<Vec3f>>(&*any) : nullptr;
    if (!image) throw std::runtime_error(array_text(array) + " is no picture of normals");
    if (!has_size("normals", *image)) return;
    // Ours are in the world, and the middle where nothing is; BlenderProc's in the camera's axes,
    // and black.
    const Eigen::Matrix3f turn = frame_.world_from_camera.linear().cast<float>();
    for (Vec3f& normal : image->pixels()) {
      const bool is_none = normal == Vec3f::Zero() && !is_own();
      normal = is_none ? Vec3f(Vec3f::Zero()) : Vec3f(2.0f * normal - Vec3f::Ones());
      if (!is_own()) normal = turn * normal;
    }
    frame_.set(kNormals, std::move(*image));
  }

  static Affine pose_of(const StoredArray& array) {
    if (!array.is_plain("<f8") || array.shape != std::vector<std::size_t>{4, 4}) {
      throw std::runtime_error(array_text(array) + " is no matrix of 4 x 4 doubles");
    }
    Json rows = Json::array();
    for (std::size_t i = 0; i < 4; ++i) {
      rows.push_back(Json::array());
      for (std::size_t k = 0; k < 4; ++k) {
        rows.back().push_back(array.value<double>(4 * i + k, array.fields[0]));
      }
    }
    return affine_of_rows(rows);
  }

  void read_camera() {
    Camera& camera = frame_.camera;
    with("cam_K", [&] {
      const StoredArray k = view_->read("cam_K");
      if (!k.is_plain("<f8") || k.count() != 9) {
        throw std::runtime_error(array_text(k) + " is no matrix of 3 x 3 doubles");
      }
      const auto at = [&](std::size_t i) { return k.value<double>(i, k.fields[0]); };
      camera.fx = at(0);
      camera.fy = at(4);
      camera.cx = at(2);
      camera.cy = at(5);
      require_usable(camera);
    });
    with("lens", [&] {
      read_lens_entry(Json{{"lens", parse_stored_json(view_->text("lens"))}}, camera);
    });
    if (dataset_.page_) {
      Json clip = Json::object();
      with("clip", [&] { clip = parse_stored_json(view_->text("clip")); });
      check_clip_frame(clip, dataset_.page_->clips, capture_, files_, file_, "clip");
    }
    with("world_from_camera",
         [&] { frame_.world_from_camera = pose_of(view_->read("world_from_camera")); });
    with("cam_states", [&] {
      Json states = parse_stored_json(view_->text("cam_states"));
      const Json& state = states.is_array() ? states.at(0) : states;
      const Json& k = state.at("cam_K");
      camera.fx = k.at(0).at(0).get<double>();
      camera.fy = k.at(1).at(1).get<double>();
      // Whole numbers are pixel centres there.
      camera.cx = k.at(0).at(2).get<double>() + 0.5;
      camera.cy = k.at(1).at(2).get<double>() + 0.5;
      require_usable(camera);
      frame_.world_from_camera = affine_of_rows(state.at("cam2world_matrix"));
    });
  }

  void read_objects() {
    if (!view_->has(kSegmentation)) return;
    std::optional<Image<std::uint32_t>> ids;
    with(kSegmentation, [&] {
      ids = ids_of_array(view_->read(kSegmentation));
      if (!has_size(kSegmentation, *ids)) ids.reset();
    });
    if (!ids) return;
    std::map<std::uint32_t, PixelBox> boxes;
    for (int y = 0; y < ids->height(); ++y) {
      for (int x = 0; x < ids->width(); ++x) {
        const auto [found, is_new] = boxes.try_emplace(ids->at(x, y), PixelBox{x, y, x + 1, y + 1});
        PixelBox& box = found->second;
        if (!is_new) {
          box = {std::min(box.x_min, x), std::min(box.y_min, y), std::max(box.x_max, x + 1),
                 std::max(box.y_max, y + 1)};
        }
      }
    }
    boxes.erase(0);
    with(kObjects, [&] {
      const Json list = parse_stored_json(view_->text(kObjects));
      if (!list.is_array()) throw std::runtime_error("is no list");
      for (const Json& object : list) add_object(object, boxes);
    });
    if (!view_->has(kObjects)) {
      for (const auto& [id, box] : boxes) add_unknown(id, box);
    }
    read_categories(*ids);
    if (wants(kInstanceId.name)) frame_.set(kInstanceId, std::move(*ids));
  }

  void add_unknown(std::uint32_t id, const PixelBox& box) {
    Instance instance;
    instance.id = id;
    instance.node_path = "/Assets/" + std::to_string(id);
    instance.tight_box = box;
    frame_.instances.push_back(std::move(instance));
  }

  void add_object(const Json& object, const std::map<std::uint32_t, PixelBox>& boxes) {
    const auto id = whole_number<std::uint32_t>(object.at("idx"));
    if (id == 0) return;  // the background
    const std::string who = object.contains("name") && object.at("name").is_string()
                                ? object.at("name").get<std::string>()
                                : "object " + std::to_string(id);
    files_.check(std::ranges::find(frame_.instances, id, &Instance::id) == frame_.instances.end(),
                 kOnce, file_, who, "its idx " + std::to_string(id) + " is there a second time");
    Instance instance;
    instance.id = id;
    const bool has_paths = dataset_.info_.holds.contains(kHoldsNodePaths);
    instance.node_path = has_paths ? who : "/Assets/" + std::to_string(id);
    instance.labels["class"] = class_of(object, who);
    const auto box = boxes.find(id);
    if (box != boxes.end()) instance.tight_box = box->second;
    files_.check(box != boxes.end() || !dataset_.page_, kIds, file_, who, "has no pixel");
    if (object.contains("category_id")) {
      const auto category = whole_number<std::int64_t>(object.at("category_id"));
      categories_[id] = category;
      const auto& classes = dataset_.info_.classes;
      files_.check(
          !dataset_.page_ || (category >= 1 && std::size_t(category) <= classes.size() &&
                              classes[std::size_t(category - 1)] == instance.labels.at("class")),
          kIds, file_, who, "its category_id is " + std::to_string(category),
          "the place of '" + instance.labels.at("class") + "' in the classes");
    }
    read_pose_entry(object, instance);
    frame_.instances.push_back(std::move(instance));
  }

  /// The name that attributes give, else the category's number.
  static std::string class_of(const Json& object, const std::string& who) {
    for (const char* key : {"class", "category_name", "cp_category_name", "category_id"}) {
      const auto value = object.find(key);
      if (value == object.end()) continue;
      if (value->is_string()) return value->get<std::string>();
      if (value->is_number_integer()) return std::to_string(value->get<std::int64_t>());
    }
    return who;
  }

  /// Each object's pixels are of its class.
  void read_categories(const Image<std::uint32_t>& ids) {
    with(kCategories, [&] {
      const auto categories = ids_of_array(view_->read(kCategories));
      if (!has_size(kCategories, categories)) return;
      std::map<std::uint32_t, std::set<std::uint32_t>> found;
      for (std::size_t i = 0; i < ids.pixels().size(); ++i) {
        found[ids.pixels()[i]].insert(categories.pixels()[i]);
      }
      for (const auto& [id, shown] : found) {
        const auto said = categories_.find(id);
        if (said == categories_.end() && !(id == 0 && dataset_.page_)) continue;
        const std::int64_t expected = id == 0 ? 0 : said->second;
        files_.check(shown.size() == 1 && std::int64_t(*shown.begin()) == expected, kPartition,
                     file_, "idx " + std::to_string(id),
                     std::string(kCategories) + " shows " + std::to_string(*shown.begin()) +
                         (shown.size() > 1 ? " and others" : "") + " on its pixels",
                     std::to_string(expected));
      }
    });
  }

  const Hdf5Dataset& dataset_;
  int capture_ = 0;
  std::string file_;
  std::optional<Hdf5View> view_;
  std::map<std::uint32_t, std::int64_t> categories_;  ///< By idx.
};

StoredCapture Hdf5Dataset::read(std::size_t i, const NameSet& wanted) const {
  return read_frames(
      info_.captures.at(i), clips_of(page_), pictures_.pictures(i),
      [&](const ListedPicture& picture, StoredCapture& stored, FrameSources& sources) {
        const std::string& folder = folders_[picture.folder];
        stored.split = folder.empty() ? "" : folder.substr(0, folder.size() - 1);
        return Hdf5PictureReading(*this, picture, wanted, stored.log).read(sources);
      });
}

}  // namespace

std::vector<std::string> Hdf5Reader::patterns() const {
  return {"*.hdf5", "*.h5", "*/*.hdf5", "*/*.h5"};
}

Recognition Hdf5Reader::recognise(const fs::path& folder) const {
  if (recognise_page(folder, kFormat) == Recognition::ByName) return Recognition::ByName;
  std::vector<fs::path> folders{folder};
  for (const std::string& below : names_in(folder, true)) folders.push_back(folder / below);
  const bool has_any = std::ranges::any_of(folders, [](const fs::path& each) {
    return std::ranges::any_of(names_in(each), is_hdf5_name);
  });
  return has_any ? Recognition::ByFiles : Recognition::No;
}

std::unique_ptr<const StoredDataset> Hdf5Reader::open(const fs::path& folder) const {
  return std::make_unique<Hdf5Dataset>(folder, host_);
}

}  // namespace diorama
