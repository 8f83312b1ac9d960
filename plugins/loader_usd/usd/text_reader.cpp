// SPDX-License-Identifier: Apache-2.0
#include "text_reader.h"

#include <algorithm>
#include <array>
#include <map>
#include <optional>
#include <set>

#include "path.h"
#include "text_scanner.h"
#include "text_values.h"
#include "variable_expression.h"

namespace diorama::usd {
namespace {

constexpr int kMaxPrimNesting = 500;

using Fields = std::vector<std::pair<std::string_view, Value>>;

struct PropertyBuilder {
  std::string name;
  SpecType type = SpecType::Unknown;
  Fields fields;
};

struct PrimBuilder {
  std::string path;
  Fields fields;
  Strings children;
  std::set<std::string, std::less<>> child_names;
  std::vector<PropertyBuilder> properties;
  std::map<std::string, std::size_t, std::less<>> property_of_name;
};

enum class Edit { Explicit, Add, Prepend, Append, Delete, Reorder };

enum class FieldKind { Value, Dictionary, TokenList, StringList, IntegerList, Free };

struct FieldType {
  std::string_view name;
  FieldKind kind;
  std::string_view value_type;
};

// Metadata with a known type; everything else may hold any value and is not kept.
constexpr std::array kFieldTypes = {
    FieldType{"active", FieldKind::Value, "bool"},
    FieldType{"allowedTokens", FieldKind::Value, "token[]"},
    FieldType{"apiSchemas", FieldKind::TokenList, {}},
    FieldType{"assetInfo", FieldKind::Dictionary, {}},
    FieldType{"bindMaterialAs", FieldKind::Value, "token"},
    FieldType{"clipSets", FieldKind::StringList, {}},
    FieldType{"clips", FieldKind::Dictionary, {}},
    FieldType{"colorConfiguration", FieldKind::Value, "asset"},
    FieldType{"colorManagementSystem", FieldKind::Value, "token"},
    FieldType{"colorSpace", FieldKind::Value, "token"},
    FieldType{"customData", FieldKind::Dictionary, {}},
    FieldType{"customLayerData", FieldKind::Dictionary, {}},
    FieldType{"defaultPrim", FieldKind::Value, "token"},
    FieldType{"displayGroup", FieldKind::Value, "string"},
    FieldType{"displayGroupOrder", FieldKind::Value, "string[]"},
    FieldType{"displayName", FieldKind::Value, "string"},
    FieldType{"elementSize", FieldKind::Value, "int"},
    FieldType{"endFrame", FieldKind::Value, "double"},
    FieldType{"endTimeCode", FieldKind::Value, "double"},
    FieldType{"expressionVariables", FieldKind::Dictionary, {}},
    FieldType{"fallbackPrimTypes", FieldKind::Dictionary, {}},
    FieldType{"framePrecision", FieldKind::Value, "int"},
    FieldType{"framesPerSecond", FieldKind::Value, "double"},
    FieldType{"hasOwnedSubLayers", FieldKind::Value, "bool"},
    FieldType{"hidden", FieldKind::Value, "bool"},
    FieldType{"inactiveIds", FieldKind::IntegerList, {}},
    FieldType{"instanceable", FieldKind::Value, "bool"},
    FieldType{"interpolation", FieldKind::Value, "token"},
    FieldType{"kilogramsPerUnit", FieldKind::Value, "double"},
    FieldType{"metersPerUnit", FieldKind::Value, "double"},
    FieldType{"noLoadHint", FieldKind::Value, "bool"},
    FieldType{"owner", FieldKind::Value, "string"},
    FieldType{"prefix", FieldKind::Value, "string"},
    FieldType{"renderSettingsPrimPath", FieldKind::Value, "string"},
    FieldType{"renderType", FieldKind::Value, "token"},
    FieldType{"sdrMetadata", FieldKind::Dictionary, {}},
    FieldType{"sessionOwner", FieldKind::Value, "string"},
    FieldType{"startFrame", FieldKind::Value, "double"},
    FieldType{"startTimeCode", FieldKind::Value, "double"},
    FieldType{"suffix", FieldKind::Value, "string"},
    FieldType{"symmetricPeer", FieldKind::Value, "string"},
    FieldType{"symmetryArguments", FieldKind::Dictionary, {}},
    FieldType{"timeCodesPerSecond", FieldKind::Value, "double"},
    FieldType{"unauthoredValuesIndex", FieldKind::Value, "int"},
    FieldType{"upAxis", FieldKind::Value, "token"},
    FieldType{"weight", FieldKind::Value, "float"},
};

FieldType field_type(std::string_view name) {
  const auto* found = std::find_if(kFieldTypes.begin(), kFieldTypes.end(),
                                   [&](const FieldType& type) { return type.name == name; });
  return found == kFieldTypes.end() ? FieldType{name, FieldKind::Free, {}} : *found;
}

constexpr std::array<std::string_view, 12> kDisplayUnits = {
    "mm", "cm", "dm", "m", "km", "in", "ft", "yd", "mi", "deg", "rad", "default"};

template <class Words>
std::string list_of(const Words& words) {
  std::string list;
  for (const std::string_view word : words) list.append(list.empty() ? "" : ", ").append(word);
  return list;
}

const Value* find_field(const Fields& fields, std::string_view name) {
  for (const auto& [key, value] : fields) {
    if (key == name) return &value;
  }
  return nullptr;
}

void set_field(Fields& fields, std::string_view name, Value value) {
  for (auto& [key, old] : fields) {
    if (key == name) {
      old = std::move(value);
      return;
    }
  }
  fields.emplace_back(name, std::move(value));
}

// Sets the part of a list edit that `edit` names and keeps its other parts.
template <class Item>
void edit_list(Fields& fields, std::string_view name, Type type, Edit edit, std::vector<Item> items,
               const ListOp<Item>* old) {
  auto op = std::make_shared<ListOp<Item>>();
  if (old) *op = *old;
  switch (edit) {
    case Edit::Explicit:
      op->is_explicit = true;
      op->explicit_items = std::move(items);
      break;
    case Edit::Add:
      op->added = std::move(items);
      break;
    case Edit::Prepend:
      op->prepended = std::move(items);
      break;
    case Edit::Append:
      op->appended = std::move(items);
      break;
    case Edit::Delete:
      op->deleted = std::move(items);
      break;
    case Edit::Reorder:
      op->ordered = std::move(items);
      break;
  }
  set_field(fields, name, Value(type, std::shared_ptr<const ListOp<Item>>(std::move(op))));
}

void edit_list(Fields& fields, std::string_view name, Type type, Edit edit, Strings items) {
  const Value* old = find_field(fields, name);
  edit_list(fields, name, type, edit, std::move(items), old ? old->as_string_list_op() : nullptr);
}

class TextReader {
 public:
  TextReader(const std::string& identifier, std::string_view text)
      : scanner_(identifier, text), layer_(std::make_shared<Layer>(identifier)) {}

