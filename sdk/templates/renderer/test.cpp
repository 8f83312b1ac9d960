// SPDX-License-Identifier: @LICENCE@
#include <diorama/renderer.h>

#include "plugin_under_test.h"

int main(int, char** argv) {
  PluginUnderTest plugin(argv[1]);
  const auto renderer = plugin.make<diorama::Renderer>();

  // A camera at the origin that looks along -z at a board of 2 m x 1 m, 4 m away, partly outside.
  diorama::Scene scene;
  const diorama::NodeId camera = scene.create(scene.root(), "cam_0");
  scene.edit(camera).camera = diorama::Camera::from_lens(40, 20, 10.0, 20.0);
  const diorama::NodeId board = scene.create(scene.root(), "board");
  scene.set_pose(board, diorama::Affine(Eigen::Translation3d(4, 0, -4)));
  scene.edit(board).mesh = std::make_shared<const diorama::Mesh>(diorama::make_plane(2.0, 1.0));
  scene.edit(board).labels = {{"class", "board"}};

  renderer->prepare(scene);
  const diorama::Frame frame = renderer->render({camera, renderer->provides(), 1});
  // 20 px per unit at depth 1: x from 3/4 to 5/4 of 20 px right of the centre, y within +-2.5 px.
  const auto& ids = frame.get(diorama::kLeafId);
  check(ids.at(35, 10) == board.index && ids.at(39, 8) == board.index, "the board is seen");
  check(ids.at(34, 10) == 0 && ids.at(35, 6) == 0, "beside it nothing is");
  check(frame.leaf_paths.at(board.index) == "/board", "ids have paths");
  check(std::abs(frame.get(diorama::kDistanceToImagePlane).at(37, 10) - 4.0f) < 1e-5f,
        "the depth is measured along the axis");
  check(frame.get(diorama::kNormals).at(37, 10).isApprox(diorama::Vec3f(0, 0, 1)),
        "the normal faces the camera");
  check(frame.get(diorama::kColor).at(0, 0) == diorama::Rgba8{0, 0, 0, 255}, "nothing is black");

  const auto masks = renderer->cover(camera, diorama::labelled_instances(scene), true);
  check(masks.size() == 1 && masks[0].covers(44, 10) && !masks[0].covers(45, 10),
        "the part outside the picture is covered, too");
  check(std::abs(masks[0].distances[masks[0].index(37, 10)] -
                 frame.get(diorama::kDistanceToCamera).at(37, 10)) < 1e-5f,
        "a mask's distances are those of the picture");
}
