// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "diorama/math.h"

namespace diorama {

enum class ColorSpace : std::uint8_t { Linear, Srgb };
enum class Wrap : std::uint8_t { Repeat, Clamp, Mirror, Black };

/// An image as a texture: rows from the top, `channels` interleaved values per pixel. Exactly one
/// of `bytes` and `floats` is filled. Immutable once in a scene; recognised by its address.
struct Texture {
  std::string name;  ///< For messages: the file it came from.
  int width = 0;
  int height = 0;
  int channels = 0;                             ///< 1 to 4.
  ColorSpace color_space = ColorSpace::Linear;  ///< Of the first three channels; alpha is linear.
  std::vector<std::uint8_t> bytes;              ///< 0..255 stands for 0..1.
  std::vector<float> floats;
};

/// A texture as one input of a material: value = texel * scale + bias, per channel, after
/// conversion to linear. `uv_from_mesh_uv` maps the mesh's uv before the lookup.
struct TextureInput {
  std::shared_ptr<const Texture> texture;  ///< Null: the input is not textured.
  Wrap wrap_u = Wrap::Repeat;
  Wrap wrap_v = Wrap::Repeat;
  int channel = 0;  ///< The channel that scalar inputs read; 3 is alpha.
  std::array<float, 4> scale{1, 1, 1, 1};
  std::array<float, 4> bias{0, 0, 0, 0};
  Eigen::Matrix<float, 2, 3> uv_from_mesh_uv = Eigen::Matrix<float, 2, 3>::Identity();
  explicit operator bool() const { return texture != nullptr; }
};

/// Metallic-roughness principled surface. A textured input replaces its constant, except where said
/// otherwise. Colours are linear Rec. 709.
struct Material {
  std::string name;
  Vec3f base_color = Vec3f::Constant(0.8f);
  TextureInput base_color_texture;  ///< Multiplied by base_color.
  float metallic = 0.0f;
  TextureInput metallic_texture;
  float roughness = 0.5f;  ///< Perceptual; GGX alpha is its square.
  TextureInput roughness_texture;
  /// Tangent space, +y up; values are -1..1 after scale and bias.
  TextureInput normal_texture;
  float ior = 1.5f;       ///< Sets the dielectric F0 and bends transmitted rays.
  float specular = 1.0f;  ///< Weight of the dielectric specular lobe.
  float clearcoat = 0.0f;
  float clearcoat_roughness = 0.01f;
  float transmission = 0.0f;  ///< 1: glass, tinted by base_color.
  /// Glass without a second surface (window panes): light passes straight.
  bool is_thin_walled = false;
  /// Below opacity_threshold (if > 0) the surface is absent, above it is opaque; without a
  /// threshold it is the share of light that meets the surface instead of passing straight through
  /// it.
  float opacity = 1.0f;
  TextureInput opacity_texture;
  float opacity_threshold = 0.0f;
  Vec3f emission = Vec3f::Zero();  ///< Radiance, both sides if the mesh is double sided.
  TextureInput emission_texture;   ///< Multiplied by emission.
};

}  // namespace diorama
