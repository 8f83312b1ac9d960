// SPDX-License-Identifier: Apache-2.0
#include "framework/host/asset_paths.h"

#include <cstdlib>
#include <fstream>
#include <functional>

#include "diorama/error.h"
#include "support/catch.h"

using namespace diorama;
namespace fs = std::filesystem;

namespace {

/// A small assets root.
class AssetFolder {
 public:
  AssetFolder() {
    std::string pattern = (fs::temp_directory_path() / "diorama_assets_XXXXXX").string();
    root = mkdtemp(pattern.data());
    for (const char* file :
         {"Isaac/Props/YCB/003_box.usd", "Isaac/Props/YCB/011_Banana.USD", "Isaac/Props/notes.txt",
          "Isaac/Props/Materials/wood.usd", "Isaac/Props/a.usda", "Isaac/Props/.usd",
          "Isaac/Props/with space.usd"}) {
      fs::create_directories((root / file).parent_path());
      std::ofstream(root / file) << "x";
    }
    fs::create_directory_symlink(root / "Isaac", root / "Isaac/Props/YCB/loop");
    fs::create_symlink("/nowhere", root / "Isaac/Props/dangling.usd");
  }
  ~AssetFolder() { fs::remove_all(root); }

  fs::path root;
};

std::string error_of(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    CHECK(error.kind() == ErrorKind::Asset);
    return error.what();
  }
  return "no error";
}

}  // namespace

TEST_CASE("paths resolve as they are, then below the assets root", "[assets]") {
  const AssetFolder assets;
  const AssetPaths paths(assets.root);
  const fs::path box = assets.root / "Isaac/Props/YCB/003_box.usd";
  CHECK(paths.resolve("/Isaac/Props/YCB/003_box.usd") == box);
  CHECK(paths.resolve("Isaac/Props/YCB/003_box.usd") == box);
  CHECK(paths.resolve(box.string()) == box);
  CHECK(paths.resolve("file://" + box.string()) == box);
  CHECK(
      paths.resolve("file://localhost" + (assets.root / "Isaac/Props/with%20space.usd").string()) ==
      assets.root / "Isaac/Props/with space.usd");
  CHECK(AssetPaths(std::nullopt).resolve(box.string()) == box);
}

TEST_CASE("paths that do not resolve list what was tried", "[assets]") {
  const AssetFolder assets;
  const AssetPaths paths(assets.root);
  CHECK(error_of([&] { paths.resolve("/Isaac/none.usd"); }) ==
        "/Isaac/none.usd: not found; tried /Isaac/none.usd and " +
            (assets.root / "Isaac/none.usd").string());
  CHECK(error_of([&] { AssetPaths(std::nullopt).resolve("none.usd"); }) ==
        "none.usd: not found; tried none.usd; there is no assets root (--assets-root, "
        "DIORAMA_ASSETS_ROOT) to look below");
  CHECK(error_of([&] { paths.resolve("file:///none.usd"); }) ==
        "file:///none.usd: there is no file /none.usd");
  CHECK(error_of([&] { paths.resolve(""); }) == "an asset has an empty name");
}

TEST_CASE("assets of servers and of other disks are looked up below the assets root", "[assets]") {
  const AssetFolder assets;
  const fs::path box = assets.root / "Isaac/Props/YCB/003_box.usd";
  const AssetPaths paths(assets.root);
  for (const char* name :
       {"omniverse://localhost/NVIDIA/Assets/Isaac/4.2/Isaac/Props/YCB/003_box.usd",
        "https://content.example.com/Assets/Isaac/2023.1/Isaac/Props/YCB/003_box.usd",
        "omniverse://server/Isaac/Props/YCB/003_box.usd", "/home/bob/Isaac/Props/YCB/003_box.usd",
        "C:/assets/Isaac/Props/YCB/003_box.usd"}) {
    CAPTURE(name);
    CHECK(paths.resolve(name) == box);
  }
  for (const char* more : {"?version=3", "?a=b/Isaac/c.usd&d=%20", "#top", "?x#y"}) {
    CAPTURE(more);
    CHECK(paths.resolve(std::string("omniverse://server/Isaac/Props/YCB/003_box.usd") + more) ==
          box);
  }
  CHECK(paths.resolve("https://host/Isaac/Props/with%20space.usd") ==
        assets.root / "Isaac/Props/with space.usd");
  // Nothing of a server lies above the assets root.
  const fs::path outside = assets.root.string() + "_outside.usd";
  std::ofstream(outside) << "x";
  for (const char* up : {"../", "Isaac/../../", "Isaac/%2e%2e/%2E%2E/"}) {
    CAPTURE(up);
    const std::string error =
        error_of([&] { paths.resolve("https://host/" + (up + outside.filename().string())); });
    CHECK(error.find("remote assets are not fetched") != std::string::npos);
  }
  fs::remove(outside);
  // Other folders have other prefixes; the longest one counts, and what is not there is looked up
  // as ever.
  const AssetPaths mapped(assets.root, {{"omniverse://nucleus/", "/nowhere"},
                                        {"omniverse://nucleus/Lib/", "Isaac/Props"},
                                        {"/mnt/lib", "/Isaac/Props/YCB/"}});
  CHECK(mapped.resolve("omniverse://nucleus/Lib/YCB/003_box.usd") == box);
  CHECK(mapped.resolve("omniverse://nucleus/Lib/YCB/003_box.usd?version=2") == box);
  CHECK(mapped.resolve("omniverse://nucleus/Lib/with%20space.usd") ==
        assets.root / "Isaac/Props/with space.usd");
  CHECK(mapped.resolve("/mnt/lib/003_box.usd") == box);
  CHECK(mapped.resolve("omniverse://nucleus/Isaac/Props/YCB/003_box.usd") == box);
  // A file that is where it says needs no table.
  CHECK(AssetPaths(assets.root, {{"/", "/nowhere"}}).resolve(box.string()) == box);
}

