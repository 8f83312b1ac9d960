// SPDX-License-Identifier: Apache-2.0
#include "framework/app/reference_pages.h"

#include <cstdlib>

#include "program_run.h"
#include "support/catch.h"

using namespace diorama;

namespace {

std::vector<PageFile> pages() {
  ParamSpec spec;
  spec.key = "size-x";
  spec.type = ParamType::Number;
  spec.default_value = Value::number(2);
  spec.help = "Uses a | and a \\ sign.";
  spec.unit = "m";
  spec.min = 0;
  return reference_pages({{"diorama", "Fills rooms.", {{"--seed N", "The start."}}},
                          {"diorama run", "Make the dataset", {{"JOB", ".hidden file"}}}},
                         {spec}, {{ComponentKind::Writer, "boxes", "Writes boxes.", {spec}}},
                         "1.2");
}

std::string page(const std::string& path) {
  for (const PageFile& file : pages()) {
    if (file.path == path) return file.text;
  }
  return "no such page";
}

}  // namespace

TEST_CASE("components get a Markdown page that the index links", "[docs]") {
  CHECK(page("reference/writer_boxes.md") ==
        "# writer `boxes`\n\nWrites boxes.\n\n"
        "| key | type | default | range | unit | meaning |\n|---|---|---|---|---|---|\n"
        "| `size-x` | number | `2` | >= 0 | m | Uses a \\| and a \\ sign. |\n");
  CHECK(
      page("reference/index.md").find("## writer\n\n- [`boxes`](writer_boxes.md): Writes boxes.") !=
      std::string::npos);
}

TEST_CASE("man pages keep signs that roff would take for its own", "[docs]") {
  const std::string man = page("man1/diorama.1");
  CHECK(
      man.starts_with(".TH DIORAMA 1 \"\" \"diorama 1.2\" \"Diorama\"\n.SH NAME\ndiorama \\- "
                      "fills rooms\n"));
  CHECK(man.find(".B \\-\\-seed N\nThe start.\n") != std::string::npos);
  CHECK(man.find(".B JOB\n\\&.hidden file\n") != std::string::npos);
  CHECK(page("man7/diorama-writer-boxes.7")
            .find(".B size\\-x\nUses a | and a \\e sign. (number, >= 0, in m, default 2)\n") !=
        std::string::npos);
}

TEST_CASE("man reads the pages without warnings", "[docs]") {
  if (std::system("command -v groff >/dev/null") != 0) {
    WARN("groff is not there; check skipped");
    return;
  }
  const test::WorkFolder folder;
  for (const PageFile& file : pages()) {
    if (!file.path.starts_with("man")) continue;
    const auto path = folder.write("page", file.text);
    const auto run = test::run_shell("groff -man -Tutf8 -ww -z " + path.string());
    CHECK(run.code == 0);
    CHECK(run.err.empty());
  }
}
