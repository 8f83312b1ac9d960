// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "diorama/config.h"
#include "diorama/math.h"
#include "diorama/params.h"
#include "diorama/rng.h"

namespace diorama {

/// What a job says of a quantity that is drawn at random: numbers, or vectors of three. In a job it
/// is one of
///
///     1.5                                          always the same
///     [0.9, 1.1]                                   uniform between the two
///     {uniform: {lower: 0.9, upper: 1.1}}          lower and upper may be [x, y, z]
///     {normal: {mean: 1.0, std: 0.1}}
///     {log_uniform: {lower: 0.1, upper: 10.0}}     every factor as likely; bounds above 0
///     {choice: {choices: [1, 2, 4], weights: [3, 1, 1]}}    weights may be left out
///     {sequence: {items: [1, 2, 4]}}               one after the other, again from the start
///     [[0, 1], 2, {normal: {mean: 0, std: 1}}]     vectors: one distribution per axis ...
///     {combine: {distributions: [...]}}            ... the same, in Replicator's words
///
/// The words may be written with a prefix, `distribution.uniform`. Choices and items may be
/// distributions themselves. A parameter is declared as any other: `v.param("scale", scale,
/// {"Scale."}, 3)`.
class DIORAMA_SDK_API Distribution {
 public:
  Distribution(double always = 0.0);
  Distribution(const Range& uniform);
  Distribution(const Vec3& always);
  static Distribution between(const Vec3& lower, const Vec3& upper);
  /// Throws Error(Config) with place and `name` when the value is none of the above, has another
  /// width than 1 or `width`, or can leave [doc.min, doc.max]. Only `normal` may: it is clamped.
  static Distribution parse(const Value& value, const std::string& name, const ParamDoc& doc,
                            int width);

  /// 1: numbers; 3: vectors.
  int width() const { return width_; }
  /// `index` counts the draws of the quantity in a job: what `sequence` goes by. Width 1 only.
  double draw(Rng& rng, std::uint64_t index = 0) const;
  /// Of width 1: three independent draws.
  Vec3 draw_vector(Rng& rng, std::uint64_t index = 0) const;
  /// As it would stand in a job.
  const Value& source() const { return source_; }

 private:
  friend class ParamReader;
  enum class Kind : std::uint8_t { Uniform, Normal, LogUniform, Choice, Sequence, Combine };
  struct Reader;
  /// parse() with diagnostics instead of an exception; nothing when there are any.
  static std::optional<Distribution> read(const Value& value, const std::string& name,
                                          const ParamDoc& doc, int width, Diagnostics& diagnostics);
  double draw_axis(int axis, Rng& rng) const;

  Kind kind_ = Kind::Uniform;
  int width_ = 1;
  Vec3 first_ = Vec3::Zero();   ///< Lower bound, or mean; the same on all axes for width 1.
  Vec3 second_ = Vec3::Zero();  ///< Upper bound, or standard deviation.
  Range limits_{-kInfinity, kInfinity};
  std::vector<Distribution> parts_;  ///< Choices, items, or one per axis.
  std::vector<double> weights_;      ///< One per choice.
  Value source_;
};

/// A text that is drawn at random. In a job: a text, a list (all as likely), or `choice` and
/// `sequence` as above.
class DIORAMA_SDK_API TextDistribution {
 public:
  TextDistribution() = default;  ///< Nothing to choose from.
  explicit TextDistribution(const std::vector<std::string>& choices);
  /// Throws Error(Config) with place and `name`.
  static TextDistribution parse(const Value& value, const std::string& name);

  const std::vector<std::string>& texts() const { return texts_; }
  /// Index into texts(), which must not be empty. `index` as for Distribution.
  std::size_t draw(Rng& rng, std::uint64_t index = 0) const;
  const Value& source() const { return source_; }

 private:
  friend class ParamReader;
  /// parse() with diagnostics instead of an exception; nothing when there are any.
  static std::optional<TextDistribution> read(const Value& value, const std::string& name,
                                              Diagnostics& diagnostics);
  std::vector<std::string> texts_;
  std::vector<double> weights_;  ///< One per text, unless it is a sequence.
  bool is_sequence_ = false;
  Value source_ = Value::make_list();
};

}  // namespace diorama
