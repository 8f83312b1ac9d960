// SPDX-License-Identifier: Apache-2.0
#include "writer_hdf5/hdf5_view.h"

#include <libdeflate.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <memory>
#include <stdexcept>

namespace diorama {
namespace {

constexpr std::uint64_t kUndefined = ~std::uint64_t(0);
constexpr std::size_t kMostRank = 8;
constexpr std::size_t kMostNames = 10'000;
constexpr std::size_t kMostMessages = 4'096;
constexpr std::size_t kMostBlocks = 64;
constexpr std::size_t kMostLevels = 32;
/// Of one data set, in memory.
constexpr std::size_t kMostBytes = std::size_t(1) << 30;
constexpr std::size_t kMostPerByte = 1032;  ///< Of deflate.
constexpr std::size_t kAlwaysAllowed = std::size_t(64) << 20;

enum FilterId : std::size_t { kDeflate = 1, kShuffle = 2, kFletcher = 3, kLzf = 32000 };

std::size_t product(std::size_t a, std::size_t b) {
  if (b != 0 && a > std::numeric_limits<std::size_t>::max() / b) {
    throw std::runtime_error("claims to be larger than its file can be");
  }
  return a * b;
}

std::size_t chunks_along(std::size_t extent, std::size_t chunk) {
  return extent / chunk + (extent % chunk != 0 ? 1 : 0);
}

std::string inflated(std::string_view packed, std::size_t size) {
  const std::unique_ptr<libdeflate_decompressor, void (*)(libdeflate_decompressor*)> inflater(
      libdeflate_alloc_decompressor(), &libdeflate_free_decompressor);
  std::string plain(size, '\0');
  const auto result = libdeflate_zlib_decompress(inflater.get(), packed.data(), packed.size(),
                                                 plain.data(), plain.size(), nullptr);
  if (result != LIBDEFLATE_SUCCESS) throw std::runtime_error("a chunk cannot be inflated");
  return plain;
}

/// LZF: runs of literals, and copies of what was before.
std::string without_lzf(std::string_view packed, std::size_t size) {
  std::string plain;
  plain.reserve(size);
  std::size_t at = 0;
  const auto take = [&] {
    if (at >= packed.size()) throw std::runtime_error("a chunk is cut short");
    return std::size_t(static_cast<unsigned char>(packed[at++]));
  };
  while (at < packed.size()) {
    const std::size_t control = take();
    std::size_t length = control + 1;
    if (control < 32) {
      if (length > packed.size() - at) throw std::runtime_error("a chunk is cut short");
      if (length > size - plain.size()) throw std::runtime_error("a chunk is too long");
      plain.append(packed.substr(at, length));
      at += length;
      continue;
    }
    length = control >> 5;
    if (length == 7) length += take();
    length += 2;
    const std::size_t back = ((control & 31) << 8 | take()) + 1;
    if (back > plain.size()) throw std::runtime_error("a chunk refers to what is before it");
    if (length > size - plain.size()) throw std::runtime_error("a chunk is too long");
    for (std::size_t i = 0; i < length; ++i) plain.push_back(plain[plain.size() - back]);
  }
  return plain;
}

/// Bytes of equal place in their numbers lie together.
std::string without_shuffle(const std::string& packed, std::size_t item) {
  if (item < 2) return packed;
  const std::size_t count = packed.size() / item;
  std::string plain = packed;
  for (std::size_t b = 0; b < item; ++b) {
    for (std::size_t i = 0; i < count; ++i) plain[i * item + b] = packed[b * count + i];
  }
  return plain;
}

void check_fletcher(std::string_view data, std::uint32_t said) {
  std::uint32_t low = 0;
  std::uint32_t high = 0;
  for (std::size_t i = 0; i < data.size(); i += 2) {
    std::uint32_t word = std::uint32_t(static_cast<unsigned char>(data[i])) << 8;
    if (i + 1 < data.size()) word |= static_cast<unsigned char>(data[i + 1]);
    low = (low + word) % 65535;
    high = (high + low) % 65535;
  }
  // Sums of nothing but zeros may be kept as 0 or as 65535.
  const auto is_same = [](std::uint32_t a, std::uint32_t b) { return a % 65535 == b % 65535; };
  if (!is_same(low, said & 0xFFFF) || !is_same(high, said >> 16)) {
    throw std::runtime_error("the checksum of a chunk is another one");
  }
}

/// Puts a chunk into an array that it may reach beyond.
void copy_chunk(const std::string& from, const std::vector<std::size_t>& chunk,
                const std::vector<std::size_t>& place, const std::vector<std::size_t>& shape,
                std::size_t item, std::string& to) {
  const std::size_t rank = shape.size();
  std::vector<std::size_t> row(rank, 0);  // in the chunk; the last axis is copied at once
  const std::size_t last = rank - 1;
  const std::size_t begin = place[last] * chunk[last];
  const std::size_t length = std::min(chunk[last], shape[last] - begin) * item;
  while (true) {
    std::size_t source = 0;
    std::size_t target = 0;
    bool is_inside = true;
    for (std::size_t axis = 0; axis < rank; ++axis) {
      const std::size_t index = place[axis] * chunk[axis] + row[axis];
      is_inside = is_inside && index < shape[axis];
      source = source * chunk[axis] + row[axis];
      target = target * shape[axis] + index;
    }
    if (is_inside) std::memcpy(to.data() + target * item, from.data() + source * item, length);
    std::size_t axis = last;
    while (axis > 0) {
      --axis;
      if (++row[axis] < chunk[axis]) break;
      row[axis] = 0;
      if (axis == 0) return;
    }
    if (last == 0) return;
  }
}

}  // namespace

Hdf5View::Hdf5View(std::string bytes) : bytes_(std::move(bytes)) {
  Group root;
  DataSet none;
  read_header(read_superblock(), none, &root);
  if (root.tree != kUndefined) {
    expect(root.heap, "HEAP");
    std::map<std::uint64_t, bool> seen;
    read_group_tree(root.tree, kMostLevels, u64(root.heap + 24), root, seen);
  }
  for (const auto& [name, header] : root.links) {
    DataSet own;
    try {
      read_header(header, own, nullptr);
    } catch (const std::runtime_error& error) {
      own.error = error.what();
      own.has_space = true;
    }
    // Groups have no space.
    if (own.has_space) sets_.emplace(name, std::move(own));
  }
}

void Hdf5View::check_place(std::uint64_t at, std::uint64_t size) const {
  if (at > bytes_.size() || size > bytes_.size() - at) {
    throw std::runtime_error("ends before byte " + std::to_string(at) + " + " +
                             std::to_string(size));
  }
}

std::uint64_t Hdf5View::number(std::uint64_t at, std::size_t size) const {
  check_place(at, size);
  std::uint64_t value = 0;
  std::memcpy(&value, bytes_.data() + at, size);
  return value;
}

std::string_view Hdf5View::part(std::uint64_t at, std::uint64_t size) const {
  check_place(at, size);
  return std::string_view(bytes_).substr(at, size);
}

void Hdf5View::expect(std::uint64_t at, std::string_view signature) const {
  if (part(at, signature.size()) != signature) {
    throw std::runtime_error("'" + std::string(signature) + "' expected at byte " +
                             std::to_string(at));
  }
}

std::string Hdf5View::word(std::uint64_t at) const {
  constexpr std::size_t kLongest = 1024;
  check_place(at, 1);
  const std::string_view rest = std::string_view(bytes_).substr(at, kLongest);
  const std::size_t end = rest.find('\0');
  if (end == std::string_view::npos) throw std::runtime_error("has a name without end");
  return std::string(rest.substr(0, end));
}

/// Where the root group's header is.
std::uint64_t Hdf5View::read_superblock() const {
  expect(0, std::string_view("\x89HDF\r\n\x1a\n", 8));
  const std::size_t version = u8(8);
  if (version > 3) throw std::runtime_error("has a superblock that is not understood");
  const bool is_old = version < 2;
  const std::uint64_t sizes = is_old ? 13 : 9;
  if (u8(sizes) != 8 || u8(sizes + 1) != 8) {
    throw std::runtime_error("has offsets that are not of 8 bytes");
  }
  const std::uint64_t base = is_old ? (version == 0 ? 24 : 28) : 12;
  if (u64(base) != 0) throw std::runtime_error("does not begin at its first byte");
  const std::uint64_t end = u64(base + 16);
  if (end > bytes_.size()) {
    throw std::runtime_error("has " + std::to_string(bytes_.size()) + " bytes of " +
                             std::to_string(end));
  }
  return u64(is_old ? base + 40 : 36);
}

void Hdf5View::read_header(std::uint64_t at, DataSet& set, Group* group) const {
  struct Block {
    std::uint64_t begin;
    std::uint64_t size;
  };
  const bool is_new = part(at, 4) == "OHDR";
  std::vector<Block> blocks;
  std::size_t order = 0;  // bytes of a message's creation order
  if (is_new) {
    const std::size_t flags = u8(at + 5);
    std::uint64_t begin = at + 6 + ((flags & 0x20) != 0 ? 16 : 0) + ((flags & 0x10) != 0 ? 4 : 0);
    const std::size_t width = std::size_t(1) << (flags & 3);
    blocks.push_back({begin + width, number(begin, width)});
    order = (flags & 4) != 0 ? 2 : 0;
  } else {
    if (u8(at) != 1) throw std::runtime_error("has an object header of another version");
    blocks.push_back({at + 16, u32(at + 8)});
  }
  const std::size_t front = is_new ? 4 + order : 8;
  std::size_t left = is_new ? kMostMessages : std::min(u16(at + 2), kMostMessages);
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    std::uint64_t place = blocks[b].begin;
    check_place(place, blocks[b].size);
    const std::uint64_t end = place + blocks[b].size;
    while (left > 0 && place + front <= end) {
      const std::size_t type = is_new ? u8(place) : u16(place);
      const std::size_t size = is_new ? u16(place + 1) : u16(place + 2);
      const std::size_t flags = is_new ? u8(place + 3) : u8(place + 4);
      const std::uint64_t content = place + front;
      check_place(content, size);
      if (type == 0x10) {
        if (blocks.size() >= kMostBlocks) throw std::runtime_error("has a header without end");
        std::uint64_t begin = u64(content);
        std::uint64_t length = u64(content + 8);
        if (is_new) {
          expect(begin, "OCHK");
          if (length < 8) throw std::runtime_error("has a header that is cut short");
          begin += 4;
          length -= 8;  // signature and checksum
        }
        blocks.push_back({begin, length});
      }
      read_message(type, flags, content, set, group);
      place = content + size;
      --left;
    }
  }
}

