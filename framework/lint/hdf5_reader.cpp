// SPDX-License-Identifier: Apache-2.0
#include "framework/lint/hdf5_reader.h"

#include <libdeflate.h>

#include <algorithm>
#include <memory>
#include <span>
#include <stdexcept>

namespace diorama::lint {
namespace {

constexpr std::uint64_t kUndefined = ~std::uint64_t(0);

/// Numbers of a file at given places, all little-endian; nothing outside is ever read.
class Bytes {
 public:
  explicit Bytes(const std::string& file) : file_(file) {}

  std::uint64_t number(std::uint64_t at, std::size_t size) const {
    check(at, size);
    std::uint64_t value = 0;
    std::memcpy(&value, file_.data() + at, size);
    return value;
  }
  std::size_t u8(std::uint64_t at) const { return number(at, 1); }
  std::size_t u16(std::uint64_t at) const { return number(at, 2); }
  std::size_t u32(std::uint64_t at) const { return number(at, 4); }
  std::uint64_t u64(std::uint64_t at) const { return number(at, 8); }
  std::string_view part(std::uint64_t at, std::uint64_t size) const {
    check(at, size);
    return std::string_view(file_).substr(at, size);
  }
  std::string word(std::uint64_t at) const {
    constexpr std::size_t kLongest = 1024;
    check(at, 1);
    const std::string_view rest = std::string_view(file_).substr(at, kLongest);
    const std::size_t end = rest.find('\0');
    if (end == std::string_view::npos) throw std::runtime_error("has a name without end");
    return std::string(rest.substr(0, end));
  }
  void expect(std::uint64_t at, std::string_view signature) const {
    if (part(at, signature.size()) != signature) {
      throw std::runtime_error("'" + std::string(signature) + "' expected at byte " +
                               std::to_string(at));
    }
  }
  std::size_t size() const { return file_.size(); }

 private:
  void check(std::uint64_t at, std::uint64_t size) const {
    if (at > file_.size() || size > file_.size() - at) {
      throw std::runtime_error("ends before byte " + std::to_string(at) + " + " +
                               std::to_string(size));
    }
  }
  const std::string& file_;
};

/// Where the bytes of a data set are, and what was done to them.
struct Storage {
  bool is_chunked = false;
  std::uint64_t address = kUndefined;
  std::uint64_t size = 0;          ///< Contiguous.
  std::vector<std::size_t> chunk;  ///< Extents of one chunk.
  bool is_deflated = false;
};

struct DataSet {
  NpyArray array;
  Storage storage;
};

std::string inflated(std::string_view packed, std::size_t size) {
  constexpr std::size_t kMostPerByte = 1032;  // of deflate
  if (size / kMostPerByte > packed.size()) throw std::runtime_error("a chunk is cut short");
  const std::unique_ptr<libdeflate_decompressor, void (*)(libdeflate_decompressor*)> inflater(
      libdeflate_alloc_decompressor(), &libdeflate_free_decompressor);
  std::string plain(size, '\0');
  const auto result = libdeflate_zlib_decompress(inflater.get(), packed.data(), packed.size(),
                                                 plain.data(), plain.size(), nullptr);
  if (result != LIBDEFLATE_SUCCESS) throw std::runtime_error("a chunk cannot be inflated");
  return plain;
}

class Hdf5Reader {
 public:
  explicit Hdf5Reader(const std::string& file) : bytes_(file) {}

  std::map<std::string, NpyArray> run() {
    bytes_.expect(0, std::string_view("\x89HDF\r\n\x1a\n", 8));
    if (bytes_.u8(8) != 0 || bytes_.u8(13) != 8 || bytes_.u8(14) != 8) {
      throw std::runtime_error("has another superblock than version 0 with 8-byte offsets");
    }
    if (const auto end = bytes_.u64(40); end > bytes_.size()) {
      throw std::runtime_error("has " + std::to_string(bytes_.size()) + " bytes of " +
                               std::to_string(end));
    }
    if (bytes_.u32(72) != 1) throw std::runtime_error("its root group has no symbol table");
    const std::uint64_t tree = bytes_.u64(80);
    const std::uint64_t heap = bytes_.u64(88);
    bytes_.expect(heap, "HEAP");
    names_ = bytes_.u64(heap + 24);
    read_group(tree, kMostLevels);
    return std::move(arrays_);
  }

 private:
  void read_group(std::uint64_t node, std::size_t above) {
    bytes_.expect(node, "TREE");
    if (!seen_.insert(node).second) throw std::runtime_error("its group tree goes in a circle");
    const std::size_t level = bytes_.u8(node + 5);
    if (level >= above) throw std::runtime_error("its group tree has levels out of order");
    for (std::size_t i = 0; i < bytes_.u16(node + 6); ++i) {
      const std::uint64_t child = bytes_.u64(node + 24 + 8 + 16 * i);
      if (level > 0) {
        read_group(child, level);
      } else {
        read_symbols(child);
      }
    }
  }

  void read_symbols(std::uint64_t node) {
    bytes_.expect(node, "SNOD");
    for (std::size_t i = 0; i < bytes_.u16(node + 6); ++i) {
      const std::uint64_t entry = node + 8 + 40 * i;
      const std::string name = bytes_.word(names_ + bytes_.u64(entry));
      try {
        arrays_.emplace(name, read_data_set(bytes_.u64(entry + 8)));
      } catch (const std::runtime_error& error) {
        throw std::runtime_error("data set '" + name + "': " + error.what());
      }
    }
  }

