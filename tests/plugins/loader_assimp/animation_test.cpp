// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "diorama/error.h"
#include "loader_assimp/posing.h"
#include "loader_assimp/scene_file.h"
#include "plugins/loader_assimp/loaded_file.h"
#include "support/catch.h"
#include "support/temporary_folder.h"
#include "support/walk_and_run.h"

namespace diorama::loader_assimp {

using test::LoadedFile;
using test::TemporaryFolder;

namespace {

/// Views and accessors of a glTF file, one for each list that is added.
class Buffer {
 public:
  int add(const std::string& bytes, int type, const std::string& shape, std::size_t count,
          const std::string& more = "") {
    views_ += (views_.empty() ? "" : ",") + std::string("{\"buffer\":0,\"byteOffset\":") +
              std::to_string(bytes_.size()) + ",\"byteLength\":" + std::to_string(bytes.size()) +
              "}";
    accessors_ += (accessors_.empty() ? "" : ",") + std::string("{\"bufferView\":") +
                  std::to_string(number_) + ",\"componentType\":" + std::to_string(type) +
                  ",\"count\":" + std::to_string(count) + ",\"type\":\"" + shape + "\"" + more +
                  "}";
    bytes_ += bytes;
    bytes_.resize((bytes_.size() + 3) / 4 * 4, '\0');
    return number_++;
  }
  std::string gltf(const std::string& rest) const {
    return R"({"asset": {"version": "2.0"}, "scene": 0, "buffers": [{"byteLength": )" +
           std::to_string(bytes_.size()) + R"(, "uri": "data:application/octet-stream;base64,)" +
           test::base64(bytes_) + R"("}], "bufferViews": [)" + views_ + R"(], "accessors": [)" +
           accessors_ + "], " + rest + "}";
  }

 private:
  std::string bytes_, views_, accessors_;
  int number_ = 0;
};

constexpr int kFloat = 5126;
constexpr int kShort = 5123;
constexpr int kByte = 5121;

/// Accessors of a triangle and of its indices.
Buffer triangle() {
  Buffer b;
  b.add(test::bytes_of<float>({0, 0, 0, 1, 0, 0, 0, 1, 0}), kFloat, "VEC3", 3,
        R"(,"min":[0,0,0],"max":[1,1,0])");
  b.add(test::bytes_of<std::uint16_t>({0, 1, 2}), kShort, "SCALAR", 3);
  return b;
}

/// Those, a target that lifts its third point by 2, and the keys of
/// a weight from 0 to 1 in a second.
Buffer face() {
  Buffer b = triangle();
  b.add(test::bytes_of<float>({0, 0, 0, 0, 0, 0, 0, 0, 2}), kFloat, "VEC3", 3,
        R"(,"min":[0,0,0],"max":[0,0,2])");
  b.add(test::bytes_of<float>({0, 1}), kFloat, "SCALAR", 2, R"(,"min":[0],"max":[1])");
  b.add(test::bytes_of<float>({0, 1}), kFloat, "SCALAR", 2);
  return b;
}

/// Two bones along x, the elbow at x = 1, which bends by 90 degrees about z in two seconds.
std::string arm() {
  const float half = std::sqrt(0.5f);
  Buffer b;
  b.add(test::bytes_of<float>({0, 0, 0, 1, 0.25f, 0, 2, 0, 0}), kFloat, "VEC3", 3,
        R"(,"min":[0,0,0],"max":[2,0.25,0])");
  b.add(test::bytes_of<std::uint16_t>({0, 1, 2}), kShort, "SCALAR", 3);
  b.add(test::bytes_of<std::uint8_t>({0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0}), kByte, "VEC4", 3);
  b.add(test::bytes_of<float>({1, 0, 0, 0, 0.5f, 0.5f, 0, 0, 0, 1, 0, 0}), kFloat, "VEC4", 3);
  b.add(test::bytes_of<float>({1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0,  0, 0, 1,
                               1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -1, 0, 0, 1}),
        kFloat, "MAT4", 2);
  b.add(test::bytes_of<float>({0, 2}), kFloat, "SCALAR", 2, R"(,"min":[0],"max":[2])");
  b.add(test::bytes_of<float>({0, 0, 0, 1, 0, 0, half, half}), kFloat, "VEC4", 2);
  return b.gltf(R"(
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "JOINTS_0": 2, "WEIGHTS_0": 3},
                                "indices": 1}]}],
    "skins": [{"joints": [1, 2], "inverseBindMatrices": 4}],
    "nodes": [{"name": "Skin", "mesh": 0, "skin": 0},
              {"name": "upper", "children": [2]}, {"name": "fore", "translation": [1, 0, 0]}],
    "animations": [{"channels": [{"sampler": 0, "target": {"node": 2, "path": "rotation"}}],
                    "samplers": [{"input": 5, "output": 6}]}],
    "scenes": [{"nodes": [0, 1]}])");
}

