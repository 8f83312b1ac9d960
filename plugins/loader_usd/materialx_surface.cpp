// SPDX-License-Identifier: Apache-2.0
#include "loader_usd/materialx_surface.h"

#include <algorithm>

namespace diorama::loader_usd {
namespace {

using usd::Prim;

constexpr int kMaxNodes = 32;

// What the surfaces call the same things, and what they take where nothing is said; null: there is
// no such input.
struct Model {
  const char* id;
  const char* base_color = "base_color";
  float default_base = 0.8f;
  const char* base_weight = nullptr;
  const char* metallic = nullptr;
  float default_metallic = 0.0f;
  const char* roughness = "specular_roughness";
  float default_roughness = 0.0f;
  const char* specular = nullptr;
  const char* ior = nullptr;
  const char* transmission = nullptr;
  const char* clearcoat = nullptr;
  const char* clearcoat_roughness = nullptr;
  float default_clearcoat_roughness = 0.0f;
  const char* emission_color = "emission_color";
  float default_emission = 1.0f;
  const char* emission_weight = nullptr;
  float default_emission_weight = 0.0f;
  const char* opacity = nullptr;
  const char* opacity_mode = nullptr;
  const char* thin_walled = nullptr;
  const char* normal = "normal";
};

constexpr Model kStandardSurface{
    .id = "ND_standard_surface_surfaceshader",
    .base_weight = "base",
    .metallic = "metalness",
    .default_roughness = 0.2f,
    .specular = "specular",
    .ior = "specular_IOR",
    .transmission = "transmission",
    .clearcoat = "coat",
    .clearcoat_roughness = "coat_roughness",
    .default_clearcoat_roughness = 0.1f,
    .emission_weight = "emission",
    .opacity = "opacity",
    .thin_walled = "thin_walled",
};

constexpr Model kOpenPbr{
    .id = "ND_open_pbr_surface_surfaceshader",
    .base_weight = "base_weight",
    .metallic = "base_metalness",
    .default_roughness = 0.3f,
    .specular = "specular_weight",
    .ior = "specular_ior",
    .transmission = "transmission_weight",
    .clearcoat = "coat_weight",
    .clearcoat_roughness = "coat_roughness",
    .emission_weight = "emission_luminance",
    .opacity = "geometry_opacity",
    .thin_walled = "geometry_thin_walled",
    .normal = "geometry_normal",
};

constexpr Model kGltf{
    .id = "ND_gltf_pbr_surfaceshader",
    .default_base = 1.0f,
    .metallic = "metallic",
    .default_metallic = 1.0f,
    .roughness = "roughness",
    .default_roughness = 1.0f,
    .specular = "specular",
    .ior = "ior",
    .transmission = "transmission",
    .clearcoat = "clearcoat",
    .clearcoat_roughness = "clearcoat_roughness",
    .emission_color = "emissive",
    .default_emission = 0.0f,
    .emission_weight = "emissive_strength",
    .default_emission_weight = 1.0f,
    .opacity = "alpha",
    .opacity_mode = "alpha_mode",
};

constexpr Model kModels[] = {kStandardSurface, kOpenPbr, kGltf};

const Model* find_model(const std::string& id) {
  const auto model = std::find_if(std::begin(kModels), std::end(kModels),
                                  [&](const Model& known) { return id.starts_with(known.id); });
  return model == std::end(kModels) ? nullptr : model;
}

Wrap to_wrap(const std::string& word) {
  if (word == "clamp") return Wrap::Clamp;
  if (word == "mirror") return Wrap::Mirror;
  if (word == "constant") return Wrap::Black;
  return Wrap::Repeat;
}

int to_channel(const std::string& output) {
  if (output.ends_with("g") || output.ends_with("y")) return 1;
  if (output.ends_with("b") || output.ends_with("z")) return 2;
  if (output == "a" || output == "outa" || output == "outw") return 3;
  return 0;
}

// A picture upstream of an input, and which of its channels the nodes between pick.
struct Picture {
  const Prim* node = nullptr;
  int channel = 0;
};

Picture find_picture(const ShaderNetwork& network, const Prim& shader, const std::string& input,
                     int& budget) {
  const ShaderNetwork::Source source = network.source(shader, input);
  if (!source.is_shader() || --budget < 0) return {};
  const std::string id = network.id(*source.prim);
  if (id.starts_with("ND_image_") || id.starts_with("ND_tiledimage_") ||
      id.starts_with("ND_gltf_colorimage") || id.starts_with("ND_gltf_image")) {
    return {source.prim, to_channel(source.output == "out" ? "" : source.output)};
  }
  for (const char* next : {"in", "in1", "in2", "fg", "bg", "mixcolor"}) {
    Picture found = find_picture(network, *source.prim, next, budget);
    if (!found.node) continue;
    if (id.starts_with("ND_separate")) found.channel = to_channel(source.output);
    if (id.starts_with("ND_extract")) {
      found.channel =
          static_cast<int>(std::clamp(network.number(*source.prim, "index", 0.0f), 0.0f, 3.0f));
    }
    return found;
  }
  return {};
}

// MaterialX says the space of a picture's colours as metadata of its file.
TextureSpace space_of(const ShaderNetwork& network, const Prim& node, bool is_data) {
  const usd::Value word = network.stage().property_metadata(node, "inputs:file", "colorSpace");
  const std::string name = word.as_text() ? *word.as_text() : "";
  if (name.find("srgb") != std::string::npos) return TextureSpace::Srgb;
  if (is_data || name == "raw" || name.starts_with("lin")) return TextureSpace::Raw;
  return TextureSpace::Auto;
}

bool connect(const Prim& shader, const char* name, TextureInput Material::*target, bool is_data,
             MaterialDraft& draft) {
  if (!name) return false;
  const ShaderNetwork& network = draft.network();
  int budget = kMaxNodes;
  const Picture picture = find_picture(network, shader, name, budget);
  if (!picture.node) return false;
  const Prim& node = *picture.node;
  const usd::FoundValue file = network.input(node, "file");
  if (!draft.connect(target, file, space_of(network, node, is_data))) return false;
  TextureInput& input = draft.material().*target;
  input.channel = picture.channel;
  input.wrap_u = to_wrap(network.text(node, "uaddressmode", "periodic"));
  input.wrap_v = to_wrap(network.text(node, "vaddressmode", "periodic"));
  const Vec2f tiling = network.pair(node, "uvtiling", Vec2f::Ones());
  const Vec2f offset = network.pair(node, "uvoffset", Vec2f::Zero());
  input.uv_from_mesh_uv = uv_map(tiling, 0.0f, offset);
  const ShaderNetwork::Source layout = network.source(node, "texcoord");
  if (layout.is_shader()) {
    const std::string primvar = network.text(*layout.prim, "geomprop", "");
    if (!primvar.empty()) draft.uv_names.push_back(primvar);
  }
  return true;
}

// glTF's alpha counts only where its mode says so.
void draft_opacity(const Prim& shader, const Model& model, MaterialDraft& draft) {
  enum Mode { kOpaque, kMask, kBlend };
  const ShaderNetwork& network = draft.network();
  const auto mode = model.opacity_mode
                        ? static_cast<int>(network.number(shader, model.opacity_mode, kOpaque))
                        : kBlend;
  if (mode == kOpaque) return;
  Material& material = draft.material();
  connect(shader, model.opacity, &Material::opacity_texture, true, draft);
  material.opacity = network.color(shader, model.opacity, Vec3f::Ones()).mean();
  if (mode == kMask) material.opacity_threshold = network.number(shader, "alpha_cutoff", 0.5f);
}

}  // namespace

bool is_materialx_surface(const std::string& id) { return find_model(id) != nullptr; }

void draft_materialx_surface(const Prim& shader, MaterialDraft& draft) {
  const ShaderNetwork& network = draft.network();
  const Model& model = *find_model(network.id(shader));
  Material& material = draft.material();
  const auto number = [&](const char* name, float fallback) {
    return name ? network.number(shader, name, fallback) : fallback;
  };
  const bool has_picture =
      connect(shader, model.base_color, &Material::base_color_texture, false, draft);
  const Vec3f base =
      has_picture ? Vec3f(Vec3f::Ones())
                  : network.color(shader, model.base_color, Vec3f::Constant(model.default_base));
  material.base_color = base * number(model.base_weight, 1.0f);
  connect(shader, model.metallic, &Material::metallic_texture, true, draft);
  material.metallic = number(model.metallic, model.default_metallic);
  connect(shader, model.roughness, &Material::roughness_texture, true, draft);
  material.roughness = number(model.roughness, model.default_roughness);
  material.specular = std::clamp(number(model.specular, 1.0f), 0.0f, 1.0f);
  material.ior = number(model.ior, 1.5f);
  material.transmission = number(model.transmission, 0.0f);
  material.is_thin_walled = model.thin_walled && network.boolean(shader, model.thin_walled, false);
  material.clearcoat = number(model.clearcoat, 0.0f);
  material.clearcoat_roughness =
      number(model.clearcoat_roughness, model.default_clearcoat_roughness);
  const bool glows =
      connect(shader, model.emission_color, &Material::emission_texture, false, draft);
  const Vec3f glow =
      glows ? Vec3f(Vec3f::Ones())
            : network.color(shader, model.emission_color, Vec3f::Constant(model.default_emission));
  material.emission = glow * number(model.emission_weight, model.default_emission_weight);
  draft_opacity(shader, model, draft);
  connect(shader, model.normal, &Material::normal_texture, true, draft);
  unpack_normals(material.normal_texture);
}

}  // namespace diorama::loader_usd
