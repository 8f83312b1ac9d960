// SPDX-License-Identifier: Apache-2.0
#include "framework/python/captures.h"

#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "diorama/writer.h"
#include "framework/datasets/frame_copy.h"
#include "framework/python/capsule.h"

namespace py = pybind11;

namespace diorama {
namespace {

/// Pixels that keep what they lie in alive and cannot be changed.
template <class Element>
py::array view_of(const Element* data, std::vector<py::ssize_t> shape, const py::capsule& owner) {
  py::array_t<Element> array(std::move(shape), data, owner);
  py::detail::array_proxy(array.ptr())->flags &= ~py::detail::npy_api::NPY_ARRAY_WRITEABLE_;
  return array;
}

py::array image_view(const AnyImage& any, const py::capsule& owner) {
  return std::visit(
      [&](const auto& image) -> py::array {
        using Pixel = typename std::decay_t<decltype(image)>::PixelType;
        const py::ssize_t height = image.height();
        const py::ssize_t width = image.width();
        if constexpr (std::is_arithmetic_v<Pixel>) {
          return view_of(image.pixels().data(), {height, width}, owner);
        } else {
          constexpr py::ssize_t kParts = sizeof(Pixel) / sizeof(std::declval<Pixel>()[0]);
          return view_of(image.pixels().empty() ? nullptr : &image.pixels()[0][0],
                         {height, width, kParts}, owner);
        }
      },
      any);
}

py::dict labels_of(const Labels& labels) {
  py::dict result;
  for (const auto& [taxonomy, label] : labels) result[text_of(taxonomy)] = text_of(label);
  return result;
}

py::object box_of(const std::optional<PixelBox>& box) {
  if (!box) return py::none();
  return py::make_tuple(box->x_min, box->y_min, box->x_max, box->y_max);
}

py::dict camera_of(const Camera& camera) {
  py::dict result;
  result["width"] = camera.width;
  result["height"] = camera.height;
  result["lens"] = kLensNames[std::size_t(camera.lens)];
  result["fx"] = camera.fx;
  result["fy"] = camera.fy;
  result["cx"] = camera.cx;
  result["cy"] = camera.cy;
  result["distortion"] = camera.distortion;
  result["fisheye_polynomial"] = camera.fisheye_polynomial;
  result["near_m"] = camera.near_m;
  result["far_m"] = camera.far_m;
  return result;
}

/// Its box, and 0 or 1 for each pixel in there.
py::tuple mask_of(const CoverageMask& mask, const py::capsule& owner) {
  return py::make_tuple(box_of(mask.box),
                        view_of(mask.bits.data(), {mask.box.height(), mask.box.width()}, owner));
}

py::object visibility_of(const std::optional<Visibility>& seen, const py::capsule& owner) {
  if (!seen) return py::none();
  py::dict result;
  result["visible_pixels"] = seen->visible_pixels;
  result["amodal_pixels"] = seen->amodal_pixels;
  result["outside_pixels"] = seen->outside_pixels;
  result["occlusion"] = seen->occlusion();
  result["truncation"] = seen->truncation();
  result["amodal_box"] = box_of(seen->amodal_box);
  const CoverageMask& mask = seen->amodal_mask;
  result["amodal_mask"] = mask.bits.empty() ? py::object(py::none()) : mask_of(mask, owner);
  return result;
}

py::object velocity_of(const std::optional<Velocity>& velocity) {
  if (!velocity) return py::none();
  py::dict result;
  result["linear"] = velocity->linear;
  result["angular"] = velocity->angular;
  return result;
}

py::list joints_of(const std::vector<JointState>& joints) {
  constexpr const char* kKinds[]{"fixed", "revolute", "prismatic"};
  py::list result;
  for (const JointState& joint : joints) {
    py::dict each;
    each["path"] = text_of(joint.path);
    each["kind"] = kKinds[std::size_t(joint.kind)];
    each["parent_path"] = text_of(joint.parent_path);
    each["child_path"] = text_of(joint.child_path);
    each["position"] = joint.position;
    each["lower"] = joint.lower;
    each["upper"] = joint.upper;
    result.append(each);
  }
  return result;
}

py::object clip_of(const std::optional<ClipFrame>& clip) {
  if (!clip) return py::none();
  py::dict result;
  result["clip"] = clip->clip;
  result["frame"] = clip->frame;
  result["frame_count"] = clip->frame_count;
  result["fps"] = clip->fps;
  return result;
}

py::dict instance_of(const Instance& instance, const NameSet& holds, const py::capsule& owner) {
  py::dict result;
  result["id"] = instance.id;
  result["path"] = text_of(instance.node_path);
  result["labels"] = labels_of(instance.labels);
  const auto if_held = [&](std::string_view name, auto make) -> py::object {
    return holds.contains(name) ? py::object(make()) : py::object(py::none());
  };
  result["world_from_object"] =
      if_held(kHoldsPoses, [&] { return py::cast(Mat4(instance.world_from_node.matrix())); });
  result["bounds"] = if_held(kHoldsBounds, [&]() -> py::object {
    const Aabb& bounds = instance.bounds_node;
    if (bounds.is_empty()) return py::none();
    return py::make_tuple(py::cast(bounds.min), py::cast(bounds.max));
  });
  result["box"] = box_of(instance.tight_box);
  result["visibility"] = visibility_of(instance.visibility, owner);
  py::dict keypoints;
  for (const Keypoint& point : instance.keypoints) {
    keypoints[text_of(point.name)] = point.position;
  }
  result["keypoints"] = keypoints;
  result["velocity"] = velocity_of(instance.velocity);
  return result;
}

py::dict frame_of(const Frame& frame, const NameSet& holds, const py::capsule& owner) {
  py::dict result;
  result["camera_name"] = text_of(frame.camera_name);
  result["camera"] = camera_of(frame.camera);
  result["world_from_camera"] = holds.contains(kHoldsCameraPose)
                                    ? py::cast(Mat4(frame.world_from_camera.matrix()))
                                    : py::none();
  py::list instances;
  for (const Instance& instance : frame.instances) {
    instances.append(instance_of(instance, holds, owner));
  }
  result["instances"] = instances;
  py::list occlusions;
  for (const Occlusion& occlusion : frame.occlusions) {
    occlusions.append(py::make_tuple(occlusion.front, occlusion.behind, occlusion.pixels));
  }
  result["occlusions"] = occlusions;
  result["joints"] = joints_of(frame.joints);
  py::dict leaf_paths;
  for (const auto& [id, path] : frame.leaf_paths) leaf_paths[py::int_(id)] = text_of(path);
  result["leaf_paths"] = leaf_paths;
  result["exposure"] = frame.exposure;
  py::dict channels;
  for (const std::string& name : frame.channels()) {
    channels[text_of(name)] = image_view(frame.image_named(name), owner);
  }
  result["channels"] = channels;
  return result;
}

py::dict finding_of(const Finding& finding) {
  py::dict result;
  result["check"] = text_of(finding.check);
  result["file"] = text_of(finding.file);
  result["capture"] = finding.capture;
  result["camera"] = text_of(finding.camera);
  result["object"] = text_of(finding.object);
  result["found"] = text_of(finding.found);
  result["expected"] = text_of(finding.expected);
  return result;
}

/// A row each: x, y, sight.
py::object keypoints_px_of(const std::vector<StoredKeypoint>& points) {
  py::array_t<double> rows({py::ssize_t(points.size()), py::ssize_t(3)});
  auto values = rows.mutable_unchecked<2>();
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto row = py::ssize_t(i);
    values(row, 0) = points[i].pixel.x();
    values(row, 1) = points[i].pixel.y();
    values(row, 2) = double(points[i].sight);
  }
  return rows;
}

}  // namespace

