// SPDX-License-Identifier: Apache-2.0
#include "layer_stack.h"

#include <algorithm>
#include <cmath>

#include "error.h"
#include "path.h"
#include "variable_expression.h"

namespace diorama::usd {
namespace {

// Dictionaries merge key by key; the stronger one wins.
void merge_over(Dictionary& weak, const Dictionary& strong) {
  for (const auto& [key, value] : strong) weak.insert_or_assign(key, value);
}

std::string variables_key(const Dictionary& variables) {
  std::string key;
  for (const auto& [name, value] : variables) {
    key += '\n' + name + '=';
    if (const std::string* text = value.as_text()) {
      key += *text;
    } else if (const auto number = value.as_number()) {
      key += std::to_string(*number);
    } else if (const Strings* items = value.as_strings()) {
      for (const std::string& item : *items) key += item + '\t';
    }
  }
  return key;
}

bool is_usable(const LayerOffset& offset) {
  return std::isfinite(offset.offset) && std::isfinite(offset.scale) && offset.scale != 0.0;
}

}  // namespace

void Diagnostics::warn(const std::string& text) {
  if (known_.insert(text).second) warnings_.push_back(text);
}

void Diagnostics::missing(const std::string& asset, const std::string& text) {
  if (!known_.insert(text).second) return;
  const auto [entry, is_new] =
      by_asset_.try_emplace(asset, Missing{warnings_.size(), missing_.size(), text});
  if (is_new) {
    warnings_.push_back(text);
    missing_.push_back({asset, text});
    return;
  }
  Missing& known = entry->second;
  ++known.others;
  const std::string all = known.text + " (and " + std::to_string(known.others) + " more " +
                          (known.others == 1 ? "reference" : "references") + " to it)";
  warnings_[known.warning] = all;
  missing_[known.place].text = all;
}

bool LayerStack::has_prim(std::string_view path) const {
  return std::any_of(layers.begin(), layers.end(),
                     [&](const Entry& entry) { return entry.layer->prim(path) != nullptr; });
}

double time_codes_per_second(const Layer& layer) {
  for (const char* field : {"timeCodesPerSecond", "framesPerSecond"}) {
    if (const auto rate = layer.get(layer.root(), field).as_number(); rate && *rate > 0.0) {
      return *rate;
    }
  }
  return 24.0;
}

std::string LayerStacks::evaluate(const std::string& text, const Layer& layer,
                                  const Dictionary& variables) const {
  if (!is_expression(text)) return text;
  const auto result = evaluate_expression(text, variables);
  if (!result) {
    diagnostics_.warn(layer.identifier() + ": the expression " + text + " cannot be evaluated");
  }
  return result.value_or("");
}

std::string LayerStacks::anchor(const std::string& asset, const Layer& layer,
                                const Dictionary& variables) const {
  return assets_.anchor(evaluate(asset, layer, variables), layer.identifier());
}

const LayerStack& LayerStacks::open(const std::string& identifier,
                                    const Dictionary& outer_variables) {
  auto [entry, is_new] = stacks_.try_emplace(identifier + variables_key(outer_variables), nullptr);
  if (entry->second) return *entry->second;
  auto stack = std::make_unique<LayerStack>();
  try {
    auto layer = assets_.open(identifier);
    const Value variables = layer->get(layer->root(), "expressionVariables");
    if (const Dictionary* own = variables.as_dictionary()) stack->expression_variables = *own;
    merge_over(stack->expression_variables, outer_variables);
    stack->time_codes_per_second = time_codes_per_second(*layer);
    std::vector<std::string> chain;
    add_layer(*stack, std::move(layer), {}, chain);
    collect_relocates(*stack);
  } catch (const FormatError&) {
    stacks_.erase(entry);
    throw;
  }
  entry->second = std::move(stack);
  return *entry->second;
}

void LayerStacks::add_layer(LayerStack& stack, std::shared_ptr<const Layer> layer,
                            LayerOffset offset, std::vector<std::string>& chain) {
  stack.layers.push_back({layer, offset});
  chain.push_back(layer->identifier());
  const Value sublayers = layer->get(layer->root(), "subLayers");
  const Value offsets = layer->get(layer->root(), "subLayerOffsets");
  const double rate = time_codes_per_second(*layer);
  const Strings none;
  const Strings& assets = sublayers.as_strings() ? *sublayers.as_strings() : none;
  for (std::size_t i = 0; i < assets.size(); ++i) {
    const std::string identifier = anchor(assets[i], *layer, stack.expression_variables);
    if (identifier.empty()) continue;
    std::shared_ptr<const Layer> sublayer;
    try {
      if (!assets_.exists(identifier)) {
        diagnostics_.missing(identifier, layer->identifier() + ": sublayer @" + assets[i] + "@ " +
                                             assets_.missing_text(identifier));
        continue;
      }
      sublayer = assets_.open(identifier);
    } catch (const FormatError& error) {
      diagnostics_.missing(identifier, layer->identifier() + ": sublayer @" + assets[i] +
                                           "@ could not be read: " + error.what());
      continue;
    }
    if (std::find(chain.begin(), chain.end(), sublayer->identifier()) != chain.end()) {
      diagnostics_.warn(layer->identifier() + ": sublayer @" + assets[i] +
                        "@ contains this layer itself");
      continue;
    }
    LayerOffset own;
    if (offsets.as_layer_offsets() && i < offsets.as_layer_offsets()->size() &&
        is_usable((*offsets.as_layer_offsets())[i])) {
      own = (*offsets.as_layer_offsets())[i];
    }
    own.scale *= rate / time_codes_per_second(*sublayer);
    add_layer(stack, std::move(sublayer), offset.compose(own), chain);
  }
  chain.pop_back();
}

void LayerStacks::collect_relocates(LayerStack& stack) {
  for (const LayerStack::Entry& entry : stack.layers) {
    const Value value = entry.layer->get(entry.layer->root(), "layerRelocates");
    if (!value.as_string_pairs()) continue;
    for (const auto& [source, target] : *value.as_string_pairs()) {
      if (!path::is_prim_path(source) || path::is_root_prim(source)) continue;
      stack.relocate_targets.try_emplace(source, target);
    }
  }
  for (const auto& [source, target] : stack.relocate_targets) {
    if (!target.empty()) stack.relocate_sources.try_emplace(target, source);
  }
}

Strings compose_strings(const LayerStack& stack, std::string_view path, std::string_view field) {
  Strings result;
  for (auto entry = stack.layers.rbegin(); entry != stack.layers.rend(); ++entry) {
    const PrimSpec* prim = entry->layer->prim(path);
    if (!prim) continue;
    const Value value = entry->layer->get(*prim, field);
    if (const auto* op = value.as_string_list_op()) op->apply(result);
  }
  return result;
}

std::vector<ComposedReference> compose_references(const LayerStacks& stacks,
                                                  const LayerStack& stack, std::string_view path,
                                                  std::string_view field) {
  std::vector<Reference> composed;
  std::vector<ComposedReference> origins;
  for (auto entry = stack.layers.rbegin(); entry != stack.layers.rend(); ++entry) {
    const PrimSpec* prim = entry->layer->prim(path);
    if (!prim) continue;
    const Value value = entry->layer->get(*prim, field);
    ListOp<Reference> op;
    if (const auto* list = value.as_reference_list_op()) op = *list;
    // Old crates hold a single payload.
    if (const Reference* single = value.as_reference()) {
      op.is_explicit = true;
      op.explicit_items = {*single};
    }
    const auto anchor_all = [&](std::vector<Reference>& items) {
      for (Reference& item : items) {
        ComposedReference origin;
        origin.authored = item.asset;
        origin.source = entry->layer.get();
        item.asset = stacks.anchor(item.asset, *entry->layer, stack.expression_variables);
        if (!is_usable(item.offset)) item.offset = {};
        item.offset = entry->offset.compose(item.offset);
        origin.reference = item;
        origins.push_back(std::move(origin));
      }
    };
    for (auto* items :
         {&op.explicit_items, &op.added, &op.prepended, &op.appended, &op.deleted, &op.ordered}) {
      anchor_all(*items);
    }
    op.apply(composed);
  }
  std::vector<ComposedReference> result;
  for (const Reference& item : composed) {
    // The last to name an item is the strongest.
    const auto origin = std::find_if(origins.rbegin(), origins.rend(),
                                     [&](const auto& o) { return o.reference == item; });
    result.push_back(*origin);
  }
  return result;
}

}  // namespace diorama::usd
