// SPDX-License-Identifier: Apache-2.0
// What the page asks for, over a dataset whose every text is hostile.
#include "framework/view/dataset_view.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>

#include "diorama/error.h"
#include "framework/lint/encoding_host.h"
#include "framework/output/journal.h"
#include "framework/view/byte_cache.h"
#include "framework/view/index_cache.h"
#include "framework/view/report.h"
#include "support/catch.h"
#include "support/temporary_folder.h"

using namespace diorama;

namespace {

using Json = nlohmann::json;

const std::string kHostile = "</script><script>alert('1')</script>\"\\ \u2028 ../../etc/passwd";

/// Three captures, numbers 3, 7 and 9; one camera; 6 x 4 pixels. The changed one has another pixel
/// in capture 7, and capture 11 instead of 9.
class HostileDataset final : public StoredDataset {
 public:
  explicit HostileDataset(bool is_changed) : is_changed_(is_changed) {
    info_.format = kHostile;
    info_.camera_names = {kHostile};
    info_.captures = {3, 7, is_changed ? 11 : 9};
    for (const std::string_view name :
         {kColor.name, kInstanceId.name, kDistanceToImagePlane.name, kNormals.name,
          kFlowForward.name, kFlowForwardState.name, kHoldsKeypoints, kHoldsClips, kHoldsInstances,
          kHoldsLabels, kHoldsTightBoxes, kHoldsPoses, kHoldsBoxes3d, kHoldsOcclusion, kHoldsCamera,
          kHoldsCameraPose}) {
      info_.holds.emplace(name);
    }
    info_.skeletons[kHostile] = {{kHostile, "tip"}, {{0, 1}}};
    for (int i = 0; i < faults; ++i) {
      log_.findings.push_back({"is read", kHostile, {}, "", "", std::to_string(i), "another"});
    }
  }
  const StoredInfo& info() const override { return info_; }
  const ReadLog& log() const override { return log_; }
  StoredCapture read(std::size_t i, const NameSet& wanted) const override {
    ++reads;
    if (stops) throw Stopped();
    if (fails) throw Error(ErrorKind::Plugin, "a.txt: is being written");
    if (info_.captures[i] == fails_at) throw std::out_of_range("a table is short");
    if (info_.captures[i] == has_no_pixels && wanted.contains(kColor.name)) throw 7;
    StoredCapture stored;
    stored.capture.index = info_.captures[i];
    stored.capture.phase = kHostile;
    stored.split = i == 0 ? "val" : "train";
    if (i > 0) stored.capture.clip = ClipFrame{5, int(i) - 1, 2, 25.0};
    Frame frame;
    frame.camera_name = kHostile;
    frame.camera.width = 6;
    frame.camera.height = 4;
    frame.camera.fx = frame.camera.fy = 5.0;
    frame.camera.cx = 3.0;
    frame.camera.cy = 2.0;
    Instance instance;
    instance.id = 0x123456;
    instance.node_path = kHostile;
    instance.labels = {{"class", kHostile}};
    instance.world_from_node.translation() = Vec3(0.0, 0.0, -2.0);
    instance.bounds_node.add(Vec3(-0.1, -0.2, -0.3));
    instance.bounds_node.add(Vec3(0.3, 0.2, 0.1));
    instance.tight_box = PixelBox{1, 1, 4, 3};
    instance.visibility = Visibility{};
    instance.visibility->visible_pixels = 6;
    instance.visibility->amodal_pixels = 8;
    if (i == 2) {  // as readers of formats with shares alone
      instance.visibility->visible_pixels = 3 << 22;
      instance.visibility->amodal_pixels = 4 << 22;
    }
    if (info_.captures[i] == has_no_numbers) {
      const double none = std::nan("");
      frame.camera.fx = none;
      frame.world_from_camera.translation().x() = none;
      instance.world_from_node.translation().z() = none;
      frame.instances.push_back(instance);
      instance.id = 2;
      instance.world_from_node.setIdentity();
      instance.bounds_node.max.x() = std::numeric_limits<double>::infinity();
    }
    frame.instances.push_back(instance);
    if (wanted.contains(kColor.name)) {
      Image<Rgba8> color(6, 4, Rgba8{10, 20, 30, 255});
      color.at(5, 3) = Rgba8{200, 100, 50, 255};
      if (is_changed_ && stored.capture.index == 7) color.at(5, 3)[0] = 199;
      frame.set(kColor, std::move(color));
    }
    if (wanted.contains(kInstanceId.name) && overlaps) {
      CoverageMask lower;
      lower.box = {1, 1, 3, 3};
      lower.bits = {0, 1, 1, 1};
      CoverageMask upper;
      upper.box = {2, 1, 3, 2};
      upper.bits = {1};
      stored.masks.push_back({{0x123456U, lower}, {9U, upper}});
    } else if (wanted.contains(kInstanceId.name)) {
      Image<std::uint32_t> ids(6, 4, 0U);
      ids.at(2, 1) = 0x123456;
      frame.set(kInstanceId, std::move(ids));
    }
    if (wanted.contains(kDistanceToImagePlane.name)) {
      Image<float> depth(6, 4, 1.2345F);
      depth.at(0, 0) = std::numeric_limits<float>::infinity();
      frame.set(kDistanceToImagePlane, std::move(depth));
    }
    if (wanted.contains(kFlowForward.name)) {
      Image<Vec2f> flow(6, 4, Vec2f(-300.5F, 0.25F));
      flow.at(1, 0) = Vec2f(-1e9F, 1e9F);
      frame.set(kFlowForward, std::move(flow));
      Image<std::uint32_t> states(6, 4, std::uint32_t(FlowState::Seen));
      states.at(2, 0) = std::uint32_t(FlowState::Hidden);
      frame.set(kFlowForwardState, std::move(states));
    }
    stored.capture.frames.push_back(std::move(frame));
    if (wanted.contains(kHoldsKeypoints)) {
      using Sight = StoredKeypoint::Sight;
      stored.keypoints.push_back({{0x123456U,
                                   {{Vec2(1.256, 2.0), Sight::Seen},
                                    {Vec2(5.0, 3.0), Sight::Hidden},
                                    {Vec2(std::nan(""), 9.0), Sight::NotTold}}}});
    }
    return stored;
  }

