// SPDX-License-Identifier: Apache-2.0
// A renderer that breaks nothing, and many that break one promise each.
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "diorama/plugin.h"
#include "diorama/renderer.h"

namespace diorama::test {

enum class Lie : std::uint8_t {
  None,
  PictureLeftRight,
  PictureUpsideDown,
  AllLeftRight,
  RowsFromBelow,
  MasksAllOnes,
  MasksOfTheWholeScene,
  MasksStopAtTheImage,
  DepthAlongTheRay,
  DistanceAlongTheAxis,
  CoverDepthAlongTheAxis,
  NormalsAway,
  NormalsInCameraSpace,
  NormalsInNodeSpace,
  PositionsInCameraSpace,
  HalfAPixelOff,
  PrincipalPointInTheCentre,
  NoDistortion,
  NoRoll,
  EncodedAlbedo,
  UvFromAbove,
  NoAlpha,
  ShowsHidden,
  ParentIds,
  OneFocalLength,
  SeesTooNear,
  CameraWithoutItsStand,
  CullsBackFaces,
  FirstMaterialOnly,
  NoTextures,
  NoColoursOfCorners,
  KeepsTheFirstPoses,
  KeepsWhatWasVisible,
  KeepsTheFirstMeshes,
  KeepsTheFirstPaint,
  KeepsTheFirstLens,
  CountsPictures,
  MillimetreDistances,
};

struct Hit {
  NodeId leaf;
  double distance = kInfinity;
  Vec3 position = Vec3::Zero();
  Vec3 normal = Vec3::Zero();
  Vec3 node_normal = Vec3::Zero();
  Vec2 uv = Vec2::Zero();
  Vec3f color = Vec3f::Zero();
};

template <Lie lie>
class Liar final : public Renderer {
 public:
  struct Params {
    void visit(ParamVisitor&) {}
  };
  Liar(Params, Host&) {}
  NameSet provides() const override {
    return {"color",
            "distance_to_camera",
            "distance_to_image_plane",
            "normals",
            "leaf_id",
            "position",
            "uv",
            "albedo"};
  }

 private:
  void do_prepare(const Scene& scene) override {
    if (lie == Lie::KeepsTheFirstPoses && !poses_.empty()) return;
    std::vector<std::pair<NodeId, Affine>> now;
    for (const NodeId node : scene.subtree(scene.root())) {
      if (!scene[node].mesh) continue;
      meshes_.emplace(node, scene[node].mesh);
      paints_.emplace(node, scene[node].materials);
      if (lie != Lie::ShowsHidden && !scene.is_visible(node)) {
        const auto was = std::ranges::find(poses_, node, &std::pair<NodeId, Affine>::first);
        if (lie != Lie::KeepsWhatWasVisible || was == poses_.end()) continue;
      }
      now.emplace_back(node, scene.world_from_node(node));
    }
    poses_ = std::move(now);
  }