void Hdf5View::read_message(std::size_t type, std::size_t flags, std::uint64_t at, DataSet& set,
                            Group* group) const {
  const bool is_shared = (flags & 2) != 0;
  if (is_shared && (type == 0x01 || type == 0x03 || type == 0x0B)) {
    set.has_space = true;
    throw std::runtime_error("shares its type with others, which is not understood");
  }
  switch (type) {
    case 0x01:
      return read_space(at, set);
    case 0x02:
      if (!group) return;
      if (u64(at + 2 + ((u8(at + 1) & 1) != 0 ? 8 : 0)) != kUndefined) {
        throw std::runtime_error(
            "keeps the names of its data sets in a heap of many, which is "
            "not understood");
      }
      return;
    case 0x03:
      return read_type(at, set);
    case 0x06:
      if (group) read_link(at, *group);
      return;
    case 0x08:
      return read_layout(at, set);
    case 0x0B:
      return read_filters(at, set);
    case 0x11:
      if (group) {
        group->tree = u64(at);
        group->heap = u64(at + 8);
      }
      return;
    default:
      return;
  }
}

void Hdf5View::read_link(std::uint64_t at, Group& group) const {
  const std::size_t flags = u8(at + 1);
  std::uint64_t place = at + 2;
  const std::size_t kind = (flags & 8) != 0 ? u8(place++) : 0;
  if ((flags & 4) != 0) place += 8;
  if ((flags & 16) != 0) ++place;
  const std::size_t width = std::size_t(1) << (flags & 3);
  const std::uint64_t length = number(place, width);
  if (length > 1024) throw std::runtime_error("has a name without end");
  place += width;
  if (kind != 0) return;  // leads elsewhere
  if (group.links.size() >= kMostNames) throw std::runtime_error("holds too many names");
  group.links.emplace_back(part(place, length), u64(place + length));
}

