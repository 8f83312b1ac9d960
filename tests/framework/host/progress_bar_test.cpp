// SPDX-License-Identifier: Apache-2.0
#include "framework/host/progress_bar.h"

#include "diorama/error.h"
#include "framework/host/terminal.h"
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

TEST_CASE("progress fits narrow terminals", "[host]") {
  const auto line = [](int columns) { return progress_line("captures", 6, 12, 0, 3.0, columns); };
  CHECK(line(80) == "[===========>            ]  6/12 captures  2.0/s  3 s left");
  CHECK(line(45) == "[====>     ]  6/12 captures  2.0/s  3 s left");
  CHECK(line(39) == "6/12 captures  2.0/s  3 s left");
  CHECK(line(20) == "6/12 captures  2.0/");
  for (int columns = 1; columns < 100; ++columns) CHECK(int(line(columns).size()) < columns);
}

TEST_CASE("long lines of help go on in their column", "[host]") {
  const std::string text =
      "Options:\n  --seed N          Start of all random streams, instead of it\n";
  CHECK(wrapped(text, 80) == text);
  CHECK(wrapped(text, 45) ==
        "Options:\n  --seed N          Start of all random\n                    streams, instead "
        "of it\n");
  CHECK(wrapped(text, 30) ==
        "Options:\n  --seed N          Start of\n   all random streams, instead\n   of it\n");
  // A last column on the right is text like the rest.
  CHECK(wrapped("  empty    Empty space, as an environment.  [diorama 0.1.0]\n", 40) ==
        "  empty    Empty space, as an\n           environment.  [diorama 0.1.0]\n");
  CHECK(wrapped("averylongwordthatnothingbreaks\n", 20) == "averylongwordthatnothingbreaks\n");
  CHECK(wrapped("", 20).empty());
}

TEST_CASE("log levels have four names", "[host]") {
  CHECK(log_level_from("debug") == LogLevel::Debug);
  CHECK(log_level_from("warning") == LogLevel::Warning);
  CHECK_THROWS_WITH(log_level_from("loud"),
                    "log level 'loud' is unknown; there are debug, info, warning and error");
}