  Frame do_render(const Scene& scene, const RenderRequest& request) override {
    Camera camera = *scene[request.camera].camera;
    if (lie == Lie::KeepsTheFirstLens) {
      camera = lenses_.emplace(std::pair(camera.width, camera.height), camera).first->second;
    }
    const int w = camera.width, h = camera.height;
    Image<Rgba8> color(w, h, {20, 30, 40, std::uint8_t(lie == Lie::NoAlpha ? 0 : 255)});
    Image<float> distance(w, h, std::numeric_limits<float>::infinity()), depth = distance;
    Image<Vec3f> normals(w, h, Vec3f::Zero()), positions = normals, albedo = normals;
    Image<Vec2f> uv(w, h, Vec2f::Zero());
    Image<std::uint32_t> ids(w, h, 0);
    const Affine world_from_camera = view_of(scene, request.camera);
    const Affine camera_from_world = world_from_camera.inverse();
    for (int y = 0; y < h; ++y) {
      for (int x = 0; x < w; ++x) {
        const Hit hit = look(scene, camera, world_from_camera, x, y, nullptr);
        if (!hit.leaf) continue;
        const int to_x = lie == Lie::AllLeftRight ? w - 1 - x : x;
        const int to_y = lie == Lie::RowsFromBelow ? h - 1 - y : y;
        const int color_x =
            lie == Lie::PictureLeftRight || lie == Lie::PictureUpsideDown ? w - 1 - to_x : to_x;
        const int color_y = lie == Lie::PictureUpsideDown ? h - 1 - to_y : to_y;
        const double along = -(camera_from_world * hit.position).z();
        for (std::size_t k = 0; k < 3; ++k) {
          color.at(color_x, color_y)[k] =
              std::uint8_t(255.0f * srgb_from_linear(hit.color[Eigen::Index(k)]));
        }
        const double unit = lie == Lie::MillimetreDistances ? 1000.0 : 1.0;
        distance.at(to_x, to_y) =
            float(unit * (lie == Lie::DistanceAlongTheAxis ? along : hit.distance));
        depth.at(to_x, to_y) = float(unit * (lie == Lie::DepthAlongTheRay ? hit.distance : along));
        normals.at(to_x, to_y) = told_normal(hit, world_from_camera).template cast<float>();
        const Vec3 place = lie == Lie::PositionsInCameraSpace
                               ? Vec3(camera_from_world * hit.position)
                               : hit.position;
        positions.at(to_x, to_y) = place.cast<float>();
        uv.at(to_x, to_y) = hit.uv.template cast<float>();
        if (lie == Lie::UvFromAbove) uv.at(to_x, to_y).y() = 1.0f - uv.at(to_x, to_y).y();
        for (int k = 0; k < 3; ++k) {
          albedo.at(to_x, to_y)[k] =
              lie == Lie::EncodedAlbedo ? srgb_from_linear(hit.color[k]) : hit.color[k];
        }
        ids.at(to_x, to_y) = lie == Lie::ParentIds && scene[hit.leaf].parent != scene.root()
                                 ? scene[hit.leaf].parent.index
                                 : hit.leaf.index;
      }
    }
    if (lie == Lie::CountsPictures) color.at(0, 0)[0] = std::uint8_t(++pictures_);
    Frame frame;
    frame.set(kColor, std::move(color));
    frame.set(kDistanceToCamera, std::move(distance));
    frame.set(kDistanceToImagePlane, std::move(depth));
    frame.set(kNormals, std::move(normals));
    frame.set(kPosition, std::move(positions));
    frame.set(kAlbedo, std::move(albedo));
    frame.set(kUv, std::move(uv));
    frame.set(kLeafId, std::move(ids));
    return frame;
  }

  std::vector<CoverageMask> do_cover(const Scene& scene, NodeId node,
                                     std::span<const LabelledInstance> instances,
                                     bool with_distances) override {
    const Camera camera = *scene[node].camera;
    const Affine world_from_camera = view_of(scene, node);
    const int w = camera.width, h = camera.height;
    std::vector<CoverageMask> masks;
    for (const LabelledInstance& instance : instances) {
      CoverageMask& mask = masks.emplace_back();
      mask.box =
          lie == Lie::MasksStopAtTheImage ? PixelBox{0, 0, w, h} : PixelBox{-w, -h, 2 * w, 2 * h};
      for (int y = mask.box.y_min; y < mask.box.y_max; ++y) {
        for (int x = mask.box.x_min; x < mask.box.x_max; ++x) {
          const Hit hit = look(scene, camera, world_from_camera, x, y,
                               lie == Lie::MasksOfTheWholeScene ? nullptr : &instance.leaves);
          mask.bits.push_back(hit.leaf || lie == Lie::MasksAllOnes ? 1 : 0);
          if (!with_distances) continue;
          const double along = -(world_from_camera.inverse() * hit.position).z();
          mask.distances.push_back(
              float(hit.leaf && lie == Lie::CoverDepthAlongTheAxis ? along : hit.distance));
        }
      }
    }
    return masks;
  }

  static Affine view_of(const Scene& scene, NodeId camera) {
    Affine view = scene.world_from_node(camera);
    if (lie == Lie::CameraWithoutItsStand) view = scene[camera].parent_from_node;
    if (lie == Lie::NoRoll) view.linear() = look_rotation(-view.linear().col(2)).toRotationMatrix();
    return view;
  }

