// SPDX-License-Identifier: Apache-2.0
#include "framework/export/crate_writer.h"

#include <algorithm>
#include <cstring>
#include <map>
#include <string_view>
#include <utility>

#include "diorama/rng.h"

namespace diorama::usd_export {
namespace {

// Names and numbers of the format: OpenUSD, pxr/usd/usd/crateFile.{h,cpp}, crateDataTypes.h.
enum class Type : std::uint64_t {
  Bool = 1,
  Int = 3,
  Float = 8,
  Double = 9,
  String = 10,
  Token = 11,
  AssetPath = 12,
  Matrix4d = 15,
  Quatf = 17,
  Vec2f = 20,
  Vec3d = 23,
  Vec3f = 24,
  Vec4f = 28,
  TokenListOp = 32,
  PathListOp = 34,
  TokenVector = 41,
  Specifier = 42,
  Variability = 44,
};
enum class SpecType : std::int32_t { Attribute = 1, Prim = 6, PseudoRoot = 7, Relationship = 8 };

constexpr std::uint64_t kIsArray = 1ull << 63;
constexpr std::uint64_t kIsInlined = 1ull << 62;
constexpr std::uint64_t kIsCompressed = 1ull << 61;
constexpr std::size_t kBootstrapSize = 88;
constexpr std::size_t kLeastCompressed = 16;  ///< Shorter integer arrays are stored plainly.
constexpr std::uint8_t kListIsExplicit = 0x01, kListHasExplicit = 0x02, kListHasPrepended = 0x20;

std::uint64_t rep(Type type, std::uint64_t payload) { return std::uint64_t(type) << 48 | payload; }
std::uint64_t inlined(Type type, std::uint32_t bits) { return rep(type, bits) | kIsInlined; }

template <class Plain>
void append_plain(Bytes& bytes, const Plain& value) {
  // Eigen's vectors are plain numbers, but do not say so to the language: byte by byte, then.
  const auto* const begin = reinterpret_cast<const Bytes::value_type*>(&value);
  bytes.insert(bytes.end(), begin, begin + sizeof value);
}
void append_plain(Bytes& bytes, const Bytes& more) {
  bytes.insert(bytes.end(), more.begin(), more.end());
}

class CrateWriter {
 public:
  CrateWriter() : file_(kBootstrapSize, std::byte{0}) {
    // A property's token is stored negated, so that none may have the number 0.
    token(";-)");
  }

  Bytes write(const Layer& layer) {
    add_layer(layer);
    std::vector<std::pair<const char*, Bytes>> sections;
    sections.emplace_back("TOKENS", tokens_section());
    sections.emplace_back("STRINGS", strings_section());
    sections.emplace_back("FIELDS", fields_section());
    sections.emplace_back("FIELDSETS", integers_section(field_sets_));
    sections.emplace_back("PATHS", paths_section());
    sections.emplace_back("SPECS", specs_section());
    Bytes contents;
    append_plain(contents, std::uint64_t(sections.size()));
    for (const auto& [name, bytes] : sections) {
      std::array<char, 16> label{};
      std::strncpy(label.data(), name, label.size() - 1);
      append_plain(contents, label);
      append_plain(contents, std::int64_t(file_.size()));
      append_plain(contents, std::int64_t(bytes.size()));
      append_plain(file_, bytes);
    }
    const auto contents_at = std::int64_t(file_.size());
    append_plain(file_, contents);
    const std::array<char, 16> start{'P', 'X', 'R', '-', 'U', 'S', 'D', 'C', 0, 8, 0};
    std::memcpy(file_.data(), start.data(), start.size());
    std::memcpy(file_.data() + 16, &contents_at, sizeof contents_at);
    return std::move(file_);
  }

 private:
  using Field = std::pair<std::int32_t, std::uint64_t>;  // token, value

  std::int32_t token(std::string_view text) {
    const auto [entry, is_new] =
        token_of_.try_emplace(std::string(text), std::int32_t(tokens_.size()));
    if (is_new) tokens_.emplace_back(text);
    return entry->second;
  }
  std::uint32_t string(const std::string& text) {
    const std::int32_t t = token(text);
    const auto [entry, is_new] = string_of_.try_emplace(t, std::uint32_t(strings_.size()));
    if (is_new) strings_.push_back(t);
    return entry->second;
  }

