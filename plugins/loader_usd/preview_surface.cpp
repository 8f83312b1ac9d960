// SPDX-License-Identifier: Apache-2.0
#include "loader_usd/preview_surface.h"

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

namespace diorama::loader_usd {
namespace {

using usd::Prim;

constexpr int kMaxTransforms = 64;

Wrap to_wrap(const std::string& word) {
  if (word == "clamp") return Wrap::Clamp;
  if (word == "mirror") return Wrap::Mirror;
  if (word == "black") return Wrap::Black;
  return Wrap::Repeat;
}

int to_channel(const std::string& output) {
  if (output == "g" || output == "y") return 1;
  if (output == "b" || output == "z") return 2;
  if (output == "a" || output == "w") return 3;
  return 0;
}

// MaterialX spells the nodes of USD's preview surface with a prefix and a version behind.
bool is_node(const std::string& id, const std::string& name) {
  return id == name || id.starts_with("ND_" + name);
}

// The suffix says the type that is read.
bool is_primvar_reader(const std::string& id) {
  return id.starts_with("UsdPrimvarReader") || id.starts_with("ND_UsdPrimvarReader");
}

bool read4(const ShaderNetwork& network, const Prim& node, const char* name,
           std::array<float, 4>& list) {
  std::array<double, 4> value{};
  if (!network.input(node, name).value.read(value)) return false;
  std::transform(value.begin(), value.end(), list.begin(),
                 [](double number) { return static_cast<float>(number); });
  return true;
}

// What stands between a texture and its primvar.
void read_layout(const Prim& texture, MaterialDraft& draft, TextureInput& input) {
  const ShaderNetwork& network = draft.network();
  const Prim* at = &texture;
  std::string name = "st";
  for (int i = 0; i < kMaxTransforms; ++i) {
    const ShaderNetwork::Source source = network.source(*at, name);
    if (!source.is_shader()) return;
    const std::string id = network.id(*source.prim);
    if (is_node(id, "UsdTransform2d")) {
      const auto step = uv_map(network.pair(*source.prim, "scale", Vec2f::Ones()),
                               network.number(*source.prim, "rotation", 0.0f),
                               network.pair(*source.prim, "translation", Vec2f::Zero()));
      input.uv_from_mesh_uv = compose(input.uv_from_mesh_uv, step);
      at = source.prim;
      name = "in";
      continue;
    }
    if (is_primvar_reader(id)) {
      const std::string primvar = network.text(*source.prim, "varname", "");
      if (!primvar.empty()) draft.uv_names.push_back(primvar);
    }
    return;
  }
}

// `is_data`: numbers, not colours, so that "auto" does not mean a colour space.
bool connect(const Prim& shader, const std::string& name, TextureInput Material::*target,
             bool is_data, MaterialDraft& draft) {
  const ShaderNetwork& network = draft.network();
  const ShaderNetwork::Source source = network.source(shader, name);
  if (!source.is_shader() || !is_node(network.id(*source.prim), "UsdUVTexture")) return false;
  const Prim& node = *source.prim;
  const std::string word = network.text(node, "sourceColorSpace", "auto");
  const TextureSpace space = word == "sRGB"             ? TextureSpace::Srgb
                             : word == "raw" || is_data ? TextureSpace::Raw
                                                        : TextureSpace::Auto;
  if (!draft.connect(target, network.input(node, "file"), space)) return false;
  TextureInput& input = draft.material().*target;
  input.wrap_u = to_wrap(network.text(node, "wrapS", ""));
  input.wrap_v = to_wrap(network.text(node, "wrapT", ""));
  input.channel = to_channel(source.output);
  const bool has_scale = read4(network, node, "scale", input.scale);
  const bool has_bias = read4(network, node, "bias", input.bias);
  // Files often forget to say what eight bits stand for.
  const usd::FoundValue file = network.input(node, "file");
  const bool is_exr = file.value.as_text() && file.value.as_text()->ends_with(".exr");
  if (name == "normal" && !has_scale && !has_bias && !is_exr) unpack_normals(input);
  read_layout(node, draft, input);
  return true;
}

// What the node of a picture that cannot be read stands for, if it says so.
std::optional<std::array<float, 4>> picture_fallback(const ShaderNetwork& network,
                                                     const ShaderNetwork::Source& source) {
  std::array<float, 4> fallback{};
  const bool is_said = source.is_shader() && is_node(network.id(*source.prim), "UsdUVTexture") &&
                       read4(network, *source.prim, "fallback", fallback);
  return is_said ? std::optional(fallback) : std::nullopt;
}

// A colour that is not textured: a number, a primvar of the mesh, or what stands in for a picture.
Vec3f plain_color(const Prim& shader, const std::string& name, const Vec3f& otherwise,
                  const ShaderNetwork& network) {
  const ShaderNetwork::Source source = network.source(shader, name);
  if (const auto fallback = picture_fallback(network, source)) {
    return Vec3f((*fallback)[0], (*fallback)[1], (*fallback)[2]);
  }
  if (source.is_shader() && is_primvar_reader(network.id(*source.prim))) {
    return network.color(*source.prim, "fallback", Vec3f::Zero());
  }
  return network.color(source, otherwise);
}

float plain_number(const Prim& shader, const char* name, float otherwise,
                   const ShaderNetwork& network) {
  const ShaderNetwork::Source source = network.source(shader, name);
  const auto fallback = picture_fallback(network, source);
  if (!fallback) return network.number(source, otherwise);
  return (*fallback)[static_cast<std::size_t>(to_channel(source.output))];
}

bool reads_display_color(const Prim& shader, const std::string& name,
                         const ShaderNetwork& network) {
  const ShaderNetwork::Source source = network.source(shader, name);
  return source.is_shader() && is_primvar_reader(network.id(*source.prim)) &&
         network.text(*source.prim, "varname", "") == "displayColor";
}

}  // namespace

bool is_preview_surface(const std::string& id) { return is_node(id, "UsdPreviewSurface"); }

void draft_preview_surface(const Prim& shader, MaterialDraft& draft) {
  const ShaderNetwork& network = draft.network();
  Material& material = draft.material();
  const auto number = [&](const char* name, float fallback) {
    return plain_number(shader, name, fallback, network);
  };
  const bool is_specular = number("useSpecularWorkflow", 0.0f) != 0.0f;
  const bool has_picture =
      connect(shader, "diffuseColor", &Material::base_color_texture, false, draft);
  material.base_color = has_picture
                            ? Vec3f::Ones()
                            : plain_color(shader, "diffuseColor", Vec3f::Constant(0.18f), network);
  if (reads_display_color(shader, "diffuseColor", network)) {
    draft.display_color_fallback = std::exchange(material.base_color, Vec3f::Ones());
  }
  connect(shader, "roughness", &Material::roughness_texture, true, draft);
  material.roughness = number("roughness", 0.5f);
  if (is_specular) {
    // Dielectrics reflect (ior - 1)^2 / (ior + 1)^2; 0.04 of it is a specular weight of one.
    const float strength = network.color(shader, "specularColor", Vec3f::Zero()).mean() / 0.04f;
    material.specular = std::clamp(strength, 0.0f, 1.0f);
  } else {
    connect(shader, "metallic", &Material::metallic_texture, true, draft);
    material.metallic = number("metallic", 0.0f);
  }
  connect(shader, "normal", &Material::normal_texture, true, draft);
  material.ior = number("ior", 1.5f);
  material.clearcoat = number("clearcoat", 0.0f);
  material.clearcoat_roughness = number("clearcoatRoughness", 0.01f);
  const bool has_mask = connect(shader, "opacity", &Material::opacity_texture, true, draft);
  material.opacity = number("opacity", 1.0f);
  material.opacity_threshold = number("opacityThreshold", 0.0f);
  const bool glows = connect(shader, "emissiveColor", &Material::emission_texture, false, draft);
  material.emission =
      glows ? Vec3f::Ones() : plain_color(shader, "emissiveColor", Vec3f::Zero(), network);
  // An even opacity below one is glass: it still reflects, and what passes goes straight on; unless
  // it says how much of the surface there is.
  const bool is_presence = network.text(shader, "opacityMode", "transparent") == "presence";
  if (!is_presence && !has_mask && material.opacity < 1.0f && material.opacity_threshold <= 0.0f) {
    material.transmission = 1.0f - std::max(material.opacity, 0.0f);
    material.opacity = 1.0f;
    material.is_thin_walled = true;
    if (material.transmission > 0.99f) material.base_color = Vec3f::Ones();
  }
}

}  // namespace diorama::loader_usd
