// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "diorama/error.h"
#include "diorama/image.h"
#include "diorama/material.h"
#include "diorama/scene.h"

namespace diorama {

enum class LogLevel : std::uint8_t { Debug, Info, Warning, Error };

enum class ImageFormat : std::uint8_t { Png, Jpeg, Hdr, Exr };

/// Interleaved pixels for encoding; rows from the top without padding. The data is not owned.
/// Png: 1, 3 or 4 channels of 8 bit, or 1 of 16. Jpeg: 1 or 3 of 8 bit (quality 75).
/// Hdr: 3 of 32-bit float. Exr: 1, 3 or 4 of 32-bit float.
struct ImageView {
  const void* data = nullptr;
  int width = 0;
  int height = 0;
  int channels = 0;
  int bits_per_channel = 8;  ///< 8 or 16 unsigned (native byte order), 32 for float.
};

/// Thrown out of what is under way when the job is to end soon; what is half made is thrown away.
/// Components let it pass.
class DIORAMA_SDK_API Stopped : public Error {
 public:
  Stopped();
  ~Stopped() override;
};

/// What the host does for plugins. Outlives every component. Every function may be called from any
/// thread; load_asset not from within the bodies of parallel_for.
class DIORAMA_SDK_API Host {
 public:
  virtual ~Host();

  /// Error: the job ends; Warning: output may surprise; Info: one line per phase; Debug: free.
  virtual void log(LogLevel level, std::string_view message) = 0;

  /// Finds a file by the job's path rules: an existing local path or file:// as it is, otherwise
  /// below the assets root. Throws Error(Asset) listing what was tried; remote URLs get a message
  /// that says to mirror them.
  virtual std::filesystem::path resolve(std::string_view asset) const = 0;
  /// Files below a folder (by the same rules), recursive, sorted by path, whose ending is one that
  /// some loader claims; entries whose name holds one of `skip` (any case) are left out, folders
  /// with all that is in them.
  virtual std::vector<std::filesystem::path> list_assets(
      std::string_view folder, std::span<const std::string> skip) const = 0;

  /// Loads an asset with the loader that claims its scheme or ending and puts one new node, called
  /// after the file, below `parent`. Loaded assets are cached: a second load of the same asset
  /// shares meshes, materials and textures.
  virtual NodeId load_asset(std::string_view asset, Scene& scene, NodeId parent) = 0;

  /// Decodes PNG, JPEG, HDR (RGBE), EXR, TGA, BMP, TIFF, WebP or JPEG 2000. 8-bit images with three
  /// or four channels are marked Srgb, everything else Linear; `name` is for messages. Throws
  /// Error(Asset).
  virtual std::shared_ptr<const Texture> decode_texture(std::span<const std::byte> bytes,
                                                        std::string_view name) const = 0;
  virtual std::shared_ptr<const Texture> read_texture(const std::filesystem::path& file) const = 0;
  /// Same pixels, same bytes, on every machine with the same library versions.
  virtual std::vector<std::byte> encode_image(const ImageView& image, ImageFormat format) const = 0;

  /// Runs body(0) ... body(count - 1) on the job's threads and the calling one; returns when all
  /// are done, rethrows the first error (by index). Bodies must not depend on their order. Calls
  /// from within a body run in place.
  virtual void parallel_for(std::size_t count, const std::function<void(std::size_t)>& body) = 0;
  virtual int thread_count() const = 0;

  /// Whether the job is to end soon (Ctrl-C, SIGTERM). What takes seconds asks it now and then, but
  /// for writers: captures that were made are written. Except in writers parallel_for() asks it
  /// before each body and throws Stopped.
  virtual bool stop_requested() const;
  /// Throws Stopped if so.
  void stop_if_asked() const;
};

}  // namespace diorama
