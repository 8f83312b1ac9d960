// SPDX-License-Identifier: Apache-2.0
#include "writer_hdf5/hdf5_file.h"

#include <hdf5.h>

#include <algorithm>
#include <type_traits>
#include <variant>
#include <vector>

#include "diorama/error.h"

namespace diorama {
namespace {

static_assert(sizeof(hid_t) == sizeof(std::int64_t));

/// Closes an HDF5 identifier of any kind when it goes out of scope.
class Handle {
 public:
  Handle(hid_t id, const char* what) : id_(id) {
    if (id_ < 0) throw Error(ErrorKind::Output, std::string("HDF5: cannot make ") + what);
  }
  ~Handle() { H5Idec_ref(id_); }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  operator hid_t() const { return id_; }

 private:
  hid_t id_;
};

/// In a file, and in memory.
struct NumberType {
  hid_t file;
  hid_t memory;
  std::size_t size;
};

NumberType type_of(Hdf5File::Number number) {
  switch (number) {
    case Hdf5File::Number::U8:
      return {H5T_STD_U8LE, H5T_NATIVE_UINT8, 1};
    case Hdf5File::Number::U16:
      return {H5T_STD_U16LE, H5T_NATIVE_UINT16, 2};
    case Hdf5File::Number::U32:
      return {H5T_STD_U32LE, H5T_NATIVE_UINT32, 4};
    case Hdf5File::Number::F32:
      return {H5T_IEEE_F32LE, H5T_NATIVE_FLOAT, 4};
    case Hdf5File::Number::F64:
      break;
  }
  return {H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, 8};
}

/// Of a chunk: the library packs each in a buffer of its own.
constexpr std::size_t kChunkBytes = std::size_t(1) << 19;

/// What the library frees it keeps for later, in lists of every size that it ever had: megabytes
/// that grow over thousands of files, as sizes of what is packed differ.
void keep_short_free_lists() {
  constexpr int kAll = 1 << 16;
  constexpr int kList = 1 << 14;
  static const bool once = [] {
    return H5set_free_list_limits(kAll, kList, kAll, kList, kAll, kList) >= 0;
  }();
  static_cast<void>(once);
}

hid_t create_in_memory() {
  keep_short_free_lists();
  const Handle access(H5Pcreate(H5P_FILE_ACCESS), "file properties");
  constexpr std::size_t kGrowth = std::size_t(1) << 18;
  H5Pset_fapl_core(access, kGrowth, false);
  return H5Fcreate("diorama.hdf5", H5F_ACC_TRUNC, H5P_DEFAULT, access);
}

}  // namespace

Hdf5File::Hdf5File() : file_(create_in_memory()) {
  if (file_ < 0) throw Error(ErrorKind::Output, "HDF5: cannot make a file in memory");
}

Hdf5File::~Hdf5File() { H5Fclose(file_); }

void Hdf5File::add(const char* name, Number number, std::span<const std::size_t> shape,
                   const Rows& rows) {
  const NumberType type = type_of(number);
  const std::vector<hsize_t> extent(shape.begin(), shape.end());
  std::size_t row_size = type.size;
  for (const std::size_t length : shape.subspan(1)) row_size *= length;
  std::vector<hsize_t> chunk = extent;
  const std::size_t rows_at_once = kChunkBytes / std::max<std::size_t>(row_size, 1);
  chunk[0] = std::clamp<hsize_t>(rows_at_once, 1, std::max<hsize_t>(extent[0], 1));
  const Handle space(H5Screate_simple(int(extent.size()), extent.data(), nullptr), name);
  const Handle properties(H5Pcreate(H5P_DATASET_CREATE), name);
  H5Pset_obj_track_times(properties, false);
  H5Pset_chunk(properties, int(chunk.size()), chunk.data());
  H5Pset_deflate(properties, 4);
  // Chunks are written once and in order: none needs to be kept.
  const Handle access(H5Pcreate(H5P_DATASET_ACCESS), name);
  H5Pset_chunk_cache(access, 0, 0, 1.0);
  const Handle set(H5Dcreate2(file_, name, type.file, space, H5P_DEFAULT, properties, access),
                   name);
  std::vector<hsize_t> start(extent.size(), 0);
  std::vector<hsize_t> count = extent;
  for (hsize_t row = 0; row < extent[0]; row += chunk[0]) {
    start[0] = row;
    count[0] = std::min(chunk[0], extent[0] - row);
    const Handle memory(H5Screate_simple(int(count.size()), count.data(), nullptr), name);
    H5Sselect_hyperslab(space, H5S_SELECT_SET, start.data(), nullptr, count.data(), nullptr);
    const void* data = rows(std::size_t(row), std::size_t(count[0]));
    if (H5Dwrite(set, type.memory, memory, space, H5P_DEFAULT, data) < 0) {
      throw Error(ErrorKind::Output, std::string("HDF5: cannot write ") + name);
    }
  }
}

void Hdf5File::add(const char* name, std::span<const std::size_t> shape, const double* data) {
  std::size_t row = 1;
  for (const std::size_t length : shape.subspan(1)) row *= length;
  add(name, Number::F64, shape, [&](std::size_t first, std::size_t) { return data + first * row; });
}

void Hdf5File::add(const char* name, const AnyImage& any) {
  std::visit(
      [&]<class Pixel>(const Image<Pixel>& image) {
        constexpr bool kIsColor = std::is_same_v<Pixel, Rgba8>;
        constexpr bool kIsId = std::is_same_v<Pixel, std::uint32_t>;
        constexpr std::size_t kNumbers = sizeof(Pixel) / (kIsColor ? 1 : 4);
        const std::size_t shape[] = {std::size_t(image.height()), std::size_t(image.width()),
                                     kNumbers};
        add(name,
            kIsColor ? Number::U8
            : kIsId  ? Number::U32
                     : Number::F32,
            std::span(shape).first(kNumbers > 1 ? 3 : 2),
            [&](std::size_t first, std::size_t) -> const void* {
              return image.pixels().data() + first * std::size_t(image.width());
            });
      },
      any);
}

void Hdf5File::add_text(const char* name, std::string_view text) {
  const Handle type(H5Tcopy(H5T_C_S1), name);
  H5Tset_size(type, text.empty() ? 1 : text.size());
  H5Tset_strpad(type, H5T_STR_NULLPAD);
  const Handle space(H5Screate(H5S_SCALAR), name);
  const Handle properties(H5Pcreate(H5P_DATASET_CREATE), name);
  H5Pset_obj_track_times(properties, false);
  const Handle set(H5Dcreate2(file_, name, type, space, H5P_DEFAULT, properties, H5P_DEFAULT),
                   name);
  const std::string copy = text.empty() ? std::string(1, '\0') : std::string(text);
  if (H5Dwrite(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, copy.data()) < 0) {
    throw Error(ErrorKind::Output, std::string("HDF5: cannot write ") + name);
  }
}

void Hdf5File::append_to(DatasetFiles& files, std::string_view path) {
  H5Fflush(file_, H5F_SCOPE_LOCAL);
  const ssize_t size = H5Fget_file_image(file_, nullptr, 0);
  // The file as it lies in memory: a copy would double it.
  void* place = nullptr;
  if (size <= 0 || H5Fget_vfd_handle(file_, H5P_DEFAULT, &place) < 0 || !place) {
    throw Error(ErrorKind::Output, "HDF5: cannot read the file back from memory");
  }
  const auto* bytes = *static_cast<const std::byte* const*>(place);
  files.append(path, {bytes, std::size_t(size)});
}

}  // namespace diorama