  static inline std::atomic<int> reads = 0;
  static inline std::atomic<int> faults = 0;  ///< Of the whole.
  static inline std::atomic<bool> fails = false;
  static inline std::atomic<bool> stops = false;
  static inline std::atomic<bool> overlaps = false;
  static inline std::atomic<int> fails_at = -1;       ///< Number of a capture.
  static inline std::atomic<int> has_no_pixels = -1;  ///< The same.
  static inline std::atomic<int> has_no_numbers = -1;

 private:
  bool is_changed_;
  StoredInfo info_;
  ReadLog log_;
};

class HostileReader final : public Reader {
 public:
  std::vector<std::string> patterns() const override { return {"mark.txt"}; }
  Recognition recognise(const std::filesystem::path&) const override { return Recognition::ByName; }
  std::unique_ptr<const StoredDataset> open(const std::filesystem::path& folder) const override {
    return std::make_unique<HostileDataset>(std::filesystem::file_size(folder / "mark.txt") > 0);
  }
};

/// A view of a folder with a hostile name, perhaps with a changed one beside it.
struct Viewed {
  explicit Viewed(std::optional<std::size_t> most = {}, bool compares = false) {
    folder.write("<img src=x>/mark.txt", "");
    folder.write("changed/mark.txt", "changed");
    options = {.folder = folder.path("<img src=x>"), .most_captures = most};
    if (compares) options.other = folder.path("changed");
    view.emplace(options, readers, host);
  }
  /// Views the folder anew until all is done; how many captures were read for it.
  int reads_with_cache(const std::filesystem::path& cache) {
    view.reset();
    options.cache = cache;
    HostileDataset::reads = 0;
    view.emplace(options, readers, host);
    while (view->work()) {
    }
    return HostileDataset::reads;
  }
  HttpAnswer answer(const std::string& path) { return view->answer(path); }
  Json json(const std::string& path) {
    const HttpAnswer made = answer(path);
    REQUIRE(made.status == 200);
    REQUIRE(made.type == "application/json");
    return Json::parse(*made.body);
  }
  Rgba8 pixel(const std::string& path, int x, int y) {
    const HttpAnswer made = answer(path);
    REQUIRE(made.status == 200);
    REQUIRE(made.type == "image/png");
    const auto image = decode_image(std::as_bytes(std::span(*made.body)), "picture");
    const std::uint8_t* at =
        image->bytes.data() + (std::size_t(y) * std::size_t(image->width) + std::size_t(x)) * 3;
    return {at[0], at[1], at[2], 255};
  }

  test::TemporaryFolder folder;
  test::EncodingHost host;
  DatasetReaders readers{
      {{"hostile", {"mark.txt"}, [] { return std::make_unique<HostileReader>(); }}}};
  DatasetView::Options options;
  std::optional<DatasetView> view;
};

std::vector<std::filesystem::path> files_in(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) files.push_back(entry);
  return files;
}

std::string content_of(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return std::string(std::istreambuf_iterator<char>(stream), {});
}

}  // namespace