py::str text_of(std::string_view text) {
  PyObject* const made =
      PyUnicode_DecodeUTF8(text.data(), py::ssize_t(text.size()), "surrogateescape");
  if (made == nullptr) throw py::error_already_set();
  return py::reinterpret_steal<py::str>(made);
}

py::list texts_of(const std::vector<std::string>& texts) {
  py::list result;
  for (const std::string& text : texts) result.append(text_of(text));
  return result;
}

py::list findings_of(const ReadLog& log) {
  py::list result;
  for (const Finding& finding : log.findings) result.append(finding_of(finding));
  return result;
}

py::dict capture_of(std::shared_ptr<const StoredCapture> stored, const NameSet& holds) {
  // Every array refers to the capsule, which ends with the last of them.
  auto* const shared = new std::shared_ptr<const StoredCapture>(stored);
  const py::capsule owner(
      shared, [](void* held) { delete static_cast<std::shared_ptr<const StoredCapture>*>(held); });
  py::dict result;
  result["index"] = stored->capture.index;
  result["visit"] = stored->capture.visit;
  result["phase"] = text_of(stored->capture.phase);
  result["environment"] = text_of(stored->capture.environment);
  result["clip"] = clip_of(stored->capture.clip);
  result["split"] = text_of(stored->split);
  py::list frames;
  for (std::size_t i = 0; i < stored->capture.frames.size(); ++i) {
    const Frame& frame = stored->capture.frames[i];
    py::dict made = frame_of(frame, holds, owner);
    const bool has_keypoints = i < stored->keypoints.size();
    py::size_t place = 0;
    for (const py::handle instance : py::list(made["instances"])) {
      const std::uint32_t id = frame.instances[place++].id;
      const bool is_known = has_keypoints && stored->keypoints[i].contains(id);
      instance["keypoints_px"] =
          is_known ? keypoints_px_of(stored->keypoints[i].at(id)) : py::object(py::none());
    }
    py::dict masks;
    if (i < stored->masks.size()) {
      for (const auto& [id, mask] : stored->masks[i]) masks[py::int_(id)] = mask_of(mask, owner);
    }
    made["masks"] = masks;
    frames.append(made);
  }
  result["frames"] = frames;
  result["findings"] = findings_of(stored->log);
  return result;
}