void Hdf5View::read_group_tree(std::uint64_t node, std::size_t above, std::uint64_t names,
                               Group& group, std::map<std::uint64_t, bool>& seen) const {
  expect(node, "TREE");
  if (!seen.emplace(node, true).second) {
    throw std::runtime_error("its group tree goes in a circle");
  }
  const std::size_t level = u8(node + 5);
  if (level >= above) throw std::runtime_error("its group tree has levels out of order");
  for (std::size_t i = 0; i < u16(node + 6); ++i) {
    const std::uint64_t child = u64(node + 24 + 8 + 16 * i);
    if (level > 0) {
      read_group_tree(child, level, names, group, seen);
      continue;
    }
    expect(child, "SNOD");
    for (std::size_t k = 0; k < u16(child + 6); ++k) {
      const std::uint64_t entry = child + 8 + 40 * k;
      if (u32(entry + 16) == 2) continue;  // leads elsewhere
      if (group.links.size() >= kMostNames) throw std::runtime_error("holds too many names");
      group.links.emplace_back(word(names + u64(entry)), u64(entry + 8));
    }
  }
}

void Hdf5View::read_space(std::uint64_t at, DataSet& set) const {
  set.has_space = true;
  const std::size_t version = u8(at);
  const std::size_t rank = u8(at + 1);
  if (version != 1 && version != 2) throw std::runtime_error("has a space of another version");
  if (rank > kMostRank) throw std::runtime_error("has rank " + std::to_string(rank));
  set.is_null = version == 2 && u8(at + 3) == 2;
  set.shape.clear();
  const std::uint64_t extents = at + (version == 1 ? 8 : 4);
  for (std::size_t i = 0; i < rank; ++i) set.shape.push_back(u64(extents + 8 * i));
}

