// SPDX-License-Identifier: Apache-2.0
#include "loader_usd/light_translator.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "diorama/image.h"

namespace diorama::loader_usd {
namespace {

using usd::Prim;
using usd::Stage;

// Lights without a size would have no surface to shine from.
constexpr double kLeastRadius = 1e-3;
// A full sun, 0.53 degrees.
constexpr double kSunAngle = 0.53;

// Inputs have been called `inputs:x` since USD 21.02 and plainly `x` before.
class Inputs {
 public:
  Inputs(const Stage& stage, const Prim& prim) : stage_(stage), prim_(prim) {}

  std::string name(const std::string& plain) const {
    const std::string with_prefix = "inputs:" + plain;
    return stage_.has_property(prim_, with_prefix) ? with_prefix : plain;
  }
  double number(const char* plain, double fallback) const {
    const double value = usd::number_or(stage_, prim_, name(plain), fallback);
    return std::isfinite(value) ? value : fallback;
  }
  bool boolean(const char* plain, bool fallback) const {
    return usd::bool_or(stage_, prim_, name(plain), fallback);
  }
  Vec3f color() const {
    const auto value = usd::vector3(stage_, prim_, name("color"));
    if (!value) return Vec3f::Ones();
    return Vec3f(static_cast<float>((*value)[0]), static_cast<float>((*value)[1]),
                 static_cast<float>((*value)[2]));
  }

