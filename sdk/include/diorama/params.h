// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "diorama/config.h"
#include "diorama/math.h"

namespace diorama {

class Distribution;
class TextDistribution;

/// What a parameter says of itself beyond name, type and default.
struct ParamDoc {
  const char* help;                                       ///< One sentence with a full stop.
  const char* unit = "";                                  ///< "m", "deg", "kg" ...; empty: none.
  double min = -std::numeric_limits<double>::infinity();  ///< Inclusive; numbers and their lists.
  double max = std::numeric_limits<double>::infinity();
};

/// A component declares its parameters once, in `void Params::visit(ParamVisitor& v)`, one line
/// each; reading, checking, unknown keys, `diorama plugins NAME`, the JSON Schema and the
/// reference pages follow from that list. Field initialisers of Params are the defaults.
///
///     struct Params {
///       std::string targets = "/Assets/*";
///       Range height_m{1.0, 1.5};
///       void visit(ParamVisitor& v) {
///         v.param("targets", targets, {"Nodes to move."});
///         v.param("height_m", height_m, {"Height above the working area.", "m", 0.0});
///       }
///     };
class DIORAMA_SDK_API ParamVisitor {
 public:
  virtual ~ParamVisitor();

  virtual void param(const char* key, bool& field, const ParamDoc& doc) = 0;
  virtual void param(const char* key, int& field, const ParamDoc& doc) = 0;
  virtual void param(const char* key, std::uint64_t& field, const ParamDoc& doc) = 0;
  virtual void param(const char* key, double& field, const ParamDoc& doc) = 0;
  virtual void param(const char* key, std::string& field, const ParamDoc& doc) = 0;
  virtual void param(const char* key, Range& field, const ParamDoc& doc) = 0;
  virtual void param(const char* key, Vec3& field, const ParamDoc& doc) = 0;
  virtual void param(const char* key, std::vector<std::string>& field, const ParamDoc& doc) = 0;
  virtual void param(const char* key, std::vector<double>& field, const ParamDoc& doc) = 0;
  /// Null or absent: no value.
  virtual void param(const char* key, std::optional<double>& field, const ParamDoc& doc) = 0;
  virtual void param(const char* key, std::optional<std::string>& field, const ParamDoc& doc) = 0;
  /// A quantity that is drawn at random (distribution.h): numbers (`width` 1), or vectors (3),
  /// which may be given as a distribution of numbers, too. Without a value it stays as it is.
  virtual void param(const char* key, Distribution& field, const ParamDoc& doc, int width = 1) = 0;
  virtual void param(const char* key, std::optional<Distribution>& field, const ParamDoc& doc,
                     int width = 1) = 0;
  virtual void param(const char* key, TextDistribution& field, const ParamDoc& doc) = 0;
  /// Any value, unchecked here: for free-form mappings that the component reads itself.
  virtual void param(const char* key, Value& field, const ParamDoc& doc) = 0;
  /// One of the given words.
  virtual void choice(const char* key, std::string& field, std::span<const char* const> words,
                      const ParamDoc& doc) = 0;

  /// A nested mapping; G has visit() of its own.
  template <class G>
  void group(const char* key, G& field, const ParamDoc& doc) {
    begin_group(key, doc);
    field.visit(*this);
    end_group();
  }
  /// A list of mappings.
  template <class G>
  void list(const char* key, std::vector<G>& field, const ParamDoc& doc) {
    const std::size_t given = begin_list(key, field.size(), doc);
    if (given != kKeepItems) field = std::vector<G>(given);
    for (std::size_t i = 0; i < field.size(); ++i) {
      begin_item(i);
      field[i].visit(*this);
      end_item();
    }
    if (wants_prototype()) {
      G prototype;
      begin_item(0);
      prototype.visit(*this);
      end_item();
    }
    end_list();
  }

