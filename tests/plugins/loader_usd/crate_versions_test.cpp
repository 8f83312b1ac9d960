// SPDX-License-Identifier: Apache-2.0
//
// Layers, ours and the shared ones, written in every crate version and read again.
#include <algorithm>
#include <cstring>
#include <filesystem>
#include <iostream>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "loader_usd/usd/asset_library.h"
#include "loader_usd/usd/crate_reader.h"
#include "loader_usd/usd/error.h"
#include "loader_usd/usd/text_reader.h"
#include "plugins/loader_usd/crate_encoder.h"
#include "support/catch.h"
#include "support/shared_data.h"

namespace fs = std::filesystem;

namespace diorama::usd {
namespace {

using test::CrateVersion;
using test::encode_crate;
using test::kCrateVersions;

std::string name_of(CrateVersion version) {
  return "0." + std::to_string(version.minor) + "." + std::to_string(version.patch);
}

// What goes wrong with the layer in this version; empty when nothing does.
std::string failure(const Layer& layer, CrateVersion version) {
  const std::string bytes = encode_crate(layer, version);
  try {
    const auto again = read_crate("again.usdc", copy_bytes(std::as_bytes(std::span(bytes))));
    return test::first_difference(layer, *again);
  } catch (const FormatError& error) {
    return error.what();
  }
}

std::uint64_t number_at(const std::string& bytes, std::size_t offset) {
  std::uint64_t number = 0;
  std::memcpy(&number, bytes.data() + offset, sizeof(number));
  return number;
}

// Where a section begins and how long it is.
std::pair<std::uint64_t, std::uint64_t> section(const std::string& bytes, const char* name) {
  const std::uint64_t contents = number_at(bytes, 16);
  for (std::uint64_t i = 0; i < number_at(bytes, contents); ++i) {
    const std::uint64_t at = contents + 8 + 32 * i;
    if (std::strncmp(bytes.data() + at, name, 16) == 0) {
      return {number_at(bytes, at + 16), number_at(bytes, at + 24)};
    }
  }
  return {};
}

// How many records the tree of paths has, before it was compressed.
std::size_t path_records(const std::string& bytes) {
  const auto [start, size] = section(bytes, "PATHS");
  const std::uint64_t pad = bytes[9] == 0 ? 4 : 0;
  std::size_t count = 0;
  std::uint64_t at = start + 8;
  for (; at < start + size; ++count) {
    const int bits = bytes[at + pad + 8] & 3;
    // The place of the sibling follows where there is a child as well.
    at += 12 + pad + (bits == 3 ? 8 : 0);
  }
  CHECK(at == start + size);
  return count;
}

// Layers with few paths, and with every kind of value.
const std::vector<std::string> kTinyLayers = {
    "",
    "(\n    upAxis = \"Z\"\n)\n",
    "def \"A\"\n{\n}\n",
    "def \"A\"\n{\n    def \"B\"\n    {\n        int x = 1\n    }\n}\n",
    // The path of a reference to a default prim is the empty one.
    "def \"A\" (\n    references = @a.usda@\n)\n{\n}\n",
    "def \"A\" (\n    payload = @a.usda@\n)\n{\n}\n",
    "def \"A\" (\n    prepend references = @a.usda@\n)\n{\n}\ndef \"B\"\n{\n}\n",
    "def \"A\" (\n    references = [@a.usda@, </B>]\n)\n{\n    rel r = [</A/C.x>, </B>]\n}\n",
    "over \"A\" (\n    variants = { string v = \"a\" }\n    variantSets = \"v\"\n)\n{\n"
    "    variantSet \"v\" = {\n        \"a\" {\n            def \"K\"\n            {\n"
    "                float x = 1.5\n            }\n        }\n        \"b\" {\n        }\n    "
    "}\n}\n",
    R"(def Mesh "M"
{
    point3f[] points = [(1, 2, 3), (4.5, 5, 6)]
    int[] short = [1, 2, 3]
    int[] long = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 140, 100000, -7, 2147483647]
    uint[] u = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 4294967295, 0]
    int64[] wide = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, -9223372036854775808, 40000, 1]
    float[] whole = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, -16]
    double[] few = [0.5, 0.5, 0.25, 0.5, 0.5, 0.5, -0, 0.5, 0.5, nan, inf, 0.5, 0.5, 1, 2, 3]
    half[] halves = [0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 1, 2, 3, 4, 5, 6]
    token[] words = ["a", "b"]
    string[] texts = ["", "c d"]
    asset[] files = [@x.png@, @@]
    float[] none = []
    bool yes = true
    uchar c = 200
    int64 big = 5000000000
    uint64 huge = 18446744073709551615
    double exact = 0.1
    double plain = 2
    double3 small = (1, -2, 3)
    float3 odd = (0.5, 1, 2)
    int2 pair = (1, 300)
    half2 two = (1, 2)
    quatf turn = (1, 0, 0, 0)
    matrix4d diagonal = ( (1, 0, 0, 0), (0, 2, 0, 0), (0, 0, 3, 0), (0, 0, 0, 1) )
    matrix4d full = ( (1, 2, 3, 4), (5, 6, 7, 8), (9, 10, 11, 12), (13, 14, 15, 16) )
    matrix2d m = ( (1, 0.5), (0, 1) )
    float blocked = None
    float moving.timeSamples = { 1: 10, 2: None, 3.5: 0.1 }
    point3f[] going.timeSamples = { 1: [(1, 2, 3)], 2: [] }
    custom string text = "x" (
        customData = {
            int a = 1
            dictionary deep = {
                string[] list = ["p", "q"]
                double3 v = (1, 2, 3)
            }
        }
    )
    rel target = </M.points>
    float in.connect = </M.out>
}
)",
    "def \"A\" (\n    delete apiSchemas = [\"X\"]\n    append inherits = </C>\n    inactiveIds = "
    "[1, 5]\n)"
    "\n{\n}\nclass \"C\"\n{\n}\n",
    "(\n    subLayers = [@a.usda@ (offset = 2), @b.usda@]\n    relocates = { </A/B>: </A/C> }\n)\n",
    "def \"A\"\n{\n    timecode t = 3\n}\n",
    "def \"A\" (\n    payload = [@a.usda@</A>, @b.usda@ (scale = 2)]\n)\n{\n}\n",
};