  std::shared_ptr<Layer> read();

 private:
  // Metadata.
  template <class ReadItem>
  void read_block(char open, char close, ReadItem read_item);
  void read_layer_metadata(PrimBuilder& root);
  void read_sublayers(PrimBuilder& root);
  void read_prim_metadata(PrimBuilder& prim);
  void read_prim_keyword(PrimBuilder& prim, std::string_view key, Edit edit);
  void read_property_metadata(Fields& fields, bool is_attribute);
  bool read_shared_metadata(Fields& fields);
  void read_field(Fields& fields, const std::string& key);
  void read_list_field(Fields& fields, Edit edit);
  void read_integer_list(Fields& fields, std::string_view name, Edit edit);
  void read_substitutions();
  Strings read_name_list();
  LayerOffset read_layer_offset(bool allow_custom_data);
  Reference read_reference(bool is_payload);
  template <class Item, class Read>
  std::vector<Item> read_items(Read read, bool allow_empty);
  void read_references(PrimBuilder& prim, std::string_view field, bool is_payload, Edit edit);
  void read_class_paths(PrimBuilder& prim, std::string_view field, Edit edit);
  void read_relocates(PrimBuilder& prim, std::string_view field);
  void read_variant_selections(PrimBuilder& prim);
  std::optional<Edit> accept_edit();

  // Prims and properties.
  bool at_prim() const;
  void read_prim(PrimBuilder& parent, int nesting);
  void read_contents(PrimBuilder& prim, int nesting);
  void read_variant_set(PrimBuilder& prim, int nesting);
  bool read_order(PrimBuilder& prim);
  void read_property(PrimBuilder& prim);
  void read_relationship(PrimBuilder& prim, Edit edit, bool is_edit, bool is_custom);
  void read_attribute(PrimBuilder& prim, Edit edit, bool is_edit, bool is_custom);
  void read_attribute_value(PropertyBuilder& attribute, const ValueTypeName& type);
  void read_time_samples(PropertyBuilder& attribute, const ValueTypeName& type);
  void read_connections(const PrimBuilder& prim, PropertyBuilder& attribute, Edit edit,
                        bool is_edit);
  void skip_spline(const ValueTypeName& type);
  Strings read_target_paths(const PrimBuilder& prim, bool is_edit, bool& is_none);
  std::string read_property_name();
  std::string read_type_name();
  PropertyBuilder& property(PrimBuilder& prim, const std::string& name, SpecType type);
  std::string resolve(const std::string& path, const PrimBuilder& prim) const;
  void end_statement(bool allow_semicolon);
  void require_distinct(const Strings& items, const char* what) const;

  FieldSet store(const Fields& fields);
  void store(PrimBuilder& prim, SpecType type);

