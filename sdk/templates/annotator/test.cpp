// SPDX-License-Identifier: @LICENCE@
#include <diorama/annotator.h>

#include "plugin_under_test.h"

int main(int, char** argv) {
  PluginUnderTest plugin(argv[1]);
  const auto annotator = plugin.make<diorama::Annotator>();
  check(annotator->provides() == diorama::NameSet{"@NAME@"}, "it provides its channel");

  // Near on the left, far on the right, nothing in the last column.
  diorama::Image<float> distance(4, 2, 1.0f);
  for (int y = 0; y < 2; ++y) {
    distance.at(2, y) = 2.0f;
    distance.at(3, y) = std::numeric_limits<float>::infinity();
  }
  diorama::Frame frame;
  frame.camera.width = distance.width();
  frame.camera.height = distance.height();
  frame.set(diorama::kDistanceToImagePlane, distance);
  annotator->annotate(diorama::Scene(), frame);
  const auto& outlines = frame.get(diorama::Channel<float>{"@NAME@"});
  check(outlines.at(0, 0) == 0.0f && outlines.at(3, 1) == 0.0f, "even parts have no outline");
  check(outlines.at(1, 0) == 1.0f && outlines.at(2, 1) == 1.0f, "jumps are outlines");
}