  /// Where these bytes stand in the file; equal bytes are written once.
  std::uint64_t place(const Bytes& bytes) {
    const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    auto& known = placed_[stable_hash(text)];
    for (const auto& [at, size] : known) {
      if (size == bytes.size() && std::memcmp(file_.data() + at, bytes.data(), size) == 0)
        return at;
    }
    file_.resize((file_.size() + 7) / 8 * 8);
    known.emplace_back(file_.size(), bytes.size());
    append_plain(file_, bytes);
    return known.back().first;
  }
  template <class Plain>
  std::uint64_t placed(Type type, const Plain& value) {
    Bytes bytes;
    append_plain(bytes, value);
    return rep(type, place(bytes));
  }
  template <class Item>
  std::uint64_t placed_array(Type type, const std::vector<Item>& items) {
    if (items.empty()) return rep(type, 0) | kIsArray;
    Bytes bytes;
    append_plain(bytes, std::uint64_t(items.size()));
    for (const Item& item : items) append_plain(bytes, item);
    return rep(type, place(bytes)) | kIsArray;
  }

  std::uint64_t value(bool v) { return inlined(Type::Bool, v ? 1 : 0); }
  std::uint64_t value(int v) { return inlined(Type::Int, std::uint32_t(v)); }
  std::uint64_t value(float v) {
    std::uint32_t bits = 0;
    std::memcpy(&bits, &v, sizeof bits);
    return inlined(Type::Float, bits);
  }
  std::uint64_t value(double v) {
    const auto single = float(v);
    if (double(single) != v) return placed(Type::Double, v);
    std::uint32_t bits = 0;
    std::memcpy(&bits, &single, sizeof bits);
    return inlined(Type::Double, bits);
  }
  std::uint64_t value(const std::string& v) { return inlined(Type::String, string(v)); }
  std::uint64_t value(const Token& v) { return inlined(Type::Token, std::uint32_t(token(v.text))); }
  std::uint64_t value(const AssetPath& v) {
    return inlined(Type::AssetPath, std::uint32_t(token(v.text)));
  }
  std::uint64_t value(const Vec2f& v) { return placed(Type::Vec2f, std::array{v.x(), v.y()}); }
  std::uint64_t value(const Vec3f& v) {
    return placed(Type::Vec3f, std::array{v.x(), v.y(), v.z()});
  }
  std::uint64_t value(const Float4& v) { return placed(Type::Vec4f, v); }
  std::uint64_t value(const Eigen::Quaternionf& q) {
    return placed(Type::Quatf, std::array{q.x(), q.y(), q.z(), q.w()});
  }
  std::uint64_t value(const Double3& v) { return placed(Type::Vec3d, v); }
  std::uint64_t value(const Matrix& v) { return placed(Type::Matrix4d, v); }
  std::uint64_t value(const std::vector<Vec2f>& v) { return placed_array(Type::Vec2f, v); }
  std::uint64_t value(const std::vector<Vec3f>& v) { return placed_array(Type::Vec3f, v); }
  std::uint64_t value(const std::vector<Token>& v) {
    std::vector<std::int32_t> indices;
    for (const Token& t : v) indices.push_back(token(t.text));
    return placed_array(Type::Token, indices);
  }
  std::uint64_t value(const std::vector<int>& v) {
    if (v.size() < kLeastCompressed) return placed_array(Type::Int, v);
    const Bytes coded = code_integers(v);
    Bytes bytes;
    append_plain(bytes, std::uint64_t(v.size()));
    append_plain(bytes, std::uint64_t(coded.size()));
    append_plain(bytes, coded);
    return rep(Type::Int, place(bytes)) | kIsArray | kIsCompressed;
  }
  std::uint64_t token_vector(const std::vector<std::string>& names) {
    Bytes bytes;
    append_plain(bytes, std::uint64_t(names.size()));
    for (const std::string& name : names) append_plain(bytes, token(name));
    return rep(Type::TokenVector, place(bytes));
  }
  std::uint64_t prepended_tokens(const std::vector<std::string>& names) {
    Bytes bytes;
    append_plain(bytes, kListHasPrepended);
    append_plain(bytes, std::uint64_t(names.size()));
    for (const std::string& name : names) append_plain(bytes, token(name));
    return rep(Type::TokenListOp, place(bytes));
  }
  std::uint64_t explicit_paths(const std::vector<std::string>& paths) {
    Bytes bytes;
    append_plain(bytes, std::uint8_t(kListIsExplicit | kListHasExplicit));
    append_plain(bytes, std::uint64_t(paths.size()));
    for (const std::string& path : paths) append_plain(bytes, path_of_.at(path));
    return rep(Type::PathListOp, place(bytes));
  }