TEST_CASE("Addresses count what the readers have, all others are nowhere", "[view]") {
  Viewed viewed;
  for (const char* path : {"/api",
                           "/api/",
                           "/api/1/info",
                           "/api/0",
                           "/api/0/",
                           "/api/00/info",
                           "/api/-1/info",
                           "/api/+0/info",
                           "/api/0/capture",
                           "/api/0/capture/4",
                           "/api/0/capture/07",
                           "/api/0/capture/99999999999999999999999",
                           "/api/0/capture/7/1/color",
                           "/api/0/capture/7/0/normals",
                           "/api/0/capture/7/0/motion",
                           "/api/0/capture/7/0/../color",
                           "/api/0/capture/7/0/rgb.png",
                           "/api/0/capture/7/0",
                           "/api/0/index/x",
                           "/api/0/brightness/-1",
                           "/etc/passwd",
                           "//",
                           "/../mark.txt",
                           "/mark.txt",
                           "/api/0/info/mark.txt",
                           "/view.js/",
                           "/index.html"}) {
    INFO(path);
    CHECK(viewed.answer(path).status == 404);
  }
  for (const char* path : {"/", "/view.js", "/view.css", "/icon.svg", "/api/state", "/api/run",
                           "/api/0/info", "/api/0/index/0", "/api/0/capture/7"}) {
    INFO(path);
    CHECK(viewed.answer(path).status == 200);
  }
}

TEST_CASE("Hostile texts arrive as texts in JSON", "[view]") {
  Viewed viewed;
  CHECK(viewed.json("/api/state")["datasets"][0]["name"] == "<img src=x>");
  CHECK(viewed.json("/api/0/info")["cameras"][0] == kHostile);
  const Json capture = viewed.json("/api/0/capture/7");
  CHECK(capture["capture"] == 7);
  CHECK(capture["phase"] == kHostile);
  const Json object = capture["frames"][0]["objects"][0];
  CHECK(object["class"] == kHostile);
  CHECK(object["path"] == kHostile);
  CHECK(object["box"] == Json({1, 1, 4, 3}));
  CHECK(object["occlusion"] == 0.25);
  CHECK(object["visible_pixels"] == 6);
  const Json share = viewed.json("/api/0/capture/9")["frames"][0]["objects"][0];
  CHECK(share["occlusion"] == 0.25);
  CHECK_FALSE(share.contains("visible_pixels"));
  // The corner (-0.1, -0.2, -0.3) of the box at z = -2 is 2.3 m before the camera.
  CHECK(object["edges"].size() == 12);
  CHECK(object["edges"][0][0].get<double>() == Approx(3.0 - 5.0 * 0.1 / 2.3).margin(0.006));
  CHECK(object["edges"][0][1].get<double>() == Approx(2.0 + 5.0 * 0.2 / 2.3).margin(0.006));
}

TEST_CASE("The page is told what is wrong with a dataset as a whole", "[view]") {
  CHECK(Viewed().json("/api/0/info")["fault_count"] == 0);
  HostileDataset::faults = 5;
  Viewed viewed;
  HostileDataset::faults = 0;
  const Json info = viewed.json("/api/0/info");
  CHECK(info["fault_count"] == 5);
  REQUIRE(info["faults"].size() == 3);
  CHECK(info["faults"][2] == kHostile + ": 2; right would be: another");
}

TEST_CASE("What is no number is not told", "[view]") {
  Viewed viewed;
  HostileDataset::has_no_numbers = 7;
  const HttpAnswer made = viewed.answer("/api/0/capture/7");
  while (viewed.view->work()) {
  }
  CHECK(viewed.answer("/api/0/index/0").status == 200);
  HostileDataset::has_no_numbers = -1;
  REQUIRE(made.status == 200);
  CHECK(made.body->find("null") == std::string::npos);
  const Json frame = Json::parse(*made.body)["frames"][0];
  CHECK_FALSE(frame.contains("focal"));
  CHECK_FALSE(frame.contains("world_from_camera"));
  REQUIRE(frame["objects"].size() == 2);
  CHECK_FALSE(frame["objects"][0].contains("world_from_node"));
  CHECK(frame["objects"][1].contains("world_from_node"));
  for (const Json& object : frame["objects"]) {
    CHECK(object["box"] == Json({1, 1, 4, 3}));
    CHECK_FALSE(object.contains("bounds"));
    CHECK_FALSE(object.contains("edges"));
  }
}

TEST_CASE("Pictures of numbers hold them exactly", "[view]") {
  Viewed viewed;
  CHECK(viewed.pixel("/api/0/capture/7/0/color", 5, 3) == Rgba8{200, 100, 50, 255});
  CHECK(viewed.pixel("/api/0/capture/7/0/ids", 2, 1) == Rgba8{0x56, 0x34, 0x12, 255});
  CHECK(viewed.pixel("/api/0/capture/7/0/ids", 0, 0) == Rgba8{0, 0, 0, 255});
  CHECK(viewed.pixel("/api/0/capture/7/0/depth", 1, 1) == Rgba8{12345 & 255, 12345 >> 8, 0, 255});
  CHECK(viewed.pixel("/api/0/capture/7/0/depth", 0, 0) == Rgba8{0, 0, 0, 255});
  CHECK(viewed.answer("/api/0/capture/7/0/thumbnail").type == "image/jpeg");
}

