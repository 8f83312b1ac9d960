// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <utility>

/// Paths of specs as plain strings: `/Room/Table`, `/Room/Table.points`, `/Chair{color=red}Leg`,
/// `/Chair{color=red}.kind`. A child of a variant follows its brace without a slash.
namespace diorama::usd::path {

/// The container: `/A/B` -> `/A`, `/A` -> `/`, `/A.p` -> `/A`, `/A{v=a}B` -> `/A{v=a}`,
/// `/A{v=a}` -> `/A`; of `/` and of an empty path the empty path.
std::string_view parent(std::string_view path);
/// The last element without its separator: `B`, `p`, `{v=a}`.
std::string_view name(std::string_view path);
/// The prim (or variant) that a property path belongs to; other paths as they are.
std::string_view prim_part(std::string_view path);
/// `p` of `/A.p`, empty for paths of prims.
std::string_view property_part(std::string_view path);

std::string append_child(std::string_view path, std::string_view name);
std::string append_property(std::string_view path, std::string_view name);
std::string append_variant(std::string_view path, std::string_view set, std::string_view variant);

/// True for `/A` of `/A`, `/A/B`, `/A.p` and `/A{v=a}`, and for `/` of every absolute path.
bool has_prefix(std::string_view path, std::string_view prefix);
/// `path` with `from`, one of its prefixes, replaced by `to`.
std::string replace_prefix(std::string_view path, std::string_view from, std::string_view to);

bool has_variants(std::string_view path);
std::string strip_variants(std::string_view path);
/// True for `/A{v=a}`; then `variant_selection` gives {v, a}.
bool is_variant(std::string_view path);
std::pair<std::string, std::string> variant_selection(std::string_view path);

/// Number of prims on the way to the path, variants not counted: 2 for `/A{v=a}B`.
int depth(std::string_view path);
/// `/A`.
bool is_root_prim(std::string_view path);

/// Resolves `../B`, `.p`, `B` against the prim `anchor`; empty when it would leave the root.
std::string make_absolute(std::string_view path, std::string_view anchor);

/// Letters, digits and underscores (also of Unicode), not beginning with a digit.
bool is_identifier(std::string_view name);
/// Bytes of the identifier at the front of `text`; 0 when there is none.
std::size_t identifier_length(std::string_view text);
/// Identifiers joined by single colons.
bool is_namespaced_identifier(std::string_view name);
/// What a variant may be called: letters, digits, '_', '|', '-', one leading '.'.
bool is_variant_name(std::string_view name);
/// Whether `path` is a well-formed absolute or relative path of a prim or property.
bool is_valid(std::string_view path);
/// Whether it is the path of a prim without variants.
bool is_prim_path(std::string_view path);

}  // namespace diorama::usd::path
