// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/demand.h"

#include <algorithm>
#include <map>
#include <optional>

#include "diorama/config.h"
#include "diorama/error.h"

namespace diorama {
namespace {

class Resolution {
 public:
  Resolution(const NameSet& renderer_provides, const std::string& renderer,
             std::span<const AnnotatorOffer> offers)
      : renderer_provides_(renderer_provides), renderer_(renderer), offers_(offers) {}

  void want(const std::string& who, const std::string& name) {
    if (name == kVisibility || name == kAmodalMask || name == kOcclusionOrder) {
      want(who, std::string(kInstanceId.name));
      want(who, std::string(kInstances));
      demand_.visibility = true;
      if (name == kAmodalMask) demand_.amodal_mask = true;
      if (name == kOcclusionOrder) demand_.occlusion_order = true;
      return;
    }
    if (const auto listed = offer_of(name, true)) return use(who, *listed);
    if (renderer_provides_.contains(name)) {
      demand_.channels.insert(name);
      return;
    }
    if (name == kMotion.name) {
      want(who, std::string(kLeafId.name));
      want(who, std::string(kPosition.name));
      demand_.motion = true;
      return;
    }
    const bool is_forward = name == kFlowForward.name || name == kFlowForwardState.name;
    if (is_forward || name == kFlowBackward.name || name == kFlowBackwardState.name) {
      want(who, std::string(kLeafId.name));
      want(who, std::string(kPosition.name));
      (is_forward ? demand_.flow_forward : demand_.flow_backward) = true;
      return;
    }
    const auto offer = offer_of(name, false);
    if (!offer) refuse(who, name);
    use(who, *offer);
  }

  Demand take() { return std::move(demand_); }

 private:
  std::optional<std::size_t> offer_of(const std::string& name, bool is_listed) const {
    const auto offer = std::find_if(offers_.begin(), offers_.end(), [&](const auto& candidate) {
      return candidate.is_listed == is_listed && candidate.provides.contains(name);
    });
    if (offer == offers_.end()) return std::nullopt;
    return std::size_t(offer - offers_.begin());
  }

  void use(const std::string& who, std::size_t index) {
    const bool is_used = std::find(demand_.annotators.begin(), demand_.annotators.end(), index) !=
                         demand_.annotators.end();
    if (is_used) return;
    const AnnotatorOffer& offer = offers_[index];
    if (std::find(open_.begin(), open_.end(), index) != open_.end()) {
      throw Error(ErrorKind::Plugin, "annotator '" + offer.type + "': needs its own output");
    }
    open_.push_back(index);
    for (const std::string& name : offer.needs) {
      want(who + " (through annotator '" + offer.type + "')", name);
    }
    open_.pop_back();
    demand_.annotators.push_back(index);
  }

  [[noreturn]] void refuse(const std::string& who, const std::string& name) const {
    std::vector<std::string> known(renderer_provides_.begin(), renderer_provides_.end());
    for (const AnnotatorOffer& offer : offers_) {
      known.insert(known.end(), offer.provides.begin(), offer.provides.end());
    }
    known.emplace_back(kVisibility);
    known.emplace_back(kAmodalMask);
    known.emplace_back(kOcclusionOrder);
    for (const auto& derived : {kMotion.name, kFlowForward.name, kFlowBackward.name,
                                kFlowForwardState.name, kFlowBackwardState.name}) {
      known.emplace_back(derived);
    }
    std::sort(known.begin(), known.end());
    known.erase(std::unique(known.begin(), known.end()), known.end());
    std::string list;
    for (const std::string& word : known) list += (list.empty() ? "" : ", ") + word;
    throw Error(ErrorKind::Config, who + ": needs '" + name + "', which neither " + renderer_ +
                                       " nor an annotator provides (there are: " + list + ")");
  }

  const NameSet& renderer_provides_;
  const std::string& renderer_;
  std::span<const AnnotatorOffer> offers_;
  std::vector<std::size_t> open_;
  Demand demand_;
};

void refuse_twins(std::span<const AnnotatorOffer> offers) {
  std::map<std::string, std::string> makers;
  for (const AnnotatorOffer& offer : offers) {
    if (!offer.is_listed) continue;
    for (const std::string& name : offer.provides) {
      const auto [first, is_new] = makers.emplace(name, offer.where);
      if (is_new) continue;
      throw Error(ErrorKind::Config, offer.where + ": " + offer.type + " makes '" + name +
                                         "', which another entry of 'annotators' (" +
                                         first->second + ") makes already");
    }
  }
}

}  // namespace

Demand resolve_demand(std::span<const Need> needs, const NameSet& renderer_provides,
                      const std::string& renderer, std::span<const AnnotatorOffer> offers) {
  refuse_twins(offers);
  Resolution resolution(renderer_provides, renderer, offers);
  for (const Need& need : needs) {
    for (const std::string& name : need.names) resolution.want(need.who, name);
  }
  return resolution.take();
}

}  // namespace diorama