void Hdf5View::read_type(std::uint64_t at, DataSet& set) const {
  const std::size_t kind = u8(at) & 0x0F;
  const std::size_t flags = u8(at + 1);
  set.item_size = u32(at + 4);
  char letter = '?';
  std::size_t own = flags;
  if (kind == 0) letter = (flags & 8) != 0 ? 'i' : 'u';
  if (kind == 1) letter = 'f';
  if (kind == 3) letter = 'S';
  if (kind == 8 && (u8(at + 8) & 0x0F) == 0) {  // names for whole numbers
    own = u8(at + 9);
    letter = (own & 8) != 0 ? 'i' : 'u';
  }
  if (kind == 9 && (flags & 0x0F) == 1) {
    set.is_variable_text = true;
    letter = 'S';
  }
  const bool is_known =
      letter == 'S' ||
      (letter == 'f' && (set.item_size == 2 || set.item_size == 4 || set.item_size == 8)) ||
      ((letter == 'i' || letter == 'u') &&
       (set.item_size == 1 || set.item_size == 2 || set.item_size == 4 || set.item_size == 8));
  if (!is_known || set.item_size == 0) {
    throw std::runtime_error("has a type that is not understood");
  }
  set.is_big_endian = letter != 'S' && (own & 1) != 0;
  const bool has_order = letter != 'S' && set.item_size > 1;
  set.type = (has_order ? "<" : "|") + std::string(1, letter) + std::to_string(set.item_size);
}

void Hdf5View::read_layout(std::uint64_t at, DataSet& set) const {
  const std::size_t version = u8(at);
  if (version != 3 && version != 4) throw std::runtime_error("has a layout of another version");
  const std::size_t kind = u8(at + 1);
  if (kind == 0) {
    set.layout = Layout::Compact;
    set.size = u16(at + 2);
    set.address = at + 4;
  } else if (kind == 1) {
    set.layout = Layout::Contiguous;
    set.address = u64(at + 2);
    set.size = u64(at + 10);
  } else if (kind == 2 && version == 3) {
    set.layout = Layout::ChunkTree;
    const std::size_t rank = u8(at + 2);  // counts the element's size as well
    if (rank < 2 || rank > kMostRank + 1) throw std::runtime_error("has chunks of no extents");
    set.address = u64(at + 3);
    set.chunk.clear();
    for (std::size_t i = 0; i + 1 < rank; ++i) set.chunk.push_back(u32(at + 11 + 4 * i));
  } else if (kind == 2) {
    read_new_chunks(at, set);
  } else {
    throw std::runtime_error("has a layout that is not understood");
  }
}

void Hdf5View::read_new_chunks(std::uint64_t at, DataSet& set) const {
  const std::size_t flags = u8(at + 2);
  const std::size_t rank = u8(at + 3);
  const std::size_t width = u8(at + 4);
  if (rank < 2 || rank > kMostRank + 1 || width < 1 || width > 8) {
    throw std::runtime_error("has chunks of no extents");
  }
  std::uint64_t place = at + 5;
  set.chunk.clear();
  for (std::size_t i = 0; i < rank; ++i, place += width) {
    if (i + 1 < rank) set.chunk.push_back(number(place, width));
  }
  const std::size_t index = u8(place++);
  if (index == 1) {
    set.layout = Layout::SingleChunk;
    if ((flags & 2) != 0) {
      set.size = u64(place);
      set.filter_mask = std::uint32_t(u32(place + 8));
      place += 12;
    }
  } else if (index == 3) {
    set.layout = Layout::FixedArray;
    ++place;  // bits of a page, which the array's own header says, too
  } else {
    throw std::runtime_error(
        "has an index of chunks that is not understood; h5repack --low=0 "
        "--high=0 writes one that is");
  }
  set.address = u64(place);
}