TEST_CASE("The index grows by work, statistics come when they were asked for", "[view]") {
  Viewed viewed;
  CHECK(viewed.json("/api/0/index/0")["columns"]["visit"].empty());
  CHECK(viewed.answer("/api/0/stats").status == 202);
  while (viewed.view->work()) {
  }
  const Json index = viewed.json("/api/0/index/1");
  CHECK(index["from"] == 1);
  CHECK(index["columns"]["objects"] == Json({1, 1}));
  CHECK(index["columns"]["visible"] == Json({75, 75}));
  // From the middle of its bounds the camera lies in the direction of -x.
  CHECK(index["columns"]["azimuth"] == Json({180, 180}));
  // 23 pixels of (10, 20, 30) and one of (200, 100, 50).
  const Json bright = viewed.json("/api/0/brightness/0");
  CHECK(bright["captures"] == 3);
  CHECK(bright["brightness"] == Json({9, 9, 9}));
  CHECK(index["columns"]["split"] == Json({1, 1}));
  CHECK(index["names"]["splits"] == Json({"val", "train"}));
  CHECK(index["names"]["classes"] == Json({kHostile}));
  CHECK(viewed.json("/api/0/stats")["pictures"] == 3);
}

TEST_CASE("An index is kept for as long as no file of its dataset changes", "[view]") {
  Viewed viewed;
  const std::filesystem::path cache = viewed.folder.path("cache/view");
  // Labels of three captures, then the pixels of each.
  CHECK(viewed.reads_with_cache({}) == 6);
  CHECK(viewed.reads_with_cache(cache) == 6);
  const Json index = viewed.json("/api/0/index/0");
  const Json bright = viewed.json("/api/0/brightness/0");
  CHECK(viewed.reads_with_cache(cache) == 0);
  CHECK(viewed.json("/api/0/index/0") == index);
  CHECK(viewed.json("/api/0/brightness/0") == bright);
  REQUIRE(files_in(cache).size() == 1);
  namespace fs = std::filesystem;
  CHECK((fs::status(cache).permissions() & (fs::perms::group_all | fs::perms::others_all)) ==
        fs::perms::none);

  SECTION("a file that comes is a change") {
    viewed.folder.write("<img src=x>/labels/a.txt", "a");
    CHECK(viewed.reads_with_cache(cache) == 6);
    CHECK(viewed.reads_with_cache(cache) == 0);
    SECTION("and its time") {
      const fs::path file = viewed.folder.path("<img src=x>/labels/a.txt");
      fs::last_write_time(file, fs::last_write_time(file) + std::chrono::seconds(1));
      CHECK(viewed.reads_with_cache(cache) == 6);
    }
    SECTION("and another file in its place") {
      const fs::path file = viewed.folder.path("<img src=x>/labels/a.txt");
      const fs::path other = viewed.folder.write("b.txt", "b");
      fs::last_write_time(other, fs::last_write_time(file));
      fs::rename(other, file);
      CHECK(viewed.reads_with_cache(cache) == 6);
    }
    SECTION("and the page of its run") {
      viewed.folder.write("dataset.json", "{}");
      CHECK(viewed.reads_with_cache(cache) == 6);
    }
    CHECK(files_in(cache).size() == 1);
  }
  SECTION("what was damaged is made anew") {
    const fs::path file = files_in(cache).front();
    const std::string whole = content_of(file);
    std::string flipped = whole;
    flipped.back() = char(flipped.back() ^ 1);
    for (const std::string& bad :
         {std::string(), whole.substr(0, 20), whole.substr(0, whole.size() - 1), flipped,
          std::string("x") + whole}) {
      std::ofstream(file, std::ios::binary | std::ios::trunc) << bad;
      INFO(bad.size());
      CHECK(viewed.reads_with_cache(cache) == 6);
      CHECK(viewed.json("/api/0/index/0") == index);
    }
    CHECK(viewed.reads_with_cache(cache) == 0);
  }
  SECTION("behind linked folders changes would not be seen") {
    fs::create_directory(viewed.folder.path("elsewhere"));
    fs::create_directory_symlink("../elsewhere", viewed.folder.path("<img src=x>/linked"));
    CHECK(viewed.reads_with_cache(cache) == 6);
    CHECK(viewed.reads_with_cache(cache) == 6);
  }
  SECTION("a cache that cannot be written is none") {
    viewed.folder.write("file", "");
    CHECK(viewed.reads_with_cache(viewed.folder.path("file/view")) == 6);
  }
  SECTION("the oldest files leave") {
    CaptureIndex empty;
    const IndexCache small(cache, empty.bytes().size() + 300);
    small.keep({"b", "content"}, empty);
    REQUIRE(files_in(cache).size() == 1);
    CHECK(files_in(cache).front().filename() == "b.index");
    CaptureIndex found;
    CHECK(small.find({"b", "content"}, 0, found));
    CHECK_FALSE(small.find({"b", "other"}, 0, found));
  }
}

