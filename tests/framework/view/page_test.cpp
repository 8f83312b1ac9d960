// SPDX-License-Identifier: Apache-2.0
// The page in the program is the one that stands in the sources, and keeps to its own rules.
#include "framework/view/page.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "framework/pipeline/sha256.h"
#include "support/catch.h"

using namespace diorama;

namespace {

namespace fs = std::filesystem;
const fs::path kWeb = fs::path(DIORAMA_SOURCE_DIR) / "framework/view/web/src";

std::string read_text(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

std::vector<fs::path> sources() {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(kWeb)) files.push_back(entry.path());
  std::ranges::sort(files);
  return files;
}

}  // namespace

TEST_CASE("The bundle is built from the sources that lie beside it", "[view]") {
  Sha256 hash;
  for (const fs::path& file : sources()) {
    const std::string bytes = file.filename().string() + "\n" + read_text(file);
    hash.add(std::as_bytes(std::span(bytes)));
  }
  INFO("stale: run 'npm ci && npm run build' in framework/view/web");
  const std::string_view script = page_script();
  CHECK(script.substr(0, script.find('\n')).ends_with("built from web/src " + hash.hex()));
}

TEST_CASE("The page makes no markup of texts, runs no texts and asks nobody else", "[view]") {
  CHECK(sources().size() > 8);
  for (const fs::path& file : sources()) {
    const std::string text = read_text(file);
    for (const char* word : {"innerHTML", "outerHTML", "insertAdjacentHTML", "document.write",
                             "eval(", "new Function", "https://", "javascript:"}) {
      INFO(file << ": " << word);
      CHECK(text.find(word) == text.npos);
    }
  }
  const std::string_view page = page_html();
  CHECK(page.find("<script src=\"view.js\" defer></script>") != page.npos);
  for (const char* word : {"style=", "onload", "http"}) CHECK(page.find(word) == page.npos);
  CHECK(page_style().find("url(") == page_style().npos);
  CHECK(page_script().size() < 400'000);
}
