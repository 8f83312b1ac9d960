// SPDX-License-Identifier: @LICENCE@
// Makes shelves out of boxes. A loader may read files as well: claim ".ending" instead of a scheme.
#include <diorama/loader.h>
#include <diorama/plugin.h>

#include <charconv>

namespace {

using diorama::NodeId;
using diorama::Vec3;

constexpr std::string_view kScheme = "@NAME@:";

class @CLASS@ final : public diorama::Loader {
 public:
  // Defaults are the field initialisers. visit() is the one list from which the program reads and
  // checks a job, describes the plugin and makes the JSON Schema.
  struct Params {
    int boards = 4;
    double width_m = 0.8;
    double depth_m = 0.3;
    double height_m = 1.6;
    void visit(diorama::ParamVisitor& v) {
      v.param("boards", boards, {"Boards of the shelf that a job asks for.", "", 2, 50});
      v.param("width_m", width_m, {"Width, along x.", "m", 0.1, 10.0});
      v.param("depth_m", depth_m, {"Depth, along y.", "m", 0.1, 10.0});
      v.param("height_m", height_m, {"Height, along z.", "m", 0.1, 10.0});
    }
  };
  @CLASS@(Params params, diorama::Host&) : params_(params) {}

  std::vector<std::string> claims() const override { return {std::string(kScheme)}; }
  std::vector<std::string> assets() const override {
    return {std::string(kScheme) + std::to_string(params_.boards)};
  }

  void load(std::string_view asset, diorama::Scene& scene, NodeId root) override {
    const int boards = boards_of(asset);
    scene.edit(root).labels = {{"class", "shelf"}};

    auto wood = std::make_shared<diorama::Material>();
    wood->name = "wood";
    wood->base_color = diorama::Vec3f(0.45f, 0.28f, 0.14f);
    wood->roughness = 0.6f;

    // Copies of a part share one mesh: it is stored and put into the renderer's tree once.
    const double inner = params_.width_m - 2.0 * kThickness;
    const auto side = std::make_shared<const diorama::Mesh>(
        diorama::make_box(Vec3(kThickness, params_.depth_m, params_.height_m)));
    const auto board = std::make_shared<const diorama::Mesh>(
        diorama::make_box(Vec3(inner, params_.depth_m, kThickness)));

    // It stands on the plane z = 0 of its node, with the front towards -y.
    const double x = 0.5 * (params_.width_m - kThickness);
    add_part(scene, root, "side", side, wood, Vec3(-x, 0, 0.5 * params_.height_m));
    add_part(scene, root, "side", side, wood, Vec3(x, 0, 0.5 * params_.height_m));
    for (int i = 0; i < boards; ++i) {
      const double share = double(i) / double(boards - 1);
      const double z = 0.5 * kThickness + share * (params_.height_m - kThickness);
      add_part(scene, root, "board", board, wood, Vec3(0, 0, z));
    }
  }

 private:
  static constexpr double kThickness = 0.02;

  // Messages begin with the asset's name and say what would be right.
  static int boards_of(std::string_view asset) {
    const std::string_view text = asset.substr(kScheme.size());
    int boards = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), boards);
    const bool is_number = error == std::errc() && end == text.data() + text.size();
    if (is_number && boards >= 2 && boards <= 50) return boards;
    throw diorama::Error(diorama::ErrorKind::Asset,
                         std::string(asset) + ": expected a number of boards in [2, 50]");
  }

  static void add_part(diorama::Scene& scene, NodeId root, const char* name,
                       std::shared_ptr<const diorama::Mesh> mesh,
                       std::shared_ptr<const diorama::Material> material, const Vec3& place) {
    const NodeId id = scene.create(root, name);
    scene.set_pose(id, diorama::Affine(Eigen::Translation3d(place)));
    diorama::Node& node = scene.edit(id);
    node.mesh = std::move(mesh);
    node.materials = {std::move(material)};
    node.collider = diorama::Collider{.shape = diorama::ColliderShape::BoundingBox};
  }

  Params params_;
};

}  // namespace

DIORAMA_PLUGIN("@NAME@", "0.1.0", "@LICENCE@") {
  DIORAMA_ADD_LOADER(@CLASS@, "@NAME@", "Makes shelves of boards.", "@NAME@:");
}
