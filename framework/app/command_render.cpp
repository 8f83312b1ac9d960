// SPDX-License-Identifier: Apache-2.0
#include "framework/app/command_render.h"

#include <algorithm>
#include <filesystem>

#include "diorama/renderer.h"
#include "framework/host/replace_file.h"
#include "framework/jobs/assemble.h"
#include "framework/plugins/plugin_call.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

ImageFormat format_of(const std::string& file) {
  std::string ending = fs::path(file).extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return char(std::tolower(c)); });
  if (ending == ".png") return ImageFormat::Png;
  if (ending == ".jpg" || ending == ".jpeg") return ImageFormat::Jpeg;
  if (ending == ".exr") return ImageFormat::Exr;
  if (ending == ".hdr") return ImageFormat::Hdr;
  throw Error(ErrorKind::Usage,
              file + ": the ending says the format; expected .png, .jpg, .exr or .hdr");
}

bool is_linear(ImageFormat format) {
  return format == ImageFormat::Exr || format == ImageFormat::Hdr;
}

std::vector<std::byte> encoded(const Frame& frame, ImageFormat format, const Host& host) {
  if (is_linear(format)) {
    const Image<Vec3f>& image = frame.get(kColorHdr);
    return host.encode_image({image.pixels().data(), image.width(), image.height(), 3, 32}, format);
  }
  const Image<Rgba8>& image = frame.get(kColor);
  if (format == ImageFormat::Png) {
    return host.encode_image({image.pixels().data(), image.width(), image.height(), 4, 8}, format);
  }
  std::vector<std::uint8_t> opaque;
  for (const Rgba8& pixel : image.pixels())
    opaque.insert(opaque.end(), pixel.begin(), pixel.begin() + 3);
  return host.encode_image({opaque.data(), image.width(), image.height(), 3, 8}, format);
}

}  // namespace

int command_render(const GlobalOptions& global, const RenderOptions& options, ConsoleLog& log) {
  const ImageFormat format = format_of(options.output);
  const JobServices services = make_services(global, log.sink());
  const std::unique_ptr<Renderer> renderer =
      make_renderer(options.picture, *services.registry, *services.host);
  Scene scene;
  const NodeId camera = load_picture_scene(options.picture, scene, *services.host, log.sink());

  RenderRequest request;
  request.camera = camera;
  request.channels = {std::string(is_linear(format) ? kColorHdr.name : kColor.name)};
  request.seed = options.picture.seed;
  const std::string who = "renderer '" + options.picture.renderer + "'";
  call_component(who, [&] { renderer->prepare(scene); });
  const Frame frame = call_component(who, [&] { return renderer->render(request); });

  replace_file(options.output, encoded(frame, format, *services.host));
  log.write(LogLevel::Info, options.output + ": " + scene.path(camera) + ", " +
                                std::to_string(frame.camera.width) + "x" +
                                std::to_string(frame.camera.height));
  return 0;
}

}  // namespace diorama
