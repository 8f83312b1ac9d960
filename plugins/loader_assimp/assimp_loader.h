// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "diorama/host.h"
#include "diorama/loader.h"
#include "diorama/params.h"
#include "loader_assimp/file_space.h"

// Endings of scenes and models that assimp reads. Left out: those that other programs use for other
// things (.xml, .raw, .mesh), and animations without geometry. USD has a loader of its own.
#define DIORAMA_ASSIMP_CLAIMS                                                               \
  ".gltf .glb .obj .fbx .dae .zae .ply .stl .3ds .3mf .ac .amf .ase .b3d .blend .cob .dxf " \
  ".hmp .ifc .irrmesh .lwo .lws .lxo .md2 .md3 .md5mesh .mdl .ms3d .ndo .nff .off .ogex "   \
  ".pmx .q3o .sib .smd .ter .x .x3d .xgl .zgl"

namespace diorama::loader_assimp {

/// Loads what the Asset Import Library reads: hierarchy, shared meshes, materials, textures (also
/// embedded ones), lights and cameras, in metres and Z up, posed as at rest.
class AssimpLoader final : public Loader {
 public:
  struct Params {
    bool missing_assets_are_errors = false;
    UnstatedSpace unstated;
    void visit(ParamVisitor& v);
  };

  AssimpLoader(Params params, Host& host) : params_(std::move(params)), host_(host) {}

  std::vector<std::string> claims() const override;
  /// Material libraries, buffers and pictures, too.
  std::vector<std::filesystem::path> files(std::string_view asset) const override;
  void load(std::string_view asset, Scene& scene, NodeId root) override;

 private:
  Params params_;
  Host& host_;
};

}  // namespace diorama::loader_assimp