TEST_CASE("remote assets that are nowhere are refused with what to do", "[assets]") {
  CHECK(error_of([&] {
          AssetPaths(std::nullopt).resolve("omniverse://server/NVIDIA/Assets/sky.hdr");
        }) ==
        "omniverse://server/NVIDIA/Assets/sky.hdr: remote assets are not fetched; copy the file "
        "below the assets root (--assets-root, DIORAMA_ASSETS_ROOT) and name it "
        "'/NVIDIA/Assets/sky.hdr'");
  const AssetFolder assets;
  CHECK(error_of([&] {
          AssetPaths(assets.root).resolve("https://host/Assets/Isaac/4.2/Isaac/gone.usd");
        }) ==
        "https://host/Assets/Isaac/4.2/Isaac/gone.usd: remote assets are not fetched; copy the "
        "file below the assets root (--assets-root, DIORAMA_ASSETS_ROOT) and name it "
        "'/Isaac/gone.usd'; tried " +
            (assets.root / "Assets/Isaac/4.2/Isaac/gone.usd").string() + " and " +
            (assets.root / "Isaac/4.2/Isaac/gone.usd").string() + " and " +
            (assets.root / "Isaac/gone.usd").string());
  CHECK(error_of([&] {
          AssetPaths(std::nullopt).resolve("https://host");
        }).find("name it '/...'") != std::string::npos);
}

TEST_CASE("folders are listed sorted, filtered and without loops", "[assets]") {
  const AssetFolder assets;
  const AssetPaths paths(assets.root);
  const std::vector<std::string> endings{".usd", ".usda"};
  const std::vector<std::string> skip{"material", "SPACE"};
  const auto names = [&](std::string_view folder, const std::vector<std::string>& without) {
    std::vector<std::string> list;
    for (const fs::path& file : paths.list(folder, endings, without)) {
      list.push_back(file.lexically_relative(assets.root / "Isaac/Props").string());
    }
    return list;
  };
  CHECK(names("/Isaac/Props", skip) ==
        std::vector<std::string>{"YCB/003_box.usd", "YCB/011_Banana.USD", "a.usda"});
  CHECK(names("/Isaac/Props", {}) ==
        std::vector<std::string>{"Materials/wood.usd", "YCB/003_box.usd", "YCB/011_Banana.USD",
                                 "a.usda", "with space.usd"});
  CHECK(error_of([&] { paths.list("/Isaac/Props/a.usda", endings, {}); }) ==
        (assets.root / "Isaac/Props/a.usda").string() + ": is a file, expected a folder of assets");
}

TEST_CASE("the assets root is the first one that is given", "[assets]") {
  const AssetFolder assets;
  const fs::path a = assets.root / "Isaac";
  const fs::path b = assets.root / "Isaac/Props";
  CHECK(choose_assets_root(a, b.c_str(), b, b) == a);
  CHECK(choose_assets_root(std::nullopt, a.c_str(), b, b) == a);
  CHECK(choose_assets_root(std::nullopt, "", a, b) == a);
  CHECK(choose_assets_root(std::nullopt, nullptr, std::nullopt, a) == a);
  CHECK(choose_assets_root(std::nullopt, nullptr, std::nullopt, "/nowhere") == std::nullopt);
  CHECK(error_of([&] { choose_assets_root("/nowhere", a.c_str(), a, a); }) ==
        "/nowhere: the assets root (--assets-root) is no folder that exists");
  CHECK(error_of([&] { choose_assets_root(std::nullopt, "/nowhere", a, a); }) ==
        "/nowhere: the assets root (DIORAMA_ASSETS_ROOT) is no folder that exists");
}

TEST_CASE("the assets root is the folder that was checked", "[assets]") {
  const AssetFolder assets;
  fs::create_directories(assets.root / "elsewhere/deep");
  fs::create_directories(assets.root / "elsewhere/pack");
  fs::create_directory_symlink(assets.root / "elsewhere/deep", assets.root / "link");
  const auto chosen = choose_assets_root(assets.root / "link/../pack", nullptr, {}, {});
  CHECK(chosen == fs::canonical(assets.root / "elsewhere/pack"));
  CHECK(choose_assets_root(assets.root / "Isaac/../link", nullptr, {}, {}) == assets.root / "link");
  CHECK(choose_assets_root(fs::path("."), nullptr, {}, {})->is_absolute());
}

TEST_CASE("variants are told from names", "[assets]") {
  using Parts = std::pair<std::string_view, std::string_view>;
  CHECK(split_variants("/a/mug.usd{look=red}{size=big}") ==
        Parts{"/a/mug.usd", "{look=red}{size=big}"});
  CHECK(split_variants("mug.usd") == Parts{"mug.usd", ""});
  CHECK(split_variants("/a{b}/mug.usd") == Parts{"/a{b}/mug.usd", ""});
  const AssetFolder assets;
  const std::string odd = (assets.root / "mug{look=red}").string();
  std::ofstream(odd) << "x";
  CHECK(split_variants(odd) == Parts{odd, ""});
}

TEST_CASE("schemes are told from paths", "[assets]") {
  CHECK(has_scheme("dining_room:7"));
  CHECK(has_scheme("file:///a"));
  CHECK_FALSE(has_scheme("/a/b:c"));
  CHECK_FALSE(has_scheme("a b:c"));
  CHECK_FALSE(has_scheme("c:/windows"));
  CHECK_FALSE(has_scheme("plain"));
}
