// SPDX-License-Identifier: Apache-2.0
#include "loader_usd/material_translator.h"

#include "loader_usd/materialx_surface.h"
#include "loader_usd/mdl_surface.h"
#include "loader_usd/preview_surface.h"
#include "loader_usd/usd/path.h"

namespace diorama::loader_usd {

using usd::Prim;

const TranslatedMaterial& MaterialTranslator::translate(const std::string& path) {
  auto [entry, is_new] = by_path_.try_emplace(path);
  if (!is_new) return entry->second;
  const Prim* prim = path.empty() ? nullptr : stage_.find(path);
  if (!prim) return entry->second;

  // The same opinions, seen through another instance, are the same material.
  std::vector<std::pair<const void*, std::string>> sites;
  for (const int i : prim->order) {
    const usd::IndexNode& node = prim->index.nodes[static_cast<std::size_t>(i)];
    sites.emplace_back(node.stack, node.path);
  }
  const auto [known, is_unseen] = by_sites_.try_emplace(std::move(sites));
  if (is_unseen) known->second = translate(*prim);
  return entry->second = known->second;
}

// USD's own preview comes first, then MaterialX, then MDL; a surface of another kind is tried by
// names.
TranslatedMaterial MaterialTranslator::translate(const Prim& prim) {
  const Prim* shader = network_.surface(prim, "outputs:surface");
  const Prim* materialx = network_.surface(prim, "outputs:mtlx:surface");
  const Prim* mdl = network_.surface(prim, "outputs:mdl:surface");
  MaterialDraft draft(network_, textures_);
  draft.material().name = std::string(usd::path::name(prim.path));
  const auto draft_known = [&](const Prim* surface) {
    const std::string id = surface ? network_.id(*surface) : "";
    if (is_preview_surface(id)) {
      draft_preview_surface(*surface, draft);
      notice_displacement(*surface);
    } else if (is_materialx_surface(id)) {
      draft_materialx_surface(*surface, draft);
    } else {
      return false;
    }
    return true;
  };
  if (!draft_known(shader) && !draft_known(materialx)) {
    const Prim* named = mdl ? mdl : shader;
    if (!named) return {};
    notice_module(*named);
    draft_mdl_surface(*named, draft);
  }
  drafts_.push_back(draft);
  return {draft.shared(), draft.uv_names, draft.display_color_fallback};
}

void MaterialTranslator::notice_displacement(const Prim& surface) {
  const bool is_moved = network_.source(surface, "displacement").is_shader() ||
                        network_.number(surface, "displacement", 0.0f) != 0.0f;
  if (!is_moved || std::exchange(has_noticed_displacement_, true)) return;
  stage_.diagnostics().warn(stage_.root_layer().identifier() + ": <" + surface.path +
                            "> displaces surfaces, which is not done");
}

void MaterialTranslator::notice_module(const Prim& shader) {
  const std::string module = mdl_module(network_, shader);
  if (!noticed_modules_.insert(module).second) return;
  host_.log(LogLevel::Info, stage_.root_layer().identifier() + ": shader " + module +
                                " is taken by the names of its common inputs");
}

void MaterialTranslator::read_textures() {
  textures_.read_announced();
  for (MaterialDraft& draft : drafts_) draft.finish();
  textures_.report_missing();
}

}  // namespace diorama::loader_usd