  static Vec3 told_normal(const Hit& hit, const Affine& world_from_camera) {
    if (lie == Lie::NormalsAway) return -hit.normal;
    if (lie == Lie::NormalsInCameraSpace)
      return world_from_camera.linear().transpose() * hit.normal;
    if (lie == Lie::NormalsInNodeSpace) return hit.node_normal;
    return hit.normal;
  }

  Hit look(const Scene& scene, Camera camera, const Affine& world_from_camera, int x, int y,
           const std::vector<NodeId>* leaves) const {
    Hit hit;
    Vec2 pixel(x + 0.5, y + 0.5);
    if (lie == Lie::HalfAPixelOff) pixel = Vec2(x, y);
    if (lie == Lie::PrincipalPointInTheCentre) {
      camera.cx = camera.width / 2.0;
      camera.cy = camera.height / 2.0;
    }
    if (lie == Lie::OneFocalLength) camera.fy = camera.fx;
    if (lie == Lie::SeesTooNear) camera.near_m = 0.0;
    if (lie == Lie::NoDistortion) camera.lens = LensModel::Pinhole;
    const auto direction = ray_direction(camera, pixel);
    if (!direction) return hit;
    const Vec3 origin = world_from_camera.translation();
    const Vec3 ray = world_from_camera.linear() * *direction;
    const double slant = std::max(-direction->z(), 1e-6);
    for (const auto& [leaf, world_from_node] : poses_) {
      if (leaves && std::ranges::find(*leaves, leaf) == leaves->end()) continue;
      const Mesh& mesh = lie == Lie::KeepsTheFirstMeshes ? *meshes_.at(leaf) : *scene[leaf].mesh;
      const auto& paint = lie == Lie::KeepsTheFirstPaint ? paints_.at(leaf) : scene[leaf].materials;
      meet(mesh, paint, leaf, world_from_node, origin, ray, camera.near_m / slant, hit);
    }
    return hit;
  }

  using Paint = std::vector<std::shared_ptr<const Material>>;

  static void meet(const Mesh& mesh, const Paint& paint, NodeId leaf, const Affine& world_from_node,
                   const Vec3& origin, const Vec3& ray, double nearest, Hit& hit) {
    for (std::size_t number = 0; number < mesh.triangles.size(); ++number) {
      const auto& triangle = mesh.triangles[number];
      const auto corner = [&](std::size_t i) -> Vec3 {
        return world_from_node * mesh.positions[triangle[i]].cast<double>();
      };
      const Vec3 a = corner(0), b = corner(1), c = corner(2);
      Mat3 columns;
      columns << Vec3(b - a), Vec3(c - a), -ray;
      if (std::abs(columns.determinant()) < 1e-14) continue;
      const Vec3 uvt = columns.inverse() * (origin - a);
      if (uvt.x() < 0 || uvt.y() < 0 || uvt.x() + uvt.y() > 1) continue;
      if (uvt.z() < nearest || uvt.z() >= hit.distance) continue;
      const bool is_from_behind = (b - a).cross(c - a).dot(ray) > 0.0;
      if (lie == Lie::CullsBackFaces && is_from_behind) continue;
      hit.leaf = leaf;
      hit.distance = uvt.z();
      hit.position = origin + uvt.z() * ray;
      hit.normal = (b - a).cross(c - a).normalized();
      if (hit.normal.dot(ray) > 0.0) hit.normal = -hit.normal;
      hit.node_normal =
          mesh.normals.empty() ? hit.normal : Vec3(mesh.normals[triangle[0]].cast<double>());
      const auto uv_at = [&](std::size_t i) -> Vec2 {
        return mesh.uvs[triangle[i]].cast<double>();
      };
      hit.uv = (1.0 - uvt.x() - uvt.y()) * uv_at(0) + uvt.x() * uv_at(1) + uvt.y() * uv_at(2);
      hit.color = color_of(mesh, paint, number);
    }
  }

