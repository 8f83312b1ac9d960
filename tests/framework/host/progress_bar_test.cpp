// SPDX-License-Identifier: Apache-2.0
#include "framework/host/progress_bar.h"

#include "diorama/error.h"
#include "support/catch.h"

using namespace diorama;

TEST_CASE("progress shows what is done, the rate and the time left", "[host]") {
  CHECK(progress_text("captures", 0, 12, 0, 0.0, 10) == "[          ]  0/12 captures");
  CHECK(progress_text("captures", 6, 12, 0, 3.0, 10) ==
        "[====>     ]  6/12 captures  2.0/s  3 s left");
  CHECK(progress_text("captures", 12, 12, 0, 6.0, 10) == "[==========]  12/12 captures  2.0/s");
  CHECK(progress_text("rooms", 1, 101, 0, 80.0, 0) == "1/101 rooms  80.0 s each  2 h 13 min left");
  CHECK(progress_text("rooms", 2, 4, 0, 90.0, 0) == "2/4 rooms  45.0 s each  1 min 30 s left");
  // What was there before does not make this run look fast.
  CHECK(progress_text("captures", 9, 12, 8, 2.0, 0) == "9/12 captures  2.0 s each  6 s left");
  CHECK(progress_text("captures", 0, 0, 0, 1.0, 4) == "[====]  0/0 captures");
}

TEST_CASE("log levels have four names", "[host]") {
  CHECK(log_level_from("debug") == LogLevel::Debug);
  CHECK(log_level_from("warning") == LogLevel::Warning);
  CHECK_THROWS_WITH(log_level_from("loud"),
                    "log level 'loud' is unknown; there are debug, info, warning and error");
}
