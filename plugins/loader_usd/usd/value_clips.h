// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

#include "layer_stack.h"

namespace diorama::usd {

struct ClipTemplate;
struct IndexNode;
struct Prim;
struct FoundValue;

/// Adds the files that value clips (`clips` of a prim) may name, be they there or not; those of
/// templates as long as there are less than a hundred thousand.
void add_clip_assets(const Dictionary& clips, std::set<std::string>& assets);

/// Reads values that stand in the layers of value clips, as they are at the stage's time, else at
/// its start, or where it has none at the first time of the clips. Values run straight from sample
/// to sample, and from what a clip says last to where the next one begins, or with
/// `interpolateMissingClipValues` over clips that say nothing. Belongs to one stage.
class ValueClips {
 public:
  /// `root` says when the stage starts, which counts as long as there is no `time` (of the stage).
  /// All must outlive it.
  ValueClips(AssetLibrary& assets, const LayerStacks& stacks, Diagnostics& diagnostics,
             const Layer& root, std::optional<double> time = {});
  ~ValueClips();

  /// What clips of the prim or of its ancestors say of the attribute; the nearest clips count. A
  /// block: their manifest declares the attribute, and they have no value. Its
  /// `spec` is the same for the same sample of the same attribute, and for nothing else.
  /// `anchor` becomes the node of the prim's index that the clips stand in, if there is one.
  FoundValue find(const Prim& prim, std::string_view attribute, const IndexNode** anchor = nullptr);

 private:
  struct ClipSet;
  struct Said;
  struct Answer;

  const std::vector<ClipSet>& sets_of(const Prim& prim);
  std::vector<ClipSet> read_sets(const Prim& prim);
  static void in_order(const Prim& prim, std::vector<ClipSet>& sets);
  void read_explicit(ClipSet& set, const Dictionary& fields);
  const std::vector<double>& times_of(const ClipSet& set, const ClipTemplate& files);
  bool read_template(ClipSet& set, const Dictionary& fields);
  std::shared_ptr<const Layer> open(const std::string& asset, const ClipSet& set);
  Said said_in(const std::string& asset, const ClipSet& set, const std::string& path,
               std::string_view attribute);
  Answer answer_of(const ClipSet& set, const std::string& path, std::string_view attribute);

  AssetLibrary& assets_;
  const LayerStacks& stacks_;
  Diagnostics& diagnostics_;
  const Layer& root_;
  std::optional<double> time_;
  std::map<const Prim*, std::vector<ClipSet>> sets_;
  using TemplateKey =
      std::tuple<const Layer*, const LayerStack*, std::string, double, double, double>;
  std::map<TemplateKey, std::vector<double>> templates_;  ///< To the times of files.
  std::map<std::tuple<const PropertySpec*, double, const ClipSet*>, std::unique_ptr<PropertySpec>>
      timed_;
};

}  // namespace diorama::usd
