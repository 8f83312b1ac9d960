// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <dlfcn.h>

#include <diorama/plugin.h>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <utility>
#include <vector>

/// The least that a component needs of its host.
class TestHost final : public diorama::Host {
 public:
  void log(diorama::LogLevel, std::string_view message) override {
    std::fprintf(stderr, "%.*s\n", int(message.size()), message.data());
  }
  std::filesystem::path resolve(std::string_view asset) const override { return asset; }
  std::vector<std::filesystem::path> list_assets(std::string_view,
                                                 std::span<const std::string>) const override {
    return {};
  }
  diorama::NodeId load_asset(std::string_view asset, diorama::Scene&, diorama::NodeId) override {
    throw missing(asset);
  }
  std::shared_ptr<const diorama::Texture> decode_texture(std::span<const std::byte>,
                                                         std::string_view name) const override {
    throw missing(name);
  }
  std::shared_ptr<const diorama::Texture> read_texture(
      const std::filesystem::path& file) const override {
    throw missing(file.string());
  }
  std::vector<std::byte> encode_image(const diorama::ImageView&,
                                      diorama::ImageFormat) const override {
    throw missing("image codecs");
  }
  void parallel_for(std::size_t count, const std::function<void(std::size_t)>& body) override {
    for (std::size_t i = 0; i < count; ++i) body(i);
  }
  int thread_count() const override { return 1; }

 private:
  static diorama::Error missing(std::string_view what) {
    return {diorama::ErrorKind::Asset, "the test host does not have " + std::string(what)};
  }
};

/// Loads the plugin as the program does and makes its components.
class PluginUnderTest final : private diorama::Registrar {
 public:
  explicit PluginUnderTest(const char* file) {
    void* library = dlopen(file, RTLD_NOW | RTLD_LOCAL);
    if (!library) fail(dlerror());
    using Entry = const DioramaPlugin* (*)();
    const auto entry = reinterpret_cast<Entry>(dlsym(library, "diorama_plugin"));
    if (!entry) fail("there is no entry function");
    entry()->register_components(*this);
  }

  /// The component of interface T that the plugin provides, for these parameters.
  template <class T>
  std::unique_ptr<T> make(const diorama::Value& params = diorama::Value::make_map()) {
    for (const diorama::ComponentInfo& info : components_) {
      if (info.kind != T::kKind) continue;
      diorama::Diagnostics diagnostics;
      std::unique_ptr<diorama::Component> made =
          info.make(info.context, params, info.type, {}, diagnostics, host_);
      diagnostics.raise();
      return std::unique_ptr<T>(dynamic_cast<T*>(made.release()));
    }
    fail("it provides no component of this kind");
  }

 private:
  void add(const diorama::ComponentInfo& info) override { components_.push_back(info); }
  [[noreturn]] static void fail(const char* reason) {
    std::fprintf(stderr, "the plugin does not load: %s\n", reason);
    std::exit(1);
  }
  TestHost host_;
  std::vector<diorama::ComponentInfo> components_;
};

/// Ends the test with a message when something does not hold.
inline void check(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "failed: %s\n", what);
  std::exit(1);
}
