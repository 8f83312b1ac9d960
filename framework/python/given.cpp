// SPDX-License-Identifier: Apache-2.0
#include "framework/python/given.h"

#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "diorama/reader.h"
#include "framework/datasets/frame_copy.h"
#include "framework/python/capsule.h"
#include "framework/python/captures.h"
#include "framework/python/scenes.h"

namespace py = pybind11;

namespace diorama {
namespace {

std::string shape_of(const py::array& array) {
  return py::str(array.dtype()).cast<std::string>() + " " +
         py::str(py::tuple(array.attr("shape"))).cast<std::string>();
}

template <class Pixel, class Element>
AnyImage image_of(const py::array& array, int width, int height) {
  const auto dense = py::array_t<Element, py::array::c_style>(array);
  Image<Pixel> image(width, height, Pixel{});
  std::memcpy(static_cast<void*>(image.pixels().data()), dense.data(), image.pixels().size_bytes());
  return image;
}

/// Copied. Types are not converted: who gives float64 has most often forgotten something.
AnyImage any_image(const std::string& name, const py::array& array, const Camera& camera) {
  const int width = camera.width, height = camera.height;
  const bool fits = array.ndim() >= 2 && array.shape(0) == height && array.shape(1) == width;
  const py::ssize_t parts = array.ndim() == 3 ? array.shape(2) : array.ndim() == 2 ? 1 : 0;
  if (fits) {
    if (py::isinstance<py::array_t<std::uint8_t>>(array) && parts == 4) {
      return image_of<Rgba8, std::uint8_t>(array, width, height);
    }
    if (py::isinstance<py::array_t<std::uint32_t>>(array) && parts == 1) {
      return image_of<std::uint32_t, std::uint32_t>(array, width, height);
    }
    if (py::isinstance<py::array_t<float>>(array)) {
      if (parts == 1) return image_of<float, float>(array, width, height);
      if (parts == 2) return image_of<Vec2f, float>(array, width, height);
      if (parts == 3) return image_of<Vec3f, float>(array, width, height);
    }
  }
  const std::string size = std::to_string(height) + ", " + std::to_string(width);
  throw Error(ErrorKind::Plugin, "channel '" + name + "': expected uint8 (" + size +
                                     ", 4), uint32 (" + size + ") or float32 (" + size + "), (" +
                                     size + ", 2), (" + size + ", 3), found " + shape_of(array));
}

void set_channels(Frame& frame, const std::map<std::string, py::array>& channels) {
  for (const auto& [name, array] : channels) {
    std::visit([&, &known = name]<class Pixel>(
                   Image<Pixel>&& image) { frame.set(Channel<Pixel>{known}, std::move(image)); },
               any_image(name, array, frame.camera));
    try {
      frame.check_channel(name);
    } catch (const Error&) {
      throw Error(ErrorKind::Plugin, "channel '" + name +
                                         "': has another type of pixels than this channel has, "
                                         "found " +
                                         shape_of(array));
    }
  }
}

/// What a class of diorama/__init__.py has below a name.
template <class T>
T value_of(const py::handle& given, const char* name) {
  const py::object value = given.attr(name);
  try {
    return value.cast<T>();
  } catch (const py::cast_error&) {
    throw Error(ErrorKind::Plugin,
                py::str(py::type::of(given).attr("__name__")).cast<std::string>() + "." + name +
                    " cannot be " + py::repr(value).cast<std::string>());
  }
}

template <class T>
std::optional<T> optional_of(const py::handle& given, const char* name) {
  return value_of<std::optional<T>>(given, name);
}

using Corners = std::array<int, 4>;

std::optional<PixelBox> pixel_box(const std::optional<Corners>& corners) {
  if (!corners) return std::nullopt;
  return PixelBox{(*corners)[0], (*corners)[1], (*corners)[2], (*corners)[3]};
}

Camera camera_given(const py::object& given) {
  Camera camera;
  camera.width = value_of<int>(given, "width");
  camera.height = value_of<int>(given, "height");
  if (camera.width < 1 || camera.height < 1) {
    throw Error(ErrorKind::Plugin, "a camera's width and height are at least 1");
  }
  const auto lens = value_of<std::string>(given, "lens");
  const auto known = std::ranges::find(kLensNames, lens);
  if (known == std::end(kLensNames)) {
    throw Error(ErrorKind::Plugin, "there is no lens '" + lens + "'");
  }
  camera.lens = LensModel(known - std::begin(kLensNames));
  camera.fx = value_of<double>(given, "fx");
  camera.fy = value_of<double>(given, "fy");
  camera.cx = value_of<double>(given, "cx");
  camera.cy = value_of<double>(given, "cy");
  const auto copy = [&](const char* name, auto& to) {
    const auto values = value_of<std::vector<double>>(given, name);
    if (values.size() > to.size()) {
      throw Error(ErrorKind::Plugin,
                  std::string(name) + " has at most " + std::to_string(to.size()) + " numbers");
    }
    std::ranges::copy(values, to.begin());
  };
  copy("distortion", camera.distortion);
  copy("fisheye_polynomial", camera.fisheye_polynomial);
  camera.near_m = value_of<double>(given, "near_m");
  camera.far_m = value_of<double>(given, "far_m");
  return camera;
}

/// `beyond` is how many image sizes the box may reach beyond the image to each side.
CoverageMask mask_given(const std::string& what, const py::object& given, const Camera& camera,
                        int beyond) {
  CoverageMask mask;
  if (given.is_none()) return mask;
  using Bits = py::array_t<bool, py::array::c_style | py::array::forcecast>;
  const auto [box, bits] = [&] {
    try {
      return given.cast<std::pair<std::optional<Corners>, Bits>>();
    } catch (const py::cast_error&) {
      throw Error(ErrorKind::Plugin, what + " is a pair of a box and its pixels, found " +
                                         py::repr(given).cast<std::string>());
    }
  }();
  const std::optional<PixelBox> place = pixel_box(box);
  if (!place) throw Error(ErrorKind::Plugin, what + " has a box");
  mask.box = *place;
  const auto fits = [beyond](int from, int to, int size) {
    return from <= to && from >= -std::int64_t(beyond) * size &&
           to <= (1 + std::int64_t(beyond)) * size;
  };
  if (!fits(place->x_min, place->x_max, camera.width) ||
      !fits(place->y_min, place->y_max, camera.height)) {
    throw Error(ErrorKind::Plugin,
                what + " has a box " +
                    (beyond > 0 ? "at most one image size beyond the image" : "in the image") +
                    ", found " + py::str(py::cast(*box)).cast<std::string>());
  }
  if (bits.ndim() != 2 || bits.shape(0) != mask.box.height() || bits.shape(1) != mask.box.width()) {
    throw Error(ErrorKind::Plugin, what + " has the size of its box, found " + shape_of(bits));
  }
  mask.bits.assign(bits.data(), bits.data() + bits.size());
  return mask;
}

Visibility visibility_given(const py::object& given, const Camera& camera) {
  Visibility seen;
  seen.visible_pixels = value_of<std::int64_t>(given, "visible_pixels");
  seen.amodal_pixels = value_of<std::int64_t>(given, "amodal_pixels");
  seen.outside_pixels = value_of<std::int64_t>(given, "outside_pixels");
  seen.amodal_box = pixel_box(optional_of<Corners>(given, "amodal_box"));
  seen.amodal_mask = mask_given("an amodal mask", given.attr("amodal_mask"), camera, 1);
  return seen;
}

Instance instance_given(const py::object& given, const Camera& camera) {
  Instance instance;
  instance.id = value_of<std::uint32_t>(given, "id");
  instance.node_path = value_of<std::string>(given, "path");
  const auto labels = value_of<std::map<std::string, std::string>>(given, "labels");
  instance.labels = Labels(labels.begin(), labels.end());
  if (const auto pose = optional_of<Mat4>(given, "world_from_object")) {
    instance.world_from_node = affine_of(*pose);
  }
  if (const auto bounds = optional_of<std::pair<Vec3, Vec3>>(given, "bounds")) {
    instance.bounds_node = Aabb{bounds->first, bounds->second};
  }
  instance.tight_box = pixel_box(optional_of<Corners>(given, "box"));
  if (const py::object seen = given.attr("visibility"); !seen.is_none()) {
    instance.visibility = visibility_given(seen, camera);
  }
  for (const auto& [name, position] : value_of<std::map<std::string, Vec3>>(given, "keypoints")) {
    instance.keypoints.push_back({name, position});
  }
  if (const py::object velocity = given.attr("velocity"); !velocity.is_none()) {
    instance.velocity =
        Velocity{value_of<Vec3>(velocity, "linear"), value_of<Vec3>(velocity, "angular")};
  }
  return instance;
}

Frame frame_given(const py::object& given) {
  Frame frame;
  frame.camera_name = value_of<std::string>(given, "camera_name");
  frame.camera_path = frame.camera_name;
  frame.camera = camera_given(given.attr("camera"));
  if (const auto pose = optional_of<Mat4>(given, "world_from_camera")) {
    frame.world_from_camera = affine_of(*pose);
  }
  for (const py::handle each : given.attr("instances")) {
    frame.instances.push_back(
        instance_given(py::reinterpret_borrow<py::object>(each), frame.camera));
  }
  for (const auto& [front, behind, pixels] :
       value_of<std::vector<std::tuple<std::uint32_t, std::uint32_t, std::int64_t>>>(
           given, "occlusions")) {
    frame.occlusions.push_back({front, behind, pixels});
  }
  frame.leaf_paths = value_of<std::map<std::uint32_t, std::string>>(given, "leaf_paths");
  set_channels(frame, value_of<std::map<std::string, py::array>>(given, "channels"));
  return frame;
}

Finding finding_given(const py::object& given) {
  Finding finding;
  finding.check = value_of<std::string>(given, "check");
  finding.file = value_of<std::string>(given, "file");
  finding.capture = optional_of<int>(given, "capture");
  finding.camera = value_of<std::string>(given, "camera");
  finding.object = value_of<std::string>(given, "object");
  finding.found = value_of<std::string>(given, "found");
  finding.expected = value_of<std::string>(given, "expected");
  return finding;
}

void store_capture(StoredCapture& stored, const py::object& given) {
  Capture& capture = stored.capture;
  capture.index = value_of<int>(given, "index");
  capture.visit = value_of<int>(given, "visit");
  capture.phase = value_of<std::string>(given, "phase");
  capture.environment = value_of<std::string>(given, "environment");
  stored.split = value_of<std::string>(given, "split");
  if (const py::object clip = given.attr("clip"); !clip.is_none()) {
    capture.clip = ClipFrame{value_of<int>(clip, "clip"), value_of<int>(clip, "frame"),
                             value_of<int>(clip, "frame_count"), value_of<double>(clip, "fps")};
  }
  for (const py::handle frame : given.attr("frames")) {
    capture.frames.push_back(frame_given(py::reinterpret_borrow<py::object>(frame)));
    auto& masks = stored.masks.emplace_back();
    for (const auto& [id, mask] : value_of<std::map<std::uint32_t, py::object>>(frame, "masks")) {
      masks.emplace(id, mask_given("a mask", mask, capture.frames.back().camera, 0));
    }
  }
  stored.files.resize(capture.frames.size());
  for (const py::handle finding : given.attr("findings")) {
    stored.log.findings.push_back(finding_given(py::reinterpret_borrow<py::object>(finding)));
  }
}

/// With what it asked for and no more, so that nothing depends on what others asked for.
py::dict frame_copy(const Frame& frame, const NameSet& needs) {
  auto stored = std::make_shared<StoredCapture>();
  Frame& copy = stored->capture.frames.emplace_back(copy_of(frame, needs));
  if (!needs.contains(kHoldsInstances)) {
    copy.instances.clear();
    copy.joints.clear();
  }
  for (Instance& instance : copy.instances) {
    if (!needs.contains("visibility")) instance.visibility.reset();
  }
  if (!needs.contains("occlusion_order")) copy.occlusions.clear();
  return py::list(capture_of(std::move(stored), made_holds())["frames"])[0];
}

}  // namespace

void bind_given(py::module_& module) {
  module.def("frame_copy", [](const py::capsule& frame, const std::vector<std::string>& needs) {
    const Frame& given = *held<const Frame>(frame, "diorama::Frame");
    return std::pair(frame_copy(given, NameSet(needs.begin(), needs.end())), given.seed);
  });
  module.def("set_channels",
             [](const py::capsule& frame, const std::map<std::string, py::array>& channels) {
               set_channels(*held<Frame>(frame, "diorama::Frame"), channels);
             });
  module.def("store_capture", [](const py::capsule& stored, const py::object& capture) {
    store_capture(*held<StoredCapture>(stored, "diorama::StoredCapture"), capture);
  });
}

}  // namespace diorama