TEST_CASE("An index is taken from its own bytes alone", "[view]") {
  CaptureIndex index;
  CaptureIndex::Entry entry;
  entry.phase = kHostile;
  entry.pictures.resize(2);
  entry.pictures[1].objects.resize(3);
  entry.pictures[1].objects[2].name = kHostile;
  for (int i = 0; i < 2; ++i) index.add(entry);
  index.add_brightness({5, CaptureIndex::kUnknown});
  const std::string bytes = index.bytes();
  CaptureIndex same;
  REQUIRE(same.take_bytes(bytes, 2));
  CHECK(same.json(0, 9) == index.json(0, 9));
  CHECK(same.brightness_json(0, 9) == index.brightness_json(0, 9));
  same.add_brightness({1, 2});
  CHECK(same.brightness_size() == 2);

  const auto refuses = [](const std::string& other, std::size_t captures) {
    CaptureIndex taken;
    const bool is_refused = !taken.take_bytes(other, captures) && taken.size() == 0;
    taken.add({});
    return is_refused && taken.json(0, 1).starts_with("{\"from\":0");
  };
  CHECK(refuses(bytes, 1));
  CHECK(refuses(bytes, 3));
  CHECK(refuses(bytes + "x", 2));
  for (std::size_t cut = 0; cut < bytes.size(); ++cut) {
    if (!refuses(bytes.substr(0, cut), 2)) FAIL(cut);
  }
  // Any byte: numbers of names and of elements must fit; other numbers may be others.
  for (std::size_t at = 0; at < bytes.size(); ++at) {
    std::string changed = bytes;
    changed[at] = char(~changed[at]);
    CaptureIndex taken;
    if (taken.take_bytes(changed, 2)) CHECK(taken.json(0, 9).starts_with("{\"from\":0"));
  }
}

TEST_CASE("Two datasets are compared as a whole and capture by capture", "[view]") {
  Viewed viewed({}, true);
  const Json sides = viewed.json("/api/state")["datasets"];
  REQUIRE(sides.size() == 2);
  CHECK(sides[0]["is_other"] == false);
  CHECK(sides[1]["is_other"] == true);
  CHECK(sides[1]["name"] == "changed");
  CHECK(viewed.answer("/api/0/compare/1").status == 202);
  CHECK(viewed.answer("/api/1/compare/1").status == 202);
  while (viewed.view->work()) {
  }
  const Json all = viewed.json("/api/0/compare/1");
  CHECK(all["captures"] == 3);
  CHECK(all["differing"] == Json({7, 9}));
  CHECK(all["pages"].empty());
  REQUIRE(all["contents"].size() == 3);
  CHECK(all["contents"][0] == "capture 11: only in the second");
  CHECK(all["contents"][2] == "capture 9: only in the first");
  CHECK(viewed.json("/api/1/compare/1")["differing"].empty());

  CHECK(viewed.json("/api/0/compare/1/3").empty());
  const Json changed = viewed.json("/api/0/compare/1/7");
  REQUIRE(changed.size() == 1);
  CHECK(all["contents"][1] == "capture 7: " + changed[0].get<std::string>());
  CHECK_THAT(changed[0].get<std::string>(), ContainsSubstring("color"));
  CHECK(viewed.json("/api/0/compare/1/9") == Json({"only in the first"}));
  CHECK(viewed.json("/api/0/compare/1/11") == Json({"only in the second"}));
  CHECK(viewed.json("/api/0/compare/1/4") == Json({"in neither"}));
  for (const char* path :
       {"/api/0/compare", "/api/0/compare/", "/api/0/compare/2", "/api/2/compare/0",
        "/api/0/compare/1/", "/api/0/compare/1/07", "/api/0/compare/1/7/0", "/api/0/compare/-1"}) {
    INFO(path);
    CHECK(viewed.answer(path).status == 404);
  }
}

TEST_CASE("A run that goes on is shown before it has anything that could be read", "[view]") {
  test::TemporaryFolder folder;
  test::EncodingHost host;
  DatasetReaders readers{
      {{"hostile", {"mark.txt"}, [] { return std::make_unique<HostileReader>(); }}}};
  CHECK_THROWS_AS(DatasetView({.folder = folder.path("")}, readers, host), Error);
  folder.write("dataset.json", R"({"captures": 3, "job": "", "writers": []})");
  DatasetView view({.folder = folder.path("")}, readers, host);
  const auto json = [&](const std::string& path) { return Json::parse(*view.answer(path).body); };
  CHECK(json("/api/state")["datasets"].empty());
  CHECK(json("/api/state")["is_finished"] == false);
  CHECK(json("/api/run")["captures"] == 3);
  CHECK(view.answer("/api/0/info").status == 404);
  folder.write("hostile/mark.txt", "");
  LocalFileSystem file_system;
  file_system.make_folders(folder.path(".diorama/journal"));
  JournalWriter writer(file_system, folder.path(".diorama/journal"), "one", ".");
  writer.commit(0, {});
  writer.published(0);
  view.work();
  CHECK(json("/api/state")["datasets"].size() == 1);
  CHECK(json("/api/state")["generation"] == 1);
  CHECK(json("/api/run")["last"] == Json({0}));
}

