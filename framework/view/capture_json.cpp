// SPDX-License-Identifier: Apache-2.0
#include "framework/view/capture_json.h"

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "framework/datasets/dataset_stats.h"

namespace diorama {
namespace {

using Json = nlohmann::json;

std::string dumped(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

Json rounded(double value, double step) {
  if (!std::isfinite(value)) return nullptr;
  return std::round(value / step) * step;
}

Json box_json(const std::optional<PixelBox>& box) {
  if (!box) return nullptr;
  return {box->x_min, box->y_min, box->x_max, box->y_max};
}

Json vector_json(const Vec3& vector) { return {vector.x(), vector.y(), vector.z()}; }

/// The upper three rows, row by row.
Json matrix_json(const Affine& map) {
  Json numbers = Json::array();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column) numbers.push_back(map.matrix()(row, column));
  }
  return numbers;
}

/// Readers give what files say, which may be no number. Then the page is not told.
bool is_finite(const Affine& map) { return map.matrix().allFinite(); }

/// Pairs of corners (see Aabb::corner()) that differ in one bit.
constexpr std::array<std::pair<int, int>, 12> kEdges{{{0, 1},
                                                      {2, 3},
                                                      {4, 5},
                                                      {6, 7},
                                                      {0, 2},
                                                      {1, 3},
                                                      {4, 6},
                                                      {5, 7},
                                                      {0, 4},
                                                      {1, 5},
                                                      {2, 6},
                                                      {3, 7}}};

/// Lines in the picture, each a flat list x, y, x, y ... Lenses bend edges, and may image parts.
Json edges_json(const Frame& frame, const Instance& instance) {
  const bool is_straight = frame.camera.lens == LensModel::Pinhole;
  const int parts = is_straight ? 8 : 24;
  const Affine camera_from_node = frame.world_from_camera.inverse() * instance.world_from_node;
  const double far = 4.0 * double(frame.camera.width + frame.camera.height);
  Json lines = Json::array();
  for (const auto& [from, to] : kEdges) {
    const Vec3 a = camera_from_node * instance.bounds_node.corner(from);
    const Vec3 b = camera_from_node * instance.bounds_node.corner(to);
    Json line = Json::array();
    for (int i = 0; i <= parts; ++i) {
      const auto pixel = project(frame.camera, a + (b - a) * (double(i) / parts));
      if (!pixel || !pixel->allFinite() || pixel->cwiseAbs().maxCoeff() > far) {
        if (line.size() > 2) lines.push_back(std::move(line));
        line = Json::array();
        continue;
      }
      line.push_back(rounded(pixel->x(), 0.01));
      line.push_back(rounded(pixel->y(), 0.01));
    }
    if (line.size() <= 2) continue;
    const bool is_whole = line.size() == 2 * std::size_t(parts) + 2;
    if (is_straight && is_whole) {
      line = {line[0], line[1], line[line.size() - 2], line[line.size() - 1]};
    }
    lines.push_back(std::move(line));
  }
  return lines;
}

/// A list of x, y, sight.
Json keypoints_json(const std::vector<StoredKeypoint>& keypoints) {
  Json list = Json::array();
  for (const StoredKeypoint& point : keypoints) {
    const bool is_told = point.sight != StoredKeypoint::Sight::NotTold;
    list.push_back({rounded(is_told ? point.pixel.x() : 0.0, 0.01),
                    rounded(is_told ? point.pixel.y() : 0.0, 0.01), int(point.sight)});
  }
  return list;
}

Json object_json(const StoredInfo& info, const Frame& frame, const Instance& instance) {
  const auto holds = [&](std::string_view name) { return info.holds.contains(name); };
  Json object{{"id", instance.id},
              {"path", instance.node_path},
              {"class", class_of(instance)},
              {"labels", instance.labels},
              {"box", box_json(instance.tight_box)}};
  if (instance.visibility) {
    const Visibility& seen = *instance.visibility;
    if (holds(kHoldsOcclusion)) {
      const auto occlusion = seen.occlusion();
      object["occlusion"] = occlusion ? rounded(*occlusion, 1e-4) : Json(nullptr);
    }
    if (holds(kHoldsTruncation)) object["truncation"] = rounded(seen.truncation(), 1e-4);
    if (holds(kHoldsAmodalBoxes)) object["amodal_box"] = box_json(seen.amodal_box);
    // Formats that hold shares alone have readers that give pixels of a size which no picture has.
    const auto pixels = std::int64_t(frame.camera.width) * frame.camera.height;
    const bool are_counted = seen.visible_pixels > 0 && seen.amodal_pixels <= pixels;
    if (are_counted) object["visible_pixels"] = seen.visible_pixels;
  }
  if (const auto seen = seen_from(info, frame, instance)) {
    object["distance_m"] = rounded(seen->distance_m, 1e-4);
  }
  if (!is_finite(instance.world_from_node)) return object;
  if (holds(kHoldsPoses) || holds(kHoldsBoxes3d)) {
    object["world_from_node"] = matrix_json(instance.world_from_node);
  }
  const Aabb& bounds = instance.bounds_node;
  if (holds(kHoldsBoxes3d) && !bounds.is_empty() && bounds.min.allFinite() &&
      bounds.max.allFinite()) {
    object["bounds"] = {vector_json(bounds.min), vector_json(bounds.max)};
    object["edges"] = edges_json(frame, instance);
  }
  return object;
}

Json frame_json(const StoredInfo& info, const Frame& frame) {
  const Camera& camera = frame.camera;
  Json json{{"camera", frame.camera_name}, {"width", camera.width}, {"height", camera.height}};
  const bool is_lens = std::isfinite(camera.fx) && std::isfinite(camera.fy) &&
                       std::isfinite(camera.cx) && std::isfinite(camera.cy);
  if (info.holds.contains(kHoldsCamera) && is_lens) {
    json["lens"] = camera.lens == LensModel::Pinhole         ? "pinhole"
                   : camera.lens == LensModel::OpencvPinhole ? "opencv"
                                                             : "fisheye";
    json["focal"] = {camera.fx, camera.fy};
    json["centre"] = {camera.cx, camera.cy};
  }
  if (info.holds.contains(kHoldsCameraPose) && is_finite(frame.world_from_camera)) {
    json["world_from_camera"] = matrix_json(frame.world_from_camera);
  }
  json["objects"] = Json::array();
  for (const Instance& instance : frame.instances) {
    json["objects"].push_back(object_json(info, frame, instance));
  }
  return json;
}

/// Lengths of runs of pixels that are not in it, that are, and so on, row by row of its box.
Json mask_json(std::uint32_t id, const CoverageMask& mask) {
  Json runs = Json::array();
  std::uint8_t value = 0;
  std::int64_t length = 0;
  for (const std::uint8_t bit : mask.bits) {
    if (bit != value) {
      runs.push_back(length);
      value = bit;
      length = 0;
    }
    ++length;
  }
  runs.push_back(length);
  return {{"id", id}, {"box", box_json(mask.box)}, {"runs", std::move(runs)}};
}

}  // namespace