/// In metres and z up, as glTF's (x, y, z) becomes (x, -z, y).
bool has_point(const LoadedFile& loaded, const std::string& path, const Vec3& place) {
  const Affine world_from_node = loaded.scene.world_from_node(loaded.id(path));
  for (const Vec3f& point : loaded.node(path).mesh->positions) {
    if ((world_from_node * point.cast<double>() - place).norm() < 1e-5) return true;
  }
  return false;
}

}  // namespace

TEST_CASE("glTF: an arm bends as its animation says at the time", "[loader_assimp]") {
  const TemporaryFolder folder;
  const std::string file = folder.write("arm.gltf", arm());
  const LoadedFile rest(file);
  CHECK(has_point(rest, "Skin", {2, 0, 0}));
  const Animation& range = *rest.scene[rest.root].animation;
  CHECK(range.start_s == 0.0);
  CHECK(range.end_s == Approx(2.0));
  CHECK(range.asset == file);
  const LoadedFile bent(file + "{time=2}");
  CHECK(has_point(bent, "Skin", {0, 0, 0}));
  CHECK(has_point(bent, "Skin", {1, 0, 1}));
  CHECK(has_point(bent, "Skin", {0.875, 0, 0.125}));
  const LoadedFile between(file + "{time=1}");
  CHECK(has_point(between, "Skin", {1 + std::sqrt(0.5), 0, std::sqrt(0.5)}));
  CHECK_THROWS_WITH(LoadedFile(file + "{time=x}"), ContainsSubstring("expected seconds"));
}

TEST_CASE("glTF: morph targets move points by their weights", "[loader_assimp]") {
  const Buffer b = face();
  const TemporaryFolder folder;
  const std::string file = folder.write("face.gltf", b.gltf(R"(
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1,
                                "targets": [{"POSITION": 2}]}], "weights": [0.25]}],
    "nodes": [{"name": "Face", "mesh": 0}],
    "animations": [{"channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}],
                    "samplers": [{"input": 3, "output": 4}]}],
    "scenes": [{"nodes": [0]}])"));
  CHECK(has_point(LoadedFile(file), "Face", {0, -0.5, 1}));
  CHECK(has_point(LoadedFile(file + "{time=0.5}"), "Face", {0, -1, 1}));
  CHECK(has_point(LoadedFile(file + "{time=1}"), "Face", {0, -2, 1}));
}

TEST_CASE("glTF: morph targets turn normals by their weights", "[loader_assimp]") {
  const auto normal = [](bool says_normals, const std::string& time) {
    Buffer b = face();
    b.add(test::bytes_of<float>({0, 0, 1, 0, 0, 1, 0, 0, 1}), kFloat, "VEC3", 3);
    b.add(test::bytes_of<float>({1, 0, 0, 1, 0, 0, 1, 0, 0}), kFloat, "VEC3", 3);
    const TemporaryFolder folder;
    const std::string target =
        says_normals ? R"({"POSITION": 2, "NORMAL": 6})" : R"({"POSITION": 2})";
    const LoadedFile loaded(folder.write("face.gltf", b.gltf(R"(
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 5}, "indices": 1,
                                "targets": [)" + target + R"(]}], "weights": [0]}],
    "nodes": [{"name": "Face", "mesh": 0}],
    "animations": [{"channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}],
                    "samplers": [{"input": 3, "output": 4}]}],
    "scenes": [{"nodes": [0]}])")) +
                            time);
    const Affine world_from_node = loaded.scene.world_from_node(loaded.id("Face"));
    return Vec3(world_from_node.linear() *
                loaded.node("Face").mesh->normals.front().cast<double>());
  };
  const auto is_near = [](const Vec3& a, const Vec3& b) {
    return (a - b.normalized()).norm() < 1e-5;
  };
  CHECK(is_near(normal(true, ""), {0, -1, 0}));
  CHECK(is_near(normal(true, "{time=0.5}"), {0.5, -1, 0}));
  CHECK(is_near(normal(true, "{time=1}"), {1, -1, 0}));
  CHECK(is_near(normal(false, "{time=1}"), {0, -1, 0}));
}