TEST_CASE("What was read of a run that goes on is not read again when there is more", "[view]") {
  test::TemporaryFolder folder;
  test::EncodingHost host;
  DatasetReaders readers{
      {{"hostile", {"mark.txt"}, [] { return std::make_unique<HostileReader>(); }}}};
  folder.write("dataset.json", R"({"captures": 12, "job": "", "writers": []})");
  folder.write("hostile/mark.txt", "");
  LocalFileSystem file_system;
  file_system.make_folders(folder.path(".diorama/journal"));
  JournalWriter writer(file_system, folder.path(".diorama/journal"), "one", ".");
  DatasetView view({.folder = folder.path("")}, readers, host);
  const auto json = [&](const std::string& path) { return Json::parse(*view.answer(path).body); };
  const auto reads_after = [&](int made) {
    writer.commit(made, {});
    writer.published(made);
    HostileDataset::reads = 0;
    while (view.work()) {
    }
    return int(HostileDataset::reads);
  };
  // Labels and brightness of three captures, which stay as they are from now on.
  CHECK(reads_after(3) == 6);
  const Json before = json("/api/0/index/0");
  CHECK(before["generation"] == 1);
  CHECK(json("/api/0/brightness/0")["generation"] == 1);
  folder.write("hostile/mark.txt", "changed");  // 11 instead of 9
  std::this_thread::sleep_for(std::chrono::milliseconds(3100));
  CHECK(reads_after(7) == 2);
  Json after = json("/api/0/index/0");
  CHECK(json("/api/0/info")["captures"] == Json({3, 7, 11}));
  CHECK(json("/api/state")["edition"] == 0);
  CHECK(std::exchange(after["generation"], 1) == 2);
  CHECK(after == before);
  CHECK(json("/api/0/brightness/0")["captures"] == 3);
}

TEST_CASE("A run that has nothing to read yet cannot be checked, and makes no report", "[view]") {
  test::TemporaryFolder folder;
  test::EncodingHost host;
  DatasetReaders readers{
      {{"hostile", {"mark.txt"}, [] { return std::make_unique<HostileReader>(); }}}};
  folder.write("dataset.json", R"({"captures": 3, "job": "", "writers": []})");
  DatasetView view({.folder = folder.path("")}, readers, host);
  CHECK(view.answer("/api/lint").status == 202);
  while (view.work()) {
  }
  const HttpAnswer findings = view.answer("/api/lint");
  CHECK(findings.status == 200);
  CHECK_THAT(Json::parse(*findings.body)["fault"].get<std::string>(),
             ContainsSubstring("holds no dataset"));
  CHECK_THROWS_WITH(write_report(view, folder.path("report"), false),
                    ContainsSubstring("nothing that could be read yet"));
  CHECK_FALSE(std::filesystem::exists(folder.path("report")));
}

TEST_CASE("Files that change under the page end nothing", "[view]") {
  Viewed viewed({}, true);
  std::filesystem::create_directories(viewed.folder.path("dataset.json"));
  for (const char* asked : {"/api/lint", "/api/0/stats", "/api/0/compare/1"}) {
    INFO(asked);
    CHECK(viewed.answer(asked).status == 202);
    CHECK_NOTHROW(viewed.view->work());
    CHECK(viewed.answer(asked).status == 200);
  }
  CHECK_THAT(viewed.json("/api/0/compare/1").value("fault", ""),
             ContainsSubstring("no regular file"));
  CHECK(viewed.answer("/api/run").status == 200);
}

TEST_CASE("What cannot be checked is told, and nothing else ends", "[view]") {
  Viewed viewed;
  const std::filesystem::path out = viewed.folder.path("report");
  CHECK(viewed.answer("/api/lint").status == 202);
  SECTION("files that are just being written") {
    HostileDataset::fails = true;
    CHECK_NOTHROW(viewed.view->work());
    HostileDataset::fails = false;
    const Json findings = viewed.json("/api/lint")[0]["findings"];
    REQUIRE(findings.size() == 3);
    CHECK(findings[1]["capture"] == 7);
    CHECK_THAT(findings[1]["found"].get<std::string>(), ContainsSubstring("is being written"));
    while (viewed.view->work()) {
    }
    write_report(*viewed.view, out, false);
    CHECK_THAT(content_of(out / "data" / "lint.js"), ContainsSubstring("is being written"));
  }
  SECTION("a report has all the same what could be read") {
    HostileDataset::fails = true;
    CHECK(write_report(*viewed.view, out, false).captures == 3);
    HostileDataset::fails = false;
    CHECK_THAT(content_of(out / "data" / "0_capture_7.js"), ContainsSubstring("is being written"));
  }
  SECTION("Ctrl-C ends the check") {
    HostileDataset::stops = true;
    CHECK_THROWS_AS(viewed.view->work(), Stopped);
    HostileDataset::stops = false;
  }
}

