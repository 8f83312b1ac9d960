// SPDX-License-Identifier: Apache-2.0
#include "crate_reader.h"

#include <algorithm>
#include <array>
#include <cstring>

#include "crate_values.h"
#include "path.h"

namespace diorama::usd {
namespace {

constexpr std::string_view kMagic = "PXR-USDC";
constexpr int kNewestMinor = 12;
constexpr std::uint64_t kHeaderSize = 88;
constexpr std::uint64_t kLeastPathRecord = 12;
constexpr std::uint32_t kEndOfFieldSet = 0xFFFFFFFF;
// Elements on the way to a prim, and bytes that all prim paths may take beyond the file's own size:
// far above real scenes, far below what a small damaged file could ask for.
constexpr std::uint32_t kMaxDepth = 2000;
constexpr std::uint64_t kPathBytes = std::uint64_t{1} << 20;
constexpr std::uint64_t kPathBytesPerFileByte = 256;
// Not every path has a place in the tree: the empty path, for one, is an index without a record.
constexpr std::uint64_t kPathsBesideTree = 1024;

struct Section {
  std::uint64_t start = 0;
  std::uint64_t size = 0;
};

struct SpecRecord {
  std::uint32_t path = 0;
  std::uint32_t field_set = 0;
  std::uint32_t type = 0;
};

class CrateReader {
 public:
  CrateReader(const std::string& identifier, ByteView view)
      : view_(view),
        crate_(std::make_shared<CrateValues>(identifier, view)),
        layer_(std::make_shared<Layer>(identifier)) {}

  std::shared_ptr<Layer> read();

 private:
  void read_header();
  CrateCursor section(std::string_view name) const;
  void read_tokens();
  void read_strings();
  void read_fields();
  void read_field_sets();
  void read_paths();
  void read_compressed_paths(CrateCursor& cursor);
  void read_path_records(CrateCursor cursor);
  void set_path(std::uint32_t index, std::uint32_t parent, std::int64_t token, bool is_property,
                const CrateCursor& cursor);
  std::vector<SpecRecord> read_specs();
  void add_prims(const std::vector<SpecRecord>& specs);
  void add_properties(const std::vector<SpecRecord>& specs);
  FieldSet field_set(std::uint32_t index) const;

  bool at_least(int minor) const { return crate_->at_least(minor); }

