// SPDX-License-Identifier: Apache-2.0
#include "framework/host/host_services.h"

#include <cstdlib>
#include <fstream>

#include "framework/host/asset_cache.h"
#include "support/catch.h"

using namespace diorama;
namespace fs = std::filesystem;

namespace {

void ignore(LogLevel, std::string_view) {}

/// Makes a body with a part that shares mesh and material; writes every load to a log that the test
/// finds by the asset's name.
class PartLoader final : public Loader {
 public:
  struct Params {
    double weight = 7.0;
    void visit(ParamVisitor& v) { v.param("weight", weight, {"Of a lid.", "kg"}); }
  };
  PartLoader(const Params& params, Host& host) : params_(params), host_(host) {}
  std::vector<std::string> claims() const override {
    return {".part", ".big.part", "part:", "=PART", "=PA"};
  }
  std::vector<fs::path> files(std::string_view asset) const override {
    return {fs::path(asset), std::to_string(int(params_.weight)) + ".kg"};
  }

  void load(std::string_view asset, Scene& scene, NodeId root) override {
    host_.log(LogLevel::Debug, "load " + std::string(asset));
    if (asset.find("broken") != std::string_view::npos) throw std::runtime_error("no parts left");
    auto mesh = std::make_shared<Mesh>(make_box({1, 2, 3}));
    auto material = std::make_shared<Material>();
    auto texture = std::make_shared<Texture>();
    texture->bytes.resize(100'000);
    material->base_color_texture.texture = texture;
    scene.edit(root).mesh = mesh;
    scene.edit(root).labels["class"] = "part";
    const NodeId lid = scene.create(root, "lid");
    scene.set_pose(lid, Transform{{0, 0, 3}, Quat::Identity(), {1, 0.5, 2}});
    Node& node = scene.edit(lid);
    node.mesh = mesh;
    node.materials = {material, material};
    node.is_visible = false;
    node.rigid_body = RigidBody{.mass_kg = params_.weight};
    scene.create(lid, "knob");
  }

 private:
  Params params_;
  Host& host_;
};

void register_parts(Registrar& registrar) {
  diorama::add<PartLoader>(registrar, "parts", "Makes parts.");
}

struct Workshop {
  explicit Workshop(std::size_t cache_bytes = std::size_t(1) << 30) {
    std::string pattern = (fs::temp_directory_path() / "diorama_host_XXXXXX").string();
    folder = mkdtemp(pattern.data());
    for (const char* name : {"a.part", "b.BIG.PART", "c.txt", "broken.part"}) {
      std::ofstream(folder / name) << "x";
    }
    fs::create_symlink(folder / "a.part", folder / "same.part");
    registry.add_builtin(register_parts, "1.0.0");
    HostOptions options;
    options.assets_root = folder;
    options.threads = 2;
    options.asset_cache_bytes = cache_bytes;
    host = std::make_unique<HostServices>(
        registry, options, [this](LogLevel, std::string_view text) { log.emplace_back(text); });
  }
  ~Workshop() { fs::remove_all(folder); }

