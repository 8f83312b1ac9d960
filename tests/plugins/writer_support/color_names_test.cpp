// SPDX-License-Identifier: Apache-2.0
#include "writer_support/color_names.h"

#include "support/catch.h"

using namespace diorama;

TEST_CASE("colours are read as Pillow reads them", "[writers]") {
  CHECK(color_from_text("Green") == Rgba8{0, 128, 0, 255});
  CHECK(color_from_text("rebeccapurple") == Rgba8{102, 51, 153, 255});
  CHECK(color_from_text("#f80") == Rgba8{255, 136, 0, 255});
  CHECK(color_from_text("#10203040") == Rgba8{16, 32, 48, 64});
  CHECK_FALSE(color_from_text("#12345"));
  CHECK_FALSE(color_from_text("grun"));
  Value list = Value::make_list();
  for (const int part : {1, 2, 255}) list.list.push_back(Value::integer(part));
  CHECK(color_from_value(list, "fill") == Rgba8{1, 2, 255, 255});
  list.list.back() = Value::integer(256);
  CHECK_THROWS_WITH(color_from_value(list, "fill"), ContainsSubstring("fill: expected a colour"));
}
