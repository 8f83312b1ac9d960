// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "reader_support/npy_array.h"

namespace diorama {

/// The data sets at the top of an HDF5 file, read by the published format (HDF5 File Format
/// Specification 3.0) and not by the HDF5 library: any bytes are safe, several threads may read.
/// Understood are superblocks 0 to 3, groups as symbol tables or lists of links, contiguous,
/// compact and chunked data, deflate, LZF, shuffle and Fletcher32. Types are those of NumPy ("<f4",
/// "|u1", "|S12"), little-endian whatever the file has. Functions throw std::runtime_error that
/// says what is damaged or not understood.
class Hdf5View {
 public:
  explicit Hdf5View(std::string bytes);

  std::vector<std::string> names() const;
  bool has(std::string_view name) const { return sets_.contains(name); }
  /// Rows first; empty for a single value.
  const std::vector<std::size_t>& shape(std::string_view name) const;
  /// Reads a data set of numbers. Takes no more memory than a file of this size can say.
  StoredArray read(std::string_view name) const;
  /// A single text, of fixed or variable length.
  std::string text(std::string_view name) const;

 private:
  enum class Layout { None, Compact, Contiguous, ChunkTree, SingleChunk, FixedArray };
  struct Filter {
    std::size_t id = 0;
    std::vector<std::uint32_t> values;
  };
  /// What the header of an object says.
  struct DataSet {
    std::string error;  ///< Why it cannot be read; empty when it can.
    bool has_space = false;
    bool is_null = false;
    std::string type;
    std::size_t item_size = 0;
    bool is_big_endian = false;
    bool is_variable_text = false;
    std::vector<std::size_t> shape;
    Layout layout = Layout::None;
    std::uint64_t address = 0;
    std::uint64_t size = 0;          ///< Bytes at the address.
    std::uint32_t filter_mask = 0;   ///< Of a single chunk.
    std::vector<std::size_t> chunk;  ///< Extents of one chunk.
    std::vector<Filter> filters;
  };
  /// A chunk as it lies in the file.
  struct Chunk {
    std::uint64_t address = 0;
    std::uint64_t size = 0;
    std::uint32_t filter_mask = 0;
    std::vector<std::size_t> place;  ///< Counted in chunks.
  };
  /// Of a group: symbol table, and links in the header.
  struct Group {
    std::uint64_t tree = ~std::uint64_t(0);
    std::uint64_t heap = 0;
    std::vector<std::pair<std::string, std::uint64_t>> links;
  };

  // Numbers at given places, little-endian; nothing outside of the file is ever read.
  void check_place(std::uint64_t at, std::uint64_t size) const;
  std::uint64_t number(std::uint64_t at, std::size_t size) const;
  std::size_t u8(std::uint64_t at) const { return number(at, 1); }
  std::size_t u16(std::uint64_t at) const { return number(at, 2); }
  std::size_t u32(std::uint64_t at) const { return number(at, 4); }
  std::uint64_t u64(std::uint64_t at) const { return number(at, 8); }
  std::string_view part(std::uint64_t at, std::uint64_t size) const;
  void expect(std::uint64_t at, std::string_view signature) const;

  std::uint64_t read_superblock() const;
  void read_header(std::uint64_t at, DataSet& set, Group* group) const;
  void read_message(std::size_t type, std::size_t flags, std::uint64_t at, DataSet& set,
                    Group* group) const;
  void read_link(std::uint64_t at, Group& group) const;
  void read_space(std::uint64_t at, DataSet& set) const;
  void read_type(std::uint64_t at, DataSet& set) const;
  void read_layout(std::uint64_t at, DataSet& set) const;
  void read_new_chunks(std::uint64_t at, DataSet& set) const;
  void read_filters(std::uint64_t at, DataSet& set) const;
  void read_group_tree(std::uint64_t node, std::size_t above, std::uint64_t names, Group& group,
                       std::map<std::uint64_t, bool>& seen) const;
  std::string word(std::uint64_t at) const;

  const DataSet& set(std::string_view name) const;
  std::size_t plain_size(const DataSet& set) const;
  std::string raw(const DataSet& set) const;
  std::string from_chunks(const DataSet& set) const;
  void read_chunk_tree(const DataSet& set, std::uint64_t node, std::size_t above, std::size_t most,
                       std::map<std::uint64_t, bool>& seen, std::vector<Chunk>& chunks) const;
  std::vector<Chunk> fixed_array(const DataSet& set, std::size_t most) const;
  std::string unfiltered(const DataSet& set, const Chunk& chunk, std::size_t size) const;

  std::string bytes_;
  std::map<std::string, DataSet, std::less<>> sets_;
};

}  // namespace diorama
