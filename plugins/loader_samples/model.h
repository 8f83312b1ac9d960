// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "diorama/host.h"
#include "diorama/rng.h"
#include "modelling/canvas.h"
#include "modelling/mesh_builder.h"
#include "modelling/shapes.h"
#include "modelling/surfaces.h"

namespace diorama::samples {

/// One object, z up, its bounding box centred at the origin.
struct Model {
  std::shared_ptr<const Mesh> mesh;
  std::vector<modelling::MaterialPtr> materials;
};
Model finish(modelling::MeshBuilder& builder, std::vector<modelling::MaterialPtr> materials);

/// An entry of the catalogue.
struct ModelKind {
  std::string_view name;  ///< "011_banana".
  double mass_kg;         ///< Of the real thing.
  Model (*make)(Host& host, Rng rng);
};
std::span<const ModelKind> boxes();
std::span<const ModelKind> containers();
std::span<const ModelKind> tools();
std::span<const ModelKind> props();

/// Paints one face of a box, given its place on the canvas in pixels. Faces as in BoxPrint.
using FacePainter =
    std::function<void(modelling::Canvas&, int face, double x, double y, double w, double h)>;
/// A printed carton: its faces side by side on one picture.
Model make_carton(const Vec3& size, double bevel, const modelling::Color& ground, double roughness,
                  const FacePainter& paint);

/// A rounded vertical profile turned from (radius, height) pairs with a smooth curve through them.
std::vector<modelling::ProfilePoint> smooth_profile(std::span<const modelling::ProfilePoint> knots,
                                                    int steps);
/// The profile of a thin-walled vessel: outside up, rim, inside down.
std::vector<modelling::ProfilePoint> vessel(std::span<const modelling::ProfilePoint> outer,
                                            double thickness);

}  // namespace diorama::samples