TEST_CASE("A capture in which the reader throws is lost alone", "[view]") {
  Viewed viewed;
  const std::filesystem::path cache = viewed.folder.path("cache/view");
  SECTION("as a whole") {
    HostileDataset::fails_at = 7;
    CHECK(viewed.reads_with_cache(cache) == 6);
    CHECK(viewed.json("/api/0/index/0")["columns"]["findings"] == Json({0, 1, 0}));
    CHECK(viewed.json("/api/0/index/0")["columns"]["pictures"] == Json({1, 0, 1}));
    CHECK(viewed.json("/api/0/brightness/0")["brightness"] == Json({9, 9}));
    const Json lost = viewed.json("/api/0/capture/7");
    CHECK(lost["frames"].empty());
    REQUIRE(lost["findings"].size() == 1);
    CHECK_THAT(lost["findings"][0]["found"].get<std::string>(),
               ContainsSubstring("a table is short"));
    CHECK(viewed.answer("/api/0/capture/7/0/color").status == 404);
    CHECK(viewed.answer("/api/0/capture/9/0/color").status == 200);
    CHECK(viewed.answer("/api/0/stats").status == 202);
    while (viewed.view->work()) {
    }
    CHECK(viewed.json("/api/0/stats")["pictures"] == 2);
    CHECK(viewed.json("/api/0/stats")["findings"] == 1);
    // Next time it may be there.
    HostileDataset::fails_at = -1;
    CHECK(viewed.reads_with_cache(cache) == 6);
    CHECK(viewed.json("/api/0/index/0")["columns"]["pictures"] == Json({1, 1, 1}));
  }
  SECTION("in its pixels") {
    HostileDataset::has_no_pixels = 3;
    while (viewed.view->work()) {
    }
    HostileDataset::has_no_pixels = -1;
    CHECK(viewed.json("/api/0/brightness/0")["brightness"] == Json({CaptureIndex::kUnknown, 9, 9}));
  }
}

TEST_CASE("A dataset that cannot be opened is named beside those that can", "[view]") {
  Viewed viewed;
  class ThrowingReader final : public Reader {
   public:
    std::vector<std::string> patterns() const override { return {"broken.txt"}; }
    Recognition recognise(const std::filesystem::path&) const override {
      return Recognition::ByName;
    }
    std::unique_ptr<const StoredDataset> open(const std::filesystem::path&) const override {
      throw std::runtime_error("no table");
    }
  };
  viewed.folder.write("broken/broken.txt", "");
  DatasetReaders readers{
      {{"hostile", {"mark.txt"}, [] { return std::make_unique<HostileReader>(); }},
       {"throwing", {"broken.txt"}, [] { return std::make_unique<ThrowingReader>(); }}}};
  DatasetView view({.folder = viewed.folder.path("")}, readers, viewed.host);
  const Json state = Json::parse(*view.answer("/api/state").body);
  CHECK(state["datasets"].size() == 2);
  REQUIRE(state["faults"].size() == 1);
  CHECK_THAT(state["faults"][0].get<std::string>(), ContainsSubstring("no table"));
  CHECK_THROWS_WITH(DatasetView({.folder = viewed.folder.path("broken")}, readers, viewed.host),
                    ContainsSubstring("no table"));
}

TEST_CASE("Masks that overlap reach the page one by one", "[view]") {
  Viewed viewed;
  CHECK(viewed.answer("/api/0/capture/7/0/masks").status == 404);
  CHECK(viewed.answer("/api/0/capture/7/0/ids").status == 200);
  HostileDataset::overlaps = true;
  const HttpAnswer ids = viewed.answer("/api/0/capture/9/0/ids");
  const Json masks = viewed.json("/api/0/capture/9/0/masks");
  const std::filesystem::path out = viewed.folder.path("report");
  write_report(*viewed.view, out, false);
  HostileDataset::overlaps = false;
  CHECK(ids.status == 204);
  CHECK(masks["objects"].size() == 2);
  CHECK(masks["objects"][1] == Json({{"id", 0x123456}, {"box", {1, 1, 3, 3}}, {"runs", {1, 3}}}));
  CHECK_THAT(content_of(out / "data" / "0_capture_9_0_masks.js"), ContainsSubstring("[1,3]"));
}