void Hdf5View::read_filters(std::uint64_t at, DataSet& set) const {
  const std::size_t version = u8(at);
  const std::size_t count = u8(at + 1);
  if (version != 1 && version != 2) throw std::runtime_error("has filters of another version");
  std::uint64_t place = at + (version == 1 ? 8 : 2);
  set.filters.clear();
  for (std::size_t i = 0; i < count; ++i) {
    Filter filter;
    filter.id = u16(place);
    const bool has_name = version == 1 || filter.id >= 256;
    const std::size_t name = has_name ? u16(place + 2) : 0;
    place += has_name ? 4 : 2;
    const std::size_t values = u16(place + 2);
    place += 4 + (version == 1 ? (name + 7) / 8 * 8 : name);
    for (std::size_t k = 0; k < values; ++k, place += 4) {
      filter.values.push_back(std::uint32_t(u32(place)));
    }
    if (version == 1 && values % 2 != 0) place += 4;
    if (filter.id != kDeflate && filter.id != kShuffle && filter.id != kFletcher &&
        filter.id != kLzf) {
      throw std::runtime_error("has the filter " + std::to_string(filter.id) +
                               ", which is not understood; h5repack -f GZIP=4 writes another");
    }
    set.filters.push_back(std::move(filter));
  }
}

std::vector<std::string> Hdf5View::names() const {
  std::vector<std::string> names;
  for (const auto& [name, set] : sets_) names.push_back(name);
  return names;
}

const Hdf5View::DataSet& Hdf5View::set(std::string_view name) const {
  const auto found = sets_.find(name);
  if (found == sets_.end()) {
    throw std::runtime_error("has no data set '" + std::string(name) + "'");
  }
  if (!found->second.error.empty()) throw std::runtime_error(found->second.error);
  return found->second;
}

const std::vector<std::size_t>& Hdf5View::shape(std::string_view name) const {
  return set(name).shape;
}

/// Bytes of the whole; what no file of this size can say is refused before memory is taken.
std::size_t Hdf5View::plain_size(const DataSet& set) const {
  std::size_t size = set.is_null ? 0 : set.item_size;
  // An extent of 0 must not hide the others.
  for (const std::size_t extent : set.shape) size = product(size, std::max<std::size_t>(extent, 1));
  if (std::ranges::find(set.shape, std::size_t(0)) != set.shape.end()) return 0;
  const std::size_t most = std::min(kMostBytes, kAlwaysAllowed + kMostPerByte * bytes_.size());
  if (size > most) throw std::runtime_error("claims to be larger than its file can be");
  return size;
}

std::string Hdf5View::raw(const DataSet& set) const {
  const std::size_t size = plain_size(set);
  if (set.layout == Layout::Compact || set.layout == Layout::Contiguous) {
    // What was never written.
    if (set.layout == Layout::Contiguous && set.address == kUndefined) {
      return std::string(size, '\0');
    }
    if (set.size != size) {
      throw std::runtime_error("holds " + std::to_string(set.size) + " bytes instead of " +
                               std::to_string(size));
    }
    return std::string(part(set.address, size));
  }
  if (set.layout == Layout::None) throw std::runtime_error("has no layout");
  return size == 0 ? std::string() : from_chunks(set);
}