NameSet wanted_for_labels(const StoredInfo& info) {
  NameSet names = info.holds;
  for (const std::string_view pixels :
       {kColor.name, kColorHdr.name, kDistanceToCamera.name, kDistanceToImagePlane.name,
        kNormals.name, kLeafId.name, kPosition.name, kUv.name, kAlbedo.name,
        kObjectCoordinates.name, kMotion.name, kFlowForward.name, kFlowBackward.name,
        kFlowForwardState.name, kFlowBackwardState.name, kSensorDepth.name,
        std::string_view("amodal_mask")}) {
    names.erase(std::string(pixels));
  }
  if (names.contains(kHoldsTightBoxes)) names.erase(std::string(kInstanceId.name));
  return names;
}

std::string capture_json(const StoredInfo& info, const StoredCapture& stored) {
  const Capture& capture = stored.capture;
  Json json{{"capture", capture.index},
            {"visit", capture.visit},
            {"phase", capture.phase},
            {"environment", capture.environment},
            {"split", stored.split}};
  if (const auto& clip = capture.clip) {
    json["clip"] = {{"clip", clip->clip},
                    {"frame", clip->frame},
                    {"frames", clip->frame_count},
                    {"fps", clip->fps}};
  }
  json["frames"] = Json::array();
  for (const Frame& frame : capture.frames) json["frames"].push_back(frame_json(info, frame));
  for (std::size_t i = 0; i < stored.keypoints.size() && i < json["frames"].size(); ++i) {
    for (Json& object : json["frames"][i]["objects"]) {
      const auto found = stored.keypoints[i].find(object["id"].get<std::uint32_t>());
      if (found != stored.keypoints[i].end()) object["keypoints"] = keypoints_json(found->second);
    }
  }
  for (std::size_t i = 0; i < stored.files.size() && i < json["frames"].size(); ++i) {
    json["frames"][i]["files"] = stored.files[i];
  }
  json["findings"] = Json::array();
  for (const Finding& finding : stored.log.findings) {
    json["findings"].push_back({{"check", finding.check},
                                {"camera", finding.camera},
                                {"object", finding.object},
                                {"found", finding.found},
                                {"expected", finding.expected}});
  }
  return dumped(json);
}

std::string amodal_json(const Frame& frame) {
  Json objects = Json::array();
  for (const Instance& instance : frame.instances) {
    if (!instance.visibility || instance.visibility->amodal_mask.bits.empty()) continue;
    objects.push_back(mask_json(instance.id, instance.visibility->amodal_mask));
  }
  return dumped({{"objects", std::move(objects)}});
}

std::string masks_json(const std::map<std::uint32_t, CoverageMask>& masks) {
  Json objects = Json::array();
  for (const auto& [id, mask] : masks) objects.push_back(mask_json(id, mask));
  return dumped({{"objects", std::move(objects)}});
}

}  // namespace diorama