  TextScanner scanner_;
  std::shared_ptr<Layer> layer_;
  std::map<std::string, std::string_view, std::less<>> names_;
};

std::shared_ptr<Layer> TextReader::read() {
  if (!is_text_layer(scanner_.rest())) {
    scanner_.fail("the first line of a layer must be '#usda 1.0'");
  }
  while (!scanner_.at_end() && scanner_.peek() != '\n' && scanner_.peek() != '\r') {
    scanner_.advance(1);
  }
  PrimBuilder root;
  root.path = "/";
  scanner_.skip_lines();
  if (scanner_.peek() == '(') read_layer_metadata(root);
  scanner_.skip_lines();
  while (!scanner_.at_end()) {
    if (at_prim()) {
      read_prim(root, 0);
      scanner_.skip_to_line_end();
      if (!scanner_.at_end()) end_statement(false);
    } else if (scanner_.accept_word("reorder")) {
      scanner_.require_space("reorder");
      if (!scanner_.accept_word("rootPrims")) scanner_.fail("expected rootPrims after reorder");
      scanner_.expect_assignment();
      set_field(root.fields, "primOrder",
                Value(Type::TokenVector, std::make_shared<const Strings>(read_name_list())));
      scanner_.skip_to_line_end();
      if (!scanner_.at_end()) end_statement(true);
    } else {
      scanner_.fail("expected def, over or class");
    }
    scanner_.skip_lines();
  }
  store(root, SpecType::PseudoRoot);
  return std::move(layer_);
}

void TextReader::end_statement(bool allow_semicolon) {
  scanner_.skip_to_line_end();
  if (allow_semicolon && scanner_.accept(';')) return;
  if (scanner_.peek() != '\n' && scanner_.peek() != '\r') {
    scanner_.fail("expected the end of the line");
  }
}

// Items separated by line ends or semicolons between two brackets.
template <class ReadItem>
void TextReader::read_block(char open, char close, ReadItem read_item) {
  scanner_.expect(open, "before a block");
  scanner_.skip_lines();
  while (!scanner_.accept(close)) {
    read_item();
    const std::size_t after = scanner_.position();
    scanner_.skip_to_line_end();
    const bool is_separated =
        scanner_.accept(';') || scanner_.peek() == '\n' || scanner_.peek() == '\r';
    if (!is_separated) scanner_.rewind(after);
    scanner_.skip_lines();
    if (!is_separated && scanner_.peek() != close) {
      scanner_.fail(std::string("expected a new line or '") + close + "'");
    }
  }
}

std::optional<Edit> TextReader::accept_edit() {
  static constexpr std::array<std::pair<std::string_view, Edit>, 5> kEdits = {
      {{"add", Edit::Add},
       {"prepend", Edit::Prepend},
       {"append", Edit::Append},
       {"delete", Edit::Delete},
       {"reorder", Edit::Reorder}}};
  for (const auto& [word, edit] : kEdits) {
    if (scanner_.accept_word(word)) {
      scanner_.require_space(std::string(word).c_str());
      return edit;
    }
  }
  return std::nullopt;
}

void TextReader::read_layer_metadata(PrimBuilder& root) {
  read_block('(', ')', [&] {
    if (scanner_.accept_word("subLayers")) return read_sublayers(root);
    if (scanner_.accept_word("relocates")) return read_relocates(root, "layerRelocates");
    if (const auto edit = accept_edit()) return read_list_field(root.fields, *edit);
    if (!read_shared_metadata(root.fields)) scanner_.fail("expected layer metadata");
  });
  const Value* rate = find_field(root.fields, "framesPerSecond");
  if (rate && !(rate->as_number().value_or(1.0) > 0.0)) {
    scanner_.fail("framesPerSecond must be greater than 0");
  }
}

void TextReader::read_sublayers(PrimBuilder& root) {
  scanner_.expect_assignment();
  if (scanner_.peek() != '[') scanner_.fail("expected a list of sublayers in [ ]");
  std::vector<LayerOffset> offsets;
  Strings assets = read_items<std::string>(
      [&] {
        if (scanner_.peek() != '@') scanner_.fail("expected an asset between @ signs");
        std::string asset = scanner_.read_asset();
        if (asset.empty()) scanner_.fail("the path of a sublayer is empty");
        const std::size_t after = scanner_.position();
        scanner_.skip_inline();
        if (scanner_.peek() == '(') {
          offsets.push_back(read_layer_offset(false));
        } else {
          scanner_.rewind(after);
          offsets.push_back({});
        }
        return asset;
      },
      true);
  set_field(root.fields, "subLayers",
            Value(Type::StringVector, std::make_shared<const Strings>(std::move(assets))));
  set_field(root.fields, "subLayerOffsets",
            Value(Type::LayerOffsetVector,
                  std::make_shared<const std::vector<LayerOffset>>(std::move(offsets))));
}

// Comments, `doc`, and fields that may stand at layers, prims and properties alike.
bool TextReader::read_shared_metadata(Fields& fields) {
  if (scanner_.at_string()) {
    set_field(fields, "comment", Value::text(Type::String, scanner_.read_string()));
    return true;
  }
  if (scanner_.accept_word("doc")) {
    scanner_.expect_assignment();
    if (!scanner_.at_string()) scanner_.fail("expected a quoted text for doc");
    set_field(fields, "documentation", Value::text(Type::String, scanner_.read_string()));
    return true;
  }
  if (scanner_.accept_word("permission")) {
    scanner_.expect_assignment();
    const std::string word(scanner_.peek_word());
    if (word != "public" && word != "private") scanner_.fail("expected public or private");
    scanner_.advance(word.size());
    set_field(fields, "permission", Value::enumerator(Type::Permission, word == "private"));
    return true;
  }
  if (scanner_.accept_word("symmetryFunction")) {
    scanner_.expect_assignment();
    scanner_.advance(scanner_.peek_word().size());
    return true;
  }
  const std::string key(scanner_.peek_word());
  const bool is_name =
      !key.empty() && (!is_keyword(key) || key == "customData" || key == "symmetryArguments");
  if (!is_name) return false;
  scanner_.advance(key.size());
  read_field(fields, key);
  return true;
}

void TextReader::read_field(Fields& fields, const std::string& key) {
  scanner_.expect_assignment();
  const FieldType type = field_type(key);
  if (scanner_.accept_word("None")) {
    if (type.kind == FieldKind::TokenList || type.kind == FieldKind::StringList) {
      edit_list(fields, type.name, Type::TokenListOp, Edit::Explicit, {});
    }
    return;
  }
  switch (type.kind) {
    case FieldKind::Value:
      set_field(fields, type.name, read_text_value(scanner_, parse_value_type(type.value_type)));
      return;
    case FieldKind::Dictionary:
      set_field(fields, type.name, Value(Type::Dictionary, read_text_dictionary(scanner_)));
      return;
    case FieldKind::TokenList:
    case FieldKind::StringList: {
      const Value items = read_text_value(scanner_, parse_value_type("token[]"));
      require_distinct(*items.as_strings(), type.name.data());
      edit_list(fields, type.name, Type::TokenListOp, Edit::Explicit, *items.as_strings());
      return;
    }
    case FieldKind::IntegerList:
      return read_integer_list(fields, type.name, Edit::Explicit);
    case FieldKind::Free:
      break;
  }
  if (scanner_.peek() == '{') {
    read_text_dictionary(scanner_);
  } else {
    skip_text_value(scanner_);
  }
}

void TextReader::read_list_field(Fields& fields, Edit edit) {
  const std::string key(scanner_.peek_word());
  if (key.empty() || is_keyword(key)) scanner_.fail("expected the name of a list");
  scanner_.advance(key.size());
  scanner_.expect_assignment();
  const FieldType type = field_type(key);
  if (scanner_.accept_word("None")) return;
  if (scanner_.peek() != '[') scanner_.fail("expected a list in [ ]");
  if (type.kind == FieldKind::IntegerList) return read_integer_list(fields, type.name, edit);
  if (type.kind != FieldKind::TokenList && type.kind != FieldKind::StringList) {
    skip_text_value(scanner_);
    return;
  }
  const Value items = read_text_value(scanner_, parse_value_type("token[]"));
  require_distinct(*items.as_strings(), type.name.data());
  edit_list(fields, type.name, Type::TokenListOp, edit, *items.as_strings());
}

void TextReader::read_integer_list(Fields& fields, std::string_view name, Edit edit) {
  const Value items = read_text_value(scanner_, parse_value_type("int64[]"));
  std::vector<std::int64_t> list(items.size());
  for (std::size_t i = 0; i < list.size(); ++i) {
    list[i] = static_cast<std::int64_t>(items.component(i));
  }
  const Value* old = find_field(fields, name);
  edit_list(fields, name, Type::Int64ListOp, edit, std::move(list),
            old ? old->as_integer_list_op() : nullptr);
}

void TextReader::read_prim_metadata(PrimBuilder& prim) {
  static constexpr std::array<std::string_view, 5> kListKeys = {"references", "payload", "inherits",
                                                                "specializes", "variantSets"};
  read_block('(', ')', [&] {
    const auto edit = accept_edit();
    for (const std::string_view key : kListKeys) {
      if (scanner_.accept_word(key)) {
        scanner_.expect_assignment();
        return read_prim_keyword(prim, key, edit.value_or(Edit::Explicit));
      }
    }
    if (edit) return read_list_field(prim.fields, *edit);
    if (scanner_.accept_word("kind")) {
      scanner_.expect_assignment();
      if (!scanner_.at_string()) scanner_.fail("expected a quoted text for kind");
      set_field(prim.fields, "kind", Value::text(Type::Token, scanner_.read_string()));
      return;
    }
    if (scanner_.accept_word("variants")) return read_variant_selections(prim);
    if (scanner_.accept_word("relocates")) return read_relocates(prim, "relocates");
    if (scanner_.accept_word("prefixSubstitutions") ||
        scanner_.accept_word("suffixSubstitutions")) {
      return read_substitutions();
    }
    if (!read_shared_metadata(prim.fields)) scanner_.fail("expected prim metadata");
  });
}

void TextReader::read_prim_keyword(PrimBuilder& prim, std::string_view key, Edit edit) {
  if (key == "references") return read_references(prim, "references", false, edit);
  if (key == "payload") return read_references(prim, "payload", true, edit);
  if (key == "inherits") return read_class_paths(prim, "inheritPaths", edit);
  if (key == "specializes") return read_class_paths(prim, "specializes", edit);
  Strings names = read_name_list();
  require_distinct(names, "variantSets");
  for (const std::string& name : names) {
    if (!path::is_identifier(name)) scanner_.fail("'" + name + "' cannot name a variant set");
  }
  edit_list(prim.fields, "variantSetNames", Type::StringListOp, edit, std::move(names));
}

void TextReader::read_substitutions() {
  scanner_.expect_assignment();
  scanner_.expect('{', "before substitutions");
  scanner_.skip_lines();
  while (!scanner_.accept('}')) {
    if (!scanner_.at_string()) scanner_.fail("expected a quoted text");
    scanner_.read_string();
    scanner_.skip_inline();
    scanner_.expect(':', "between the texts");
    scanner_.skip_inline();
    if (!scanner_.at_string()) scanner_.fail("expected a quoted text");
    scanner_.read_string();
    scanner_.skip_inline();
    const bool has_more = scanner_.accept(',');
    scanner_.skip_lines();
    if (!has_more && scanner_.peek() != '}') scanner_.expect('}', "after substitutions");
  }
}

Strings TextReader::read_name_list() {
  const auto read_name = [&] {
    if (!scanner_.at_string()) scanner_.fail("expected a quoted name");
    return scanner_.read_string();
  };
  if (scanner_.peek() != '[') return {read_name()};
  return read_items<std::string>(read_name, false);
}

// `[ item, item, ]`.
template <class Item, class Read>
std::vector<Item> TextReader::read_items(Read read, bool allow_empty) {
  std::vector<Item> items;
  scanner_.expect('[', "before a list");
  scanner_.skip_lines();
  while (!scanner_.accept(']')) {
    items.push_back(read());
    const std::size_t after = scanner_.position();
    scanner_.skip_inline();
    const bool has_more = scanner_.accept(',');
    if (!has_more) scanner_.rewind(after);
    scanner_.skip_lines();
    if (!has_more && scanner_.peek() != ']') scanner_.expect(']', "after a list");
  }
  if (items.empty() && !allow_empty) scanner_.fail("the list is empty");
  return items;
}

LayerOffset TextReader::read_layer_offset(bool allow_custom_data) {
  LayerOffset offset;
  read_block('(', ')', [&] {
    if (allow_custom_data && scanner_.accept_word("customData")) {
      scanner_.expect_assignment();
      read_text_dictionary(scanner_);
      return;
    }
    const bool is_offset = scanner_.accept_word("offset");
    if (!is_offset && !scanner_.accept_word("scale")) scanner_.fail("expected offset or scale");
    scanner_.expect_assignment();
    const std::string_view digits = scanner_.read_number();
    if (digits.empty()) scanner_.fail("expected a number");
    (is_offset ? offset.offset : offset.scale) = parse_number(digits);
  });
  return offset;
}

Reference TextReader::read_reference(bool is_payload) {
  Reference reference;
  if (scanner_.peek() == '@') {
    reference.asset = scanner_.read_asset();
    if (reference.asset.empty()) {
      scanner_.fail(std::string("the asset of a ") + (is_payload ? "payload" : "reference") +
                    " is empty; a prim of the same layer is named without @@");
    }
    const std::size_t after = scanner_.position();
    scanner_.skip_inline();
    if (scanner_.peek() != '<') scanner_.rewind(after);
  } else if (scanner_.peek() != '<') {
    scanner_.fail("expected an asset between @ signs or a path between < >");
  }
  if (scanner_.peek() == '<') {
    reference.path = scanner_.read_path();
    const bool is_usable = reference.path.empty() ||
                           (reference.path.front() == '/' && path::is_prim_path(reference.path));
    if (!is_usable) scanner_.fail("<" + reference.path + "> is not the absolute path of a prim");
  }
  const std::size_t after = scanner_.position();
  scanner_.skip_inline();
  if (scanner_.peek() == '(') {
    reference.offset = read_layer_offset(!is_payload);
  } else {
    scanner_.rewind(after);
  }
  return reference;
}

void TextReader::read_references(PrimBuilder& prim, std::string_view field, bool is_payload,
                                 Edit edit) {
  std::vector<Reference> items;
  if (scanner_.accept_word("None")) {
    if (edit != Edit::Explicit) scanner_.fail("None cannot be added to a list or removed from it");
  } else if (scanner_.peek() == '[') {
    items =
        read_items<Reference>([&] { return read_reference(is_payload); }, edit == Edit::Explicit);
  } else {
    items.push_back(read_reference(is_payload));
  }
  for (std::size_t i = 0; i < items.size(); ++i) {
    if (std::find(items.begin(), items.begin() + i, items[i]) != items.begin() + i) {
      scanner_.fail(std::string(field) + " hold the same item twice");
    }
  }
  const Value* old = find_field(prim.fields, field);
  edit_list(prim.fields, field, is_payload ? Type::PayloadListOp : Type::ReferenceListOp, edit,
            std::move(items), old ? old->as_reference_list_op() : nullptr);
}

void TextReader::read_class_paths(PrimBuilder& prim, std::string_view field, Edit edit) {
  const auto read_path = [&] {
    const std::string path = resolve(scanner_.read_path(), prim);
    if (!path::is_prim_path(path)) scanner_.fail("<" + path + "> is not the path of a prim");
    return path;
  };
  Strings paths;
  if (scanner_.accept_word("None")) {
    if (edit != Edit::Explicit) scanner_.fail("None cannot be added to a list or removed from it");
  } else if (scanner_.peek() == '[') {
    paths = read_items<std::string>(read_path, edit == Edit::Explicit);
  } else {
    paths.push_back(read_path());
  }
  require_distinct(paths, "the list");
  edit_list(prim.fields, field, Type::PathListOp, edit, std::move(paths));
}

void TextReader::read_relocates(PrimBuilder& prim, std::string_view field) {
  const auto read_path = [&](bool may_be_empty) {
    const std::string text = scanner_.read_path();
    if (text.empty() && may_be_empty) return text;
    std::string path = resolve(text, prim);
    if (!path::is_prim_path(path)) scanner_.fail("<" + text + "> is not the path of a prim");
    return path;
  };
  scanner_.expect_assignment();
  scanner_.expect('{', "before relocates");
  scanner_.skip_lines();
  StringPairs pairs;
  while (!scanner_.accept('}')) {
    std::string source = read_path(false);
    scanner_.skip_inline();
    scanner_.expect(':', "between two paths");
    scanner_.skip_inline();
    pairs.emplace_back(std::move(source), read_path(true));
    scanner_.skip_inline();
    const bool has_more = scanner_.accept(',');
    scanner_.skip_lines();
    if (!has_more && scanner_.peek() != '}') scanner_.expect('}', "after relocates");
  }
  set_field(prim.fields, field,
            Value(Type::Relocates, std::make_shared<const StringPairs>(std::move(pairs))));
}

void TextReader::read_variant_selections(PrimBuilder& prim) {
  scanner_.expect_assignment();
  StringPairs pairs;
  const auto dictionary = read_text_dictionary(scanner_);
  for (const auto& [set, value] : *dictionary) {
    const std::string* variant = value.type() == Type::String ? value.as_text() : nullptr;
    if (!variant) scanner_.fail("the selection of variant set '" + set + "' is not a string");
    if (!variant->empty() && !is_expression(*variant) && !path::is_variant_name(*variant)) {
      scanner_.fail("'" + *variant + "' cannot name a variant");
    }
    pairs.emplace_back(set, *variant);
  }
  set_field(
      prim.fields, "variantSelection",
      Value(Type::VariantSelectionMap, std::make_shared<const StringPairs>(std::move(pairs))));
}

bool TextReader::at_prim() const {
  const std::string_view word = scanner_.peek_word();
  return word == "def" || word == "over" || word == "class";
}

void TextReader::read_prim(PrimBuilder& parent, int nesting) {
  if (nesting > kMaxPrimNesting) scanner_.fail("prims are nested too deeply");
  PrimBuilder prim;
  const std::string_view word = scanner_.peek_word();
  const Specifier specifier = word == "def"    ? Specifier::Def
                              : word == "over" ? Specifier::Over
                                               : Specifier::Class;
  scanner_.advance(word.size());
  scanner_.require_space("the specifier");
  set_field(prim.fields, "specifier",
            Value::enumerator(Type::Specifier, static_cast<int>(specifier)));
  if (!scanner_.at_string()) {
    std::string type = read_type_name();
    while (scanner_.accept('.')) type += "." + read_type_name();
    scanner_.require_space("the type of a prim");
    set_field(prim.fields, "typeName", Value::text(Type::Token, type));
  }
  if (!scanner_.at_string()) scanner_.fail("expected the quoted name of the prim");
  const std::string name = scanner_.read_string();
  if (!path::is_identifier(name)) scanner_.fail("'" + name + "' cannot name a prim");
  if (!parent.child_names.insert(name).second) {
    scanner_.fail("there is a prim '" + name + "' already");
  }
  parent.children.push_back(name);
  prim.path = path::append_child(parent.path, name);
  scanner_.skip_lines();
  if (scanner_.peek() == '(') read_prim_metadata(prim);
  scanner_.skip_lines();
  scanner_.expect('{', "before the contents of a prim");
  read_contents(prim, nesting);
  scanner_.expect('}', "after the contents of a prim");
  store(prim, SpecType::Prim);
}

void TextReader::read_contents(PrimBuilder& prim, int nesting) {
  scanner_.skip_lines();
  while (!scanner_.at_end() && scanner_.peek() != '}') {
    if (at_prim()) {
      read_prim(prim, nesting + 1);
      end_statement(false);
    } else if (scanner_.accept_word("variantSet")) {
      read_variant_set(prim, nesting);
      end_statement(false);
    } else {
      if (!read_order(prim)) read_property(prim);
      end_statement(true);
    }
    scanner_.skip_lines();
  }
}

void TextReader::read_variant_set(PrimBuilder& prim, int nesting) {
  if (nesting > kMaxPrimNesting) scanner_.fail("variants are nested too deeply");
  scanner_.require_space("variantSet");
  if (!scanner_.at_string()) scanner_.fail("expected the quoted name of the variant set");
  const std::string set = scanner_.read_string();
  if (!path::is_identifier(set)) scanner_.fail("'" + set + "' cannot name a variant set");
  scanner_.skip_inline();
  scanner_.expect('=', "before the variants");
  scanner_.skip_lines();
  scanner_.expect('{', "before the variants");
  scanner_.skip_lines();
  Strings variants;
  while (!scanner_.accept('}')) {
    if (!scanner_.at_string()) scanner_.fail("expected the quoted name of a variant");
    const std::string name = scanner_.read_string();
    if (!path::is_variant_name(name)) scanner_.fail("'" + name + "' cannot name a variant");
    PrimBuilder variant;
    variant.path = path::append_variant(prim.path, set, name);
    scanner_.skip_lines();
    if (scanner_.peek() == '(') read_prim_metadata(variant);
    scanner_.skip_lines();
    scanner_.expect('{', "before the contents of a variant");
    read_contents(variant, nesting + 1);
    scanner_.expect('}', "after the contents of a variant");
    scanner_.skip_lines();
    store(variant, SpecType::Variant);
    variants.push_back(name);
  }
  PrimBuilder spec;
  spec.path = path::append_variant(prim.path, set, "");
  set_field(spec.fields, "variantChildren",
            Value(Type::TokenVector, std::make_shared<const Strings>(std::move(variants))));
  store(spec, SpecType::VariantSet);
}

bool TextReader::read_order(PrimBuilder& prim) {
  const std::size_t start = scanner_.position();
  if (!scanner_.accept_word("reorder")) return false;
  scanner_.require_space("reorder");
  const bool orders_children = scanner_.accept_word("nameChildren");
  if (!orders_children && !scanner_.accept_word("properties")) {
    scanner_.rewind(start);
    return false;
  }
  scanner_.skip_inline();
  if (scanner_.peek() != '=') {
    scanner_.rewind(start);
    return false;
  }
  scanner_.expect_assignment();
  set_field(prim.fields, orders_children ? "primOrder" : "propertyOrder",
            Value(Type::TokenVector, std::make_shared<const Strings>(read_name_list())));
  return true;
}

std::string TextReader::read_property_name() {
  std::string name;
  for (;;) {
    const std::string_view word = scanner_.peek_word();
    if (word.empty()) scanner_.fail("expected the name of a property");
    name += word;
    scanner_.advance(word.size());
    if (!scanner_.accept(':')) return name;
    name += ':';
  }
}

std::string TextReader::read_type_name() {
  std::string name;
  for (;;) {
    const std::string_view word = scanner_.peek_word();
    if (word.empty() || is_keyword(word)) scanner_.fail("expected a type");
    name += word;
    scanner_.advance(word.size());
    if (!scanner_.rest().starts_with("::")) return name;
    scanner_.advance(2);
    name += "::";
  }
}

void TextReader::read_property(PrimBuilder& prim) {
  const auto edit = accept_edit();
  const auto accept = [&](const char* word) {
    if (!scanner_.accept_word(word)) return false;
    scanner_.require_space(word);
    return true;
  };
  const bool is_custom = accept("custom");
  const bool is_varying = accept("varying");
  if (accept("rel")) {
    return read_relationship(prim, edit.value_or(Edit::Explicit), edit.has_value(), is_custom);
  }
  if (is_varying) scanner_.fail("expected rel after varying");
  read_attribute(prim, edit.value_or(Edit::Explicit), edit.has_value(), is_custom);
}

PropertyBuilder& TextReader::property(PrimBuilder& prim, const std::string& name, SpecType type) {
  const auto [entry, is_new] = prim.property_of_name.try_emplace(name, prim.properties.size());
  if (is_new) prim.properties.push_back({name, type, {}});
  PropertyBuilder& result = prim.properties[entry->second];
  if (result.type != type) {
    scanner_.fail("'" + name + "' is an attribute in one place and a relationship in another");
  }
  return result;
}

std::string TextReader::resolve(const std::string& path, const PrimBuilder& prim) const {
  std::string result = path::make_absolute(path, path::strip_variants(prim.path));
  if (path.empty() || result.empty()) scanner_.fail("<" + path + "> does not lead to a prim");
  return result;
}

void TextReader::require_distinct(const Strings& items, const char* what) const {
  const std::set<std::string_view> distinct(items.begin(), items.end());
  if (distinct.size() != items.size()) {
    scanner_.fail(std::string(what) + ": an item is listed twice");
  }
}

Strings TextReader::read_target_paths(const PrimBuilder& prim, bool is_edit, bool& is_none) {
  const auto read_path = [&] {
    const std::string path = resolve(scanner_.read_path(), prim);
    if (path::has_variants(path)) scanner_.fail("<" + path + "> must not select a variant");
    return path;
  };
  Strings paths;
  is_none = scanner_.accept_word("None");
  if (is_none) {
    if (is_edit) scanner_.fail("None cannot be added to a list or removed from it");
  } else if (scanner_.peek() == '[') {
    paths = read_items<std::string>(read_path, !is_edit);
  } else {
    paths.push_back(read_path());
  }
  require_distinct(paths, "targets");
  return paths;
}

void TextReader::read_relationship(PrimBuilder& prim, Edit edit, bool is_edit, bool is_custom) {
  PropertyBuilder& relationship = property(prim, read_property_name(), SpecType::Relationship);
  if (is_custom) set_field(relationship.fields, "custom", Value::boolean(true));
  const std::size_t after = scanner_.position();
  scanner_.skip_inline();
  if (!is_edit && scanner_.accept('.')) {
    scanner_.skip_inline();
    if (!scanner_.accept_word("default")) scanner_.fail("expected default");
    scanner_.expect_assignment();
    scanner_.read_path();
    return;
  }
  if (!is_edit && scanner_.accept('[')) {
    scanner_.skip_inline();
    scanner_.read_path();
    scanner_.skip_inline();
    scanner_.expect(']', "after a target");
    return;
  }
  if (scanner_.peek() == '=') {
    scanner_.expect_assignment();
    bool is_none = false;
    Strings targets = read_target_paths(prim, is_edit, is_none);
    edit_list(relationship.fields, "targetPaths", Type::PathListOp, edit, std::move(targets));
  } else {
    scanner_.rewind(after);
  }
  const std::size_t end = scanner_.position();
  scanner_.skip_inline();
  if (!is_edit && scanner_.peek() == '(') {
    read_property_metadata(relationship.fields, false);
  } else {
    scanner_.rewind(end);
  }
}

void TextReader::read_attribute(PrimBuilder& prim, Edit edit, bool is_edit, bool is_custom) {
  bool is_uniform = false;
  for (const char* word : {"uniform", "config"}) {
    if (!is_uniform && scanner_.accept_word(word)) {
      scanner_.require_space(word);
      is_uniform = true;
    }
  }
  std::string type_name = read_type_name();
  const std::size_t after_type = scanner_.position();
  scanner_.skip_inline();
  if (scanner_.accept('[')) {
    scanner_.skip_inline();
    scanner_.expect(']', "after [");
    type_name += "[]";
  } else {
    scanner_.rewind(after_type);
  }
  scanner_.require_space("a type");
  const ValueTypeName type = parse_value_type(type_name);
  PropertyBuilder& attribute = property(prim, read_property_name(), SpecType::Attribute);
  const Value* old_type = find_field(attribute.fields, "typeName");
  if (old_type && *old_type->as_text() != type_name) {
    scanner_.fail("'" + attribute.name + "' is of type " + *old_type->as_text() +
                  " in one place and of type " + type_name + " in another");
  }
  const Value* variability = find_field(attribute.fields, "variability");
  if (old_type && (variability != nullptr) != is_uniform) {
    scanner_.fail("'" + attribute.name + "' is uniform in one place and varying in another");
  }
  set_field(attribute.fields, "typeName", Value::text(Type::Token, type_name));
  if (is_custom) set_field(attribute.fields, "custom", Value::boolean(true));
  if (is_uniform)
    set_field(attribute.fields, "variability", Value::enumerator(Type::Variability, 1));

  const std::size_t after = scanner_.position();
  scanner_.skip_inline();
  if (scanner_.accept('.')) {
    scanner_.skip_inline();
    if (scanner_.accept_word("connect")) return read_connections(prim, attribute, edit, is_edit);
    if (!is_edit && scanner_.accept_word("timeSamples")) return read_time_samples(attribute, type);
    if (!is_edit && scanner_.accept_word("spline")) return skip_spline(type);
    scanner_.fail("expected connect, timeSamples or spline");
  }
  if (is_edit) scanner_.fail("only connections of attributes can be edited as lists");
  scanner_.rewind(after);
  read_attribute_value(attribute, type);
}

void TextReader::read_attribute_value(PropertyBuilder& attribute, const ValueTypeName& type) {
  std::size_t after = scanner_.position();
  scanner_.skip_inline();
  if (scanner_.peek() == '=') {
    scanner_.expect_assignment();
    if (scanner_.accept_word("None") || scanner_.accept_word("AnimationBlock")) {
      set_field(attribute.fields, "default", Value::block());
    } else {
      const std::string& name = find_field(attribute.fields, "typeName")->as_text()[0];
      if (name == "opaque" || name == "group") {
        scanner_.fail("an attribute of type " + name + " cannot have a value");
      }
      set_field(attribute.fields, "default", read_text_value(scanner_, type));
    }
    after = scanner_.position();
    scanner_.skip_inline();
  }
  if (scanner_.peek() == '(') {
    read_property_metadata(attribute.fields, true);
  } else {
    scanner_.rewind(after);
  }
}

void TextReader::read_time_samples(PropertyBuilder& attribute, const ValueTypeName& type) {
  if (type.type == Type::Invalid) scanner_.fail("time samples of a type that is not known");
  scanner_.expect_assignment();
  scanner_.expect('{', "before time samples");
  scanner_.skip_lines();
  std::map<double, Value> values;
  while (!scanner_.accept('}')) {
    const std::string_view digits = scanner_.read_number();
    if (digits.empty() || digits == "nan") scanner_.fail("expected the time of a sample");
    scanner_.skip_inline();
    scanner_.expect(':', "after the time of a sample");
    scanner_.skip_inline();
    Value value = scanner_.accept_word("None") ? Value::block() : read_text_value(scanner_, type);
    values.insert_or_assign(parse_number(digits), std::move(value));
    const std::size_t after = scanner_.position();
    scanner_.skip_inline();
    const bool has_more = scanner_.accept(',');
    if (!has_more) scanner_.rewind(after);
    scanner_.skip_lines();
    if (!has_more && scanner_.peek() != '}') scanner_.expect('}', "after time samples");
  }
  auto samples = std::make_shared<TimeSamples>();
  for (auto& [time, value] : values) {
    samples->times.push_back(time);
    samples->values.push_back(std::move(value));
  }
  set_field(attribute.fields, "timeSamples",
            Value(Type::TimeSamples, std::shared_ptr<const TimeSamples>(std::move(samples))));
}

void TextReader::read_connections(const PrimBuilder& prim, PropertyBuilder& attribute, Edit edit,
                                  bool is_edit) {
  scanner_.expect_assignment();
  bool is_none = false;
  Strings targets = read_target_paths(prim, is_edit, is_none);
  edit_list(attribute.fields, "connectionPaths", Type::PathListOp, edit, std::move(targets));
}

// Splines hold animation; the reader takes defaults and samples only.
void TextReader::skip_spline(const ValueTypeName& type) {
  const bool is_number = !type.is_array && (type.type == Type::Double || type.type == Type::Float ||
                                            type.type == Type::Half || type.type == Type::TimeCode);
  if (!is_number) scanner_.fail("an attribute of type " + type.canonical + " cannot be a spline");
  scanner_.expect_assignment();
  scanner_.expect('{', "before a spline");
  for (int open = 1; open > 0;) {
    scanner_.skip_lines();
    if (scanner_.at_end()) scanner_.fail("the spline is not closed");
    if (scanner_.at_string()) {
      scanner_.read_string();
      continue;
    }
    const char c = scanner_.peek();
    if (c == '{') ++open;
    if (c == '}') --open;
    scanner_.advance(1);
  }
}

void TextReader::read_property_metadata(Fields& fields, bool is_attribute) {
  read_block('(', ')', [&] {
    if (const auto edit = accept_edit()) return read_list_field(fields, *edit);
    if (is_attribute && scanner_.accept_word("displayUnit")) {
      scanner_.expect_assignment();
      const std::string_view word = scanner_.peek_word();
      if (std::find(kDisplayUnits.begin(), kDisplayUnits.end(), word) == kDisplayUnits.end()) {
        scanner_.fail("'" + std::string(word) + "' is not a unit; known are " +
                      list_of(kDisplayUnits));
      }
      scanner_.advance(word.size());
      return;
    }
    if (!read_shared_metadata(fields)) scanner_.fail("expected the metadata of a property");
  });
}

FieldSet TextReader::store(const Fields& fields) {
  auto& indices = layer_->field_indices();
  const FieldSet set{static_cast<std::uint32_t>(indices.size()),
                     static_cast<std::uint32_t>(fields.size())};
  for (const auto& [name, value] : fields) {
    Layer::Field field;
    field.name = name;
    field.value = value;
    indices.push_back(layer_->add_field(std::move(field)));
  }
  return set;
}

void TextReader::store(PrimBuilder& prim, SpecType type) {
  if (!prim.children.empty()) {
    set_field(prim.fields, "primChildren",
              Value(Type::TokenVector, std::make_shared<const Strings>(std::move(prim.children))));
  }
  PrimSpec spec;
  spec.type = type;
  spec.fields = store(prim.fields);
  for (const PropertyBuilder& property : prim.properties) {
    auto known = names_.find(property.name);
    if (known == names_.end()) {
      known = names_.emplace(property.name, layer_->intern(property.name)).first;
    }
    spec.properties.push_back({known->second, property.type, store(property.fields)});
  }
  layer_->prims().insert_or_assign(std::move(prim.path), std::move(spec));
}

}  // namespace

bool is_text_layer(std::string_view text) {
  return text.starts_with("#usda 1.") || text.starts_with("#sdf 1.4.32");
}

std::shared_ptr<Layer> read_text_layer(const std::string& identifier, std::string_view text) {
  return TextReader(identifier, text).read();
}

}  // namespace diorama::usd
