// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace diorama::test {

/// A DirectX file whose node Mover, with the mesh, goes along x: by 1 m in the 2 s of its animation
/// Walk, by 5 m in the second of Run.
inline std::string walk_and_run(const std::string& mesh) {
  const auto set = [](const std::string& name, const std::string& end, const std::string& x) {
    return "AnimationSet " + name +
           " {\n Animation {\n  {Mover}\n  AnimationKey { 2; 2; 0;3;0.0,0.0,0.0;;, " + end + ";3;" +
           x + ",0.0,0.0;;; }\n }\n}\n";
  };
  return R"(xof 0303txt 0032
AnimTicksPerSecond { 10; }
Frame Mover {
 FrameTransformMatrix { 1.0,0.0,0.0,0.0, 0.0,1.0,0.0,0.0, 0.0,0.0,1.0,0.0, 0.0,0.0,0.0,1.0;; }
 Mesh { )" +
         mesh + R"( }
}
)" + set("Walk", "20", "1.0") +
         set("Run", "10", "5.0");
}

}  // namespace diorama::test