  std::int32_t add_field(std::string_view name, std::uint64_t field_value) {
    const Field field{token(name), field_value};
    const auto [entry, is_new] = field_of_.try_emplace(field, std::int32_t(fields_.size()));
    if (is_new) fields_.push_back(field);
    return entry->second;
  }
  void add_spec(std::int32_t path, SpecType type, const std::vector<std::int32_t>& fields) {
    const auto [entry, is_new] = set_of_.try_emplace(fields, std::int32_t(field_sets_.size()));
    if (is_new) {
      field_sets_.insert(field_sets_.end(), fields.begin(), fields.end());
      field_sets_.push_back(-1);
    }
    spec_paths_.push_back(path);
    spec_sets_.push_back(entry->second);
    spec_types_.push_back(std::int32_t(type));
  }

  // One entry of the path tree; its number is its place in the list, depth first.
  std::int32_t add_path(const std::string& path, std::int32_t element) {
    const auto number = std::int32_t(elements_.size());
    path_of_.emplace(path, number);
    elements_.push_back(element);
    jumps_.push_back(-2);
    return number;
  }
  /// Numbers everything below a prim; properties come before children.
  void add_paths_below(const std::vector<Property>& properties, const std::vector<Prim>& children,
                       const std::string& path, std::int32_t number) {
    std::int32_t last = -1;
    const auto link = [&](std::int32_t next) {
      // The one before gets a sibling: right behind it when it has no children of its own.
      if (last >= 0) jumps_[std::size_t(last)] = jumps_[std::size_t(last)] == -1 ? next - last : 0;
      last = next;
    };
    for (const Property& property : properties) {
      link(add_path(path + "." + property.name, -token(property.name)));
    }
    for (const Prim& child : children) {
      const std::string child_path = path + "/" + child.name;
      const std::int32_t next = add_path(child_path, token(child.name));
      link(next);
      add_paths_below(child.properties, child.children, child_path, next);
    }
    if (last >= 0) jumps_[std::size_t(number)] = -1;
  }

  void add_layer(const Layer& layer) {
    // Paths first: connections refer to them by number.
    add_path("/", token(""));
    add_paths_below({}, layer.roots, "", 0);
    std::vector<std::int32_t> fields;
    if (!layer.roots.empty())
      fields.push_back(add_field("defaultPrim", value(Token{layer.roots[0].name})));
    fields.push_back(add_field("metersPerUnit", value(1.0)));
    fields.push_back(add_field("upAxis", value(Token{"Z"})));
    fields.push_back(add_field("primChildren", token_vector(names_of(layer.roots))));
    add_spec(0, SpecType::PseudoRoot, fields);
    for (const Prim& prim : layer.roots) add_prim(prim, "/" + prim.name);
  }

  template <class Named>
  static std::vector<std::string> names_of(const std::vector<Named>& list) {
    std::vector<std::string> names;
    for (const Named& item : list) names.push_back(item.name);
    return names;
  }

  void add_prim(const Prim& prim, const std::string& path) {
    std::vector<std::int32_t> fields{add_field("specifier", inlined(Type::Specifier, 0))};
    if (!prim.type.empty()) fields.push_back(add_field("typeName", value(Token{prim.type})));
    if (!prim.api_schemas.empty()) {
      fields.push_back(add_field("apiSchemas", prepended_tokens(prim.api_schemas)));
    }
    if (!prim.kind.empty()) fields.push_back(add_field("kind", value(Token{prim.kind})));
    if (!prim.properties.empty()) {
      fields.push_back(add_field("properties", token_vector(names_of(prim.properties))));
    }
    if (!prim.children.empty()) {
      fields.push_back(add_field("primChildren", token_vector(names_of(prim.children))));
    }
    add_spec(path_of_.at(path), SpecType::Prim, fields);
    for (const Property& property : prim.properties) add_property(property, path);
    for (const Prim& child : prim.children) add_prim(child, path + "/" + child.name);
  }

