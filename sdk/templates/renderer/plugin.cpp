// SPDX-License-Identifier: @LICENCE@
// One ray per pixel against every triangle: exact ids and distances, a lamp at the camera for light.
// To be of use for large scenes it wants a tree over the triangles instead of one box per mesh.
#include <diorama/plugin.h>
#include <diorama/renderer.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace {

using diorama::Frame;
using diorama::Image;
using diorama::NodeId;
using diorama::Vec3;

struct Triangle {
  Vec3 a, ab, ac;  // world
};

struct Leaf {
  NodeId node;
  diorama::Aabb bounds;
  diorama::Vec3f color;
  std::vector<Triangle> triangles;
};

struct Hit {
  double distance = diorama::kInfinity;
  const Leaf* leaf = nullptr;
  Vec3 normal = Vec3::Zero();
};

// Moeller and Trumbore 1997.
double distance_to(const Triangle& triangle, const Vec3& origin, const Vec3& direction) {
  const Vec3 p = direction.cross(triangle.ac);
  const double determinant = triangle.ab.dot(p);
  if (determinant == 0.0) return diorama::kInfinity;
  const Vec3 from_a = origin - triangle.a;
  const double u = from_a.dot(p) / determinant;
  const Vec3 q = from_a.cross(triangle.ab);
  const double v = direction.dot(q) / determinant;
  if (u < 0.0 || v < 0.0 || u + v > 1.0) return diorama::kInfinity;
  const double distance = triangle.ac.dot(q) / determinant;
  return distance > 0.0 ? distance : diorama::kInfinity;
}

bool meets(const diorama::Aabb& box, const Vec3& origin, const Vec3& direction) {
  double from = 0.0, to = diorama::kInfinity;
  for (int axis = 0; axis < 3; ++axis) {
    // A ray along the slab gives infinities, or nan on its face, which the comparisons pass over.
    const double t1 = (box.min[axis] - origin[axis]) / direction[axis];
    const double t2 = (box.max[axis] - origin[axis]) / direction[axis];
    from = std::max(from, std::min(t1, t2));
    to = std::min(to, std::max(t1, t2));
  }
  return from <= to * (1.0 + 1e-12);
}

class @CLASS@ final : public diorama::Renderer {
 public:
  // Defaults are the field initialisers. visit() is the one list from which the program reads and
  // checks a job, describes the plugin and makes the JSON Schema.
  struct Params {
    double ambient = 0.2;
    void visit(diorama::ParamVisitor& v) {
      v.param("ambient", ambient, {"Light on surfaces seen edge on.", "", 0.0, 1.0});
    }
  };
  @CLASS@(Params params, diorama::Host& host) : params_(params), host_(host) {}

  diorama::NameSet provides() const override {
    return {std::string(diorama::kColor.name), std::string(diorama::kLeafId.name),
            std::string(diorama::kDistanceToCamera.name),
            std::string(diorama::kDistanceToImagePlane.name), std::string(diorama::kNormals.name)};
  }

 private:
  void do_prepare(const diorama::Scene& scene) override {
    leaves_.clear();
    for (const NodeId id : scene.subtree(scene.root())) {
      if (scene[id].mesh && scene.is_visible(id)) leaves_.push_back(leaf_of(scene, id));
    }
  }

  // The request was checked; the base class fills in the camera and the leaf paths.
  Frame do_render(const diorama::Scene& scene, const diorama::RenderRequest& request) override {
    const diorama::Camera& camera = *scene[request.camera].camera;
    const diorama::Affine world_from_camera = scene.world_from_node(request.camera);
    const int width = camera.width, height = camera.height;
    constexpr float kFar = std::numeric_limits<float>::infinity();

    Image<diorama::Rgba8> color(width, height, {0, 0, 0, 255});
    Image<std::uint32_t> ids(width, height, 0);
    Image<float> distance(width, height, kFar), depth(width, height, kFar);
    Image<diorama::Vec3f> normals(width, height, diorama::Vec3f::Zero());
    // Rows do not depend on each other, so any number of threads gives the same bytes.
    host_.parallel_for(std::size_t(height), [&](std::size_t row) {
      const int y = int(row);
      for (int x = 0; x < width; ++x) {
        const auto ray = diorama::ray_direction(camera, {x + 0.5, y + 0.5});
        if (!ray) continue;
        const Vec3 direction = (world_from_camera.linear() * *ray).normalized();
        const Hit hit = nearest(leaves_, world_from_camera.translation(), direction, camera, *ray);
        if (!hit.leaf) continue;
        ids.at(x, y) = hit.leaf->node.index;
        distance.at(x, y) = float(hit.distance);
        depth.at(x, y) = float(-ray->z() * hit.distance);
        normals.at(x, y) = hit.normal.cast<float>();
        color.at(x, y) = shade(*hit.leaf, -hit.normal.dot(direction));
      }
    });

    Frame frame;
    frame.set(diorama::kColor, std::move(color));
    frame.set(diorama::kLeafId, std::move(ids));
    frame.set(diorama::kDistanceToCamera, std::move(distance));
    frame.set(diorama::kDistanceToImagePlane, std::move(depth));
    frame.set(diorama::kNormals, std::move(normals));
    return frame;
  }

