// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "diorama/abi.h"
#include "diorama/annotator.h"
#include "diorama/config.h"
#include "diorama/distribution.h"
#include "diorama/frame.h"
#include "diorama/headers_digest.h"
#include "diorama/host.h"
#include "diorama/joints.h"
#include "diorama/loader.h"
#include "diorama/params.h"
#include "diorama/physics_backend.h"
#include "diorama/randomizer.h"
#include "diorama/reader.h"
#include "diorama/renderer.h"
#include "diorama/rng.h"
#include "diorama/scene.h"
#include "diorama/writer.h"

/// Everything that two C++ binaries must agree on, in one line of text.
#define DIORAMA_ABI_TAG \
  "sdk=" DIORAMA_DETAIL_TEXT(DIORAMA_SDK_ABI) " gxx=" DIORAMA_DETAIL_TEXT(__GXX_ABI_VERSION)    \
  " libstdcxx=" DIORAMA_DETAIL_TEXT(_GLIBCXX_RELEASE) " stl=" DIORAMA_DETAIL_STL                \
  " sanitizer=" DIORAMA_DETAIL_SANITIZER " std=" DIORAMA_DETAIL_TEXT(__cplusplus)               \
  " eigen=" DIORAMA_DETAIL_TEXT(EIGEN_WORLD_VERSION) "." DIORAMA_DETAIL_TEXT(                   \
      EIGEN_MAJOR_VERSION) "." DIORAMA_DETAIL_TEXT(EIGEN_MINOR_VERSION)                         \
  " align=" DIORAMA_DETAIL_TEXT(EIGEN_MAX_ALIGN_BYTES)

namespace diorama::abi {

/// FNV-1a over the sizes and alignments of the given types, in order.
template <class... Types>
consteval std::uint64_t layout_of() {
  std::uint64_t hash = 0xcbf29ce484222325ull;
  const auto mix = [&hash](std::size_t n) { hash = (hash ^ n) * 0x100000001b3ull; };
  ((mix(sizeof(Types)), mix(alignof(Types))), ...);
  return hash;
}

/// Layout of every type that crosses between host and plugin.
inline constexpr std::uint64_t kLayout =
    layout_of<Vec2, Vec3, Vec3f, Quat, Mat4, Affine, Transform, Aabb, Rng, Image<Rgba8>, AnyImage,
              PixelBox, Mesh, Texture, TextureInput, Material, Light, Camera, Collider, RigidBody,
              NodeId, Joint, Animation, Node, Scene, LabelledInstance, CoverageMask, Visibility,
              Velocity, Instance, JointState, JointTarget, CompoundJoint, Frame, ClipFrame, Capture,
              SourceLocation, Value, Diagnostics, Range, ParamDoc, ParamSpec, ParamReader,
              ParamLister, Distribution, TextDistribution, Component, Host, ImageView, Loader,
              PhysicsReport, PhysicsBackend, RandomizeContext, Randomizer, RenderRequest,
              RenderReport, Renderer, Annotator, DatasetInfo, DatasetFiles, CaptureFiles, Writer,
              Finding, ReadLog, StoredInfo, StoredCapture, StoredDataset, Reader, Error>();

}  // namespace diorama::abi