  void add_property(const Property& property, const std::string& prim_path) {
    const std::int32_t path = path_of_.at(prim_path + "." + property.name);
    std::vector<std::int32_t> fields;
    if (property.type.empty()) {
      fields.push_back(add_field("variability", inlined(Type::Variability, 1)));
      fields.push_back(add_field("targetPaths", explicit_paths(property.targets)));
      return add_spec(path, SpecType::Relationship, fields);
    }
    fields.push_back(add_field("typeName", value(Token{property.type})));
    if (property.is_custom) fields.push_back(add_field("custom", value(true)));
    if (property.is_uniform)
      fields.push_back(add_field("variability", inlined(Type::Variability, 1)));
    if (!property.interpolation.empty()) {
      fields.push_back(add_field("interpolation", value(Token{property.interpolation})));
    }
    if (property.value) {
      const std::uint64_t v =
          std::visit([this](const auto& typed) { return value(typed); }, *property.value);
      fields.push_back(add_field("default", v));
    }
    if (!property.targets.empty()) {
      fields.push_back(add_field("connectionPaths", explicit_paths(property.targets)));
    }
    add_spec(path, SpecType::Attribute, fields);
  }

  static void append_compressed(Bytes& bytes, const Bytes& compressed) {
    append_plain(bytes, std::uint64_t(compressed.size()));
    append_plain(bytes, compressed);
  }
  Bytes tokens_section() const {
    Bytes raw;
    for (const std::string& text : tokens_) {
      const auto* begin = reinterpret_cast<const std::byte*>(text.c_str());
      raw.insert(raw.end(), begin, begin + text.size() + 1);
    }
    Bytes bytes;
    append_plain(bytes, std::uint64_t(tokens_.size()));
    append_plain(bytes, std::uint64_t(raw.size()));
    append_compressed(bytes, compress(raw));
    return bytes;
  }
  Bytes strings_section() const {
    Bytes bytes;
    append_plain(bytes, std::uint64_t(strings_.size()));
    for (const std::int32_t index : strings_) append_plain(bytes, index);
    return bytes;
  }
  Bytes fields_section() const {
    std::vector<std::int32_t> names;
    Bytes values;
    for (const auto& [name, field_value] : fields_) {
      names.push_back(name);
      append_plain(values, field_value);
    }
    Bytes bytes = integers_section(names);
    append_compressed(bytes, compress(values));
    return bytes;
  }
  static Bytes integers_section(const std::vector<std::int32_t>& list) {
    Bytes bytes;
    append_plain(bytes, std::uint64_t(list.size()));
    append_compressed(bytes, code_integers(list));
    return bytes;
  }
  Bytes paths_section() const {
    std::vector<std::int32_t> numbers(elements_.size());
    for (std::size_t i = 0; i < numbers.size(); ++i) numbers[i] = std::int32_t(i);
    Bytes bytes;
    append_plain(bytes, std::uint64_t(elements_.size()));
    append_plain(bytes, std::uint64_t(elements_.size()));
    for (const std::vector<std::int32_t>* list :
         {static_cast<const std::vector<std::int32_t>*>(&numbers), &elements_, &jumps_})
      append_compressed(bytes, code_integers(*list));
    return bytes;
  }
  Bytes specs_section() const {
    Bytes bytes;
    append_plain(bytes, std::uint64_t(spec_paths_.size()));
    for (const auto* list : {&spec_paths_, &spec_sets_, &spec_types_})
      append_compressed(bytes, code_integers(*list));
    return bytes;
  }

  Bytes file_;
  std::map<std::uint64_t, std::vector<std::pair<std::size_t, std::size_t>>> placed_;
  std::vector<std::string> tokens_;
  std::map<std::string, std::int32_t, std::less<>> token_of_;
  std::vector<std::int32_t> strings_;
  std::map<std::int32_t, std::uint32_t> string_of_;
  std::vector<Field> fields_;
  std::map<Field, std::int32_t> field_of_;
  std::vector<std::int32_t> field_sets_;
  std::map<std::vector<std::int32_t>, std::int32_t> set_of_;
  std::vector<std::int32_t> elements_, jumps_;
  std::map<std::string, std::int32_t> path_of_;
  std::vector<std::int32_t> spec_paths_, spec_sets_, spec_types_;
};

}  // namespace

Bytes write_crate(const Layer& layer) { return CrateWriter().write(layer); }

}  // namespace diorama::usd_export