  // The same rays, against one instance at a time, in a picture three times as wide and high.
  std::vector<diorama::CoverageMask> do_cover(const diorama::Scene& scene, NodeId camera_node,
                                              std::span<const diorama::LabelledInstance> instances,
                                              bool with_distances) override {
    const diorama::Camera& camera = *scene[camera_node].camera;
    const diorama::Affine world_from_camera = scene.world_from_node(camera_node);
    const diorama::PixelBox reach{-camera.width, -camera.height, 2 * camera.width,
                                  2 * camera.height};
    std::vector<diorama::CoverageMask> masks(instances.size());
    host_.parallel_for(instances.size(), [&](std::size_t i) {
      std::vector<Leaf> leaves;
      for (const NodeId id : instances[i].leaves) leaves.push_back(leaf_of(scene, id));
      masks[i].box = reach;
      for (int y = reach.y_min; y < reach.y_max; ++y) {
        for (int x = reach.x_min; x < reach.x_max; ++x) {
          const auto ray = diorama::ray_direction(camera, {x + 0.5, y + 0.5});
          const Vec3 direction =
              ray ? (world_from_camera.linear() * *ray).normalized() : Vec3::Zero();
          Hit hit;
          if (ray) hit = nearest(leaves, world_from_camera.translation(), direction, camera, *ray);
          masks[i].bits.push_back(hit.leaf ? 1 : 0);
          if (with_distances) masks[i].distances.push_back(float(hit.distance));
        }
      }
    });
    return masks;
  }

  static Leaf leaf_of(const diorama::Scene& scene, NodeId id) {
    const diorama::Node& node = scene[id];
    const diorama::Affine world_from_node = scene.world_from_node(id);
    Leaf leaf;
    leaf.node = id;
    const bool has_material = !node.materials.empty() && node.materials.front();
    leaf.color = has_material ? node.materials.front()->base_color : diorama::Material().base_color;
    const auto point = [&](std::uint32_t index) {
      const Vec3 place = world_from_node * node.mesh->positions[index].cast<double>();
      leaf.bounds.add(place);
      return place;
    };
    for (const auto& [i, j, k] : node.mesh->triangles) {
      const Vec3 a = point(i), b = point(j), c = point(k);
      leaf.triangles.push_back({a, b - a, c - a});
    }
    return leaf;
  }

  // Only what lies between the camera's near and far planes is seen.
  static Hit nearest(const std::vector<Leaf>& leaves, const Vec3& origin, const Vec3& direction,
                     const diorama::Camera& camera, const Vec3& ray_camera) {
    const double along_axis = std::abs(ray_camera.z());
    Hit hit;
    for (const Leaf& leaf : leaves) {
      if (!meets(leaf.bounds, origin, direction)) continue;
      for (const Triangle& triangle : leaf.triangles) {
        const double distance = distance_to(triangle, origin, direction);
        const double depth = distance * along_axis;
        if (!(distance < hit.distance) || depth < camera.near_m || depth > camera.far_m) continue;
        hit = {distance, &leaf, triangle.ab.cross(triangle.ac).normalized()};
      }
    }
    if (hit.normal.dot(direction) > 0.0) hit.normal = -hit.normal;  // towards the camera
    return hit;
  }

  diorama::Rgba8 shade(const Leaf& leaf, double facing) const {
    const double light = params_.ambient + (1.0 - params_.ambient) * facing;
    diorama::Rgba8 pixel{0, 0, 0, 255};
    for (std::size_t i = 0; i < 3; ++i) {
      const float linear = std::clamp(float(light) * leaf.color[Eigen::Index(i)], 0.0f, 1.0f);
      pixel[i] = std::uint8_t(std::lround(255.0f * diorama::srgb_from_linear(linear)));
    }
    return pixel;
  }

  Params params_;
  diorama::Host& host_;
  std::vector<Leaf> leaves_;
};

}  // namespace

DIORAMA_PLUGIN("@NAME@", "0.1.0", "@LICENCE@") {
  DIORAMA_ADD(@CLASS@, "@NAME@", "Casts one ray per pixel, with a lamp at the camera.");
}
