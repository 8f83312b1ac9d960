// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "loader_usd/usd/stage.h"
#include "loader_usd/usd/value.h"

namespace diorama::loader_usd {

enum class Interpolation { Constant, Uniform, Vertex, Varying, FaceVarying };

/// One attribute of a mesh, of curves or of points: `width` floats for each of its elements.
struct CornerData {
  usd::Numbers<float> values;
  std::optional<usd::Numbers<std::int32_t>> indices;
  Interpolation interpolation = Interpolation::Constant;
  std::size_t width = 0;

  std::size_t count() const { return indices ? indices->span.size() : values.span.size() / width; }
  /// The values of an element; null when the data are too short for it.
  const float* element(std::size_t i) const {
    if (indices) {
      if (i >= indices->span.size() || indices->span[i] < 0) return nullptr;
      i = static_cast<std::size_t>(indices->span[i]);
    }
    const std::size_t begin = i * width;
    return begin + width <= values.span.size() ? values.span.data() + begin : nullptr;
  }
  /// The values of a mesh's corner; on a mesh, varying is the same as vertex.
  const float* at(std::size_t face, std::size_t point, std::size_t corner) const {
    switch (interpolation) {
      case Interpolation::Uniform:
        return element(face);
      case Interpolation::Vertex:
      case Interpolation::Varying:
        return element(point);
      case Interpolation::FaceVarying:
        return element(corner);
      default:
        return element(0);
    }
  }
};

/// `fallback`: the interpolation where none is authored. Nothing when there are no values or the
/// interpolation is unknown.
std::optional<CornerData> read_corner_data(const usd::Stage& stage, const usd::Prim& prim,
                                           const std::string& name, std::size_t width,
                                           const std::string& fallback);

}  // namespace diorama::loader_usd