std::shared_ptr<const StoredCapture> copy_of(const Capture& capture, const NameSet& needs) {
  auto stored = std::make_shared<StoredCapture>();
  stored->capture.index = capture.index;
  stored->capture.visit = capture.visit;
  stored->capture.phase = capture.phase;
  stored->capture.environment = capture.environment;
  stored->capture.clip = capture.clip;
  for (const Frame& frame : capture.frames) stored->capture.frames.push_back(copy_of(frame, needs));
  return stored;
}

NameSet made_holds() {
  return {std::string(kHoldsPoses), std::string(kHoldsBounds), std::string(kHoldsCameraPose)};
}

namespace {

/// Of one call of a writer, as Access of scenes.cpp.
struct PyFiles {
  DatasetFiles* files = nullptr;
  CaptureFiles* of_capture = nullptr;  ///< Null in begin() and finish().

  DatasetFiles& get() const {
    if (!files) throw Error(ErrorKind::Plugin, "the files were given for one call, which is over");
    return *files;
  }
};

using Content = std::variant<py::bytes, std::string>;

std::span<const std::byte> bytes_of(const Content& content) {
  const std::string_view text =
      std::visit([](const auto& each) { return std::string_view(each); }, content);
  return std::as_bytes(std::span(text));
}

void bind_files(py::module_& module) {
  py::class_<PyFiles>(
      module, "Files",
      "The files of a writer, for one call. Paths are relative to the writer's folder, with '/'.")
      .def(
          "add",
          [](const PyFiles& f, const std::string& path, const Content& content) {
            const auto bytes = bytes_of(content);
            f.get().add(path, {bytes.begin(), bytes.end()});
          },
          py::arg("path"), py::arg("content"), "A file; texts are written as UTF-8.")
      .def(
          "append",
          [](const PyFiles& f, const std::string& path, const Content& content) {
            f.get().append(path, bytes_of(content));
          },
          py::arg("path"), py::arg("content"),
          "Puts content at the end of a file that begins empty.")
      .def(
          "record",
          [](const PyFiles& f, const std::string& line) {
            f.get();
            if (!f.of_capture) {
              throw Error(ErrorKind::Plugin, "only write() has a capture to keep a record of");
            }
            f.of_capture->record(line);
          },
          py::arg("line"), "In write() alone: a line that finish() gets.")
      .def("_end", [](PyFiles& f) { f = {}; });
  module.def("files_of", [](const py::capsule& files) {
    return PyFiles{held<DatasetFiles>(files, "diorama::DatasetFiles"), nullptr};
  });
  module.def("capture_files_of", [](const py::capsule& files) {
    auto* const of_capture = held<CaptureFiles>(files, "diorama::CaptureFiles");
    return PyFiles{of_capture, of_capture};
  });
}

py::dict dataset_of(const DatasetInfo& info) {
  py::dict result;
  result["seed"] = info.seed;
  result["captures"] = info.capture_count;
  result["cameras"] = texts_of(info.camera_names);
  py::list labels;
  for (const Labels& each : info.labels) labels.append(labels_of(each));
  result["labels"] = labels;
  result["classes"] = texts_of(info.classes);
  result["validation"] = info.validation;
  result["job"] = text_of(info.resolved_job);
  result["version"] = info.program_version;
  return result;
}

}  // namespace

void bind_captures(py::module_& module) {
  bind_files(module);
  module.def("capture_copy", [](const py::capsule& capture, const std::vector<std::string>& needs) {
    return capture_of(copy_of(*held<const Capture>(capture, "diorama::Capture"),
                              NameSet(needs.begin(), needs.end())),
                      made_holds());
  });
  module.def("dataset_of", [](const py::capsule& info) {
    return dataset_of(*held<const DatasetInfo>(info, "diorama::DatasetInfo"));
  });
}

}  // namespace diorama