  ByteView view_;
  std::shared_ptr<CrateValues> crate_;
  std::shared_ptr<Layer> layer_;
  std::array<std::pair<std::string, Section>, 6> sections_{{{"TOKENS", {}},
                                                            {"STRINGS", {}},
                                                            {"FIELDS", {}},
                                                            {"FIELDSETS", {}},
                                                            {"PATHS", {}},
                                                            {"SPECS", {}}}};
  std::uint64_t field_count_ = 0;
  std::vector<std::uint32_t> field_set_ends_;
  std::vector<std::uint32_t> depths_;
  std::vector<PrimSpec*> prim_of_path_;
};

std::shared_ptr<Layer> CrateReader::read() {
  read_header();
  read_tokens();
  read_strings();
  read_fields();
  read_field_sets();
  read_paths();
  const std::vector<SpecRecord> specs = read_specs();
  add_prims(specs);
  add_properties(specs);
  layer_->set_source(crate_);
  return std::move(layer_);
}

void CrateReader::read_header() {
  CrateCursor cursor = crate_->cursor(0);
  if (view_.bytes.size() < kHeaderSize) cursor.fail("the file is too short for a crate header");
  if (!is_crate(view_.bytes)) cursor.fail("this is not a crate file (no PXR-USDC)");
  const auto version = view_.bytes.subspan(8, 3);
  const int major = std::to_integer<int>(version[0]);
  crate_->version_minor_ = std::to_integer<int>(version[1]);
  if (major != 0 || crate_->version_minor_ > kNewestMinor) {
    cursor.fail_at("crate version " + std::to_string(major) + "." +
                       std::to_string(crate_->version_minor_) + "." +
                       std::to_string(std::to_integer<int>(version[2])) +
                       " is not supported; the newest supported one is 0.12",
                   8);
  }
  cursor = crate_->cursor(16);
  const auto contents = cursor.read<std::int64_t>("the offset of the contents");
  if (contents < 0 || static_cast<std::uint64_t>(contents) >= view_.bytes.size()) {
    cursor.fail_at("the table of contents lies behind the end of the file", 16);
  }
  cursor = crate_->cursor(static_cast<std::uint64_t>(contents));
  const std::uint64_t count = cursor.read_count(32, "sections");
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::uint64_t at = cursor.position();
    const auto name_bytes = cursor.take(16, "the name of a section");
    const auto* text = reinterpret_cast<const char*>(name_bytes.data());
    const std::string_view name(text, ::strnlen(text, 16));
    const auto start = cursor.read<std::uint64_t>("the start of a section");
    const auto size = cursor.read<std::uint64_t>("the size of a section");
    if (start > view_.bytes.size() || size > view_.bytes.size() - start) {
      cursor.fail_at("section " + std::string(name) + " reaches behind the end of the file", at);
    }
    for (auto& [known, place] : sections_) {
      if (known == name) place = {start, size};
    }
  }
}

CrateCursor CrateReader::section(std::string_view name) const {
  for (const auto& [known, place] : sections_) {
    if (known != name) continue;
    if (place.size == 0) {
      crate_->cursor(0).fail_at("section " + known + " is missing", 16);
    }
    return CrateCursor(crate_->file(), view_.bytes.first(place.start + place.size), place.start);
  }
  throw FormatError(crate_->file() + ": no section " + std::string(name));
}

void CrateReader::read_tokens() {
  CrateCursor cursor = section("TOKENS");
  const std::uint64_t start = cursor.position();
  const auto count = cursor.read<std::uint64_t>("the number of tokens");
  const auto raw_size = cursor.read<std::uint64_t>("the size of the tokens");
  if (at_least(4)) {
    const auto compressed = cursor.read<std::uint64_t>("the compressed size of the tokens");
    crate_->token_text_ = cursor.read_compressed(compressed, raw_size, "the tokens");
  } else {
    const auto bytes = cursor.take(raw_size, "the tokens");
    crate_->token_text_.assign(bytes.begin(), bytes.end());
  }
  const auto& text = crate_->token_text_;
  if (text.size() != raw_size || count > raw_size) {
    cursor.fail_at(
        std::to_string(count) + " tokens do not fit into " + std::to_string(text.size()) + " bytes",
        start);
  }
  crate_->tokens_.reserve(count);
  const auto* at = reinterpret_cast<const char*>(text.data());
  const char* end = at + text.size();
  for (std::uint64_t i = 0; i < count; ++i) {
    const auto* stop = at == end ? nullptr : static_cast<const char*>(std::memchr(at, 0, end - at));
    if (!stop) cursor.fail_at("the tokens end before token " + std::to_string(i), start);
    crate_->tokens_.emplace_back(at, static_cast<std::size_t>(stop - at));
    at = stop + 1;
  }
}

void CrateReader::read_strings() {
  CrateCursor cursor = section("STRINGS");
  const std::uint64_t count = cursor.read_count(4, "strings");
  const auto bytes = cursor.take(count * 4, "the strings");
  crate_->strings_.resize(count);
  if (count > 0) std::memcpy(crate_->strings_.data(), bytes.data(), bytes.size());
}

void CrateReader::read_fields() {
  CrateCursor cursor = section("FIELDS");
  const std::uint64_t start = cursor.position();
  const auto add = [&](std::uint32_t token, std::uint64_t representation) {
    Layer::Field field;
    field.name = crate_->token(token, start);
    field.representation = representation;
    layer_->add_field(std::move(field));
  };
  if (!at_least(4)) {
    field_count_ = cursor.read_count(16, "fields");
    for (std::uint64_t i = 0; i < field_count_; ++i) {
      cursor.read<std::uint32_t>("padding");
      const auto token = cursor.read<std::uint32_t>("the name of a field");
      add(token, cursor.read<std::uint64_t>("the value of a field"));
    }
    return;
  }
  field_count_ = cursor.read<std::uint64_t>("the number of fields");
  const auto tokens = cursor.read_integers<std::uint32_t>(field_count_, "field names");
  const auto size = cursor.read<std::uint64_t>("the size of the fields");
  const auto bytes = cursor.read_compressed(size, field_count_ * 8, "the fields");
  if (bytes.size() != field_count_ * 8) cursor.fail_at("the list of fields is cut off", start);
  for (std::uint64_t i = 0; i < field_count_; ++i) {
    std::uint64_t representation;
    std::memcpy(&representation, bytes.data() + i * 8, 8);
    add(tokens[i], representation);
  }
}

void CrateReader::read_field_sets() {
  CrateCursor cursor = section("FIELDSETS");
  const std::uint64_t start = cursor.position();
  auto& indices = layer_->field_indices();
  if (at_least(4)) {
    const auto count = cursor.read<std::uint64_t>("the number of field set entries");
    indices = cursor.read_integers<std::uint32_t>(count, "field set entries");
  } else {
    const std::uint64_t count = cursor.read_count(4, "field set entries");
    const auto bytes = cursor.take(count * 4, "the field sets");
    indices.resize(count);
    if (count > 0) std::memcpy(indices.data(), bytes.data(), bytes.size());
  }
  if (indices.empty() || indices.back() != kEndOfFieldSet) {
    cursor.fail_at("the last field set has no end", start);
  }
  field_set_ends_.resize(indices.size());
  std::uint32_t end = static_cast<std::uint32_t>(indices.size());
  for (std::size_t i = indices.size(); i-- > 0;) {
    if (indices[i] == kEndOfFieldSet) {
      end = static_cast<std::uint32_t>(i);
    } else if (indices[i] >= field_count_) {
      cursor.fail_at("field index " + std::to_string(indices[i]) + " is not below " +
                         std::to_string(field_count_),
                     start);
    }
    field_set_ends_[i] = end;
  }
}

FieldSet CrateReader::field_set(std::uint32_t index) const {
  return {index, field_set_ends_[index] - index};
}

void CrateReader::set_path(std::uint32_t index, std::uint32_t parent, std::int64_t token,
                           bool is_property, const CrateCursor& cursor) {
  using Entry = CrateValues::PathEntry;
  if (index >= crate_->paths_.size()) {
    cursor.fail("path index " + std::to_string(index) + " is not below " +
                std::to_string(crate_->paths_.size()));
  }
  Entry& entry = crate_->paths_[index];
  if (entry.parent != Entry::kUnset) {
    cursor.fail("the path tree holds path " + std::to_string(index) + " twice");
  }
  entry.parent = parent;
  entry.is_property = is_property;
  if (parent == Entry::kRoot) return;
  const std::string_view element =
      crate_->token(static_cast<std::uint64_t>(token), cursor.position());
  const bool is_plain = element.find_first_of("{[.") != 0;
  const bool is_sound = is_property ? path::is_namespaced_identifier(element)
                                    : !is_plain || path::is_identifier(element);
  if (!is_sound) {
    cursor.fail("'" + std::string(element) + "' is not the name of a " +
                (is_property ? "property" : "prim"));
  }
  entry.token = static_cast<std::uint32_t>(token);
  depths_[index] = depths_[parent] + 1;
  if (depths_[index] > kMaxDepth) cursor.fail("paths are nested too deeply");
}

void CrateReader::read_paths() {
  CrateCursor cursor = section("PATHS");
  const std::uint64_t start = cursor.position();
  const auto count = cursor.read<std::uint64_t>("the number of paths");
  // Compressed trees may take less than a byte for an entry; 1024 bounds what they can expand to.
  const std::uint64_t in_tree =
      at_least(4) ? cursor.remaining() * 1024 : cursor.remaining() / kLeastPathRecord;
  const std::uint64_t most = in_tree * 2 + kPathsBesideTree;
  if (count == 0 || count > most || count > CrateValues::PathEntry::kRoot) {
    cursor.fail_at(std::to_string(count) + " paths do not fit into " +
                       std::to_string(cursor.remaining()) + " bytes",
                   start);
  }
  if (at_least(4)) {
    read_compressed_paths(cursor);
  } else {
    crate_->paths_.resize(count);
    depths_.resize(count);
    read_path_records(cursor);
  }
  if (crate_->paths_.size() < count) crate_->paths_.resize(count);
  prim_of_path_.resize(crate_->paths_.size());
}

void CrateReader::read_compressed_paths(CrateCursor& cursor) {
  const std::uint64_t start = cursor.position();
  CrateCursor header = section("PATHS");
  const auto table_size = header.read<std::uint64_t>("the number of paths");
  const auto count = cursor.read<std::uint64_t>("the number of paths in the tree");
  const auto indices = cursor.read_integers<std::uint32_t>(count, "path indices");
  const auto tokens = cursor.read_integers<std::int32_t>(count, "path elements");
  const auto jumps = cursor.read_integers<std::int32_t>(count, "path jumps");
  if (count == 0 || table_size > count * 2 + kPathsBesideTree) {
    cursor.fail_at("a table of " + std::to_string(table_size) + " paths has a tree of " +
                       std::to_string(count),
                   start);
  }
  crate_->paths_.resize(table_size);
  depths_.resize(table_size);

  struct Pending {
    std::uint64_t at;
    std::uint32_t parent;
  };
  std::vector<Pending> pending{{0, CrateValues::PathEntry::kRoot}};
  while (!pending.empty()) {
    auto [at, parent] = pending.back();
    pending.pop_back();
    for (;;) {
      if (at >= count) cursor.fail_at("the path tree is cut off", start);
      const bool is_property = tokens[at] < 0;
      // Every index is accepted once only, so damaged jumps cannot loop.
      set_path(indices[at], parent, std::abs(std::int64_t{tokens[at]}), is_property, cursor);
      const std::int32_t jump = jumps[at];
      const bool has_child = jump > 0 || jump == -1;
      if (jump > 0) pending.push_back({at + static_cast<std::uint64_t>(jump), parent});
      if (!has_child && jump != 0) break;
      if (has_child) parent = indices[at];
      if (!has_child && parent == CrateValues::PathEntry::kRoot) break;
      ++at;
    }
  }
}

void CrateReader::read_path_records(CrateCursor cursor) {
  struct Pending {
    std::uint64_t offset;
    std::uint32_t parent;
  };
  constexpr int kHasChild = 1;
  constexpr int kHasSibling = 2;
  constexpr int kIsProperty = 4;
  const bool has_padding = !at_least(1);
  std::vector<Pending> pending{{cursor.position(), CrateValues::PathEntry::kRoot}};
  while (!pending.empty()) {
    auto [offset, parent] = pending.back();
    pending.pop_back();
    CrateCursor record = crate_->cursor(offset);
    for (;;) {
      if (has_padding) record.read<std::uint32_t>("padding");
      const auto index = record.read<std::uint32_t>("a path index");
      const auto token = record.read<std::uint32_t>("a path element");
      const int bits = record.read<std::uint8_t>("the bits of a path");
      record.take(3, "padding");
      set_path(index, parent, token, bits & kIsProperty, record);
      const bool has_child = bits & kHasChild;
      const bool has_sibling = bits & kHasSibling;
      if (has_child && has_sibling) {
        pending.push_back({record.read<std::uint64_t>("the offset of a path"), parent});
      }
      if (!has_child && !has_sibling) break;
      if (has_child) parent = index;
      if (!has_child && parent == CrateValues::PathEntry::kRoot) break;
    }
  }
}

std::vector<SpecRecord> CrateReader::read_specs() {
  CrateCursor cursor = section("SPECS");
  const std::uint64_t start = cursor.position();
  std::vector<SpecRecord> specs;
  if (at_least(4)) {
    const auto count = cursor.read<std::uint64_t>("the number of specs");
    const auto paths = cursor.read_integers<std::uint32_t>(count, "the paths of specs");
    const auto sets = cursor.read_integers<std::uint32_t>(count, "the field sets of specs");
    const auto types = cursor.read_integers<std::uint32_t>(count, "the types of specs");
    specs.reserve(count);
    for (std::uint64_t i = 0; i < count; ++i) specs.push_back({paths[i], sets[i], types[i]});
  } else {
    const bool has_padding = !at_least(1);
    const std::uint64_t count = cursor.read_count(has_padding ? 16 : 12, "specs");
    specs.reserve(count);
    for (std::uint64_t i = 0; i < count; ++i) {
      if (has_padding) cursor.read<std::uint32_t>("padding");
      SpecRecord spec;
      spec.path = cursor.read<std::uint32_t>("the path of a spec");
      spec.field_set = cursor.read<std::uint32_t>("the field set of a spec");
      spec.type = cursor.read<std::uint32_t>("the type of a spec");
      specs.push_back(spec);
    }
  }
  for (const SpecRecord& spec : specs) {
    if (spec.path >= crate_->paths_.size() || spec.field_set >= field_set_ends_.size() ||
        spec.type == 0 || spec.type > 11) {
      cursor.fail_at("a spec has path " + std::to_string(spec.path) + ", field set " +
                         std::to_string(spec.field_set) + " and type " + std::to_string(spec.type),
                     start);
    }
  }
  return specs;
}

void CrateReader::add_prims(const std::vector<SpecRecord>& specs) {
  CrateCursor cursor = section("SPECS");
  std::uint64_t budget = kPathBytes + kPathBytesPerFileByte * view_.bytes.size();
  for (const SpecRecord& record : specs) {
    const auto type = static_cast<SpecType>(record.type);
    const bool is_prim = type == SpecType::Prim || type == SpecType::PseudoRoot ||
                         type == SpecType::Variant || type == SpecType::VariantSet;
    if (!is_prim) continue;
    std::string path = crate_->path(record.path, cursor.position());
    if (path.empty() || prim_of_path_[record.path]) {
      cursor.fail("a spec has a path that is missing or taken");
    }
    if (path.size() > budget) cursor.fail("the paths of the prims are too long");
    budget -= path.size();
    PrimSpec& spec = layer_->prims()[std::move(path)];
    spec.type = type;
    spec.fields = field_set(record.field_set);
    prim_of_path_[record.path] = &spec;
  }
  if (!layer_->prim("/")) cursor.fail("the layer has no root spec");
}

void CrateReader::add_properties(const std::vector<SpecRecord>& specs) {
  for (const SpecRecord& record : specs) {
    const auto type = static_cast<SpecType>(record.type);
    if (type != SpecType::Attribute && type != SpecType::Relationship) continue;
    const CrateValues::PathEntry& entry = crate_->paths_[record.path];
    if (entry.parent >= prim_of_path_.size() || !entry.is_property) continue;
    PrimSpec* prim = prim_of_path_[entry.parent];
    if (!prim) continue;
    prim->properties.push_back({crate_->tokens_[entry.token], type, field_set(record.field_set)});
  }
}

}  // namespace

bool is_crate(std::span<const std::byte> bytes) {
  return bytes.size() >= kMagic.size() &&
         std::memcmp(bytes.data(), kMagic.data(), kMagic.size()) == 0;
}

std::shared_ptr<Layer> read_crate(const std::string& identifier, ByteView bytes) {
  return CrateReader(identifier, std::move(bytes)).read();
}

}  // namespace diorama::usd
