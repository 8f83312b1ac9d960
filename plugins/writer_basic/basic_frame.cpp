// SPDX-License-Identifier: Apache-2.0
#include "writer_basic/basic_frame.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <set>
#include <utility>

#include "reader_support/camera_json.h"
#include "writer_basic/joint_states.h"

namespace diorama {
namespace {

constexpr std::uint32_t kUnlabelled = 1;
constexpr std::uint32_t kFirstObject = 2;
constexpr const char* kRatio = "occlusion agrees between files";
constexpr const char* kPoints = "point clouds agree with pictures";
constexpr const char* kLens = "focal length agrees with the projection";

/// Throws std::runtime_error when there is no such column of that type.
template <class T>
T number_in(const StoredArray& array, std::size_t row, const char* column, const char* type) {
  const auto* field = array.field(column);
  if (!field || field->type != type) {
    throw std::runtime_error("has no column " + std::string(column));
  }
  return array.value<T>(row, *field);
}

/// Sixteen numbers for row vectors, as a matrix for column vectors.
Mat4 column_matrix(const Json& list) {
  Mat4 matrix;
  for (int i = 0; i < 16; ++i) matrix(i % 4, i / 4) = list.at(std::size_t(i)).get<double>();
  if (!matrix.allFinite()) throw std::runtime_error("a matrix has numbers that are not finite");
  return matrix;
}

/// "(1, 2, 3, 4)" or "12" as a picture's value: four channels of eight bits, or one number.
std::uint32_t value_of_key(const std::string& key) {
  std::array<unsigned, 4> c{};
  if (key.starts_with('(')) {
    if (std::sscanf(key.c_str(), "(%3u, %3u, %3u, %3u)", &c[0], &c[1], &c[2], &c[3]) == 4) {
      return c[0] | c[1] << 8 | c[2] << 16 | c[3] << 24;
    }
  } else if (!key.empty() && key.size() <= 9 && key.find_first_not_of("0123456789") == key.npos) {
    return std::uint32_t(std::stoul(key));
  }
  throw std::runtime_error("'" + key + "' is neither a colour nor an id");
}

std::uint32_t value_at(const StoredPicture& picture, int x, int y) {
  if (picture.channels() == 1) return picture.at(x, y);
  std::uint32_t value = 0;
  for (int c = std::min(picture.channels(), 4) - 1; c >= 0; --c) {
    value = value << 8 | picture.at(x, y, c);
  }
  return picture.channels() == 3 ? value | 0xFF000000u : value;
}

/// Calls visit(y, from, to, value) for pixels side by side that have one value.
template <class Visit>
void visit_runs(const StoredPicture& picture, Visit&& visit) {
  const Texture& texture = *picture.texture;
  // As nearly all are: without a call for each pixel.
  const std::uint8_t* bytes =
      texture.floats.empty() && picture.channels() == 4 ? texture.bytes.data() : nullptr;
  for (int y = 0; y < picture.height(); ++y) {
    const auto value = [&](int x) {
      if (!bytes) return value_at(picture, x, y);
      const std::uint8_t* c =
          bytes + 4 * (std::size_t(y) * std::size_t(picture.width()) + std::size_t(x));
      return std::uint32_t(c[0]) | std::uint32_t(c[1]) << 8 | std::uint32_t(c[2]) << 16 |
             std::uint32_t(c[3]) << 24;
    };
    for (int x = 0; x < picture.width();) {
      const int from = x;
      const std::uint32_t here = value(from);
      while (++x < picture.width() && value(x) == here) {
      }
      visit(y, from, x, here);
    }
  }
}

Labels labels_of(const Json& json) {
  Labels labels;
  for (const auto& [taxonomy, label] : json.items()) {
    if (label.is_string()) labels[taxonomy] = label.get<std::string>();
  }
  return labels;
}

std::string text_of(const Labels& labels) {
  std::string text;
  for (const auto& [taxonomy, label] : labels) {
    text += (text.empty() ? "" : ", ") + taxonomy + ": " + label;
  }
  return text.empty() ? "none" : text;
}

/// "BACKGROUND" and "UNLABELLED", alone or as a class.
bool is_named(const Json& entry, const char* name) {
  if (entry.is_object()) return entry.contains("class") && entry.at("class") == name;
  return entry == name;
}

/// What stands for pixels of no object.
bool is_known_word(const Json& entry) {
  static const std::set<std::string> kWords{"BACKGROUND", "UNLABELLED", "UNLABELED", "INVALID"};
  return kWords.contains(entry.get<std::string>());
}

bool is_object_path(const Json& entry) {
  return entry.is_string() && entry.get<std::string>().starts_with('/');
}

}  // namespace

std::optional<Frame> BasicFrameReading::read(const std::string& camera, FrameSources& sources) {
  frame_.camera_name = camera;
  frame_.camera_path = "/Cameras/" + camera;
  read_camera();
  read_joints();
  read_color();
  read_distances();
  read_normals();
  read_motion();
  read_flows();
  read_instances();
  read_leaves();
  check_semantics();
  read_boxes();
  set_visibility();
  read_velocities();
  read_points();
  if (!has_size_) return std::nullopt;
  sources = std::move(sources_);
  return std::move(frame_);
}

bool BasicFrameReading::note_size(int width, int height, const std::string& file) {
  if (has_size_) {
    const bool fits = width == frame_.camera.width && height == frame_.camera.height;
    files_.check(fits, kCounts, file, "",
                 "is " + std::to_string(width) + " x " + std::to_string(height) + " pixels",
                 size_file_ + " says " + std::to_string(frame_.camera.width) + " x " +
                     std::to_string(frame_.camera.height));
    return fits;
  }
  frame_.camera.width = width;
  frame_.camera.height = height;
  size_file_ = file;
  has_size_ = true;
  return true;
}

void BasicFrameReading::read_joints() {
  const std::string file = path("joint_states.json");
  if (file.empty() || !wants(kHoldsJoints)) return;
  const auto json = files_.json(file);
  if (!json) return;
  files_.reading(file, [&] { frame_.joints = joint_states_from(*json); });
  sources_.emplace(kHoldsJoints, file);
}

void BasicFrameReading::read_camera() {
  const std::string file = path("camera_params.json");
  if (file.empty()) return;
  const auto json = files_.json(file);
  if (!json) return;
  files_.reading(file, [&] {
    const Json& size = json->at("renderProductResolution");
    Camera& camera = frame_.camera;
    const int width = whole_number<int>(size.at(0));
    const int height = whole_number<int>(size.at(1));
    if (width <= 0 || height <= 0 || std::int64_t(width) * height > (std::int64_t(1) << 28)) {
      throw std::runtime_error("its resolution is none");
    }
    const Mat4 clip_from_camera = column_matrix(json->at("cameraProjection"));
    Affine camera_from_world;
    camera_from_world.matrix() = column_matrix(json->at("cameraViewTransform"));
    require_rigid(camera_from_world, "cameraViewTransform");
    note_size(width, height, file);
    const Vec2 half(0.5 * width, 0.5 * height);
    camera.fx = half.x() * clip_from_camera(0, 0);
    camera.fy = half.y() * clip_from_camera(1, 1);
    camera.cx = half.x() * (1.0 - clip_from_camera(0, 2));
    camera.cy = half.y() * (1.0 + clip_from_camera(1, 2));
    require_usable(camera);
    frame_.world_from_camera = camera_from_world.inverse();
    const std::string model = json->at("cameraModel").get<std::string>();
    const auto polynomial = json->at("cameraFisheyePolynomial").get<std::vector<double>>();
    if (model == "pinholeOpenCV") {
      const auto p = json->at("cameraFisheyeLensP").get<std::vector<double>>();
      camera.lens = LensModel::OpencvPinhole;
      camera.distortion = {polynomial.at(0), polynomial.at(1), p.at(0),          p.at(1),
                           polynomial.at(2), polynomial.at(3), polynomial.at(4), polynomial.at(5)};
    } else if (model == "fisheyePolynomial") {
      camera.lens = LensModel::FisheyePolynomial;
      std::copy_n(polynomial.begin(), std::min<std::size_t>(polynomial.size(), 6),
                  camera.fisheye_polynomial.begin());
      camera.fisheye_max_angle_rad = json->at("cameraFisheyeMaxFOV").get<double>() * kPi / 360.0;
    }
    const double focal = json->at("cameraFocalLength").get<double>();
    const double aperture = json->at("cameraAperture").at(0).get<double>();
    camera.focal_length_mm = focal;
    camera.horizontal_aperture_mm = aperture;
    camera.near_m = json->at("cameraNearFar").at(0).get<double>();
    camera.far_m = json->at("cameraNearFar").at(1).get<double>();
    camera.f_stop = json->at("cameraFStop").get<double>();
    camera.focus_distance_m = json->at("cameraFocusDistance").get<double>();
    const double fx = aperture > 0.0 ? focal / aperture * width : 0.0;
    files_.check(std::abs(fx - camera.fx) <= 1e-3 * camera.fx, kLens, file, "",
                 "focal length and aperture give " + std::to_string(fx) + " pixels",
                 "the projection gives " + std::to_string(camera.fx));
    check_camera(*json, clip_from_camera, file);
    sources_.emplace(kHoldsCamera, file);
    sources_.emplace(kHoldsCameraPose, file);
  });
}

/// What the file says twice: lens and sensor in millimetres, and the projection.
void BasicFrameReading::check_camera(const Json& json, const Mat4& clip_from_camera,
                                     const std::string& file) {
  static const std::set<std::string> kModels{"pinhole",
                                             "pinholeOpenCV",
                                             "fisheyePolynomial",
                                             "fisheyeOrthographic",
                                             "fisheyeEquidistant",
                                             "fisheyeEquisolid",
                                             "fisheyeSpherical",
                                             "fisheyeKannalaBrandtK3",
                                             "fisheyeRadTanThinPrism",
                                             "omniDirectionalStereo"};
  const std::string model = json.at("cameraModel").get<std::string>();
  files_.check(kModels.contains(model), kLens, file, "", "the lens '" + model + "' is unknown");
  files_.check(json.value("metersPerSceneUnit", 1.0) > 0.0, kLens, file, "",
               "metersPerSceneUnit is not above 0");
  if (model != "pinhole") return;
  const Camera& camera = frame_.camera;
  const double per_pixel = camera.horizontal_aperture_mm / camera.width;
  const auto agrees = [&](const char* what, double said, double expected) {
    files_.check(std::abs(said - expected) <= 1e-3 * (std::abs(expected) + per_pixel), kLens, file,
                 "", std::string(what) + " is " + std::to_string(said),
                 std::to_string(expected) + " by the projection");
  };
  if (camera.fy == camera.fx && json.at("cameraAperture").size() > 1) {
    agrees("the aperture's height", json.at("cameraAperture").at(1).get<double>(),
           per_pixel * camera.height);
  }
  if (const auto offset = json.find("cameraApertureOffset");
      offset != json.end() && offset->size() == 2) {
    agrees("the aperture's offset to the side", offset->at(0).get<double>(),
           (0.5 * camera.width - camera.cx) * per_pixel);
    agrees("the aperture's offset upwards", offset->at(1).get<double>(),
           (camera.cy - 0.5 * camera.height) * per_pixel);
  }
  // Only depth stands in the third row, and only the axis in the fourth.
  Mat4 rest = clip_from_camera;
  rest(0, 0) = rest(1, 1) = rest(0, 2) = rest(1, 2) = 0.0;
  rest(3, 2) += 1.0;
  const double near = camera.near_m;
  const double far = camera.far_m;
  files_.check(near > 0.0 && far > near, kLens, file, "",
               "cameraNearFar is " + std::to_string(near) + ", " + std::to_string(far));
  // An infinitely far plane leaves 0 and the near one; others have other ranges of depth.
  const double scale = rest(2, 2);
  const double shift = rest(2, 3);
  rest(2, 2) = rest(2, 3) = 0.0;
  files_.check(rest.isZero(1e-6), kLens, file, "",
               "cameraProjection has numbers where a projection has none");
  const double range = far - near;
  const bool is_reversed = std::abs(scale - near / range) <= 1e-3 * near / range &&
                           std::abs(shift - near * far / range) <= 1e-3 * near;
  const bool is_plain = std::abs(scale + (far + near) / range) <= 1e-3 &&
                        std::abs(shift + 2.0 * near * far / range) <= 2e-3 * near;
  const bool is_endless = std::abs(scale) <= 1e-9 && std::abs(shift - near) <= 1e-3 * near;
  files_.check(is_reversed || is_plain || is_endless, kLens, file, "",
               "its range of depth is " + std::to_string(scale) + ", " + std::to_string(shift),
               "what cameraNearFar gives");
}

void BasicFrameReading::read_color() {
  for (const char* kind : {"rgb.png", "rgb.jpg", "rgb.jpeg", "rgb.exr"}) {
    const std::string file = path(kind);
    if (file.empty()) continue;
    const bool is_linear = std::string_view(kind) == "rgb.exr";
    if (!wants(is_linear ? kColorHdr.name : kColor.name) && has_size_) continue;
    const auto picture = files_.picture(file);
    if (!picture || !note_size(picture->width(), picture->height(), file)) continue;
    if (!is_linear) {
      frame_.set(kColor, picture->color());
      sources_.emplace(kColor.name, file);
      continue;
    }
    const Texture& texture = *picture->texture;
    if (texture.floats.empty() || texture.channels < 3) {
      files_.find(kReadable, file, "", "holds no three channels in linear light");
      continue;
    }
    Image<Vec3f> image(texture.width, texture.height, Vec3f::Zero());
    for (std::size_t i = 0; i < image.pixels().size(); ++i) {
      image.pixels()[i] =
          Eigen::Map<const Vec3f>(&texture.floats[i * std::size_t(texture.channels)]);
    }
    frame_.set(kColorHdr, std::move(image));
    sources_.emplace(kColorHdr.name, file);
  }
}

/// Floats by row and column; nothing when it is something else.
std::optional<StoredArray> BasicFrameReading::pixel_array(const std::string& file,
                                                          std::size_t values, const char* type) {
  auto text = files_.text(file);
  if (!text) return std::nullopt;
  std::optional<StoredArray> array;
  files_.reading(file, [&] {
    StoredArray parsed = parse_array(std::move(*text));
    const std::size_t dimensions = parsed.shape.size();
    const bool fits =
        parsed.is_plain(type) &&
        ((values == 1 && dimensions == 2) || (dimensions == 3 && parsed.shape[2] == values)) &&
        parsed.shape[0] < 65536 && parsed.shape[1] < 65536;
    if (!fits) throw std::runtime_error("is no array of 32-bit numbers by row and column");
    if (note_size(int(parsed.shape[1]), int(parsed.shape[0]), file)) array = std::move(parsed);
  });
  return array;
}

void BasicFrameReading::read_distances() {
  for (const Channel<float>& channel : {kDistanceToCamera, kDistanceToImagePlane, kSensorDepth}) {
    const std::string picture = path(std::string(channel.name) + ".png");
    std::optional<StoredPicture> drawn;
    if (!picture.empty() && wants(channel.name)) {
      drawn = files_.picture(picture);
      if (drawn) note_size(drawn->width(), drawn->height(), picture);
    }
    const std::string file = path(std::string(channel.name) + ".npy");
    if (file.empty() || !wants(channel.name)) continue;
    const auto array = pixel_array(file, 1);
    if (!array) continue;
    Image<float> image(int(array->shape[1]), int(array->shape[0]), 0.0f);
    std::memcpy(image.pixels().data(), array->data.data(), array->data.size());
    if (drawn && drawn->width() == image.width() && drawn->height() == image.height()) {
      check_drawn(*drawn, image, picture);
    }
    frame_.set(channel, std::move(image));
    sources_.emplace(channel.name, file);
  }
}

/// However distances are drawn: with them, shades go one way, and what was not met has one.
void BasicFrameReading::check_drawn(const StoredPicture& drawn, const Image<float>& distances,
                                    const std::string& file) {
  std::vector<std::pair<float, std::int64_t>> shades;
  std::set<std::uint32_t> unmet;
  for (int y = 0; y < distances.height(); ++y) {
    for (int x = 0; x < distances.width(); ++x) {
      const float distance = distances.at(x, y);
      if (std::isfinite(distance) && distance > 0.0f) {
        shades.emplace_back(distance, std::int64_t(drawn.at(x, y)));
      } else {
        unmet.insert(drawn.at(x, y));
      }
    }
  }
  const auto falls = [&] {
    std::ranges::sort(shades);
    const auto is_fall = [](const auto& a, const auto& b) { return b.second < a.second; };
    return std::ranges::adjacent_find(shades, is_fall) != shades.end();
  };
  bool is_one_way = !falls();
  if (!is_one_way) {
    for (auto& [distance, shade] : shades) shade = -shade;
    is_one_way = !falls();
  }
  files_.check(is_one_way && unmet.size() <= 1, kCounts, file, "",
               "its shades do not follow the distances beside it");
}

void BasicFrameReading::read_normals() {
  const std::string file = path("normals.png");
  if (file.empty() || !wants(kNormals.name)) return;
  const auto picture = files_.picture(file);
  if (!picture || !note_size(picture->width(), picture->height(), file)) return;
  if (picture->channels() < 3) return files_.find(kReadable, file, "", "has no three channels");
  Image<Vec3f> normals(picture->width(), picture->height(), Vec3f::Zero());
  for (int y = 0; y < normals.height(); ++y) {
    for (int x = 0; x < normals.width(); ++x) {
      const std::array value{picture->at(x, y, 0), picture->at(x, y, 1), picture->at(x, y, 2)};
      const bool is_miss = picture->channels() > 3
                               ? picture->at(x, y, 3) < 255
                               : value == std::array<std::uint32_t, 3>{127, 127, 127};
      if (is_miss) continue;
      // Numbers were cut off, so the middle of the step is the best guess.
      for (std::size_t c = 0; c < 3; ++c) {
        const float step = value[c] == 255 ? 255.0f : float(value[c]) + 0.5f;
        normals.at(x, y)[Eigen::Index(c)] = step / 255.0f * 2.0f - 1.0f;
      }
    }
  }
  frame_.set(kNormals, std::move(normals));
  sources_.emplace(kNormals.name, file);
}

void BasicFrameReading::read_motion() {
  const std::string file = path("motion_vectors.npy");
  if (file.empty() || !wants(kMotion.name)) return;
  const auto array = pixel_array(file, 4);
  if (!array) return;
  Image<Vec2f> motion(int(array->shape[1]), int(array->shape[0]), Vec2f::Zero());
  for (std::size_t i = 0; i < motion.pixels().size(); ++i) {
    std::array<float, 4> v{};
    std::memcpy(v.data(), array->data.data() + i * sizeof v, sizeof v);
    // The format counts motion to the left and up.
    motion.pixels()[i] = Vec2f(0.0f - v[0], 0.0f - v[1]);
  }
  frame_.set(kMotion, std::move(motion));
  sources_.emplace(kMotion.name, file);
}

void BasicFrameReading::read_flows() {
  for (const auto& [flow, states] :
       {std::pair(kFlowForward, kFlowForwardState), std::pair(kFlowBackward, kFlowBackwardState)}) {
    const std::string file = path(std::string(flow.name) + ".npy");
    if (!file.empty() && wants(flow.name)) {
      if (const auto array = pixel_array(file, 2)) {
        Image<Vec2f> image(int(array->shape[1]), int(array->shape[0]), Vec2f::Zero());
        for (std::size_t i = 0; i < image.pixels().size(); ++i) {
          std::array<float, 2> v{};
          std::memcpy(v.data(), array->data.data() + i * sizeof v, sizeof v);
          image.pixels()[i] = Vec2f(v[0], v[1]);
        }
        frame_.set(flow, std::move(image));
        sources_.emplace(flow.name, file);
      }
    }
    const std::string state_file = path(std::string(states.name) + ".npy");
    if (state_file.empty() || !wants(states.name)) continue;
    const auto array = pixel_array(state_file, 1, "<u4");
    if (!array) continue;
    Image<std::uint32_t> image(int(array->shape[1]), int(array->shape[0]), 0u);
    std::memcpy(image.pixels().data(), array->data.data(), array->data.size());
    std::uint32_t highest = 0;
    for (const std::uint32_t state : image.pixels()) highest = std::max(highest, state);
    files_.check(highest <= std::uint32_t(FlowState::Unknown), kIds, state_file, "",
                 "has the state " + std::to_string(highest), "0 to 3");
    frame_.set(states, std::move(image));
    sources_.emplace(states.name, state_file);
  }
}

void BasicFrameReading::read_velocities() {
  const std::string file = path("velocities.json");
  if (file.empty() || !wants(kHoldsVelocities)) return;
  const auto json = files_.json(file);
  if (!json) return;
  files_.reading(file, [&] {
    for (const auto& [node_path, entry] : json->items()) {
      const Velocity velocity{vector_of_json(entry.at("linear")),
                              vector_of_json(entry.at("angular"))};
      // What no other file tells of is out of the picture.
      const auto place = place_of_path_.find(node_path);
      if (place != place_of_path_.end()) frame_.instances[place->second].velocity = velocity;
    }
  });
  sources_.emplace(kHoldsVelocities, file);
}

std::vector<std::pair<std::uint32_t, Json>> BasicFrameReading::read_keys(const std::string& file) {
  std::vector<std::pair<std::uint32_t, Json>> entries;
  std::set<std::uint32_t> known;
  if (file.empty()) return entries;
  const auto json = files_.json(file);
  if (!json) return entries;
  files_.reading(file, [&] {
    for (const auto& [key, value] : json->items()) {
      const std::uint32_t number = value_of_key(key);
      const bool is_new = known.insert(number).second;
      files_.check(is_new, kOnce, file, key, "is listed twice");
      if (is_new) entries.emplace_back(number, value);
    }
  });
  return entries;
}

/// Ids count in the order of the JSON file, so that they are small whatever the colours.
std::optional<BasicFrameReading::Segmentation> BasicFrameReading::read_segmentation(
    std::string_view picture_kind, std::string_view mapping_kind) {
  const std::string file = path(picture_kind);
  if (file.empty()) return std::nullopt;
  const auto picture = files_.picture(file);
  if (!picture || !note_size(picture->width(), picture->height(), file)) return std::nullopt;
  const std::string mapping = path(mapping_kind);
  const auto entries = read_keys(mapping);
  Segmentation result;
  result.file = file;
  const bool is_raw = picture->channels() == 1;
  std::uint32_t next = kFirstObject;
  for (const auto& [key, entry] : entries) {
    const bool is_unlabelled = is_named(entry, "UNLABELLED");
    const bool is_nothing = entry.is_string() && !is_object_path(entry)
                                ? !is_unlabelled
                                : is_named(entry, "BACKGROUND");
    files_.check(!entry.is_string() || is_object_path(entry) || is_known_word(entry), kIds, mapping,
                 entry.dump(), "is neither a path nor a word for what is no object");
    std::uint32_t id = is_unlabelled ? kUnlabelled : is_nothing ? 0 : next++;
    if (is_raw) id = key;
    result.id_of_key.emplace(key, id);
    result.entries.emplace(id, entry);
  }
  result.ids = Image<std::uint32_t>(picture->width(), picture->height(), 0);
  std::map<std::uint32_t, std::size_t> unknown;
  visit_runs(*picture, [&](int y, int from, int to, std::uint32_t value) {
    const auto found = result.id_of_key.find(value);
    if (found == result.id_of_key.end()) {
      unknown[value] += std::size_t(to - from);
    } else {
      const auto row = result.ids.row(y);
      std::fill(row.begin() + from, row.begin() + to, found->second);
    }
  });
  for (const auto& [value, count] : unknown) {
    files_.check(mapping.empty(), kIds, file, "",
                 std::to_string(count) + " pixels have a value that " + mapping + " does not list");
  }
  return result;
}

Instance& BasicFrameReading::instance(const std::string& node_path) {
  const auto [place, is_new] = place_of_path_.emplace(node_path, frame_.instances.size());
  if (is_new) {
    frame_.instances.emplace_back();
    frame_.instances.back().node_path = node_path;
  }
  return frame_.instances[place->second];
}

void BasicFrameReading::read_instances() {
  if (!wants_pixels_of_objects()) return;
  instances_ = read_segmentation("instance_segmentation.png", "instance_segmentation_mapping.json");
  if (!instances_) return;
  const std::string file = path("instance_segmentation_mapping.json");
  for (const auto& [id, entry] : instances_->entries) {
    if (!is_object_path(entry)) continue;
    const std::string node_path = entry.get<std::string>();
    files_.check(!place_of_path_.contains(node_path), kOnce, file, node_path, "is listed twice");
    instance(node_path).id = id;
  }
  const std::string semantics_file = path("instance_segmentation_semantics_mapping.json");
  for (const auto& [key, entry] : read_keys(semantics_file)) {
    const auto id = instances_->id_of_key.find(key);
    if (id == instances_->id_of_key.end()) {
      files_.check(false, kIds, semantics_file, "",
                   "names a value that " + file + " does not list");
      continue;
    }
    const auto path_entry = instances_->entries.find(id->second);
    if (path_entry == instances_->entries.end()) continue;
    if (!is_object_path(path_entry->second)) {
      const bool has_class = entry.is_object() && entry.contains("class");
      files_.check(
          !has_class || !path_entry->second.is_string() || entry.at("class") == path_entry->second,
          kIds, semantics_file, path_entry->second.dump(), "is called " + entry.dump());
      continue;
    }
    if (entry.is_object())
      labels_of_path_[path_entry->second.get<std::string>()] = labels_of(entry);
  }
  for (const auto& [node_path, labels] : labels_of_path_) instance(node_path).labels = labels;
  set_ids(*instances_);
  sources_.emplace(kInstanceId.name, instances_->file);
  sources_.emplace(kHoldsInstances, file.empty() ? instances_->file : file);
  sources_.emplace(kHoldsLabels, semantics_file.empty() ? instances_->file : semantics_file);
}

void BasicFrameReading::set_ids(const Segmentation& from) {
  Image<std::uint32_t> ids = from.ids;
  std::uint32_t last = 0;
  std::int64_t* count = nullptr;
  for (std::uint32_t& id : ids.pixels()) {
    if (id == kUnlabelled) id = 0;
    if (id == 0) continue;
    if (!count || id != last) count = &visible_[id];
    last = id;
    ++*count;
  }
  frame_.set(kInstanceId, std::move(ids));
}

void BasicFrameReading::read_leaves() {
  if (!wants(kLeafId.name)) return;
  auto leaves =
      read_segmentation("instance_id_segmentation.png", "instance_id_segmentation_mapping.json");
  if (!leaves) return;
  // Ids of nodes were moved up by one for the picture.
  for (std::uint32_t& id : leaves->ids.pixels()) id = id == 0 ? 0 : id - 1;
  for (const auto& [id, entry] : leaves->entries) {
    if (is_object_path(entry) && id > 0)
      frame_.leaf_paths.emplace(id - 1, entry.get<std::string>());
  }
  sources_.emplace(kLeafId.name, leaves->file);
  frame_.set(kLeafId, std::move(leaves->ids));
}

/// Each instance has one label set, and the semantic picture shows it wherever the instance is.
void BasicFrameReading::check_semantics() {
  if (!wants(kHoldsLabels) || !wants_pixels_of_objects()) return;
  const auto semantics =
      read_segmentation("semantic_segmentation.png", "semantic_segmentation_labels.json");
  if (!semantics || !instances_) return;
  std::set<std::pair<std::uint32_t, std::uint32_t>> pairs;
  const auto instance_ids = instances_->ids.pixels();
  const auto semantic_ids = semantics->ids.pixels();
  for (std::size_t i = 0; i < semantic_ids.size(); ++i) {
    const bool is_same =
        i > 0 && instance_ids[i] == instance_ids[i - 1] && semantic_ids[i] == semantic_ids[i - 1];
    if (!is_same) pairs.emplace(instance_ids[i], semantic_ids[i]);
  }
  for (const auto& [instance_id, semantic_id] : pairs) {
    const auto entry = instances_->entries.find(instance_id);
    const auto shown = semantics->entries.find(semantic_id);
    if (entry == instances_->entries.end() || shown == semantics->entries.end()) continue;
    if (!is_object_path(entry->second)) {
      const bool is_nothing = semantic_id < kFirstObject;
      files_.check(
          is_nothing, kPartition, semantics->file, "",
          "shows " + shown->second.dump() + " where " + instances_->file + " has no object");
      continue;
    }
    const std::string node_path = entry->second.get<std::string>();
    const auto labels = labels_of_path_.find(node_path);
    if (labels == labels_of_path_.end() || !shown->second.is_object()) continue;
    files_.check(labels_of(shown->second) == labels->second, kPartition, semantics->file, node_path,
                 "is shown as " + text_of(labels_of(shown->second)),
                 "is " + text_of(labels->second));
  }
}

/// The array of one kind of box, with the labels of its ids and the path of each row.
std::optional<BasicFrameReading::BoxRows> BasicFrameReading::read_rows(const std::string& name) {
  const std::string file = path(name + ".npy");
  if (file.empty()) return std::nullopt;
  const auto text = files_.text(file);
  if (!text) return std::nullopt;
  BoxRows rows;
  bool is_good = false;
  files_.reading(file, [&] {
    rows.array = parse_array(*text);
    const auto* id = rows.array.field("semanticId");
    const auto* ratio = rows.array.field("occlusionRatio");
    if (!id || id->type != "<u4" || !ratio || ratio->type != "<f4") {
      throw std::runtime_error("has no columns semanticId and occlusionRatio");
    }
    is_good = true;
  });
  if (!is_good) return std::nullopt;
  const std::size_t count = rows.array.count();
  const std::string labels_file = path(name + "_labels.json");
  const auto labels = labels_file.empty() ? std::nullopt : files_.json(labels_file);
  const std::string paths_file = path(name + "_prim_paths.json");
  const auto paths = paths_file.empty() ? std::nullopt : files_.json(paths_file);
  if (paths) {
    files_.reading(paths_file, [&] { rows.paths = paths->get<std::vector<std::string>>(); });
    files_.check(rows.paths.size() == count, kCounts, file, "",
                 "has " + std::to_string(count) + " rows",
                 paths_file + " has " + std::to_string(rows.paths.size()));
    const std::set<std::string> once(rows.paths.begin(), rows.paths.end());
    files_.check(once.size() == rows.paths.size(), kOnce, paths_file, "", "names an object twice");
  }
  rows.paths.resize(count);
  const bool is_nameless = names_.nameless_boxes() == name;
  for (std::size_t row = 0; row < count; ++row) {
    if (is_nameless) rows.paths[row] = "/Assets/" + std::to_string(row + 1);
    const std::string who =
        rows.paths[row].empty() ? "row " + std::to_string(row) : rows.paths[row];
    const float ratio = rows.array.value<float>(row, *rows.array.field("occlusionRatio"));
    files_.check(ratio == -1.0f || (ratio >= 0.0f && ratio <= 1.0f), kAmodal, file, who,
                 "its occlusion ratio is " + std::to_string(ratio), "0 to 1, or -1");
    rows.ratios.push_back(ratio >= 0.0f && ratio <= 1.0f ? std::optional(double(ratio))
                                                         : std::nullopt);
    rows.labels.emplace_back();
    if (!labels) continue;
    const std::string id =
        std::to_string(rows.array.value<std::uint32_t>(row, *rows.array.field("semanticId")));
    files_.check(labels->contains(id), kIds, file, who, "has the semantic id " + id,
                 "one of " + labels_file);
    if (labels->contains(id) && labels->at(id).is_object()) {
      rows.labels.back() = labels_of(labels->at(id));
    }
  }
  return rows;
}

/// What all kinds of boxes say of an object must be the same.
void BasicFrameReading::take_row(const BoxRows& rows, std::size_t row, const std::string& file,
                                 Instance& object) {
  const Labels& labels = rows.labels[row];
  if (object.labels.empty()) object.labels = labels;
  files_.check(labels.empty() || labels == object.labels, kIds, file, object.node_path,
               "is labelled " + text_of(labels), "other files say " + text_of(object.labels));
  if (!rows.ratios[row]) return;
  const auto [known, is_new] = ratio_of_path_.emplace(object.node_path, *rows.ratios[row]);
  files_.check(is_new || known->second == *rows.ratios[row], kRatio, file, object.node_path,
               "its occlusion ratio is " + std::to_string(*rows.ratios[row]),
               "other files say " + std::to_string(known->second));
}

void BasicFrameReading::read_boxes() {
  if (!wants(kHoldsInstances) && !wants(kHoldsTightBoxes) && !wants(kHoldsOcclusion)) return;
  read_3d();
  read_tight();
  read_loose();
  read_occlusion();
  std::uint32_t next = kFirstObject;
  for (const Instance& each : frame_.instances) next = std::max(next, each.id + 1);
  for (Instance& each : frame_.instances) {
    if (each.id == 0) each.id = next++;
  }
}

template <class Take>
bool BasicFrameReading::read_pixel_boxes(const std::string& name, Take&& take) {
  const auto rows = read_rows(name);
  if (!rows) return false;
  const std::string file = path(name + ".npy");
  files_.reading(file, [&] {
    for (std::size_t row = 0; row < rows->array.count(); ++row) {
      if (rows->paths[row].empty()) continue;
      const auto number = [&](const char* column) {
        return number_in<std::int32_t>(rows->array, row, column, "<i4");
      };
      Instance& object = instance(rows->paths[row]);
      // The format names the last pixel.
      take(object,
           PixelBox{number("x_min"), number("y_min"), number("x_max") + 1, number("y_max") + 1});
      take_row(*rows, row, file, object);
    }
  });
  sources_.emplace(kHoldsInstances, file);
  return true;
}

void BasicFrameReading::read_tight() {
  const std::string name = "bounding_box_2d_tight";
  const bool is_there =
      read_pixel_boxes(name, [](Instance& object, const PixelBox& box) { object.tight_box = box; });
  if (is_there) sources_.emplace(kHoldsTightBoxes, path(name + ".npy"));
}

void BasicFrameReading::read_loose() {
  const std::string name = "bounding_box_2d_loose";
  const bool is_there = read_pixel_boxes(
      name, [&](Instance& object, const PixelBox& box) { loose_of_path_[object.node_path] = box; });
  if (!is_there) return;
  const std::string file = path(name + ".npy");
  if (!names_.nameless_boxes().empty()) return;
  for (const Instance& object : frame_.instances) {
    files_.check(!object.tight_box || loose_of_path_.contains(object.node_path), kAmodal, file,
                 object.node_path, "has a tight box, but no loose one");
  }
  sources_.emplace(kHoldsAmodalBoxes, file);
}

void BasicFrameReading::read_3d() {
  const auto rows = read_rows("bounding_box_3d");
  if (!rows) return;
  const std::string file = path("bounding_box_3d.npy");
  files_.reading(file, [&] {
    const auto* matrix = rows->array.field("transform");
    if (!matrix || matrix->type != "<f4" || matrix->count != 16) {
      throw std::runtime_error("has no column transform of four by four numbers");
    }
    for (std::size_t row = 0; row < rows->array.count(); ++row) {
      if (rows->paths[row].empty()) continue;
      const auto number = [&](const char* column) {
        return double(number_in<float>(rows->array, row, column, "<f4"));
      };
      Instance& object = instance(rows->paths[row]);
      object.bounds_node.min = {number("x_min"), number("y_min"), number("z_min")};
      object.bounds_node.max = {number("x_max"), number("y_max"), number("z_max")};
      files_.check(!object.bounds_node.is_empty(), kReadable, file, object.node_path,
                   "its 3-D box ends before it begins");
      for (std::size_t i = 0; i < 16; ++i) {
        // For row vectors in the file.
        object.world_from_node.matrix()(Eigen::Index(i % 4), Eigen::Index(i / 4)) =
            double(rows->array.value<float>(row, *matrix, i));
      }
      take_row(*rows, row, file, object);
    }
  });
  for (const std::string_view name : {kHoldsPoses, kHoldsBounds, kHoldsBoxes3d, kHoldsInstances}) {
    sources_.emplace(name, file);
  }
}

/// Rows say an id of the instance pictures; colours hide it, so that rows are compared as a whole.
void BasicFrameReading::read_occlusion() {
  const std::string file = path("occlusion.npy");
  if (file.empty()) return;
  const auto text = files_.text(file);
  if (!text) return;
  files_.reading(file, [&] {
    const StoredArray array = parse_array(*text);
    const auto* ratio = array.field("occlusionRatio");
    const auto* id = array.field("instanceId");
    if (!ratio || ratio->type != "<f4" || !id || id->type != "<u4") {
      throw std::runtime_error("has no columns instanceId and occlusionRatio");
    }
    std::vector<double> ratios;
    std::set<std::uint32_t> ids;
    for (std::size_t row = 0; row < array.count(); ++row) {
      const float value = array.value<float>(row, *ratio);
      files_.check(value == -1.0f || (value >= 0.0f && value <= 1.0f), kAmodal, file,
                   "row " + std::to_string(row), "its occlusion ratio is " + std::to_string(value),
                   "0 to 1, or -1");
      if (value >= 0.0f && value <= 1.0f) ratios.push_back(double(value));
      files_.check(ids.insert(array.value<std::uint32_t>(row, *id)).second, kOnce, file,
                   "row " + std::to_string(row), "names an instance again");
    }
    if (path("bounding_box_3d.npy").empty()) return;
    std::vector<double> expected;
    for (const auto& [node_path, value] : ratio_of_path_) expected.push_back(value);
    std::ranges::sort(expected);
    std::ranges::sort(ratios);
    files_.check(ratios == expected, kRatio, file, "", "holds other ratios than the boxes");
  });
}

/// Counts that give the share which the files say.
void BasicFrameReading::set_visibility() {
  constexpr std::int64_t kUnknownSize = std::int64_t(1) << 24;
  for (Instance& object : frame_.instances) {
    const auto ratio = ratio_of_path_.find(object.node_path);
    const auto loose = loose_of_path_.find(object.node_path);
    if (ratio == ratio_of_path_.end() && loose == loose_of_path_.end()) continue;
    Visibility seen;
    if (loose != loose_of_path_.end()) seen.amodal_box = loose->second;
    if (ratio != ratio_of_path_.end()) {
      const double visible_share = 1.0 - ratio->second;
      seen.amodal_pixels = kUnknownSize;
      seen.visible_pixels = std::llround(visible_share * double(kUnknownSize));
      if (instances_) {
        const auto count = visible_.find(object.id);
        seen.visible_pixels = count == visible_.end() ? 0 : count->second;
        const bool fits = (seen.visible_pixels > 0) == (visible_share > 0.0);
        const std::string file =
            path("bounding_box_3d.npy").empty() ? instances_->file : path("bounding_box_3d.npy");
        files_.check(fits, kRatio, file, object.node_path,
                     "its occlusion ratio is " + std::to_string(ratio->second),
                     std::to_string(seen.visible_pixels) + " of its pixels are visible");
        if (fits && seen.visible_pixels > 0) {
          // A share of two counts: a number near it that no counts give is wrong.
          const double whole = double(seen.visible_pixels) / visible_share;
          const double slack = 0.02 + 2e-7 * whole * whole / double(seen.visible_pixels);
          files_.check(std::abs(whole - std::round(whole)) <= slack, kRatio, file, object.node_path,
                       "its occlusion ratio is " + std::to_string(ratio->second),
                       "a share of pixels, of which " + std::to_string(seen.visible_pixels) +
                           " are visible");
          seen.amodal_pixels = std::llround(std::min(whole, 1e15));
        } else {
          seen.amodal_pixels = std::max<std::int64_t>(seen.visible_pixels, 1);
        }
        if (seen.amodal_box) {
          const auto area = std::int64_t(seen.amodal_box->width()) * seen.amodal_box->height();
          files_.check(
              seen.amodal_pixels <= area, kRatio, file, object.node_path,
              "its occlusion ratio makes it " + std::to_string(seen.amodal_pixels) + " pixels",
              "at most the " + std::to_string(area) + " of its loose box");
        }
      }
    }
    object.visibility = std::move(seen);
  }
}

/// Points are pixels in the picture's order.
void BasicFrameReading::read_points() {
  const std::string file = path("pointcloud.npy");
  if (file.empty() || !wants("pointcloud")) return;
  const auto text = files_.text(file);
  if (!text) return;
  files_.reading(file, [&] {
    const StoredArray points = parse_array(*text);
    if (!points.is_plain("<f4") || points.shape.size() != 2 || points.shape[1] != 3) {
      throw std::runtime_error("is no list of points of three 32-bit numbers");
    }
    std::map<std::string, StoredArray> others;
    for (const char* kind :
         {"pointcloud_rgb", "pointcloud_normals", "pointcloud_semantic", "pointcloud_instance"}) {
      const std::string name = path(std::string(kind) + ".npy");
      if (name.empty()) continue;
      const auto content = files_.text(name);
      if (!content) continue;
      files_.reading(name, [&] {
        StoredArray array = parse_array(*content);
        const bool fits = !array.shape.empty() && array.shape[0] == points.shape[0];
        files_.check(fits, kCounts, name, "",
                     "has " + std::to_string(array.shape.empty() ? 0 : array.shape[0]) + " entries",
                     std::to_string(points.shape[0]) + ", one per point");
        if (fits) others.emplace(kind, std::move(array));
      });
    }
    if (!instances_) return;
    std::vector<std::size_t> labelled;
    std::vector<std::size_t> surfaces;
    const auto ids = instances_->ids.pixels();
    for (std::size_t i = 0; i < ids.size(); ++i) {
      if (ids[i] >= kFirstObject) labelled.push_back(i);
      if (ids[i] != 0) surfaces.push_back(i);
    }
    const std::size_t count = points.shape[0];
    const bool is_known = count == labelled.size() || count == surfaces.size();
    files_.check(is_known, kPoints, file, "", "has " + std::to_string(count) + " points",
                 std::to_string(labelled.size()) + " labelled pixels, or " +
                     std::to_string(surfaces.size()) + " with all surfaces");
    if (!is_known) return;
    const auto& pixels = count == labelled.size() ? labelled : surfaces;
    check_point_places(points, pixels, file);
    std::size_t wrong_normals = 0;
    std::size_t wrong_colors = 0;
    std::map<std::uint32_t, std::set<std::uint32_t>> ids_seen;
    const auto* colors = others.contains("pointcloud_rgb") ? &others.at("pointcloud_rgb") : nullptr;
    const auto* normals =
        others.contains("pointcloud_normals") ? &others.at("pointcloud_normals") : nullptr;
    const auto* instance_ids =
        others.contains("pointcloud_instance") ? &others.at("pointcloud_instance") : nullptr;
    const bool has_colors = colors && colors->is_plain("|u1") && frame_.has(kColor.name) &&
                            colors->count() == 4 * count && !path("rgb.png").empty();
    const bool has_normals = normals && normals->is_plain("<f4") && frame_.has(kNormals.name) &&
                             normals->count() == 4 * count;
    const bool has_ids =
        instance_ids && instance_ids->is_plain("<u4") && instance_ids->count() == count;
    for (std::size_t k = 0; k < count; ++k) {
      const std::size_t pixel = pixels[k];
      if (has_colors) {
        const Rgba8& color = frame_.get(kColor).pixels()[pixel];
        if (std::memcmp(color.data(), colors->data.data() + 4 * k, 3) != 0) ++wrong_colors;
      }
      if (has_normals) {
        Vec3f normal;
        std::memcpy(normal.data(), normals->data.data() + 16 * k, 12);
        const Vec3f off = normal - frame_.get(kNormals).pixels()[pixel];
        if (!(off.cwiseAbs().maxCoeff() <= 0.01f)) ++wrong_normals;
      }
      if (has_ids) {
        std::uint32_t id = 0;
        std::memcpy(&id, instance_ids->data.data() + 4 * k, 4);
        ids_seen[id].insert(ids[pixel]);
      }
    }
    files_.check(wrong_colors == 0, kPoints, path("pointcloud_rgb.npy"), "",
                 std::to_string(wrong_colors) + " points have another colour than their pixels");
    files_.check(wrong_normals == 0, kPoints, path("pointcloud_normals.npy"), "",
                 std::to_string(wrong_normals) + " points have another normal than their pixels");
    for (const auto& [id, shown] : ids_seen) {
      files_.check(
          shown.size() == 1, kPoints, path("pointcloud_instance.npy"), "",
          "the id " + std::to_string(id) + " lies on " + std::to_string(shown.size()) + " objects",
          "one");
    }
  });
}

/// As far from the camera as the distance pictures say.
void BasicFrameReading::check_point_places(const StoredArray& points,
                                           const std::vector<std::size_t>& pixels,
                                           const std::string& file) {
  if (!sources_.contains(kHoldsCameraPose)) return;
  const bool is_along_ray = frame_.has(kDistanceToCamera.name);
  if (!is_along_ray && !frame_.has(kDistanceToImagePlane.name)) return;
  const auto& distances = frame_.get(is_along_ray ? kDistanceToCamera : kDistanceToImagePlane);
  const Affine camera_from_world = frame_.world_from_camera.inverse();
  std::size_t wrong = 0;
  for (std::size_t k = 0; k < pixels.size(); ++k) {
    Vec3f point;
    std::memcpy(point.data(), points.data.data() + 12 * k, 12);
    const Vec3 p = camera_from_world * point.cast<double>();
    const double found = is_along_ray ? p.norm() : -p.z();
    const double expected = double(distances.pixels()[pixels[k]]);
    if (!(std::abs(found - expected) <= 1e-3 + 1e-4 * expected)) ++wrong;
  }
  files_.check(wrong == 0, kPoints, file, "",
               std::to_string(wrong) + " points are not as far away as their pixels");
}

}  // namespace diorama