  NpyArray read_data_set(std::uint64_t header) {
    if (bytes_.u8(header) != 1) throw std::runtime_error("has an object header of another version");
    DataSet set;
    std::size_t left = bytes_.u16(header + 2);
    std::vector<std::pair<std::uint64_t, std::uint64_t>> blocks{
        {header + 16, bytes_.u32(header + 8)}};
    for (std::size_t b = 0; b < blocks.size(); ++b) {
      std::uint64_t at = blocks[b].first;
      const std::uint64_t end = at + blocks[b].second;
      while (left > 0 && at + 8 <= end) {
        const std::size_t type = bytes_.u16(at);
        if (type == 0x10) blocks.emplace_back(bytes_.u64(at + 8), bytes_.u64(at + 16));
        read_message(type, at + 8, set);
        at += 8 + bytes_.u16(at + 2);
        --left;
      }
    }
    load(set);
    return std::move(set.array);
  }

  void read_message(std::size_t type, std::uint64_t at, DataSet& set) {
    switch (type) {
      case 0x01:
        read_space(at, set.array);
        break;
      case 0x03:
        read_type(at, set.array);
        break;
      case 0x08:
        read_layout(at, set.storage);
        break;
      case 0x0B:
        read_filters(at, set.storage);
        break;
      default:
        break;
    }
  }

  void read_space(std::uint64_t at, NpyArray& array) {
    const std::uint64_t extents = at + (bytes_.u8(at) == 1 ? 8 : 4);
    array.shape.clear();
    for (std::size_t i = 0; i < bytes_.u8(at + 1); ++i) {
      array.shape.push_back(bytes_.u64(extents + 8 * i));
    }
  }

  void read_type(std::uint64_t at, NpyArray& array) {
    const std::size_t kind = bytes_.u8(at) & 0x0F;
    const std::size_t flags = bytes_.u8(at + 1);
    array.item_size = bytes_.u32(at + 4);
    if ((flags & 1) != 0 && kind <= 1) throw std::runtime_error("is big-endian");
    const char letter = kind == 0   ? ((flags & 8) != 0 ? 'i' : 'u')
                        : kind == 1 ? 'f'
                        : kind == 3 ? 'S'
                                    : '?';
    if (letter == '?') throw std::runtime_error("has a type that is not understood");
    const bool has_order = letter != 'S' && array.item_size > 1;
    array.descr =
        (has_order ? "<" : "|") + std::string(1, letter) + std::to_string(array.item_size);
  }

  void read_layout(std::uint64_t at, Storage& storage) {
    if (bytes_.u8(at) != 3) throw std::runtime_error("has a layout of another version");
    const std::size_t kind = bytes_.u8(at + 1);
    if (kind != 1 && kind != 2) throw std::runtime_error("has a layout that is not understood");
    storage.is_chunked = kind == 2;
    if (!storage.is_chunked) {
      storage.address = bytes_.u64(at + 2);
      storage.size = bytes_.u64(at + 10);
      return;
    }
    const std::size_t rank = bytes_.u8(at + 2);  // counts the element's size as well
    storage.address = bytes_.u64(at + 3);
    storage.chunk.clear();
    for (std::size_t i = 0; i + 1 < rank; ++i) storage.chunk.push_back(bytes_.u32(at + 11 + 4 * i));
  }

  void read_filters(std::uint64_t at, Storage& storage) {
    const bool is_deflate = bytes_.u8(at) == 1 && bytes_.u8(at + 1) == 1 && bytes_.u16(at + 8) == 1;
    if (!is_deflate) throw std::runtime_error("has other filters than deflate");
    storage.is_deflated = true;
  }

  void load(DataSet& set) {
    constexpr std::uint64_t kMostPerByte = 1032;  // of deflate
    const std::uint64_t size = checked_size(set.array, kMostPerByte * bytes_.size());
    // Many names may share one data set.
    if (size > kMostInAll - loaded_) throw std::runtime_error("holds more than 2 GiB");
    loaded_ += size;
    const Storage& storage = set.storage;
    std::string plain;
    if (storage.is_chunked) {
      if (storage.chunk != set.array.shape) throw std::runtime_error("is cut into several chunks");
      plain = only_chunk(storage, size);
    } else if (storage.address != kUndefined) {
      plain = bytes_.part(storage.address, storage.size);
    }
    if (plain.size() != size) {
      throw std::runtime_error("holds " + std::to_string(plain.size()) + " bytes instead of " +
                               std::to_string(size));
    }
    const auto bytes = std::as_bytes(std::span(plain));
    set.array.data.assign(bytes.begin(), bytes.end());
  }

  std::string only_chunk(const Storage& storage, std::uint64_t size) {
    if (storage.address == kUndefined) return {};
    bytes_.expect(storage.address, "TREE");
    if (bytes_.u8(storage.address + 5) != 0 || bytes_.u16(storage.address + 6) != 1) {
      throw std::runtime_error("is cut into several chunks");
    }
    const std::uint64_t key = storage.address + 24;
    const std::size_t key_size = 8 + 8 * (storage.chunk.size() + 1);
    const auto packed = bytes_.part(bytes_.u64(key + key_size), bytes_.u32(key));
    const bool is_filtered = storage.is_deflated && (bytes_.u32(key + 4) & 1) == 0;
    return is_filtered ? inflated(packed, size) : std::string(packed);
  }

  static constexpr std::size_t kMostLevels = 32;
  static constexpr std::uint64_t kMostInAll = std::uint64_t(2) << 30;
  Bytes bytes_;
  std::uint64_t names_ = 0;
  std::uint64_t loaded_ = 0;
  std::set<std::uint64_t> seen_;
  std::map<std::string, NpyArray> arrays_;
};

}  // namespace

std::map<std::string, NpyArray> read_hdf5(const std::string& file) {
  return Hdf5Reader(file).run();
}

}  // namespace diorama::lint
