// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "embree_support/embree_scene.h"
#include "embree_support/picture_film.h"
#include "gpu_path_tracer.h"
#include "renderer_support/isa.h"
#include "renderer_support/sample_plan.h"

namespace diorama {

/// Has `tracer` trace the light paths of a picture, with virtual lights and a radiance cache of its
/// own where `settings` ask for them; its sums and film are the picture's from then on. `meshes` is
/// what `scene` was made of: the processor finds the virtual lights. Adds to `counts`.
void trace_picture(GpuPathTracer& tracer, const GpuScene& scene, const EmbreeScene& meshes,
                   const View& view, const PathSettings& settings, Isa isa, SamplePlan& plan,
                   Host& host, PictureCounts& counts);

}  // namespace diorama