 private:
  const Stage& stage_;
  const Prim& prim_;
};

// Colour of a black body in linear Rec. 709, scaled to a luminance of one: CIE 1931 chromaticity of
// the Planckian locus after Kim et al., "Design of Advanced Color Temperature Control System"
// (2002).
Vec3f black_body(double kelvin) {
  const double t = std::clamp(kelvin, 1667.0, 25000.0);
  const double x =
      t <= 4000.0 ? -0.2661239e9 / (t * t * t) - 0.2343589e6 / (t * t) + 0.8776956e3 / t + 0.179910
                  : -3.0258469e9 / (t * t * t) + 2.1070379e6 / (t * t) + 0.2226347e3 / t + 0.240390;
  double y = 0.0;
  if (t <= 2222.0) {
    y = -1.1063814 * x * x * x - 1.34811020 * x * x + 2.18555832 * x - 0.20219683;
  } else if (t <= 4000.0) {
    y = -0.9549476 * x * x * x - 1.37418593 * x * x + 2.09137015 * x - 0.16748867;
  } else {
    y = 3.0817580 * x * x * x - 5.87338670 * x * x + 3.75112997 * x - 0.37001483;
  }
  const double big_x = x / y;
  const double big_z = (1.0 - x - y) / y;
  Vec3f rgb(static_cast<float>(3.2404542 * big_x - 1.5371385 - 0.4985314 * big_z),
            static_cast<float>(-0.9692660 * big_x + 1.8760108 + 0.0415560 * big_z),
            static_cast<float>(0.0556434 * big_x - 0.2040259 + 1.0572252 * big_z));
  return rgb.cwiseMax(0.0f);
}

Vec3f emission(const Inputs& inputs, double fallback_intensity) {
  Vec3f color = inputs.color();
  if (inputs.boolean("enableColorTemperature", false)) {
    color = color.cwiseProduct(black_body(inputs.number("colorTemperature", 6500.0)));
  }
  const double strength =
      inputs.number("intensity", fallback_intensity) * std::exp2(inputs.number("exposure", 0.0));
  color *= static_cast<float>(std::max(strength, 0.0));
  return color.allFinite() ? Vec3f(color.cwiseMax(0.0f)) : Vec3f::Zero();
}

// Emitting area in stage units; also sets the size.
double read_size(const std::string& type, const Inputs& inputs, double world_scale, Light& light) {
  const double area_scale = world_scale * world_scale;
  if (type == "RectLight") {
    light.kind = LightKind::Rect;
    light.width_m = std::max(std::abs(inputs.number("width", 1.0)), kLeastRadius);
    light.height_m = std::max(std::abs(inputs.number("height", 1.0)), kLeastRadius);
    return light.width_m * light.height_m * area_scale;
  }
  const double radius = std::max(std::abs(inputs.number("radius", 0.5)), kLeastRadius);
  light.radius_m = radius;
  if (type == "DiskLight") {
    light.kind = LightKind::Disk;
    return kPi * radius * radius * area_scale;
  }
  light.kind = LightKind::Sphere;
  double area = 4.0 * kPi * radius * radius;
  if (type == "CylinderLight") {
    area = 2.0 * kPi * radius * std::abs(inputs.number("length", 1.0));
    light.radius_m = std::max(std::sqrt(area / (4.0 * kPi)), kLeastRadius);
  }
  return area * area_scale;
}

void read_shaping(const Stage& stage, const Prim& prim, const Inputs& inputs, Light& light) {
  const std::string cone = inputs.name("shaping:cone:angle");
  if (!stage.has_property(prim, cone)) return;
  const double degrees = inputs.number("shaping:cone:angle", 90.0);
  if (degrees >= 180.0) return;
  light.cone_angle_rad = std::max(degrees, 0.0) * kPi / 180.0;
  light.cone_softness = std::clamp(inputs.number("shaping:cone:softness", 0.0), 0.0, 1.0);
}

// What the light says and the scene cannot hold.
std::vector<std::string> find_losses(const Stage& stage, const Prim& prim, const Inputs& inputs) {
  std::vector<std::string> losses;
  const auto lose = [&](const std::string& name) { losses.push_back(name + " is not taken"); };
  for (const auto& [name, fallback] :
       {std::pair("diffuse", 1.0), std::pair("specular", 1.0), std::pair("shaping:focus", 0.0)}) {
    if (inputs.number(name, fallback) != fallback) lose(inputs.name(name));
  }
  const usd::Value profile = stage.value(prim, inputs.name("shaping:ies:file"));
  if (profile.as_text() && !profile.as_text()->empty()) lose(inputs.name("shaping:ies:file"));
  if (!inputs.boolean("shadow:enable", true)) lose(inputs.name("shadow:enable"));
  for (const char* name :
       {"light:filters", "collection:lightLink:includes", "collection:lightLink:excludes",
        "collection:shadowLink:includes", "collection:shadowLink:excludes"}) {
    if (!stage.targets(prim, name).empty()) lose(name);
  }
  return losses;
}

Vec3f mean_color(const Texture& texture) {
  std::array<double, 256> linear{};
  for (std::size_t i = 0; i < linear.size(); ++i) {
    const float value = float(i) / 255.0f;
    linear[i] = texture.color_space == ColorSpace::Srgb ? linear_from_srgb(value) : value;
  }
  const auto channels = static_cast<std::size_t>(texture.channels);
  const std::size_t pixels = std::max(texture.bytes.size(), texture.floats.size()) / channels;
  Vec3 sum = Vec3::Zero();
  for (std::size_t i = 0; i < pixels; ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      const std::size_t at = i * channels + (channels < 3 ? 0 : c);
      const double value = texture.floats.empty() ? linear[texture.bytes[at]]
                                                  : static_cast<double>(texture.floats[at]);
      sum[Eigen::Index(c)] += std::isfinite(value) ? value : 0.0;
    }
  }
  return pixels == 0 ? Vec3f::Ones() : Vec3f((sum / double(pixels)).cast<float>());
}

// The scene's rectangles have no pictures; its mean colour keeps the light that one gives.
void read_rect_picture(const Stage& stage, const Prim& prim, const Inputs& inputs,
                       TextureLibrary& textures, TranslatedLight& result) {
  const auto file = stage.find_value(prim, inputs.name("texture:file"));
  if (!file.value.as_text() || file.value.as_text()->empty()) return;
  const auto texture = textures.read(file, TextureSpace::Auto, "").texture;
  if (!texture) return;
  result.light.color = result.light.color.cwiseProduct(mean_color(*texture));
  result.losses.push_back("picture is taken as its mean color");
}

// USD's dome has its pole at +y and the middle of the image at +z; ours has them at +z and +x.
Affine prim_from_dome() {
  Affine turn = Affine::Identity();
  turn.linear() << 0, 1, 0, 0, 0, 1, 1, 0, 0;
  return turn;
}

}  // namespace

