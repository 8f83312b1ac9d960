// SPDX-License-Identifier: Apache-2.0
#include "writer_hdf5/hdf5_file.h"

#include <hdf5.h>

#include <type_traits>
#include <variant>

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

void write_array(hid_t file, const char* name, std::span<const std::size_t> shape, hid_t file_type,
                 hid_t memory_type, const void* data) {
  const std::vector<hsize_t> extent(shape.begin(), shape.end());
  const Handle space(H5Screate_simple(int(extent.size()), extent.data(), nullptr), name);
  const Handle properties(H5Pcreate(H5P_DATASET_CREATE), name);
  H5Pset_obj_track_times(properties, false);
  H5Pset_chunk(properties, int(extent.size()), extent.data());
  H5Pset_deflate(properties, 4);
  const Handle set(H5Dcreate2(file, name, file_type, space, H5P_DEFAULT, properties, H5P_DEFAULT),
                   name);
  if (H5Dwrite(set, memory_type, H5S_ALL, H5S_ALL, H5P_DEFAULT, data) < 0) {
    throw Error(ErrorKind::Output, std::string("HDF5: cannot write ") + name);
  }
}

hid_t create_in_memory() {
  const Handle access(H5Pcreate(H5P_FILE_ACCESS), "file properties");
  constexpr std::size_t kGrowth = std::size_t(1) << 20;
  H5Pset_fapl_core(access, kGrowth, false);
  return H5Fcreate("diorama.hdf5", H5F_ACC_TRUNC, H5P_DEFAULT, access);
}

}  // namespace

Hdf5File::Hdf5File() : file_(create_in_memory()) {
  if (file_ < 0) throw Error(ErrorKind::Output, "HDF5: cannot make a file in memory");
}

Hdf5File::~Hdf5File() { H5Fclose(file_); }

void Hdf5File::add(const char* name, std::span<const std::size_t> shape, const std::uint8_t* data) {
  write_array(file_, name, shape, H5T_STD_U8LE, H5T_NATIVE_UINT8, data);
}

void Hdf5File::add(const char* name, std::span<const std::size_t> shape,
                   const std::uint16_t* data) {
  write_array(file_, name, shape, H5T_STD_U16LE, H5T_NATIVE_UINT16, data);
}

void Hdf5File::add(const char* name, std::span<const std::size_t> shape, const float* data) {
  write_array(file_, name, shape, H5T_IEEE_F32LE, H5T_NATIVE_FLOAT, data);
}

void Hdf5File::add(const char* name, std::span<const std::size_t> shape, const double* data) {
  write_array(file_, name, shape, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, data);
}

void Hdf5File::add(const char* name, const AnyImage& any) {
  std::visit(
      [&]<class Pixel>(const Image<Pixel>& image) {
        constexpr bool kIsColor = std::is_same_v<Pixel, Rgba8>;
        constexpr bool kIsId = std::is_same_v<Pixel, std::uint32_t>;
        constexpr std::size_t kNumbers = sizeof(Pixel) / (kIsColor ? 1 : 4);
        const std::size_t shape[] = {std::size_t(image.height()), std::size_t(image.width()),
                                     kNumbers};
        write_array(file_, name, std::span(shape).first(kNumbers > 1 ? 3 : 2),
                    kIsColor ? H5T_STD_U8LE
                    : kIsId  ? H5T_STD_U32LE
                             : H5T_IEEE_F32LE,
                    kIsColor ? H5T_NATIVE_UINT8
                    : kIsId  ? H5T_NATIVE_UINT32
                             : H5T_NATIVE_FLOAT,
                    image.pixels().data());
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

std::vector<std::byte> Hdf5File::bytes() {
  H5Fflush(file_, H5F_SCOPE_LOCAL);
  const ssize_t size = H5Fget_file_image(file_, nullptr, 0);
  std::vector<std::byte> image(size < 0 ? 0 : std::size_t(size));
  if (size <= 0 || H5Fget_file_image(file_, image.data(), image.size()) != size) {
    throw Error(ErrorKind::Output, "HDF5: cannot read the file back from memory");
  }
  return image;
}

}  // namespace diorama
