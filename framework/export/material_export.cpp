// SPDX-License-Identifier: Apache-2.0
#include "framework/export/material_export.h"

#include <cmath>
#include <utility>

namespace diorama::usd_export {
namespace {

const char* wrap_word(Wrap wrap) {
  switch (wrap) {
    case Wrap::Clamp:
      return "clamp";
    case Wrap::Mirror:
      return "mirror";
    case Wrap::Black:
      return "black";
    case Wrap::Repeat:
      break;
  }
  return "repeat";
}

Prim shader(const std::string& name, const std::string& id) {
  Prim prim;
  prim.name = name;
  prim.type = "Shader";
  prim.set_uniform("info:id", "token", Token{id});
  return prim;
}

/// Builds the network of one material.
class Network {
 public:
  Network(std::string path, std::string thing, TextureNames& textures)
      : path_(std::move(path)), thing_(std::move(thing)), textures_(textures) {}

  /// An input of the surface, textured or not. `factor` multiplies the texture.
  void add_color(Prim& surface, const std::string& input, const Vec3f& constant,
                 const TextureInput& texture, const char* pass, const Vec3f& factor) {
    if (!texture) return surface.set("inputs:" + input, "color3f", constant);
    Float4 scale = texture.scale, bias = texture.bias;
    for (std::size_t c = 0; c < 3; ++c) {
      scale[c] *= factor[Eigen::Index(c)];
      bias[c] *= factor[Eigen::Index(c)];
    }
    surface.connect("inputs:" + input, "color3f", read_texture(texture, scale, bias, pass, "rgb"));
  }
  void add_number(Prim& surface, const std::string& input, float constant,
                  const TextureInput& texture, const char* pass) {
    if (!texture) return surface.set("inputs:" + input, "float", constant);
    static constexpr std::array<const char*, 4> kOutputs{"r", "g", "b", "a"};
    surface.connect("inputs:" + input, "float",
                    read_texture(texture, texture.scale, texture.bias, pass,
                                 kOutputs[std::size_t(texture.channel)]));
  }
  void add_normal(Prim& surface, const TextureInput& texture) {
    if (!texture) return;
    surface.connect("inputs:normal", "normal3f",
                    read_texture(texture, texture.scale, texture.bias, "NORMAL", "rgb"));
  }
  std::vector<Prim> take() { return std::move(shaders_); }

 private:
  std::string read_texture(const TextureInput& input, const Float4& scale, const Float4& bias,
                           const std::string& pass, const std::string& output) {
    Prim node = shader(pass + "_node", "UsdUVTexture");
    node.set("inputs:file", "asset", textures_.name(input.texture, thing_, pass));
    node.set("inputs:sourceColorSpace", "token",
             Token{input.texture->color_space == ColorSpace::Srgb ? "sRGB" : "raw"});
    node.connect("inputs:st", "float2", coordinates(input, pass));
    node.set("inputs:wrapS", "token", Token{wrap_word(input.wrap_u)});
    node.set("inputs:wrapT", "token", Token{wrap_word(input.wrap_v)});
    node.set("inputs:scale", "float4", scale);
    node.set("inputs:bias", "float4", bias);
    Property out;
    out.name = "outputs:" + output;
    out.type = output == "rgb" ? "float3" : "float";
    node.properties.push_back(out);
    shaders_.push_back(std::move(node));
    return path_ + "/" + pass + "_node.outputs:" + output;
  }

  /// The primvar reader, and behind it a map of the coordinates where they are mapped.
  std::string coordinates(const TextureInput& input, const std::string& pass) {
    if (!has_reader_) {
      Prim reader = shader("uvmap", "UsdPrimvarReader_float2");
      reader.set("inputs:varname", "string", std::string("st"));
      Property out;
      out.name = "outputs:result";
      out.type = "float2";
      reader.properties.push_back(out);
      shaders_.push_back(std::move(reader));
      has_reader_ = true;
    }
    const auto& map = input.uv_from_mesh_uv;
    if (map == Eigen::Matrix<float, 2, 3>::Identity()) return path_ + "/uvmap.outputs:result";
    const float scale_u = map.col(0).norm();
    const float angle = std::atan2(map(1, 0), map(0, 0));
    const float scale_v = (map(0, 0) * map(1, 1) - map(0, 1) * map(1, 0)) / scale_u;
    Prim transform = shader(pass + "_place", "UsdTransform2d");
    transform.connect("inputs:in", "float2", path_ + "/uvmap.outputs:result");
    transform.set("inputs:rotation", "float", angle * float(180 / kPi));
    transform.set("inputs:scale", "float2", Vec2f(scale_u, scale_v));
    transform.set("inputs:translation", "float2", Vec2f(map.col(2)));
    Property out;
    out.name = "outputs:result";
    out.type = "float2";
    transform.properties.push_back(out);
    shaders_.push_back(std::move(transform));
    return path_ + "/" + pass + "_place.outputs:result";
  }