/// A triangle on a node that moves along x by an interpolation of glTF; two nodes have one name.
std::string mover(const std::string& interpolation, const std::vector<float>& places,
                  const std::string& more = "") {
  Buffer b = triangle();
  b.add(test::bytes_of<float>({0, 1, 3}), kFloat, "SCALAR", 3, R"(,"min":[0],"max":[3])");
  b.add(test::bytes_of<float>(places), kFloat, "VEC3", places.size() / 3, more);
  return b.gltf(R"(
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
    "nodes": [{"name": "same", "mesh": 0, "translation": [0, 5, 0]}, {"name": "same", "mesh": 0}],
    "animations": [{"channels": [{"sampler": 0, "target": {"node": 1, "path": "translation"}}],
                    "samplers": [{"input": 2, "output": 3, "interpolation": ")" +
                interpolation + R"("}]}], "scenes": [{"nodes": [0, 1]}])");
}

/// Where the second node is along x.
double x_of_mover(const std::string& file, const std::string& time) {
  const LoadedFile loaded(file + "{time=" + time + "}");
  double x = -1.0;
  for (const NodeId node : loaded.scene.subtree(loaded.root)) {
    if (!loaded.scene[node].mesh) continue;
    const Vec3 place = loaded.scene.world_from_node(node).translation();
    if (std::abs(place.z()) < 1e-6) x = place.x();
  }
  return x;
}

TEST_CASE("glTF: steps hold, and splines run along their tangents", "[loader_assimp]") {
  const TemporaryFolder folder;
  const std::vector<float> places{0, 0, 0, 2, 0, 0, 6, 0, 0};
  const std::string straight = folder.write("straight.gltf", mover("LINEAR", places));
  CHECK(x_of_mover(straight, "0.25") == Approx(0.5));
  CHECK(x_of_mover(straight, "2") == Approx(4.0));
  const std::string step = folder.write("step.gltf", mover("STEP", places));
  CHECK(x_of_mover(step, "0.25") == Approx(0.0).margin(1e-6));
  CHECK(x_of_mover(step, "0.99") == Approx(0.0).margin(1e-6));
  CHECK(x_of_mover(step, "1") == Approx(2.0));
  CHECK(x_of_mover(step, "3") == Approx(6.0));
  // Per key: the tangent before it, the value, the tangent behind it.
  const std::string spline =
      folder.write("spline.gltf", mover("CUBICSPLINE", {0, 0, 0, 0, 0, 0, 4, 0, 0, 1, 0, 0, 2, 0,
                                                        0, 3, 0, 0, 0, 0, 0, 6, 0, 0, 0, 0, 0}));
  CHECK(x_of_mover(spline, "1") == Approx(2.0));
  // Hermite's at a half: the mean, and an eighth of the span times the tangents' difference.
  CHECK(x_of_mover(spline, "0.5") == Approx(1.0 + (4.0 - 1.0) / 8.0));
  CHECK(x_of_mover(spline, "2") == Approx(4.0 + 2.0 * (3.0 - 0.0) / 8.0));
}

TEST_CASE("glTF: sparse keys and weights below zero count", "[loader_assimp]") {
  const TemporaryFolder folder;
  Buffer b = triangle();
  b.add(test::bytes_of<float>({0, 0, 0, 0, 0, 0, 0, 0, 2}), kFloat, "VEC3", 3,
        R"(,"min":[0,0,0],"max":[0,0,2])");
  b.add(test::bytes_of<float>({0, 1}), kFloat, "SCALAR", 2, R"(,"min":[0],"max":[1])");
  b.add(test::bytes_of<std::uint8_t>({1}), kByte, "SCALAR", 1);
  b.add(test::bytes_of<float>({-1}), kFloat, "SCALAR", 1);
  // No view of its own: zeros, of which the second becomes -1.
  b.add(test::bytes_of<float>({5, 5}), kFloat, "SCALAR", 2,
        R"(,"sparse":{"count":1,"indices":{"bufferView":4,"componentType":5121},)"
        R"("values":{"bufferView":5}})");
  const std::string file = folder.write("face.gltf", b.gltf(R"(
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1,
                                "targets": [{"POSITION": 2}]}]}],
    "nodes": [{"name": "Face", "mesh": 0}],
    "animations": [{"channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}],
                    "samplers": [{"input": 3, "output": 6, "interpolation": "STEP"}]}],
    "scenes": [{"nodes": [0]}])"));
  CHECK(has_point(LoadedFile(file + "{time=1}"), "Face", {0, 2, 1}));
  CHECK(has_point(LoadedFile(file + "{time=0.5}"), "Face", {0, -10, 1}));
}

