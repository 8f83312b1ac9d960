// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "layer_stack.h"

namespace diorama::usd {

struct IndexNode;
struct Prim;
struct FoundValue;

/// Reads values that stand in the layers of value clips, as they are at the stage's time, else at
/// its start, or where it has none at the first time of the clips. Values run straight from sample
/// to sample, and from the last one of a clip to where the next clip begins. Belongs to one stage.
class ValueClips {
 public:
  /// `root` says when the stage starts, which counts as long as there is no `time` (of the stage).
  /// All must outlive it.
  ValueClips(AssetLibrary& assets, const LayerStacks& stacks, Diagnostics& diagnostics,
             const Layer& root, std::optional<double> time = {});
  ~ValueClips();

  /// What clips of the prim or of its ancestors say of the attribute; the nearest clips count. Its
  /// `spec` is the same for the same sample of the same attribute, and for nothing else.
  /// `anchor` becomes the node of the prim's index that the clips stand in, if there is one.
  FoundValue find(const Prim& prim, std::string_view attribute, const IndexNode** anchor = nullptr);

 private:
  struct ClipSet;
  struct Said;

  const std::vector<ClipSet>& sets_of(const Prim& prim);
  std::vector<ClipSet> read_sets(const Prim& prim);
  void read_explicit(ClipSet& set, const Dictionary& fields);
  bool read_template(ClipSet& set, const Dictionary& fields);
  std::shared_ptr<const Layer> open(const std::string& asset, const ClipSet& set);
  Said said_in(const std::string& asset, const ClipSet& set, const std::string& path,
               std::string_view attribute);

  AssetLibrary& assets_;
  const LayerStacks& stacks_;
  Diagnostics& diagnostics_;
  const Layer& root_;
  std::optional<double> time_;
  std::map<const Prim*, std::vector<ClipSet>> sets_;
  std::map<std::pair<const PropertySpec*, double>, std::unique_ptr<PropertySpec>> timed_;
};

}  // namespace diorama::usd