  std::string path_;
  std::string thing_;
  TextureNames& textures_;
  std::vector<Prim> shaders_;
  bool has_reader_ = false;
};

}  // namespace

void Prim::set(std::string property, std::string property_type, Value new_value) {
  Property p;
  p.name = std::move(property);
  p.type = std::move(property_type);
  p.value = std::move(new_value);
  properties.push_back(std::move(p));
}

void Prim::set_uniform(std::string property, std::string property_type, Value new_value) {
  set(std::move(property), std::move(property_type), std::move(new_value));
  properties.back().is_uniform = true;
}

void Prim::connect(std::string property, std::string property_type, std::string target) {
  Property p;
  p.name = std::move(property);
  p.type = std::move(property_type);
  p.targets.push_back(std::move(target));
  properties.push_back(std::move(p));
}

void Prim::relate(std::string property, std::string target) {
  connect(std::move(property), "", std::move(target));
}

TextureNames::TextureNames(std::string folder, std::string stem)
    : folder_(std::move(folder)), stem_(std::move(stem)) {}

AssetPath TextureNames::name(const std::shared_ptr<const Texture>& texture,
                             const std::string& thing, const std::string& pass) {
  const auto [entry, is_new] = known_.try_emplace(texture.get(), files_.size());
  if (is_new) {
    std::string base = stem_ + "_" + thing + "_" + pass;
    if (const int times = taken_[base]++; times > 0) base += "_" + std::to_string(times);
    files_.push_back({folder_ + "/" + base + (texture->floats.empty() ? ".png" : ".hdr"), texture});
  }
  return {"./" + files_[entry->second].name};
}

Prim material_prim(const Material& material, const std::string& name, const std::string& path,
                   TextureNames& textures) {
  Prim prim;
  prim.name = name;
  prim.type = "Material";
  Network network(path, name, textures);
  Prim surface = shader("Principled_BSDF", "UsdPreviewSurface");
  network.add_color(surface, "diffuseColor", material.base_color, material.base_color_texture,
                    "DIFFUSE", material.base_color);
  network.add_number(surface, "roughness", material.roughness, material.roughness_texture,
                     "ROUGHNESS");
  network.add_number(surface, "metallic", material.metallic, material.metallic_texture, "METAL");
  network.add_normal(surface, material.normal_texture);
  network.add_number(surface, "opacity",
                     material.transmission > 0 ? 1 - material.transmission : material.opacity,
                     material.opacity_texture, "OPACITY");
  if (material.opacity_threshold > 0) {
    surface.set("inputs:opacityThreshold", "float", material.opacity_threshold);
  }
  if (material.emission != Vec3f::Zero() || material.emission_texture) {
    network.add_color(surface, "emissiveColor", material.emission, material.emission_texture,
                      "EMIT", material.emission);
  }
  surface.set("inputs:ior", "float", material.ior);
  surface.set("inputs:clearcoat", "float", material.clearcoat);
  surface.set("inputs:clearcoatRoughness", "float", material.clearcoat_roughness);
  Property out;
  out.name = "outputs:surface";
  out.type = "token";
  surface.properties.push_back(out);
  prim.connect("outputs:surface", "token", path + "/Principled_BSDF.outputs:surface");
  prim.children = network.take();
  prim.children.insert(prim.children.begin(), std::move(surface));
  return prim;
}

std::string prim_name(const std::string& text) {
  std::string name;
  for (const char c : text) {
    const bool is_plain =
        (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
    name += is_plain ? c : '_';
  }
  if (name.empty() || (name[0] >= '0' && name[0] <= '9')) name.insert(0, "_");
  return name;
}

}  // namespace diorama::usd_export
