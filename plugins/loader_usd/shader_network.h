// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "diorama/math.h"
#include "loader_usd/usd/stage.h"

namespace diorama::loader_usd {

/// Looks up the inputs of shaders, through materials and node graphs.
class ShaderNetwork {
 public:
  /// Where an input gets its value from: an output of a shader, or a value.
  struct Source {
    const usd::Prim* prim = nullptr;
    std::string attribute;  ///< Of a value.
    std::string output;     ///< Of a shader: `rgb`; empty for a value.
    bool is_shader() const { return prim && !output.empty(); }
  };

  explicit ShaderNetwork(usd::Stage& stage) : stage_(stage) {}

  usd::Stage& stage() const { return stage_; }
  Source follow(const usd::Prim& prim, const std::string& attribute) const;
  /// What an input of a shader, named without `inputs:`, is connected to.
  Source source(const usd::Prim& shader, const std::string& input) const;
  /// The shader at a material's output; null when there is none.
  const usd::Prim* surface(const usd::Prim& material, std::string_view output) const;
  /// `UsdPreviewSurface`; empty for shaders that are told otherwise.
  std::string id(const usd::Prim& shader) const;

  usd::FoundValue input(const usd::Prim& shader, const std::string& name) const;
  /// Nothing when the source is a shader.
  usd::FoundValue value(const Source& source) const;
  std::string text(const usd::Prim& shader, const std::string& name,
                   const std::string& fallback) const;
  float number(const usd::Prim& shader, const std::string& name, float fallback) const;
  float number(const Source& source, float fallback) const;
  bool boolean(const usd::Prim& shader, const std::string& name, bool fallback) const;
  Vec2f pair(const usd::Prim& shader, const std::string& name, const Vec2f& fallback) const;
  Vec3f color(const usd::Prim& shader, const std::string& name, const Vec3f& fallback) const;
  Vec3f color(const Source& source, const Vec3f& fallback) const;

 private:
  usd::Stage& stage_;
};

}  // namespace diorama::loader_usd
