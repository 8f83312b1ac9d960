// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <set>
#include <sstream>

#include "loader_usd/usd/error.h"
#include "loader_usd/usd/text_reader.h"
#include "plugins/loader_usd/stage_dump.h"
#include "support/catch.h"
#include "support/shared_data.h"
#include "support/temporary_folder.h"

namespace fs = std::filesystem;

namespace diorama::usd {
namespace {

std::optional<fs::path> data_folder() {
  const auto shared = diorama::test::shared_folder();
  if (!shared || !fs::is_directory(*shared / "data" / "expected")) {
    WARN("no shared data here: the comparison with OpenUSD is skipped");
    return std::nullopt;
  }
  return *shared / "data";
}

// The archive of one scene has to be unpacked first; its stage is `ALab/entry.usda`.
std::optional<std::string> unpack(const fs::path& archive,
                                  const diorama::test::TemporaryFolder& folder) {
  const std::string command =
      "tar xzf '" + archive.string() + "' -C '" + folder.path("") + "' 2>/dev/null";
  if (std::system(command.c_str()) != 0) return std::nullopt;
  return folder.path("ALab/entry.usda");
}

std::string first_difference(const fs::path& source, const fs::path& expected_file) {
  std::ifstream file(expected_file);
  const auto expected = nlohmann::json::parse(file);
  const auto differences = test::compare_dumps(test::dump_stage(source.string()), expected);
  return differences.empty() ? std::string() : differences.front();
}

}  // namespace

TEST_CASE("matrices are compared as what they do to the stage", "[expected]") {
  // A thing of a hundred metres, turned by a right angle about z.
  const auto stage = [](double cosine, double x) {
    const auto bounds = nlohmann::json::array({{0, 0, 0}, {100, 20, 3}});
    nlohmann::json prim{{"path", "/A"}, {"worldBounds", bounds}};
    prim["localToWorld"] = {cosine, 1, 0, 0, -1, cosine, 0, 0, 0, 0, 1, 0, x, 0, 50, 1};
    return nlohmann::json{{"opens", true},
                          {"upAxis", "Z"},
                          {"metersPerUnit", 1.0},
                          {"defaultPrim", nullptr},
                          {"totals", {{"worldBounds", bounds}}},
                          {"prims", nlohmann::json::array({prim})}};
  };
  const auto are_equal = [&](double cosine, double x) {
    return test::compare_dumps(stage(cosine, x), stage(0.0, 0.0)).empty();
  };
  // What is nothing beside the largest numbers counts as nothing, whatever it is beside itself.
  CHECK(are_equal(6e-17, 5e-5));
  CHECK_FALSE(are_equal(1e-5, 0.0));
  CHECK_FALSE(are_equal(0.0, 1e-3));
}

TEST_CASE("composed stages equal what OpenUSD says about them", "[expected][slow]") {
  const auto data = data_folder();
  if (!data) return;
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(*data / "expected")) {
    if (entry.path().extension() == ".json") files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  const diorama::test::TemporaryFolder folder;
  std::size_t equal = 0;
  std::vector<std::string> unequal;
  for (const fs::path& file : files) {
    const fs::path name = fs::relative(file, *data / "expected").replace_extension();
    fs::path source = *data / name;
    if (source.extension() == ".gz") {
      const auto stage = unpack(source, folder);
      if (!stage) {
        unequal.push_back(name.string() + ": cannot be unpacked");
        continue;
      }
      source = *stage;
    }
    const std::string difference = first_difference(source, file);
    if (difference.empty()) {
      ++equal;
    } else {
      unequal.push_back(name.string() + ": " + difference);
    }
  }
  std::cout << equal << " of " << files.size() << " stages are equal in full\n";
  for (const std::string& line : unequal) std::cout << "  unequal: " << line << '\n';
  REQUIRE(files.size() > 1000);
  CHECK(equal * 100 >= files.size() * 99);
}

TEST_CASE("files that OpenUSD refuses are refused with their name", "[expected]") {
  const auto data = data_folder();
  if (!data) return;
  std::ifstream list(*data / "expected" / "usd_must_fail.txt");
  std::size_t count = 0;
  for (std::string name; std::getline(list, name);) {
    if (name.empty()) continue;
    ++count;
    const auto dump = test::dump_stage((*data / "usd" / name).string());
    INFO(name);
    CHECK_FALSE(dump["opens"].get<bool>());
    CHECK(dump.value("error", "").find(fs::path(name).filename().string()) != std::string::npos);
  }
  CHECK(count > 30);
}

TEST_CASE("the text parser takes and refuses what OpenUSD's takes and refuses", "[expected]") {
  const auto data = data_folder();
  if (!data) return;
  std::ifstream table(*data / "expected" / "sdf_parsing.tsv");
  std::string line;
  std::getline(table, line);
  std::size_t count = 0;
  while (std::getline(table, line)) {
    const std::size_t tab = line.find('\t');
    const std::string name = line.substr(0, tab);
    std::ifstream file(*data / "usd" / name);
    std::stringstream text;
    text << file.rdbuf();
    bool opens = true;
    std::string error;
    try {
      read_text_layer(name, text.str());
    } catch (const FormatError& failure) {
      opens = false;
      error = failure.what();
    }
    INFO(name << ' ' << error);
    CHECK(opens == (line.substr(tab + 1) == "yes"));
    ++count;
  }
  CHECK(count > 100);
}

}  // namespace diorama::usd
