// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diorama/host.h"
#include "diorama/loader.h"
#include "diorama/params.h"
#include "diorama/plugin.h"

namespace diorama {

/// Names files for a job's lists; the loaders that claim their endings read them.
class FilesLoader final : public Loader {
 public:
  struct Params {
    std::vector<std::string> folders;
    std::vector<std::string> files;
    std::vector<std::string> skip{".thumbs", "material", "texture"};
    void visit(ParamVisitor& v);
  };
  FilesLoader(Params params, Host& host);

  std::vector<std::string> claims() const override;
  /// The files in their order, then what the folders hold. Throws Error(Asset) for missing ones.
  std::vector<std::string> assets() const override;
  void load(std::string_view asset, Scene& scene, NodeId root) override;

 private:
  Params params_;
  Host& host_;
};

/// Nothing at all, for objects in empty space: `{type: empty}` under environments.
class EmptyLoader final : public Loader {
 public:
  struct Params {
    void visit(ParamVisitor&) {}
  };
  EmptyLoader(Params, Host&) {}

  std::vector<std::string> claims() const override { return {"empty:"}; }
  std::vector<std::string> assets() const override { return {"empty:space"}; }
  void load(std::string_view, Scene&, NodeId) override {}
};

/// Makes "shape:cube" and its like: primitives of USD's default sizes (a cube of edge 2 m, a sphere
/// of radius 1 m), meant to be scaled, with exact colliders.
class ShapesLoader final : public Loader {
 public:
  struct Params {
    std::vector<std::string> shapes{"capsule", "cone", "cylinder", "sphere", "cube"};
    void visit(ParamVisitor& v);
  };
  /// Throws Error(Config) for an unknown shape.
  ShapesLoader(Params params, Host& host);

  std::vector<std::string> claims() const override;
  std::vector<std::string> assets() const override;
  void load(std::string_view asset, Scene& scene, NodeId root) override;

 private:
  Params params_;
};

/// Registers `files` and `shapes`.
void register_builtin_loaders(Registrar& registrar);

}  // namespace diorama
