// SPDX-License-Identifier: Apache-2.0
#include "oidn_denoiser.h"

#include <OpenImageDenoise/oidn.h>

#include <memory>
#include <string>
#include <type_traits>

#include "diorama/error.h"

namespace diorama {
namespace {

struct Release {
  void operator()(OIDNDevice device) const { oidnReleaseDevice(device); }
  void operator()(OIDNFilter filter) const { oidnReleaseFilter(filter); }
};
template <class Handle>
using Owned = std::unique_ptr<std::remove_pointer_t<Handle>, Release>;

void check(OIDNDevice device) {
  const char* message = nullptr;
  if (oidnGetDeviceError(device, &message) == OIDN_ERROR_NONE) return;
  throw Error(ErrorKind::Plugin,
              std::string("Open Image Denoise: ") + (message ? message : "unknown error"));
}

}  // namespace

Image<Vec3f> oidn_denoised(const Film& film, const Host& host) {
  Image<Vec3f> result(film.width(), film.height(), Vec3f::Zero());
  if (result.pixels().empty()) return result;
  const Owned<OIDNDevice> device(oidnNewDevice(OIDN_DEVICE_TYPE_CPU));
  oidnSetDeviceInt(device.get(), "numThreads", host.thread_count());
  oidnSetDeviceBool(device.get(), "setAffinity", false);
  oidnCommitDevice(device.get());
  check(device.get());

  const Owned<OIDNFilter> filter(oidnNewFilter(device.get(), "RT"));
  const auto width = std::size_t(film.width());
  const auto height = std::size_t(film.height());
  const FilmPixel& first = film.pixels().front();
  // The library reads the film where it lies. It does not write to its inputs.
  const auto give = [&](const char* name, const Vec3f& of_first) {
    oidnSetSharedFilterImage(filter.get(), name, const_cast<float*>(of_first.data()),
                             OIDN_FORMAT_FLOAT3, width, height, 0, sizeof(FilmPixel),
                             width * sizeof(FilmPixel));
  };
  give("color", first.scattered);
  give("albedo", first.albedo);
  give("normal", first.normal);
  oidnSetSharedFilterImage(filter.get(), "output", result.pixels().front().data(),
                           OIDN_FORMAT_FLOAT3, width, height, 0, sizeof(Vec3f),
                           width * sizeof(Vec3f));
  oidnSetFilterBool(filter.get(), "hdr", true);
  oidnCommitFilter(filter.get());
  oidnExecuteFilter(filter.get());
  check(device.get());
  for (std::size_t i = 0; i < film.pixels().size(); ++i) {
    result.pixels()[i] += film.pixels()[i].seen;
  }
  return result;
}

}  // namespace diorama
