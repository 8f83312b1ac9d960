// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <string>
#include <string_view>
#include <vector>

#include "diorama/joints.h"
#include "loader_urdf/urdf_loader.h"
#include "loader_urdf/xml_check.h"
#include "loader_usd/usd_loader.h"
#include "support/catch.h"
#include "support/plain_host.h"
#include "support/temporary_folder.h"

// urdfdom forgets what it had read when a model fails. Unused without the address sanitizer.
extern "C" const char* __lsan_default_suppressions() { return "leak:liburdfdom_model"; }

namespace diorama::loader_urdf {

using test::TemporaryFolder;

namespace {

/// Meshes are a box of a metre whose node has the file's name.
class MeshHost final : public test::PlainHost {
 public:
  std::vector<std::string> loaded;
  std::filesystem::path resolve(std::string_view asset) const override { return asset; }
  NodeId load_asset(std::string_view asset, Scene& scene, NodeId parent) override {
    loaded.emplace_back(asset);
    const NodeId node = scene.create(parent, "mesh");
    scene.edit(node).mesh = std::make_shared<const Mesh>(make_box(Vec3::Ones()));
    return node;
  }
};

struct LoadedModel {
  Scene scene;
  MeshHost host;
  NodeId root;
  explicit LoadedModel(const std::string& file, UrdfLoader::Params params = {}) {
    root = scene.create(scene.root(), "asset");
    UrdfLoader(params, host).load(file, scene, root);
  }
  const Node& node(const std::string& path) { return scene[scene.require("/asset/" + path)]; }
  std::string log() const {
    std::string all;
    for (const std::string& line : host.messages) all += line + "\n";
    return all;
  }
};

std::string robot(const std::string& inside) { return "<robot name=\"r\">" + inside + "</robot>"; }

const std::string kTwo = R"(<link name="a"/><link name="b"/>)";

std::string joint(const std::string& type, const std::string& inside) {
  return "<joint name=\"j\" type=\"" + type + "\"><parent link=\"a\"/><child link=\"b\"/>" +
         inside + "</joint>";
}

}  // namespace

TEST_CASE("the cabinet is the same by URDF and by USD", "[loader_urdf]") {
  const std::string folder = DIORAMA_SOURCE_DIR "/examples/articulated/";
  LoadedModel urdf(folder + "cabinet.urdf");
  Scene usd;
  const NodeId root = usd.create(usd.root(), "asset");
  test::PlainHost host;
  loader_usd::UsdLoader({}, host).load(folder + "cabinet.usda", usd, root);
  CHECK(urdf.host.messages.empty());

  const std::vector<JointState> states = joint_states(urdf.scene);
  REQUIRE(states.size() == 4);
  const NodeId cabinet = usd.require("/asset/Cabinet");
  for (const char* name :
       {"drawer_low_slide", "drawer_mid_slide", "drawer_high_slide", "door_hinge"}) {
    INFO(name);
    const NodeId one = urdf.scene.require("/asset/joints/" + std::string(name));
    const NodeId other = usd.require("/asset/Cabinet/joints/" + std::string(name));
    const Joint& a = *urdf.scene[one].joint;
    const Joint& b = *usd[other].joint;
    CHECK(a.kind == b.kind);
    CHECK(a.axis == b.axis);
    CHECK(a.lower == Approx(b.lower));
    CHECK(a.upper == Approx(b.upper).epsilon(1e-6));
    CHECK(urdf.scene[a.child_body].name == usd[b.child_body].name);
    CHECK(urdf.scene[a.parent_body].name == usd[b.parent_body].name);
    CHECK(urdf.scene[a.child_body].rigid_body->mass_kg == usd[b.child_body].rigid_body->mass_kg);
    pose_joints(urdf.scene, std::vector<JointTarget>{{one, 0.7 * a.lower + 0.3 * a.upper}});
    pose_joints(usd, std::vector<JointTarget>{{other, 0.7 * a.lower + 0.3 * a.upper}});
  }
  // Board for board in the same place, opened likewise.
  int boards = 0;
  for (const NodeId node : urdf.scene.subtree(urdf.root)) {
    if (!urdf.scene[node].mesh) continue;
    const std::string path = urdf.scene.path(node).substr(std::string("/asset").size());
    const NodeId same = usd.find(usd.path(cabinet) + path);
    INFO(path);
    REQUIRE(same);
    const Aabb a = urdf.scene.world_bounds(node);
    const Aabb b = usd.world_bounds(same);
    CHECK((a.min - b.min).norm() < 1e-6);
    CHECK((a.max - b.max).norm() < 1e-6);
    CHECK(urdf.scene[node].collider->primitive == PrimitiveShape::Box);
    ++boards;
  }
  CHECK(boards == 26);
}

TEST_CASE("meshes are found beside the model, by package and above it", "[loader_urdf]") {
  const TemporaryFolder folder;
  folder.write("my_robot/meshes/hand.stl", "solid");
  folder.write("my_robot/urdf/near.obj", "#");
  folder.write("elsewhere/parts/shell.dae", "<a/>");
  const auto mesh = [](const std::string& name) {
    return "<visual><origin xyz=\"1 2 3\"/><geometry><mesh filename=\"" + name +
           "\" scale=\"2 1 0.5\"/></geometry></visual>";
  };
  const std::string file =
      folder.write("my_robot/urdf/r.urdf",
                   robot("<link name=\"a\">" + mesh("package://my_robot/meshes/hand.stl") +
                         mesh("near.obj") + mesh("package://parts/shell.dae") +
                         mesh("../../nothing.stl") + mesh("http://example.org/a.stl") + "</link>"));
  UrdfLoader::Params params;
  params.packages = {folder.path("elsewhere")};
  LoadedModel model(file, params);
  REQUIRE(model.host.loaded.size() == 3);
  CHECK(model.host.loaded[0].ends_with("my_robot/meshes/hand.stl"));
  CHECK(model.host.loaded[1].ends_with("near.obj"));
  CHECK(model.host.loaded[2].ends_with("elsewhere/parts/shell.dae"));
  CHECK(model.log().find("r.urdf: link 'a': there is no file ../../nothing.stl") !=
        std::string::npos);
  CHECK((model.scene.world_bounds(model.root).max - Vec3(2.0, 2.5, 3.25)).norm() < 1e-6);
  MeshHost host;
  CHECK(UrdfLoader(params, host).files(file).size() == 4);
  params.missing_assets_are_errors = true;
  CHECK_THROWS_WITH(LoadedModel(file, params), ContainsSubstring("there is no file"));
}

TEST_CASE("joints turn about their axis behind their origin, and mimic", "[loader_urdf]") {
  const TemporaryFolder folder;
  const std::string file = folder.write("r.urdf", robot(R"(
    <link name="a"/><link name="b"/><link name="c"/>
    <joint name="j" type="revolute"><parent link="a"/><child link="b"/>
      <origin xyz="1 0 0" rpy="0 0 1.5707963267948966"/><axis xyz="0 0 2"/>
      <limit lower="-1" upper="2" effort="1" velocity="1"/></joint>
    <joint name="k" type="continuous"><parent link="b"/><child link="c"/>
      <origin xyz="2 0 0"/><axis xyz="0 1 0"/><mimic joint="j" multiplier="-2" offset="0.5"/></joint>
  )"));
  LoadedModel model(file);
  const NodeId j = model.scene.require("/asset/joints/j");
  const NodeId k = model.scene.require("/asset/joints/k");
  const NodeId c = model.scene.require("/asset/c");
  CHECK((model.scene.world_from_node(c).translation() - Vec3(1, 2, 0)).norm() < 1e-12);
  CHECK(model.scene[j].joint->lower == -1.0);
  CHECK(model.scene[k].joint->upper == kInfinity);
  pose_joints(model.scene, std::vector<JointTarget>{{j, 0.5 * kPi}});
  CHECK((model.scene.world_from_node(c).translation() - Vec3(-1, 0, 0)).norm() < 1e-12);
  CHECK(joint_position(model.scene, k) ==
        Approx(std::remainder(-kPi + 0.5, 2 * kPi)).epsilon(1e-9));
}

TEST_CASE("links that nothing can touch go with the bodies that they are fixed to",
          "[loader_urdf]") {
  const TemporaryFolder folder;
  const auto joined = [](const char* name, const char* type, const char* parent,
                         const char* child) {
    return std::string("<joint name=\"") + name + "\" type=\"" + type + "\"><parent link=\"" +
           parent + "\"/><child link=\"" + child +
           "\"/><origin xyz=\"0 0 1\"/><axis xyz=\"0 0 1\"/></joint>";
  };
  const auto solid = [](const char* name) {
    return std::string("<link name=\"") + name +
           "\"><collision><geometry><box size=\"1 1 1\"/></geometry></collision></link>";
  };
  const auto model_with_root = [&](const std::string& name) {
    return robot(
        "<link name=\"" + name + "\"/><link name=\"plate\"/>" + solid("base") + solid("arm") +
        "<link name=\"cross\"><inertial><mass value=\"0.3\"/><inertia ixx=\"1\" ixy=\"0\" "
        "ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/></inertial></link>"
        "<link name=\"gap\"/><link name=\"tool\"><visual><geometry><sphere radius=\"1\"/>"
        "</geometry></visual></link>" +
        joined("a", "fixed", name.c_str(), "plate") + joined("b", "fixed", "plate", "base") +
        joined("c", "continuous", "base", "cross") + joined("d", "continuous", "cross", "gap") +
        joined("e", "continuous", "gap", "arm") + joined("f", "fixed", "arm", "tool"));
  };
  LoadedModel model(folder.write("r.urdf", model_with_root("footprint")));
  // Two lie below the body above them, which they began with, and one below that before it.
  for (const auto& [path, height] : {std::pair<std::string, double>{"base/footprint", 0.0},
                                     {"base/plate", 1.0},
                                     {"base", 2.0},
                                     {"cross", 3.0},
                                     {"gap", 4.0},
                                     {"arm", 5.0},
                                     {"arm/tool", 6.0}}) {
    INFO(path);
    const NodeId node = model.scene.require("/asset/" + path);
    CHECK((model.scene.world_from_node(node).translation() - Vec3(0, 0, height)).norm() < 1e-12);
    CHECK(model.scene[node].rigid_body.has_value() == (path.find('/') == std::string::npos));
  }
  CHECK(model.node("cross").rigid_body->mass_kg == 0.3);
  CHECK(model.node("gap").rigid_body->mass_kg == 0.1);
  // It turns with what holds it.
  pose_joints(model.scene,
              std::vector<JointTarget>{{model.scene.require("/asset/joints/e"), 0.5 * kPi}});
  const NodeId tool = model.scene.require("/asset/arm/tool");
  CHECK((model.scene.world_from_node(tool) * Vec3::UnitX() - Vec3(0, 1, 6)).norm() < 1e-12);
  // What begins with the world is held by it.
  LoadedModel held(folder.write("held.urdf", robot("<link name=\"world\"/>" + solid("base") +
                                                   joined("a", "continuous", "world", "base"))));
  CHECK_FALSE(held.node("world").rigid_body);
  // Also when it is fixed to it, itself or by links between.
  for (const char* between : {"", "plate"}) {
    CAPTURE(between);
    const bool has_between = std::string_view(between) != "";
    const std::string joints = has_between ? "<link name=\"plate\"/>" +
                                                 joined("a", "fixed", "world", between) +
                                                 joined("b", "fixed", between, "base")
                                           : joined("a", "fixed", "world", "base");
    LoadedModel arm(
        folder.write("arm.urdf", robot("<link name=\"world\"/>" + solid("base") + solid("tool") +
                                       joints + joined("t", "continuous", "base", "tool"))));
    const NodeId base = arm.scene.require("/asset/base");
    CHECK(arm.scene[base].rigid_body);
    CHECK_FALSE(arm.node("world").rigid_body);
    const Joint& joint = *arm.scene[arm.scene.require("/asset/joints/a")].joint;
    CHECK(joint.parent_body == arm.scene.require("/asset/world"));
    const NodeId held_body = has_between ? arm.scene.require("/asset/base/plate") : base;
    CHECK(joint.child_body == held_body);
  }
}

TEST_CASE("models with words that cannot be are one message", "[loader_urdf]") {
  const TemporaryFolder folder;
  const auto refused = [&](const std::string& text, const std::string& message) {
    INFO(text.substr(0, 200));
    const std::string file = folder.write("r.urdf", text);
    CHECK_THROWS_WITH(LoadedModel(file), ContainsSubstring(file) && ContainsSubstring(message));
  };
  refused("", "found no element, expected <robot>");
  refused("<robot name=\"r\">\n<link name=\"a\">\n</robot>",
          "r.urdf:3: found </robot>, expected </link>");
  refused("<robot name=\"r\"><link name=a/></robot>", "expected a value in quotes");
  refused("<!DOCTYPE r [<!ENTITY a \"aaaa\"><!ENTITY b \"&a;&a;&a;\">]><robot name=\"r\"/>",
          "found a document type or raw text");
  refused(robot("<link name=\"a\"/><link name=\"a\"/>"), "is no URDF model");
  refused(robot(joint("fixed", "")), "is no URDF model");
  refused(robot(kTwo), "is no URDF model");
  // Each hangs on the other.
  refused(robot(kTwo + joint("fixed", "") +
                "<joint name=\"k\" type=\"fixed\"><parent link=\"b\"/><child link=\"a\"/></joint>"),
          "is no URDF model");
  // What the library would take for a format when it complains.
  for (const char* number : {"%n%n%n", "&#37;n", "&#x25;s%s%s%s%s%s%s%s%s%s"}) {
    refused(robot(kTwo + joint("fixed", "<origin xyz=\"" + std::string(number) + " 0 0\"/>")),
            "is no URDF model");
  }
  std::string deep;
  for (int i = 0; i < 100; ++i) deep += "<a>";
  refused(robot(deep), "elements in more than 64 others");
  std::string many;
  for (int i = 0; i < 10'001; ++i) many += "<link name=\"l" + std::to_string(i) + "\"/>";
  refused(robot(many), "more than 10000 links");
  many.clear();
  for (int i = 0; i < 10'001; ++i) many += "<geometry/>";
  refused(robot(many), "more than 10000 shapes");
  many.clear();
  for (int i = 0; i < 101; ++i) many += " a" + std::to_string(i) + "=''";
  refused(robot("<link" + many + "/>"), "more than 100 attributes");
}

TEST_CASE("floating and planar joints are chains of joints", "[loader_urdf]") {
  const TemporaryFolder folder;
  LoadedModel floating(folder.write("f.urdf", robot(kTwo + joint("floating", ""))));
  CHECK(floating.log().empty());
  const auto loose = compound_joints(floating.scene);
  REQUIRE(loose.size() == 1);
  CHECK(loose.front().joints.size() == 6);
  LoadedModel planar(folder.write(
      "p.urdf", robot(kTwo + joint("planar", "<origin xyz=\"1 0 0\"/><axis xyz=\"0 2 0\"/>"))));
  CHECK(planar.log().empty());
  const auto flat = compound_joints(planar.scene);
  REQUIRE(flat.size() == 1);
  REQUIRE(flat.front().joints.size() == 3);
  const Scene& scene = planar.scene;
  CHECK(scene.path(flat.front().joints[2]).ends_with("/joints/j/rotZ"));
  CHECK(scene[flat.front().joints[2]].joint->axis.isApprox(Vec3::UnitY()));
  pose_joints(planar.scene, std::vector<JointTarget>{{flat.front().joints[0], 0.3},
                                                     {flat.front().joints[1], -0.4},
                                                     {flat.front().joints[2], 1.1}});
  const NodeId child = scene[flat.front().joints[2]].joint->child_body;
  const NodeId parent = scene[flat.front().joints[0]].joint->parent_body;
  const Affine moved = scene.world_from_node(parent).inverse() * scene.world_from_node(child);
  CHECK(std::abs(moved.translation().y()) < 1e-12);
  CHECK((moved.translation() - Vec3(1, 0, 0)).norm() == Approx(0.5));
  CHECK(Eigen::AngleAxisd(moved.linear()).angle() == Approx(1.1));
}

TEST_CASE("numbers that cannot be are warnings, and what they are of is left out",
          "[loader_urdf]") {
  const TemporaryFolder folder;
  const auto warned = [&](const std::string& inside, const std::string& message) {
    INFO(inside);
    LoadedModel model(folder.write("r.urdf", robot(inside)));
    CHECK(model.log().find(message) != std::string::npos);
    for (const NodeId node : model.scene.subtree(model.root)) {
      CHECK(model.scene[node].parent_from_node.matrix().allFinite());
    }
  };
  for (const char* type : {"planar", "floating", "fixed"}) {
    warned("<link name=\"z\"/>" + kTwo +
               "<joint name=\"i\" type=\"fixed\"><parent link=\"z\"/><child link=\"a\"/>"
               "<origin xyz=\"1e308 0 0\"/></joint>" +
               joint(type, "<origin xyz=\"1e308 0 0\"/>"),
           "too far away");
  }
  warned(kTwo + joint("planar", "<axis xyz=\"0 0 0\"/>"), "joint 'j' has no axis; it is x");
  warned(kTwo + joint("continuous", "<axis xyz=\"0 0 0\"/>"), "joint 'j' has no axis; it is x");
  warned(kTwo + joint("revolute", "<limit lower=\"2\" upper=\"1\" effort=\"1\" velocity=\"1\"/>"),
         "limits the wrong way round");
  warned(kTwo + joint("fixed", "<mimic joint=\"nobody\"/>"), "mimics no joint of the model");
  warned("<link name=\"a\"><visual><geometry><box size=\"1 0 1\"/></geometry></visual></link>",
         "a shape without a size");
  warned(
      "<link name=\"a\"><inertial><mass value=\"-1\"/><inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" "
      "iyy=\"1\" iyz=\"0\" izz=\"1\"/></inertial><collision><geometry><sphere radius=\"1\"/>"
      "</geometry></collision></link>",
      "a mass that is not above 0");
  warned(
      "<link name=\"a\"><visual><geometry><mesh filename=\"r.urdf\"/></geometry></visual></link>",
      "names a model as a mesh");
  folder.write("R.URDF", "<robot/>");
  warned(
      "<link name=\"a\"><visual><geometry><mesh filename=\"R.URDF\"/></geometry></visual></link>",
      "names a model as a mesh");
  warned(kTwo + joint("fixed", "") +
             "<link name=\"c\"/><link name=\"d\"/><joint name=\"k\" type=\"fixed\">"
             "<parent link=\"c\"/><child link=\"d\"/></joint><joint name=\"l\" type=\"fixed\">"
             "<parent link=\"d\"/><child link=\"c\"/></joint>",
         "link 'c' hangs on a loop of joints");
  warned("<link name=\"a\"><visual><geometry><capsule/></geometry></visual></link>",
         "a part of it cannot be read: Unknown geometry type 'capsule'");
}

}  // namespace diorama::loader_urdf
