// SPDX-License-Identifier: Apache-2.0
//
// One input is one URDF model. It is read by the system's library behind our own check, put into a
// scene, and its joints are posed. Refusing is fine; crashing, hanging, running out of memory, and
// scenes with numbers that are none are findings.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <vector>

#include "diorama/error.h"
#include "diorama/joints.h"
#include "input_file.h"
#include "loader_urdf/urdf_loader.h"
#include "support/plain_host.h"

namespace {

using namespace diorama;

/// Whatever file a model names is a mesh, and a texture.
class AnyFileHost final : public test::PlainHost {
 public:
  std::filesystem::path resolve(std::string_view asset) const override { return asset; }
  NodeId load_asset(std::string_view, Scene& scene, NodeId parent) override {
    const NodeId node = scene.create(parent, "mesh");
    scene.edit(node).mesh = std::make_shared<const Mesh>(make_box(Vec3::Ones()));
    return node;
  }
  std::shared_ptr<const Texture> read_texture(const std::filesystem::path&) const override {
    return std::make_shared<const Texture>();
  }
};

void require(bool is_sound) {
  if (!is_sound) std::abort();
}

/// Far away, places lose digits and overflow in the end: what is posed there may be refused.
void check(Scene& scene) {
  for (const NodeId id : scene.subtree(scene.root())) {
    const Node& node = scene[id];
    require(node.parent_from_node.matrix().allFinite());
    if (node.mesh) node.mesh->validate(node.name);
    if (node.rigid_body) require(node.rigid_body->mass_kg > 0.0);
    if (node.joint) require(node.joint->lower <= node.joint->upper);
  }
  std::vector<JointTarget> targets;
  for (const NodeId joint : joints_of(scene)) targets.push_back({joint, 0.3});
  pose_joints(scene, targets);
  joint_states(scene);
}

}  // namespace

// Of a model that it refuses for a loop of joints, the library never lets go.
extern "C" const char* __lsan_default_suppressions() { return "leak:liburdfdom_model"; }

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const diorama::test::InputFile file(".urdf");
  AnyFileHost host;
  const loader_urdf::UrdfLoader loader({}, host);
  const std::string& path = file.write(data, size);
  try {
    loader.files(path);
    Scene scene;
    const NodeId root = scene.create(scene.root(), "asset");
    loader_urdf::UrdfLoader({}, host).load(path, scene, root);
    check(scene);
  } catch (const Error& refused) {
    require(refused.kind() != ErrorKind::Internal ||
            std::string(refused.what()).find("is not finite") != std::string::npos);
  }
  return 0;
}