std::string Hdf5View::from_chunks(const DataSet& set) const {
  const std::size_t rank = set.shape.size();
  if (rank == 0 || set.chunk.size() != rank) {
    throw std::runtime_error("has chunks of another rank");
  }
  std::string plain(plain_size(set), '\0');
  if (set.address == kUndefined) return plain;
  std::size_t chunk_size = set.item_size;
  std::size_t count = 1;
  for (std::size_t axis = 0; axis < rank; ++axis) {
    if (set.chunk[axis] == 0) throw std::runtime_error("has chunks of no extents");
    chunk_size = product(chunk_size, set.chunk[axis]);
    count = product(count, chunks_along(set.shape[axis], set.chunk[axis]));
  }
  // Chunks that reach far beyond their array are work for nothing.
  if (product(chunk_size, count) > 16 * plain.size() + kAlwaysAllowed) {
    throw std::runtime_error("has chunks that are far larger than itself");
  }
  std::vector<Chunk> chunks;
  if (set.layout == Layout::SingleChunk) {
    chunks.push_back({set.address, set.filters.empty() ? chunk_size : set.size, set.filter_mask,
                      std::vector<std::size_t>(rank, 0)});
    if (count != 1) throw std::runtime_error("has chunks of other extents than its own");
  } else if (set.layout == Layout::FixedArray) {
    chunks = fixed_array(set, count);
  } else {
    std::map<std::uint64_t, bool> seen;
    read_chunk_tree(set, set.address, kMostLevels, count, seen, chunks);
  }
  std::vector<bool> is_there(count, false);
  for (const Chunk& chunk : chunks) {
    std::size_t index = 0;
    for (std::size_t axis = 0; axis < rank; ++axis) {
      const std::size_t along = chunks_along(set.shape[axis], set.chunk[axis]);
      if (chunk.place[axis] >= along) throw std::runtime_error("has a chunk outside of itself");
      index = index * along + chunk.place[axis];
    }
    if (is_there[index]) throw std::runtime_error("has a chunk twice");
    is_there[index] = true;
    copy_chunk(unfiltered(set, chunk, chunk_size), set.chunk, chunk.place, set.shape, set.item_size,
               plain);
  }
  return plain;
}

void Hdf5View::read_chunk_tree(const DataSet& set, std::uint64_t node, std::size_t above,
                               std::size_t most, std::map<std::uint64_t, bool>& seen,
                               std::vector<Chunk>& chunks) const {
  expect(node, "TREE");
  if (!seen.emplace(node, true).second) {
    throw std::runtime_error("its tree of chunks goes in a circle");
  }
  const std::size_t level = u8(node + 5);
  if (u8(node + 4) != 1 || level >= above) {
    throw std::runtime_error("its tree of chunks has levels out of order");
  }
  const std::size_t rank = set.chunk.size();
  const std::size_t key_size = 8 + 8 * (rank + 1);
  for (std::size_t i = 0; i < u16(node + 6); ++i) {
    const std::uint64_t key = node + 24 + i * (key_size + 8);
    const std::uint64_t child = u64(key + key_size);
    if (level > 0) {
      read_chunk_tree(set, child, level, most, seen, chunks);
      continue;
    }
    if (chunks.size() >= most) throw std::runtime_error("has more chunks than it needs");
    Chunk chunk{child, u32(key), std::uint32_t(u32(key + 4)), {}};
    for (std::size_t axis = 0; axis < rank; ++axis) {
      const std::uint64_t offset = u64(key + 8 + 8 * axis);
      if (offset % set.chunk[axis] != 0) throw std::runtime_error("has a chunk between others");
      chunk.place.push_back(offset / set.chunk[axis]);
    }
    chunks.push_back(std::move(chunk));
  }
}

std::vector<Hdf5View::Chunk> Hdf5View::fixed_array(const DataSet& set, std::size_t most) const {
  expect(set.address, "FAHD");
  const bool is_filtered = u8(set.address + 5) == 1;
  const std::size_t entry = u8(set.address + 6);
  const std::size_t page_bits = u8(set.address + 7);
  const std::uint64_t entries = u64(set.address + 8);
  const std::uint64_t block = u64(set.address + 16);
  if (entries != most || entry < (is_filtered ? 13u : 8u) || entry > 20) {
    throw std::runtime_error("has an index of another number of chunks");
  }
  if (page_bits < 63 && entries > (std::uint64_t(1) << page_bits)) {
    throw std::runtime_error(
        "has an index of chunks in pages, which is not understood; h5repack "
        "--low=0 --high=0 writes another");
  }
  std::vector<Chunk> chunks;
  if (block == kUndefined) return chunks;
  expect(block, "FADB");
  std::size_t chunk_size = set.item_size;
  for (const std::size_t extent : set.chunk) chunk_size = product(chunk_size, extent);
  const std::size_t rank = set.shape.size();
  for (std::size_t i = 0; i < entries; ++i) {
    const std::uint64_t at = block + 14 + entry * i;
    Chunk chunk{u64(at), chunk_size, 0, std::vector<std::size_t>(rank, 0)};
    if (is_filtered) {
      chunk.size = number(at + 8, entry - 12);
      chunk.filter_mask = std::uint32_t(u32(at + entry - 4));
    }
    if (chunk.address == kUndefined) continue;
    std::size_t rest = i;
    for (std::size_t axis = rank; axis-- > 0;) {
      const std::size_t along = chunks_along(set.shape[axis], set.chunk[axis]);
      chunk.place[axis] = rest % along;
      rest /= along;
    }
    chunks.push_back(std::move(chunk));
  }
  return chunks;
}