TEST_CASE("Clips, keypoints and flow reach the page", "[view]") {
  Viewed viewed;
  const Json info = viewed.json("/api/0/info");
  CHECK(info["skeletons"][kHostile] == Json({{"names", {kHostile, "tip"}}, {"lines", {{0, 1}}}}));
  CHECK_FALSE(viewed.json("/api/0/capture/3").contains("clip"));
  const Json capture = viewed.json("/api/0/capture/9");
  CHECK(capture["clip"] == Json({{"clip", 5}, {"frame", 1}, {"frames", 2}, {"fps", 25.0}}));
  CHECK(capture["frames"][0]["objects"][0]["keypoints"] ==
        Json::parse("[[1.26, 2.0, 2], [5.0, 3.0, 1], [0.0, 0.0, 0]]"));
  while (viewed.view->work()) {
  }
  CHECK(viewed.json("/api/0/index/0")["columns"]["clip"] == Json({CaptureIndex::kUnknown, 5, 5}));

  // x above and y below in steps of 1/256 from -8192, the state in the highest bits of x.
  const auto number = [&](int x, int y) {
    const Rgba8 rgb = viewed.pixel("/api/0/capture/3/0/flow_forward", x, y);
    return unsigned(rgb[0]) | unsigned(rgb[1]) << 8 | unsigned(rgb[2]) << 16;
  };
  CHECK(number(0, 0) == unsigned((8192.0 - 300.5) * 256));
  CHECK(number(0, 4) == unsigned((8192.0 + 0.25) * 256));
  CHECK(number(2, 0) == (unsigned((8192.0 - 300.5) * 256) | 1U << 22));
  CHECK(number(1, 0) == 0);
  CHECK(number(1, 4) == 4194303U);
  CHECK(viewed.answer("/api/0/capture/3/0/flow_backward").status == 404);
}

TEST_CASE("A report is the same as files, whose names no text of the dataset makes", "[view]") {
  Viewed viewed(2);
  const std::filesystem::path out = viewed.folder.path("report");
  const ReportSize size = write_report(*viewed.view, out, false);
  CHECK(size.captures == 2);
  const auto read = [&](const std::string& name) {
    std::ifstream stream(out / name, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(stream), {});
  };
  CHECK(read("index.html").find("Content-Security-Policy") != std::string::npos);
  const std::string capture = read("data/0_capture_3.js");
  // A script of one text, which is JSON whatever the dataset's texts are.
  CHECK(capture.starts_with(R"(diorama_data('/api/0/capture/3','{"capture":3)"));
  CHECK(capture.find(R"(alert(\'1\'))") != std::string::npos);
  CHECK(capture.find(R"(\\")") != std::string::npos);
  CHECK(std::ranges::count(capture, '\n') == 1);
  CHECK(read("data/0_capture_3_0_ids.js").find("'\"data:image/png;base64,iVBOR") !=
        std::string::npos);
  CHECK(read("data/0_capture_3_0_color").starts_with("\xFF\xD8\xFF"));
  // What it lacks its page does not ask for.
  const auto holds = [&](const std::filesystem::path& report, const char* name) {
    std::ifstream stream(report / "data" / "0_info.js", std::ios::binary);
    const std::string text(std::istreambuf_iterator<char>(stream), {});
    return text.find("\"" + std::string(name) + "\"") != text.npos;
  };
  CHECK(holds(out, "instance_id"));
  CHECK_FALSE(holds(out, "distance_to_image_plane"));
  CHECK_FALSE(std::filesystem::exists(out / "data" / "0_capture_3_0_depth.js"));
  const std::filesystem::path whole = viewed.folder.path("whole");
  write_report(*viewed.view, whole, true);
  CHECK(holds(whole, "flow_forward"));
  for (const char* kind : {"depth", "flow_forward"}) {
    CHECK(std::filesystem::exists(whole / "data" / ("0_capture_3_0_" + std::string(kind) + ".js")));
  }
  CHECK(read("data/0_stats.js").find("\"captures\": 3") != std::string::npos);
  for (const auto& entry : std::filesystem::recursive_directory_iterator(out)) {
    const std::string name = entry.path().filename().string();
    INFO(name);
    CHECK(name.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789_.") == name.npos);
  }
  CHECK_THROWS_WITH(write_report(*viewed.view, out, false), ContainsSubstring("is not empty"));
}

TEST_CASE("What was not asked for the longest leaves a full cache", "[view]") {
  ByteCache<int> cache(100);
  cache.add("a", std::make_shared<const int>(1), 40);
  cache.add("b", std::make_shared<const int>(2), 40);
  CHECK(*cache.find("a") == 1);
  cache.add("c", std::make_shared<const int>(3), 40);
  CHECK(cache.find("b") == nullptr);
  CHECK(*cache.find("a") == 1);
  CHECK(*cache.find("c") == 3);
  cache.add("d", std::make_shared<const int>(4), 101);
  CHECK(cache.find("d") == nullptr);
}
