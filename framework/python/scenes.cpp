// SPDX-License-Identifier: Apache-2.0
#include "framework/python/scenes.h"

#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "diorama/headers_digest.h"
#include "diorama/host.h"
#include "diorama/rng.h"
#include "diorama/scene.h"
#include "framework/python/capsule.h"

namespace py = pybind11;

namespace diorama {
namespace {

/// The scene of one call. Scripts may keep what they got; it is of no use afterwards.
struct Access {
  Scene* scene = nullptr;
  Host* host = nullptr;

  Scene& get() const {
    if (!scene) throw Error(ErrorKind::Plugin, "the scene was given for one call, which is over");
    return *scene;
  }
};

struct PyNode {
  std::shared_ptr<Access> access;
  NodeId id;

  Scene& scene() const { return access->get(); }
  const Node& node() const { return scene()[id]; }
};

struct PyScene {
  std::shared_ptr<Access> access;

  PyNode wrap(NodeId id) const { return {access, id}; }
};

/// Properties have no argument names that pybind11's own message could say.
template <class T>
T given_as(const py::object& value, const char* expected) {
  try {
    return value.cast<T>();
  } catch (const py::cast_error&) {
    throw py::type_error(std::string(expected) + ", found " + py::repr(value).cast<std::string>());
  }
}

constexpr const char* kPoseExpected = "a pose is a matrix of 4 x 4 numbers";
constexpr const char* kColorExpected = "a colour is three numbers";

Affine world_from_parent(const PyNode& node) {
  const NodeId parent = node.node().parent;
  return parent ? node.scene().world_from_node(parent) : Affine::Identity();
}

void set_world_pose(const PyNode& node, const Affine& world_from_node) {
  node.scene().set_pose(node.id, world_from_parent(node).inverse() * world_from_node);
}

void set_position(const PyNode& node, const py::object& world) {
  Affine pose = node.scene().world_from_node(node.id);
  pose.translation() = given_as<Vec3>(world, "a position is three numbers, metres");
  set_world_pose(node, pose);
}

Light& light_of(const PyNode& node) {
  Node& edited = node.scene().edit(node.id);
  if (!edited.light) {
    throw Error(ErrorKind::Plugin, node.scene().path(node.id) + " is no light");
  }
  return *edited.light;
}

/// Materials are shared: those of the nodes at and below this one become their own.
void set_base_color(const PyNode& node, const py::object& given) {
  const auto color = given_as<Vec3f>(given, kColorExpected);
  Scene& scene = node.scene();
  for (const NodeId each : scene.subtree(node.id)) {
    if (!scene[each].mesh) continue;
    Node& edited = scene.edit(each);
    if (edited.materials.empty()) edited.materials.push_back(nullptr);
    for (std::shared_ptr<const Material>& material : edited.materials) {
      auto own = material ? std::make_shared<Material>(*material) : std::make_shared<Material>();
      own->base_color = color;
      own->base_color_texture = {};
      material = std::move(own);
    }
  }
}

std::optional<std::pair<Vec3, Vec3>> bounds_of(const PyNode& node) {
  const Aabb box = node.scene().world_bounds(node.id);
  if (box.is_empty()) return std::nullopt;
  return std::pair(box.min, box.max);
}

void bind_node(py::module_& module) {
  py::class_<PyNode>(
      module, "Node",
      "A node of the scene's tree. Poses are float64, 4 x 4, in metres; what is set holds for all "
      "below it.")
      .def_property_readonly(
          "path", [](const PyNode& n) { return n.scene().path(n.id); }, R"("/Assets/mug_01")")
      .def_property_readonly(
          "name", [](const PyNode& n) { return n.node().name; }, "The end of the path.")
      .def_property_readonly(
          "parent",
          [](const PyNode& n) -> std::optional<PyNode> {
            if (!n.node().parent) return std::nullopt;
            return PyNode{n.access, n.node().parent};
          },
          "None above the root.")
      .def_property_readonly(
          "children",
          [](const PyNode& n) {
            std::vector<PyNode> all;
            for (const NodeId id : n.node().children) {
              all.push_back({n.access, id});
            }
            return all;
          },
          "In their order.")
      .def_property(
          "labels",
          [](const PyNode& n) {
            return std::map<std::string, std::string>(n.node().labels.begin(),
                                                      n.node().labels.end());
          },
          [](const PyNode& n, const py::object& given) {
            const auto labels = given_as<std::map<std::string, std::string>>(
                given, "labels are texts by texts, {'class': 'mug'}");
            n.scene().edit(n.id).labels = Labels(labels.begin(), labels.end());
          },
          "Taxonomy to label, of this node alone; set it as a whole.")
      .def_property(
          "is_visible", [](const PyNode& n) { return n.node().is_visible; },
          [](const PyNode& n, const py::object& value) {
            n.scene().edit(n.id).is_visible = given_as<bool>(value, "True or False");
          },
          "False hides all below it from cameras, not from physics.")
      .def_property(
          "parent_from_node",
          [](const PyNode& n) { return Mat4(n.node().parent_from_node.matrix()); },
          [](const PyNode& n, const py::object& pose) {
            n.scene().set_pose(n.id, affine_of(given_as<Mat4>(pose, kPoseExpected)));
          },
          "float64, 4 x 4, metres.")
      .def_property(
          "world_from_node",
          [](const PyNode& n) { return Mat4(n.scene().world_from_node(n.id).matrix()); },
          [](const PyNode& n, const py::object& pose) {
            set_world_pose(n, affine_of(given_as<Mat4>(pose, kPoseExpected)));
          },
          "float64, 4 x 4, metres.")
      .def_property(
          "position",
          [](const PyNode& n) { return Vec3(n.scene().world_from_node(n.id).translation()); },
          &set_position,
          "float64, 3, metres: of its origin in the world; setting it keeps rotation and scale.")
      .def_property_readonly("world_bounds", &bounds_of,
                             "Least and greatest corner, float64, 3 each, metres, of the visible "
                             "meshes at and below it; None where there are none.")
      .def_property_readonly(
          "has_mesh", [](const PyNode& n) { return n.node().mesh != nullptr; },
          "Whether it has a shape of its own.")
      .def_property_readonly(
          "is_light", [](const PyNode& n) { return n.node().light.has_value(); },
          "Whether it shines.")
      .def_property_readonly(
          "is_camera", [](const PyNode& n) { return n.node().camera.has_value(); },
          "Whether it takes pictures.")
      .def_property(
          "light_color",
          [](const PyNode& n) -> std::optional<Vec3f> {
            if (!n.node().light) return std::nullopt;
            return n.node().light->color;
          },
          [](const PyNode& n, const py::object& given) {
            const auto color = given_as<Vec3f>(given, kColorExpected);
            if (!color.allFinite() || (color.array() < 0.0F).any()) {
              throw Error(ErrorKind::Plugin, "the colour of a light is finite and not negative");
            }
            light_of(n).color = color;
          },
          "float32, 3, or None: nits; lux of a distant light.")
      .def("set_base_color", &set_base_color, py::arg("color"),
           "Linear red, green, blue of all materials at and below it, instead of their textures.")
      .def("__eq__", [](const PyNode& a, const PyNode& b) { return a.id == b.id; })
      .def("__hash__", [](const PyNode& n) { return n.id.index; })
      .def("__repr__", [](const PyNode& n) {
        return n.access->scene ? "<diorama.Node " + n.scene().path(n.id) + ">"
                               : std::string("<diorama.Node of a scene that is gone>");
      });
}

void bind_scene(py::module_& module) {
  py::class_<PyScene>(module, "Scene",
                      "The tree of nodes, for one call. Units are metres, z is up.")
      .def_property_readonly(
          "root", [](const PyScene& s) { return s.wrap(s.access->get().root()); },
          "The node above all others.")
      .def(
          "match",
          [](const PyScene& s, const std::string& pattern) {
            std::vector<PyNode> all;
            for (const NodeId id : s.access->get().match(pattern)) all.push_back(s.wrap(id));
            return all;
          },
          py::arg("pattern"),
          "Nodes by path in creation order: '*' is any text without '/', '**' any text.")
      .def(
          "find",
          [](const PyScene& s, const std::string& path) -> std::optional<PyNode> {
            const NodeId id = s.access->get().find(path);
            if (!id) return std::nullopt;
            return s.wrap(id);
          },
          py::arg("path"), "The node at a path, or None.")
      .def(
          "create",
          [](const PyScene& s, const PyNode& parent, const std::string& name) {
            return s.wrap(s.access->get().create(parent.id, name));
          },
          py::arg("parent"), py::arg("name"), "A taken name gets a number.")
      .def(
          "erase", [](const PyScene& s, const PyNode& node) { s.access->get().erase(node.id); },
          py::arg("node"), "With all below it.")
      .def(
          "load",
          [](const PyScene& s, const std::string& asset, const PyNode& parent) {
            Scene& scene = s.access->get();
            return s.wrap(s.access->host->load_asset(asset, scene, parent.id));
          },
          py::arg("asset"), py::arg("parent"), "An asset by the job's path rules, as a new node.")
      .def("_end", [](const PyScene& s) { *s.access = {}; });
}

void bind_rng(py::module_& module) {
  py::class_<Rng>(module, "Rng")
      .def(py::init<std::uint64_t>(), py::arg("seed"))
      .def(
          "fork",
          [](const Rng& rng, const std::variant<std::uint64_t, std::string>& key) {
            return std::visit([&](const auto& each) { return rng.fork(each); }, key);
          },
          py::arg("key"))
      .def("bits", &Rng::bits)
      .def(
          "uniform", [](Rng& rng, double low, double high) { return rng.uniform(low, high); },
          py::arg("low") = 0.0, py::arg("high") = 1.0)
      .def(
          "normal",
          [](Rng& rng, double mean, double deviation) { return mean + deviation * rng.normal(); },
          py::arg("mean") = 0.0, py::arg("deviation") = 1.0)
      .def(
          "index",
          [](Rng& rng, std::size_t count) {
            if (count == 0) throw Error(ErrorKind::Plugin, "there is nothing to choose from");
            return rng.index(count);
          },
          py::arg("count"))
      .def("chance", &Rng::chance, py::arg("probability"))
      .def("unit_vector", &Rng::unit_vector)
      .def("rotation",
           [](Rng& rng) { return Eigen::Matrix3d(rng.uniform_rotation().toRotationMatrix()); });
}

}  // namespace

Affine affine_of(const Mat4& matrix) {
  if (!matrix.row(3).isApprox(Eigen::RowVector4d(0, 0, 0, 1))) {
    throw Error(ErrorKind::Plugin, "a pose is a 4 x 4 matrix whose last row is 0 0 0 1");
  }
  Affine pose;
  pose.matrix() = matrix;
  return pose;
}

void bind_scenes(py::module_& module) {
  module.attr("HEADERS") = std::uint64_t(DIORAMA_HEADERS_DIGEST);
  bind_node(module);
  bind_scene(module);
  bind_rng(module);
  module.def("scene_of", [](const py::capsule& scene, const py::capsule& host) {
    return PyScene{std::make_shared<Access>(
        Access{held<Scene>(scene, "diorama::Scene"), held<Host>(host, "diorama::Host")})};
  });
  module.def("rng_of",
             [](const py::capsule& rng) { return *held<const Rng>(rng, "diorama::Rng"); });
}

}  // namespace diorama