/// Filters were applied in their order; each may have been left out of a chunk.
std::string Hdf5View::unfiltered(const DataSet& set, const Chunk& chunk, std::size_t size) const {
  const std::string_view stored = part(chunk.address, chunk.size);
  std::string plain;
  bool is_stored = true;
  for (std::size_t i = set.filters.size(); i-- > 0;) {
    if (i < 32 && (chunk.filter_mask >> i & 1) != 0) continue;
    const std::string_view now = is_stored ? stored : std::string_view(plain);
    const Filter& filter = set.filters[i];
    std::string next;
    switch (filter.id) {
      case kDeflate:
        // A checksum that was made before lies behind the data.
        next = inflated(now, size + (i > 0 && set.filters[i - 1].id == kFletcher ? 4 : 0));
        break;
      case kLzf:
        next = without_lzf(now, size + (i > 0 && set.filters[i - 1].id == kFletcher ? 4 : 0));
        break;
      case kShuffle:
        next = without_shuffle(std::string(now), set.item_size);
        break;
      default: {
        if (now.size() < 4) throw std::runtime_error("a chunk is cut short");
        std::uint32_t said = 0;
        std::memcpy(&said, now.data() + now.size() - 4, 4);
        check_fletcher(now.substr(0, now.size() - 4), said);
        next = now.substr(0, now.size() - 4);
      }
    }
    plain = std::move(next);
    is_stored = false;
  }
  if (is_stored) plain = stored;
  if (plain.size() != size) {
    throw std::runtime_error("has a chunk of " + std::to_string(plain.size()) +
                             " bytes instead of " + std::to_string(size));
  }
  return plain;
}

StoredArray Hdf5View::read(std::string_view name) const {
  const DataSet& from = set(name);
  if (from.type.empty() || from.is_variable_text) throw std::runtime_error("holds no numbers");
  StoredArray array;
  array.fields.push_back({"", from.type, 0, 1});
  array.item_size = from.item_size;
  array.shape = from.shape;
  array.data = raw(from);
  if (from.is_big_endian) {
    for (std::size_t i = 0; i + from.item_size <= array.data.size(); i += from.item_size) {
      std::reverse(array.data.begin() + std::ptrdiff_t(i),
                   array.data.begin() + std::ptrdiff_t(i + from.item_size));
    }
  }
  return array;
}

std::string Hdf5View::text(std::string_view name) const {
  const DataSet& from = set(name);
  const bool is_one = std::ranges::all_of(from.shape, [](std::size_t n) { return n == 1; });
  if (from.type.empty() || from.type[1] != 'S' || !is_one) {
    throw std::runtime_error("is no single text");
  }
  std::string bytes = raw(from);
  if (from.is_variable_text) {
    // Length, and the place in a heap that many share.
    if (bytes.size() != 16) throw std::runtime_error("is no single text");
    std::uint32_t length = 0;
    std::uint64_t heap = 0;
    std::uint32_t wanted = 0;
    std::memcpy(&length, bytes.data(), 4);
    std::memcpy(&heap, bytes.data() + 4, 8);
    std::memcpy(&wanted, bytes.data() + 12, 4);
    expect(heap, "GCOL");
    const std::uint64_t end = heap + std::min<std::uint64_t>(u64(heap + 8), bytes_.size());
    std::uint64_t at = heap + 16;
    while (at + 16 <= end) {
      const std::size_t index = u16(at);
      const std::uint64_t size = u64(at + 8);
      check_place(at + 16, size);
      if (index == wanted && index != 0)
        return std::string(part(at + 16, std::min<std::uint64_t>(length, size)));
      if (index == 0) break;
      at += 16 + (size + 7) / 8 * 8;
    }
    throw std::runtime_error("its text is not in the heap");
  }
  return bytes.substr(0, bytes.find('\0'));
}

}  // namespace diorama