  static Vec3f color_of(const Mesh& mesh, const Paint& paint, std::size_t triangle) {
    if (paint.empty()) return Vec3f::Constant(0.8f);
    const bool has_slots = !mesh.material_slots.empty() && lie != Lie::FirstMaterialOnly;
    const Material& material = *paint[has_slots ? mesh.material_slots[triangle] : 0];
    Vec3f color = material.base_color;
    // The textures of the checks are of one colour.
    const auto& texture = material.base_color_texture.texture;
    for (int k = 0; texture && lie != Lie::NoTextures && k < 3; ++k) {
      color[k] *= linear_from_srgb(float(texture->bytes[std::size_t(k)]) / 255.0f);
    }
    if (mesh.colors.empty() || lie == Lie::NoColoursOfCorners) return color;
    return color.cwiseProduct(mesh.colors[mesh.triangles[triangle][0]]);
  }

  std::map<NodeId, std::shared_ptr<const Mesh>> meshes_;  // as they were first
  std::map<NodeId, Paint> paints_;
  std::map<std::pair<int, int>, Camera> lenses_;
  std::vector<std::pair<NodeId, Affine>> poses_;
  int pictures_ = 0;
};

}  // namespace diorama::test

DIORAMA_PLUGIN("lying_renderers", "1.0.0", "MIT") {
  using namespace diorama::test;
#define ADD_LIAR(LIE, TYPE) DIORAMA_ADD(Liar<Lie::LIE>, TYPE, "Casts rays, and may lie.")
  ADD_LIAR(None, "honest");
  ADD_LIAR(PictureLeftRight, "picture_left_right");
  ADD_LIAR(PictureUpsideDown, "picture_upside_down");
  ADD_LIAR(AllLeftRight, "all_left_right");
  ADD_LIAR(RowsFromBelow, "rows_from_below");
  ADD_LIAR(MasksAllOnes, "masks_all_ones");
  ADD_LIAR(MasksOfTheWholeScene, "masks_of_the_whole_scene");
  ADD_LIAR(MasksStopAtTheImage, "masks_stop_at_the_image");
  ADD_LIAR(DepthAlongTheRay, "depth_along_the_ray");
  ADD_LIAR(DistanceAlongTheAxis, "distance_along_the_axis");
  ADD_LIAR(CoverDepthAlongTheAxis, "cover_depth_along_the_axis");
  ADD_LIAR(NormalsAway, "normals_away");
  ADD_LIAR(NormalsInCameraSpace, "normals_in_camera_space");
  ADD_LIAR(NormalsInNodeSpace, "normals_in_node_space");
  ADD_LIAR(PositionsInCameraSpace, "positions_in_camera_space");
  ADD_LIAR(HalfAPixelOff, "half_a_pixel_off");
  ADD_LIAR(PrincipalPointInTheCentre, "principal_point_in_the_centre");
  ADD_LIAR(NoDistortion, "no_distortion");
  ADD_LIAR(NoRoll, "no_roll");
  ADD_LIAR(EncodedAlbedo, "encoded_albedo");
  ADD_LIAR(UvFromAbove, "uv_from_above");
  ADD_LIAR(NoAlpha, "no_alpha");
  ADD_LIAR(ShowsHidden, "shows_hidden");
  ADD_LIAR(ParentIds, "parent_ids");
  ADD_LIAR(OneFocalLength, "one_focal_length");
  ADD_LIAR(SeesTooNear, "sees_too_near");
  ADD_LIAR(CameraWithoutItsStand, "camera_without_its_stand");
  ADD_LIAR(CullsBackFaces, "culls_back_faces");
  ADD_LIAR(FirstMaterialOnly, "first_material_only");
  ADD_LIAR(NoTextures, "no_textures");
  ADD_LIAR(NoColoursOfCorners, "no_colours_of_corners");
  ADD_LIAR(KeepsTheFirstPoses, "keeps_the_first_poses");
  ADD_LIAR(KeepsWhatWasVisible, "keeps_what_was_visible");
  ADD_LIAR(KeepsTheFirstMeshes, "keeps_the_first_meshes");
  ADD_LIAR(KeepsTheFirstPaint, "keeps_the_first_paint");
  ADD_LIAR(KeepsTheFirstLens, "keeps_the_first_lens");
  ADD_LIAR(CountsPictures, "counts_pictures");
  ADD_LIAR(MillimetreDistances, "millimetre_distances");
#undef ADD_LIAR
}