std::vector<fs::path> shared_layers() {
  std::vector<fs::path> files;
  const auto shared = diorama::test::shared_folder();
  if (!shared || !fs::is_directory(*shared / "data")) return files;
  const std::set<std::string> endings{".usd", ".usda", ".usdc", ".usdz", ".sdf"};
  for (const char* folder : {"usd", "assets_root"}) {
    if (!fs::is_directory(*shared / "data" / folder)) continue;
    for (const auto& entry : fs::recursive_directory_iterator(*shared / "data" / folder)) {
      if (endings.contains(entry.path().extension().string())) files.push_back(entry.path());
    }
  }
  std::sort(files.begin(), files.end());
  return files;
}

}  // namespace

TEST_CASE("tiny layers are read in every crate version", "[usdc]") {
  for (const std::string& text : kTinyLayers) {
    const auto layer = read_text_layer("tiny.usda", "#usda 1.0\n" + text);
    for (const CrateVersion version : kCrateVersions) {
      INFO(name_of(version) << '\n' << text);
      CHECK(failure(*layer, version) == "");
    }
  }
}

TEST_CASE("a crate in an old version has the old form", "[usdc]") {
  const auto layer = read_text_layer("tiny.usda", "#usda 1.0\n" + kTinyLayers[4]);
  // "/", "/A" and the empty path, which has no record.
  const std::string first = encode_crate(*layer, {0, 1});
  CHECK(first[9] == 0);
  CHECK(first[10] == 1);
  CHECK(number_at(first, section(first, "PATHS").first) == 3);
  CHECK(section(first, "PATHS").second == 8 + 2 * 16);
  const std::string second = encode_crate(*layer, {1, 0});
  CHECK(section(second, "PATHS").second == 8 + 2 * 12);
  CHECK(section(second, "SPECS").second == 8 + 2 * 12);
  // Prepended items came with 0.2.0.
  const auto prepended = read_text_layer("tiny.usda", "#usda 1.0\n" + kTinyLayers[6]);
  CHECK(encode_crate(*prepended, {0, 1})[9] == 2);
}

TEST_CASE("the encoder of this test makes the path tables that OpenUSD makes", "[usdc]") {
  const auto shared = diorama::test::shared_folder();
  if (!shared || !fs::is_directory(*shared / "data" / "usd" / "reencoded")) {
    WARN("no shared data here: the encoder is not compared");
    return;
  }
  std::size_t compared = 0;
  for (const auto& entry : fs::directory_iterator(*shared / "data" / "usd" / "reencoded")) {
    if (entry.path().extension() != ".usdc") continue;
    const ByteView view = map_file(entry.path().string());
    const std::string theirs(reinterpret_cast<const char*>(view.bytes.data()), view.bytes.size());
    const auto layer = read_crate(entry.path().string(), view);
    const std::string ours = encode_crate(*layer, {theirs[9], theirs[10]});
    INFO(entry.path());
    CHECK(ours[9] == theirs[9]);
    CHECK(number_at(ours, section(ours, "PATHS").first) ==
          number_at(theirs, section(theirs, "PATHS").first));
    if (theirs[9] < 4) CHECK(path_records(ours) == path_records(theirs));
    ++compared;
  }
  CHECK(compared > 100);
}

TEST_CASE("every shared layer is read in every crate version", "[usdc][slow]") {
  const std::vector<fs::path> files = shared_layers();
  if (files.empty()) {
    WARN("no shared data here: only the layers of this test are written in every version");
    return;
  }
  AssetLibrary library;
  std::size_t layers = 0;
  std::vector<std::string> failures;
  for (const fs::path& file : files) {
    std::shared_ptr<const Layer> layer;
    try {
      layer = library.open(file.string());
    } catch (const FormatError&) {
      continue;  // Those that must be refused are listed elsewhere.
    }
    ++layers;
    for (const CrateVersion version : kCrateVersions) {
      const std::string found = failure(*layer, version);
      if (!found.empty()) {
        failures.push_back(file.string() + " in " + name_of(version) + ": " + found);
      }
    }
  }
  std::cout << layers << " layers in " << std::size(kCrateVersions) << " crate versions\n";
  for (std::size_t i = 0; i < std::min<std::size_t>(failures.size(), 20); ++i) {
    std::cout << "  " << failures[i] << '\n';
  }
  CHECK(failures.empty());
  CHECK(layers > 1000);
}

}  // namespace diorama::usd