std::optional<TranslatedLight> translate_light(const Stage& stage, const Prim& prim,
                                               double world_scale, TextureLibrary& textures) {
  if (!prim.traits.is_light) return std::nullopt;
  const Inputs inputs(stage, prim);
  const std::string& type = prim.type_name;
  TranslatedLight result;
  Light& light = result.light;
  const bool is_normalized = inputs.boolean("normalize", false);
  result.losses = find_losses(stage, prim, inputs);
  if (type == "DistantLight") {
    light.kind = LightKind::Distant;
    const double degrees = std::clamp(inputs.number("angle", kSunAngle), 0.0, 180.0);
    light.angle_rad = degrees * kPi / 180.0;
    light.color = emission(inputs, 50000.0);
    // The radiance fills a cone; what arrives at a surface that faces it is its projected solid
    // angle.
    const double half_sine = std::sin(0.5 * light.angle_rad);
    const double solid_angle = kPi * half_sine * half_sine;
    if (!is_normalized && solid_angle > 0.0) light.color *= static_cast<float>(solid_angle);
    return result;
  }
  light.color = emission(inputs, 1.0);
  if (type == "DomeLight" || type == "DomeLight_1") {
    light.kind = LightKind::Dome;
    light.texture =
        textures.read(stage.find_value(prim, inputs.name("texture:file")), TextureSpace::Auto, "")
            .texture;
    result.prim_from_light = prim_from_dome();
    const std::string format =
        usd::token_or(stage, prim, inputs.name("texture:format"), "automatic");
    if (light.texture && format != "automatic" && format != "latlong") {
      result.losses.push_back(inputs.name("texture:format") + " is taken as latlong");
    }
    return result;
  }
  const bool has_size = type == "SphereLight" || type == "DiskLight" || type == "RectLight" ||
                        type == "CylinderLight";
  if (!has_size) return std::nullopt;
  const double area = read_size(type, inputs, world_scale, light);
  if (is_normalized && area > 0.0) light.color /= static_cast<float>(area);
  read_shaping(stage, prim, inputs, light);
  if (type == "RectLight") read_rect_picture(stage, prim, inputs, textures, result);
  return result;
}

MeshLight translate_mesh_light(const Stage& stage, const Prim& prim, const Mesh& mesh,
                               double world_scale) {
  const Inputs inputs(stage, prim);
  MeshLight light;
  light.emission = emission(inputs, 1.0);
  light.sync_mode = usd::token_or(stage, prim, "light:materialSyncMode", "materialGlowTintsLight");
  light.losses = find_losses(stage, prim, inputs);
  if (!inputs.boolean("normalize", false)) return light;
  double area = 0.0;
  for (const auto& [a, b, c] : mesh.triangles) {
    const Vec3 origin = mesh.positions[a].cast<double>();
    area += 0.5 * (mesh.positions[b].cast<double>() - origin)
                      .cross(mesh.positions[c].cast<double>() - origin)
                      .norm();
  }
  area *= world_scale * world_scale;
  if (area > 0.0 && std::isfinite(area)) light.emission /= static_cast<float>(area);
  return light;
}

Material shining_material(const Material& material, const MeshLight& light) {
  if (light.sync_mode == "noMaterialResponse") {
    Material shining;
    shining.name = material.name;
    shining.base_color = Vec3f::Zero();
    shining.specular = 0.0f;
    shining.emission = light.emission;
    return shining;
  }
  Material shining = material;
  const bool is_tinted = light.sync_mode != "independent" && !material.emission.isZero();
  if (!is_tinted) shining.emission_texture = {};
  shining.emission =
      is_tinted ? Vec3f(material.emission.cwiseProduct(light.emission)) : light.emission;
  return shining;
}

}  // namespace diorama::loader_usd