  fs::path folder;
  Registry registry{{}, ignore};
  std::vector<std::string> log;
  std::unique_ptr<HostServices> host;
  Scene scene;
};

}  // namespace

TEST_CASE("a loaded asset is copied with all that it carries, and shared", "[host]") {
  Workshop shop;
  const NodeId first = shop.host->load_asset("/a.part", shop.scene, shop.scene.root());
  const NodeId second = shop.host->load_asset("a.part", shop.scene, shop.scene.root());
  const NodeId third = shop.host->load_asset("same.part", shop.scene, first);
  CHECK(shop.log == std::vector<std::string>{"load " + (shop.folder / "a.part").string()});
  CHECK(shop.scene.path(first) == "/a");
  CHECK(shop.scene.path(second) == "/a_01");
  CHECK(shop.scene.path(third) == "/a/same");
  const NodeId lid = shop.scene.require("/a_01/lid");
  const Node& node = shop.scene[lid];
  CHECK(node.mesh == shop.scene[first].mesh);
  CHECK(node.materials.size() == 2);
  CHECK(node.materials[1] == shop.scene[shop.scene.require("/a/same/lid")].materials[0]);
  CHECK_FALSE(node.is_visible);
  CHECK(node.rigid_body->mass_kg == 7);
  CHECK(node.parent_from_node.translation() == Vec3(0, 0, 3));
  CHECK(node.parent_from_node.linear()(2, 2) == 2);
  CHECK(shop.scene.find("/a_01/lid/knob"));
  CHECK(shop.scene[second].labels.at("class") == "part");
}

TEST_CASE("a job's loader takes the place of the default one", "[host]") {
  Workshop shop;
  shop.host->use_loader("parts", std::make_unique<PartLoader>(PartLoader::Params{3.0}, *shop.host));
  shop.host->load_asset("a.part", shop.scene, shop.scene.root());
  CHECK(shop.scene[shop.scene.require("/a/lid")].rigid_body->mass_kg == 3.0);
}

TEST_CASE("an asset's files are those that the job's loader names", "[host]") {
  Workshop shop;
  CHECK(shop.host->loader_of("b.BIG.PART") == "parts");
  CHECK(shop.host->files_of("b.BIG.PART") ==
        std::vector<fs::path>{shop.folder / "b.BIG.PART", "7.kg"});
  shop.host->use_loader("parts", std::make_unique<PartLoader>(PartLoader::Params{3.0}, *shop.host));
  CHECK(shop.host->files_of("part:x/7") == std::vector<fs::path>{"part:x/7", "3.kg"});
  CHECK_FALSE(shop.host->loader_of("c.txt"));
  CHECK(shop.host->files_of("c.txt") == std::vector<fs::path>{shop.folder / "c.txt"});
}

TEST_CASE("files that components name are remembered until they are asked for", "[host]") {
  Workshop shop;
  for (const char* name : {"/c.txt", "/a.part", "/c.txt", "/"}) (void)shop.host->resolve(name);
  CHECK(shop.host->take_resolved() ==
        std::vector<fs::path>{shop.folder / "a.part", shop.folder / "c.txt"});
  CHECK(shop.host->take_resolved().empty());
  // A picture needs no loader.
  CHECK(shop.host->files_of((shop.folder / "c.txt").string()) ==
        std::vector<fs::path>{shop.folder / "c.txt"});
}

TEST_CASE("the longest claim takes the asset, in any case; schemes give names", "[host]") {
  Workshop shop;
  CHECK(shop.scene.path(shop.host->load_asset("b.BIG.PART", shop.scene, shop.scene.root())) ==
        "/b");
  CHECK(shop.scene.path(shop.host->load_asset("part:x/7", shop.scene, shop.scene.root())) ==
        "/part_x_7");
  CHECK(shop.log.back() == "load part:x/7");
}

TEST_CASE("files without an ending are taken by how they begin", "[host]") {
  Workshop shop;
  std::ofstream(shop.folder / "crate") << "PART and more";
  std::ofstream(shop.folder / "short") << "P";
  std::ofstream(shop.folder / "other") << "a PART";
  std::ofstream(shop.folder / "named.txt") << "PART";
  CHECK(shop.scene.path(shop.host->load_asset("crate", shop.scene, shop.scene.root())) == "/crate");
  CHECK(shop.host->loader_of("crate") == "parts");
  for (const char* name : {"short", "other", "named.txt"}) {
    INFO(name);
    CHECK_FALSE(shop.host->loader_of(name));
  }
  CHECK_THROWS_WITH(shop.host->load_asset("short", shop.scene, shop.scene.root()),
                    (shop.folder / "short").string() +
                        ": no loader reads a file without an ending that begins like this; there "
                        "are loaders for: .big.part .part");
}

TEST_CASE("the cache keeps to its bytes and drops what was unused longest", "[host]") {
  Workshop shop(250'000);  // two parts of some 100 kB
  const auto load = [&](const char* asset) {
    shop.host->load_asset(asset, shop.scene, shop.scene.root());
  };
  for (const char* asset : {"part:a", "part:b", "part:a", "part:c", "part:a", "part:b"})
    load(asset);
  CHECK(shop.log ==
        std::vector<std::string>{"load part:a", "load part:b", "load part:c", "load part:b"});
  Workshop small(1000);
  small.host->load_asset("part:a", small.scene, small.scene.root());
  small.host->load_asset("part:a", small.scene, small.scene.root());
  CHECK(small.log.size() == 2);
}

TEST_CASE("errors of loaders name loader and asset and leave the scene as it was", "[host]") {
  Workshop shop;
  CHECK_THROWS_WITH(shop.host->load_asset("broken.part", shop.scene, shop.scene.root()),
                    "loader 'parts': unexpected error: no parts left");
  CHECK(shop.scene[shop.scene.root()].children.empty());
  CHECK_THROWS_WITH(shop.host->load_asset("c.txt", shop.scene, shop.scene.root()),
                    (shop.folder / "c.txt").string() +
                        ": no loader reads '.txt' files; there are loaders for: .big.part .part");
}

TEST_CASE("folders list what some loader reads", "[host]") {
  Workshop shop;
  const std::vector<std::string> skip{"broken", "same"};
  CHECK(shop.host->list_assets(shop.folder.string(), skip) ==
        std::vector<fs::path>{shop.folder / "a.part", shop.folder / "b.BIG.PART"});
}

TEST_CASE("image files that cannot be read say so", "[host]") {
  Workshop shop;
  CHECK_THROWS_WITH(shop.host->read_texture(shop.folder / "none.png"),
                    (shop.folder / "none.png").string() +
                        ": the image cannot be read: No such file or directory");
  CHECK(shop.host->thread_count() == 2);
}

TEST_CASE("A picture that is in use is decoded once, and is that of the file as it is now",
          "[host]") {
  Workshop shop;
  const fs::path file = shop.folder / "picture.png";
  const auto write = [&](std::uint8_t grey) {
    const std::vector<std::uint8_t> pixels(6, grey);
    const auto bytes = shop.host->encode_image({pixels.data(), 2, 1, 3, 8}, ImageFormat::Png);
    std::ofstream(file, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
  };
  write(10);
  const auto first = shop.host->read_texture(file);
  CHECK(shop.host->read_texture(file) == first);
  write(200);
  const auto second = shop.host->read_texture(file);
  CHECK(second != first);
  CHECK(second->bytes.front() == 200);
  CHECK(first->bytes.front() == 10);
}

TEST_CASE("Copies of an asset have joints of their own, but for those that lead out of it",
          "[host]") {
  Scene from;
  const NodeId top = from.create(from.root(), "chest");
  const NodeId body = from.create(top, "body");
  const NodeId drawer = from.create(top, "drawer");
  const NodeId slide = from.create(top, "slide");
  const NodeId outer = from.create(top, "outer");
  Joint joint;
  joint.parent_body = body;
  joint.child_body = drawer;
  joint.upper = 0.3;
  joint.mimic = Joint::Mimic{slide, 2.0, 0.0};
  from.edit(slide).joint = joint;
  joint.parent_body = from.root();
  from.edit(outer).joint = joint;
  Scene to;
  to.create(to.root(), "else");
  for (const char* name : {"/one", "/two"}) {
    instantiate(from, top, to, to.root(), name + 1);
    const std::string path = name;
    const Joint& copy = *to[to.require(path + "/slide")].joint;
    CHECK(copy.parent_body == to.require(path + "/body"));
    CHECK(copy.child_body == to.require(path + "/drawer"));
    CHECK(copy.mimic->joint == to.require(path + "/slide"));
    CHECK(copy.upper == 0.3);
    CHECK_FALSE(to[to.require(path + "/outer")].joint);
  }
}
