// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "batch.h"
#include "light_table.h"

// A light is chosen in proportion to its unshadowed contribution (estimated), so that one shadow
// ray per vertex goes where it matters.
namespace diorama {

/// Places of a batch that want a light each, by numbers u in [0, 1).
struct LightQueries {
  std::size_t count = 0;
  BatchVectors position;
  BatchVectors normal;
  BatchInts is_two_sided{};
  BatchFloats u{};

  Receiver receiver(std::size_t i) const {
    return {position.at(i), normal.at(i), is_two_sided[i] != 0, 0.0f};
  }
};
/// The lights chosen for them.
struct LightSelections {
  BatchInts light{};
  BatchFloats probability{};        ///< Zero: no light can contribute.
  BatchFloats total_score{};        ///< For Receiver.
  std::vector<BatchFloats> scores;  ///< Of the entries that are compared.
};

namespace detail {

/// The entry that each place of a batch has come to among those offered so far.
struct LightPicks {
  BatchInts entry;  ///< -1: none.
  BatchFloats score{};
  BatchFloats before{};  ///< Sum of the scores of the entries before it ...
  BatchFloats end{};     ///< ... and with its own.
  LightPicks() { entry.fill(-1); }
  void offer(int index, const BatchFloats& scores, const BatchFloats& u, const BatchFloats& total,
             std::size_t size);
};

inline float score_of_distant(const LightTable::Record& light, const Vec3f& normal,
                              bool is_two_sided) {
  constexpr float kFloor = 0.1f;
  const float reach = std::sqrt(light.one_minus_cos * (2.0f - light.one_minus_cos)) + 1e-3f;
  const float facing = -normal.dot(light.direction);
  const float cosine = reach + (is_two_sided ? std::abs(facing) : facing);
  return cosine > 0.0f ? light.power * std::max(kFloor, std::min(1.0f, cosine)) : 0.0f;
}

inline float score_of_surroundings(const LightTable::Record& light, const Receiver& receiver) {
  if (light.shape == LightShape::Distant) {
    return score_of_distant(light, receiver.normal, receiver.is_two_sided) *
           light.sun->share(receiver.position);
  }
  return light.power * light.sky->power(light.sky->grid().cell(receiver.position));
}

/// The same for the places of a batch.
inline void score_surroundings(const LightTable::Record& light, const LightQueries& queries,
                               BatchFloats& scores) {
  const std::size_t size = whole_steps(queries.count);
  if (light.shape == LightShape::Distant) {
    light.sun->find_shares(queries.position, size, scores);
    for (std::size_t i = 0; i < size; ++i) {
      scores[i] *= score_of_distant(light, queries.normal.at(i), queries.is_two_sided[i] != 0);
    }
    return;
  }
  BatchInts cells;
  light.sky->grid().find_cells(queries.position, size, cells);
  light.sky->find_powers(cells, size, scores);
  const float power = light.power;
  for (std::size_t i = 0; i < size; ++i) scores[i] *= power;
}

// Rounding may leave a number beyond the last share: then the last is taken.
inline void LightPicks::offer(int index, const BatchFloats& scores, const BatchFloats& u,
                              const BatchFloats& total, std::size_t size) {
  for (std::size_t i = 0; i < size; ++i) {
    const bool is_open = u[i] * total[i] >= end[i] && scores[i] > 0.0f;
    entry[i] = is_open ? index : entry[i];
    score[i] = is_open ? scores[i] : score[i];
    before[i] = is_open ? end[i] : before[i];
    end[i] = is_open ? end[i] + scores[i] : end[i];
  }
}

/// Where a group was picked, one of its lights.
[[gnu::noinline]] inline void descend_groups(const LightTable& table, const LightQueries& queries,
                                             const LightPicks& picks, LightSelections& selections) {
  for (std::size_t i = 0; i < queries.count; ++i) {
    if (selections.light[i] >= 0) continue;
    const float rest =
        (queries.u[i] * selections.total_score[i] - picks.before[i]) / picks.score[i];
    const LightTree::Choice within = table.tree().choose(
        std::uint32_t(picks.entry[i]), queries.receiver(i), std::clamp(rest, 0.0f, 0.9999999f));
    selections.light[i] = std::int32_t(table.bodies()[within.light]);
    selections.probability[i] *= within.probability;
  }
  // Loops over whole steps look up lights behind the last place, too.
  std::fill(selections.light.begin() + std::ptrdiff_t(queries.count), selections.light.end(), 0);
}

}  // namespace detail

/// Scores first, then the light in whose share of their sum a place's number falls.
inline void choose_lights(const LightTable& table, const LightQueries& queries,
                          LightSelections& selections) {
  const std::size_t size = whole_steps(queries.count);
  const std::uint32_t roots = table.tree().root_count();
  selections.scores.resize(table.entry_lights().size());
  selections.total_score.fill(0.0f);
  for (std::uint32_t entry = 0; entry < selections.scores.size(); ++entry) {
    BatchFloats& scores = selections.scores[entry];
    if (entry < roots) {
      for (std::size_t i = 0; i < size; ++i) {
        scores[i] = table.tree().root_score(entry, queries.receiver(i));
      }
    } else {
      detail::score_surroundings(table.records()[table.surroundings()[entry - roots]], queries,
                                 scores);
    }
    for (std::size_t i = 0; i < size; ++i) selections.total_score[i] += scores[i];
  }
  detail::LightPicks picks;
  for (std::size_t entry = 0; entry < selections.scores.size(); ++entry) {
    picks.offer(int(entry), selections.scores[entry], queries.u, selections.total_score, size);
  }
  selections.light.fill(0);
  selections.probability.fill(0.0f);
  if (table.entry_lights().empty()) return;
  BatchInts picked;
  for (std::size_t i = 0; i < size; ++i) picked[i] = std::max(picks.entry[i], 0);
  gather(table.entry_lights(), picked, size, picked);
  for (std::size_t i = 0; i < size; ++i) {
    const float share = picks.score[i] / selections.total_score[i];
    const bool is_none = picks.entry[i] < 0;
    selections.light[i] = is_none ? 0 : picked[i];
    selections.probability[i] = is_none ? 0.0f : share;
  }
  if (table.tree().has_groups()) detail::descend_groups(table, queries, picks, selections);
}

/// With which choose_lights() picks this light for the receiver.
inline float choice_probability(const LightTable& table, std::uint32_t light,
                                const Receiver& receiver) {
  const float total = receiver.total_score;
  if (!(total > 0.0f)) return 0.0f;
  const LightTable::Record& record = table.records()[light];
  if (!record.is_body()) return detail::score_of_surroundings(record, receiver) / total;
  float tree_score = 0.0f;
  const float within = table.tree().probability(table.order()[light], receiver, tree_score);
  return within * (tree_score / total);
}

}  // namespace diorama