TEST_CASE("glTF: what cannot be read of an animation is said", "[loader_assimp]") {
  const TemporaryFolder folder;
  const std::string file = folder.write("odd.gltf", mover("WIGGLE", {0, 0, 0, 2, 0, 0, 6, 0, 0}));
  const LoadedFile loaded(file + "{time=0.5}");
  REQUIRE(loaded.host.messages.size() == 1);
  CHECK_THAT(loaded.host.messages.front(),
             ContainsSubstring("cannot be read: unknown interpolation"));
}

namespace {

/// One triangle that moves along x by three animations: 1 m in 2 s, 5 m in 1 s, and a pose at 7 m.
std::string three_animations(const std::string& first, const std::string& second) {
  Buffer b = triangle();
  b.add(test::bytes_of<float>({0, 2}), kFloat, "SCALAR", 2, R"(,"min":[0],"max":[2])");
  b.add(test::bytes_of<float>({0, 0, 0, 1, 0, 0}), kFloat, "VEC3", 2);
  b.add(test::bytes_of<float>({0, 1}), kFloat, "SCALAR", 2, R"(,"min":[0],"max":[1])");
  b.add(test::bytes_of<float>({0, 0, 0, 5, 0, 0}), kFloat, "VEC3", 2);
  b.add(test::bytes_of<float>({0}), kFloat, "SCALAR", 1, R"(,"min":[0],"max":[0])");
  b.add(test::bytes_of<float>({7, 0, 0}), kFloat, "VEC3", 1);
  const auto animation = [](const std::string& name, int times, int values) {
    return R"({"name": ")" + name + R"(",
     "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}],
     "samplers": [{"input": )" +
           std::to_string(times) + R"(, "output": )" + std::to_string(values) + "}]}";
  };
  return b.gltf(R"(
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
    "nodes": [{"name": "Mover", "mesh": 0}],
    "animations": [)" +
                animation(first, 2, 3) + "," + animation(second, 4, 5) + "," +
                animation("Stand", 6, 7) + R"(], "scenes": [{"nodes": [0]}])");
}

/// An FBX file as text: a triangle that goes along x as that of walk_and_run() does.
std::string walk_and_run_fbx() {
  std::string objects, connections;
  int id = 10;
  const auto array = [](const char* name, const std::string& numbers, int count) {
    return std::string(name) + ": *" + std::to_string(count) + " {\na: " + numbers + "\n}\n";
  };
  const auto add = [&](const std::string& name, int x, int end_s) {
    const std::string stack = std::to_string(id), layer = std::to_string(id + 1);
    const std::string node = std::to_string(id + 2), curve = std::to_string(id + 3);
    id += 10;
    const std::string end = std::to_string(46186158000 * end_s);
    objects += "AnimationStack: " + stack + ", \"AnimStack::" + name +
               "\", \"\" {\nProperties70:  {\nP: \"LocalStop\", \"KTime\", \"Time\", \"\"," + end +
               "\n}\n}\nAnimationLayer: " + layer +
               ", \"AnimLayer::\", \"\" {\n}\nAnimationCurveNode: " + node +
               ", \"AnimCurveNode::T\", \"\" {\n}\nAnimationCurve: " + curve +
               ", \"AnimCurve::\", \"\" {\n" + array("KeyTime", "0," + end, 2) +
               array("KeyValueFloat", "0," + std::to_string(x), 2) +
               array("KeyAttrFlags", "24836", 1) + array("KeyAttrDataFloat", "0,0,0,0", 4) +
               array("KeyAttrRefCount", "2", 1) + "}\n";
    connections += "C: \"OO\"," + layer + "," + stack + "\nC: \"OO\"," + node + "," + layer +
                   "\nC: \"OP\"," + node + ",2, \"Lcl Translation\"\nC: \"OP\"," + curve + "," +
                   node + ", \"d|X\"\n";
  };
  add("Walk", 1, 2);
  add("Run", 5, 1);
  return "; FBX 7.4.0 project file\nFBXHeaderExtension:  {\nFBXVersion: 7400\n}\nGlobalSettings:  "
         "{\n"
         "Properties70:  {\nP: \"UnitScaleFactor\", \"double\", \"Number\", \"\",100\n}\n}\n"
         "Objects:  {\nGeometry: 1, \"Geometry::\", \"Mesh\" {\n" +
         array("Vertices", "0,0,0,1,0,0,0,1,0", 9) + array("PolygonVertexIndex", "0,1,-3", 3) +
         "}\nModel: 2, \"Model::Mover\", \"Mesh\" {\n}\n" + objects +
         "}\nConnections:  {\nC: \"OO\",2,0\nC: \"OO\",1,2\n" + connections + "}\n";
}

double x_of(const LoadedFile& loaded) {
  double x = -1.0;
  for (const NodeId node : loaded.scene.subtree(loaded.root)) {
    if (loaded.scene[node].mesh) x = loaded.scene.world_from_node(node).translation().x();
  }
  return x;
}

}  // namespace

TEST_CASE("glTF: a file's animations are chosen by name or number", "[loader_assimp]") {
  const TemporaryFolder folder;
  const std::string file = folder.write("mover.gltf", three_animations("Walk", "Run"));
  const auto range = [](const LoadedFile& loaded) { return *loaded.scene[loaded.root].animation; };
  CHECK(x_of(LoadedFile(file + "{time=1}")) == Approx(0.5));
  for (const std::string word : {"{animation=Run}", "{animation=1}"}) {
    CAPTURE(word);
    const LoadedFile rest(file + word);
    CHECK(x_of(rest) == 0.0);
    CHECK(range(rest).asset == file + word);
    CHECK(range(rest).end_s == Approx(1.0));
    const LoadedFile later(file + word + "{time=0.5}");
    CHECK(x_of(later) == Approx(2.5));
    CHECK(range(later).asset == file + word);
  }
  CHECK(x_of(LoadedFile(file + "{animation=Walk}{time=1}")) == Approx(0.5));
  // One that lasts no time is a pose.
  const LoadedFile pose(file + "{animation=Stand}{time=0}");
  CHECK(x_of(pose) == Approx(7.0));
  CHECK(range(pose).end_s == 0.0);
  // A name that looks like a number is a name.
  const std::string numbers = folder.write("numbers.gltf", three_animations("1", "Run"));
  CHECK(x_of(LoadedFile(numbers + "{animation=1}{time=2}")) == Approx(1.0));

  CHECK_THROWS_WITH(LoadedFile(file + "{animation=Rum}{time=1}"),
                    file +
                        "{animation=Rum}: found the animation 'Rum', expected 0 'Walk', 1 'Run' "
                        "or 2 'Stand'; did you mean 'Run'?");
  CHECK_THROWS_WITH(
      LoadedFile(file + "{animation=3}"),
      ContainsSubstring("found the animation '3', expected 0 'Walk', 1 'Run' or 2 'Stand'"));
  std::string still = three_animations("Walk", "Run");
  still.replace(still.find("\"animations\""), 12, "\"extras\"");
  CHECK_THROWS_WITH(
      LoadedFile(folder.write("still.gltf", still) + "{animation=Walk}"),
      ContainsSubstring("found the animation 'Walk', expected none, as the file has none"));
  CHECK_THROWS_WITH(LoadedFile(file + "{animation=Run}{time=x}"),
                    ContainsSubstring("expected seconds"));
}

TEST_CASE("animations are told with names and lengths", "[loader_assimp]") {
  const TemporaryFolder folder;
  test::RenderHost host{1};
  const SceneFile file({folder.write("mover.gltf", three_animations("Walk", "Run")), {}, {}}, host);
  CHECK(describe_animation(file.scene(), 0) == "animation 0 'Walk' lasts 2 s");
  CHECK(describe_animation(file.scene(), 1) == "animation 1 'Run' lasts 1 s");
  CHECK(describe_animation(file.scene(), 2) == "animation 2 'Stand' lasts 0 s");
}

TEST_CASE("other formats choose among animations likewise", "[loader_assimp]") {
  const TemporaryFolder folder;
  const std::string files[] = {
      folder.write("mover.x", test::walk_and_run("3; 0;0;0;, 1;0;0;, 0;1;0;; 1; 3;0,1,2;;")),
      folder.write("mover.fbx", walk_and_run_fbx())};
  for (const std::string& file : files) {
    CAPTURE(file);
    CHECK(x_of(LoadedFile(file + "{time=1}")) == Approx(0.5));
    CHECK(x_of(LoadedFile(file + "{animation=Run}{time=0.5}")) == Approx(2.5));
    CHECK(x_of(LoadedFile(file + "{animation=1}{time=1}")) == Approx(5.0));
    CHECK_THROWS_WITH(LoadedFile(file + "{animation=run}"),
                      ContainsSubstring("did you mean 'Run'?"));
  }
}

}  // namespace diorama::loader_assimp
