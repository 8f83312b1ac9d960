// SPDX-License-Identifier: Apache-2.0
#include "writer_support/segmentation_colors.h"

#include "support/catch.h"

using namespace diorama;

TEST_CASE("ids have Replicator's colours", "[writers]") {
  // 2, 3 and 4 stand in a file that Replicator wrote; the rest follows from its published formula.
  const std::vector<std::pair<std::uint32_t, const char*>> expected{
      {0, "(0, 0, 0, 0)"},        {1, "(0, 0, 0, 255)"},      {2, "(93, 220, 11, 255)"},
      {3, "(243, 69, 141, 255)"}, {4, "(35, 198, 233, 255)"}, {5, "(227, 192, 29, 255)"},
      {6, "(152, 14, 98, 255)"},  {7, "(7, 207, 7, 255)"},    {8, "(211, 0, 53, 255)"},
      {11, "(218, 55, 58, 255)"}, {15, "(55, 214, 1, 255)"},  {20, "(30, 252, 193, 255)"}};
  for (const auto& [id, color] : expected) CHECK(color_text(segmentation_color(id)) == color);
}

TEST_CASE("no two ids of one picture share a colour", "[writers]") {
  std::set<std::uint32_t> ids;
  for (std::uint32_t id = 0; id < 60000; ++id) ids.insert(id);
  const auto colors = distinct_colors(ids);
  std::set<Rgba8> seen;
  bool had_to_move = false;
  for (const auto& [id, color] : colors) {
    CHECK(seen.insert(color).second);
    had_to_move = had_to_move || color != segmentation_color(id);
  }
  CHECK(had_to_move);  // else this test says nothing about clashes
}
