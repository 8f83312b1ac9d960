// SPDX-License-Identifier: Apache-2.0
#include "loader_usd/corner_data.h"

#include <utility>

namespace diorama::loader_usd {
namespace {

std::optional<Interpolation> interpolation_of(const std::string& name) {
  if (name == "constant") return Interpolation::Constant;
  if (name == "uniform") return Interpolation::Uniform;
  if (name == "vertex") return Interpolation::Vertex;
  if (name == "varying") return Interpolation::Varying;
  if (name == "faceVarying") return Interpolation::FaceVarying;
  return std::nullopt;
}

}  // namespace

std::optional<CornerData> read_corner_data(const usd::Stage& stage, const usd::Prim& prim,
                                           const std::string& name, std::size_t width,
                                           const std::string& fallback) {
  auto values = usd::numbers<float>(stage.value(prim, name), width);
  if (!values || values->span.empty()) return std::nullopt;
  const usd::Value word = stage.property_metadata(prim, name, "interpolation");
  const auto interpolation = interpolation_of(word.as_text() ? *word.as_text() : fallback);
  if (!interpolation) return std::nullopt;
  CornerData data;
  data.values = std::move(*values);
  data.interpolation = *interpolation;
  data.width = width;
  data.indices = usd::numbers<std::int32_t>(stage.value(prim, name + ":indices"), 1);
  return data;
}

}  // namespace diorama::loader_usd