 protected:
  virtual void begin_group(const char* key, const ParamDoc& doc) = 0;
  virtual void end_group() = 0;
  static constexpr std::size_t kKeepItems = std::size_t(-1);
  /// Returns how many fresh items replace those of the list, or kKeepItems.
  virtual std::size_t begin_list(const char* key, std::size_t count, const ParamDoc& doc) = 0;
  virtual void begin_item(std::size_t index) = 0;
  virtual void end_item() = 0;
  virtual void end_list() = 0;
  /// True when the visitor describes instead of reads: it is shown one default item.
  virtual bool wants_prototype() const = 0;
};

enum class ParamType : std::uint8_t {
  Bool,
  Int,
  Number,
  Text,
  Interval,  ///< Range.
  Vector,    ///< Vec3.
  TextList,
  NumberList,
  OptionalNumber,
  OptionalText,
  Distribution,        ///< Of numbers.
  VectorDistribution,  ///< Of vectors, or of numbers that hold for all axes.
  OptionalDistribution,
  OptionalVectorDistribution,
  TextDistribution,
  Any,
  Choice,
  Group,
  List,
};

/// One declared parameter, as data.
struct ParamSpec {
  std::string key;
  ParamType type = ParamType::Any;
  Value default_value;
  std::string help;
  std::string unit;
  double min = -std::numeric_limits<double>::infinity();
  double max = std::numeric_limits<double>::infinity();
  std::vector<std::string> choices;
  std::vector<ParamSpec> children;  ///< Of a group, of an item of a list, or of a variant of Any.
};

/// Reads a mapping into fields. Diagnostics: unknown keys (with the nearest known one), wrong
/// types, values out of range. Keys in `also_known` are the caller's own.
class DIORAMA_SDK_API ParamReader final : public ParamVisitor {
 public:
  /// `path` is put in front of keys in messages: "renderer". All arguments must outlive the reader.
  ParamReader(const Value& map, std::string path, Diagnostics& diagnostics);
  ~ParamReader() override;
  /// Call after visiting: complains about keys that nobody read.
  void finish(std::span<const std::string_view> also_known = {});

  void param(const char* key, bool& field, const ParamDoc& doc) override;
  void param(const char* key, int& field, const ParamDoc& doc) override;
  void param(const char* key, std::uint64_t& field, const ParamDoc& doc) override;
  void param(const char* key, double& field, const ParamDoc& doc) override;
  void param(const char* key, std::string& field, const ParamDoc& doc) override;
  void param(const char* key, Range& field, const ParamDoc& doc) override;
  void param(const char* key, Vec3& field, const ParamDoc& doc) override;
  void param(const char* key, std::vector<std::string>& field, const ParamDoc& doc) override;
  void param(const char* key, std::vector<double>& field, const ParamDoc& doc) override;
  void param(const char* key, std::optional<double>& field, const ParamDoc& doc) override;
  void param(const char* key, std::optional<std::string>& field, const ParamDoc& doc) override;
  void param(const char* key, Distribution& field, const ParamDoc& doc, int width) override;
  void param(const char* key, std::optional<Distribution>& field, const ParamDoc& doc,
             int width) override;
  void param(const char* key, TextDistribution& field, const ParamDoc& doc) override;
  void param(const char* key, Value& field, const ParamDoc& doc) override;
  void choice(const char* key, std::string& field, std::span<const char* const> words,
              const ParamDoc& doc) override;

 protected:
  void begin_group(const char* key, const ParamDoc& doc) override;
  void end_group() override;
  std::size_t begin_list(const char* key, std::size_t count, const ParamDoc& doc) override;
  void begin_item(std::size_t index) override;
  void end_item() override;
  void end_list() override;
  bool wants_prototype() const override { return false; }

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Lists what visit() declares, defaults included.
class DIORAMA_SDK_API ParamLister final : public ParamVisitor {
 public:
  ParamLister();
  ~ParamLister() override;
  std::vector<ParamSpec> take();

  void param(const char* key, bool& field, const ParamDoc& doc) override;
  void param(const char* key, int& field, const ParamDoc& doc) override;
  void param(const char* key, std::uint64_t& field, const ParamDoc& doc) override;
  void param(const char* key, double& field, const ParamDoc& doc) override;
  void param(const char* key, std::string& field, const ParamDoc& doc) override;
  void param(const char* key, Range& field, const ParamDoc& doc) override;
  void param(const char* key, Vec3& field, const ParamDoc& doc) override;
  void param(const char* key, std::vector<std::string>& field, const ParamDoc& doc) override;
  void param(const char* key, std::vector<double>& field, const ParamDoc& doc) override;
  void param(const char* key, std::optional<double>& field, const ParamDoc& doc) override;
  void param(const char* key, std::optional<std::string>& field, const ParamDoc& doc) override;
  void param(const char* key, Distribution& field, const ParamDoc& doc, int width) override;
  void param(const char* key, std::optional<Distribution>& field, const ParamDoc& doc,
             int width) override;
  void param(const char* key, TextDistribution& field, const ParamDoc& doc) override;
  void param(const char* key, Value& field, const ParamDoc& doc) override;
  void choice(const char* key, std::string& field, std::span<const char* const> words,
              const ParamDoc& doc) override;

 protected:
  void begin_group(const char* key, const ParamDoc& doc) override;
  void end_group() override;
  std::size_t begin_list(const char* key, std::size_t count, const ParamDoc& doc) override;
  void begin_item(std::size_t index) override;
  void end_item() override;
  void end_list() override;
  bool wants_prototype() const override { return true; }

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace diorama
