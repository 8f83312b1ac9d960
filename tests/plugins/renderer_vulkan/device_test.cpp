// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cstdlib>
#include <future>
#include <initializer_list>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "diorama/error.h"
#include "diorama/rng.h"
#include "plugins/renderer_embree/test_world.h"
#include "support/catch.h"
#include "support/render_host/render_host.h"
#include "vulkan_arena.h"
#include "vulkan_for_tests.h"
#include "vulkan_renderer.h"

namespace diorama {
namespace {

std::string error_of(const VulkanRenderer::Params& params) {
  test::RenderHost host(1);
  try {
    VulkanRenderer(params, host);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

/// A variable of the environment while it lives.
class Environment {
 public:
  Environment(const char* name, const char* value) : name_(name) {
    const char* before = std::getenv(name);
    if (before) before_ = before;
    had_ = before != nullptr;
    setenv(name, value, 1);
  }
  ~Environment() {
    if (had_) {
      setenv(name_, before_.c_str(), 1);
    } else {
      unsetenv(name_);
    }
  }
  Environment(const Environment&) = delete;
  Environment& operator=(const Environment&) = delete;

 private:
  const char* name_;
  std::string before_;
  bool had_ = false;
};

}  // namespace

TEST_CASE("a device that is not there is named with those that are", "[vulkan]") {
  if (!test::has_vulkan_device()) return;
  VulkanRenderer::Params params;
  params.device = 77;
  const std::string text = error_of(params);
  CHECK(text.starts_with("device: there is no Vulkan device 77; this machine has 0: "));
  CHECK(text.find(VulkanInstance::of_process().device(0).name) != std::string::npos);
}

TEST_CASE("a machine without Vulkan is told what to install", "[vulkan_errors]") {
  CHECK_THROWS_WITH(VulkanInstance("libno_vulkan_here.so.1"),
                    "this machine has no Vulkan: libno_vulkan_here.so.1 is not there; install "
                    "libvulkan1 and the driver of the device, or use the renderer embree");
  CHECK_THROWS_WITH(VulkanInstance("libm.so.6"),
                    "libm.so.6 is no Vulkan loader: it has no vkCreateInstance");
}

TEST_CASE("a device that cannot trace paths is told with what it lacks", "[vulkan_errors]") {
  VulkanDeviceInfo device;
  device.name = "Board";
  device.driver = "driver 1";
  device.api = "1.2.3";
  device.memory = std::uint64_t(3) << 30;
  CHECK(description_of(device) == "Board, driver 1, Vulkan 1.2.3, 3072 MiB");
  device.missing = {"bufferDeviceAddress", "a queue for compute shaders"};
  CHECK(description_of(device) ==
        "Board, driver 1, Vulkan 1.2.3, 3072 MiB; lacks bufferDeviceAddress, a queue for compute "
        "shaders");
}

TEST_CASE("a machine without a driver is told what to install", "[vulkan]") {
  if (!test::has_vulkan_device()) return;
  const Environment none("VK_ICD_FILENAMES", "/nowhere/no_icd.json");
  const Environment none_of_new("VK_DRIVER_FILES", "/nowhere/no_icd.json");
  CHECK_THROWS_WITH(
      VulkanInstance(),
      Catch::Matchers::StartsWith("Vulkan ") &&
          ContainsSubstring("install the driver of the device, or mesa-vulkan-drivers"));
}

TEST_CASE("too little memory is told with what was wanted and what there is", "[vulkan]") {
  if (!test::has_vulkan_device()) return;
  const VulkanDevice device(0);
  std::string text;
  try {
    const VulkanBuffer buffer(device, std::size_t(1) << 50, VulkanBuffer::Place::Device, "a test");
  } catch (const Error& error) {
    text = error.what();
  }
  CAPTURE(text);
  CHECK(text.find("has too little memory: 1073741825 MiB for a test beside") != std::string::npos);
  CHECK(text.find("or the renderer embree") != std::string::npos);
}

TEST_CASE("what is lost with a device is told", "[vulkan]") {
  if (!test::has_vulkan_device()) return;
  const VulkanDevice device(0);
  CHECK(!device.is_lost());
  CHECK_THROWS_WITH(
      device.check(VK_ERROR_DEVICE_LOST, "run kernels"),
      ContainsSubstring("failed to run kernels: the device was lost; the captures that "
                        "were written stay: run the job again with --resume"));
  CHECK(device.is_lost());
}

TEST_CASE("a device is open once in a process, and stays so", "[vulkan]") {
  if (!test::has_vulkan_device()) return;
  std::weak_ptr<const PathDevice> left = shared_path_device(0);
  CHECK(!left.expired());
  CHECK(shared_path_device(0) == test::path_device());
  CHECK_THROWS_WITH(shared_path_device(77), ContainsSubstring("there is no Vulkan device 77"));
  CHECK(&test::path_device()->device.instance() == &VulkanInstance::of_process());
}

TEST_CASE("devices are numbers, or all", "[vulkan]") {
  if (!test::has_vulkan_device()) return;
  const auto numbers_of = [](const Value& devices) {
    VulkanRenderer::Params params;
    params.device = 3;
    params.devices = devices;
    return params.device_numbers();
  };
  const auto list_of = [](std::initializer_list<const char*> texts) {
    Value list = Value::make_list();
    for (const char* text : texts) list.list.push_back(Value::text(text));
    return list;
  };
  CHECK(numbers_of({}) == std::vector<int>{3});
  CHECK(numbers_of(list_of({"0", "0", "2"})) == std::vector<int>{0, 0, 2});
  CHECK_FALSE(numbers_of(Value::text("all")).empty());
  constexpr const char* kWanted =
      "devices: expected a list of device numbers such as [0, 1], or all, found ";
  CHECK_THROWS_WITH(numbers_of(Value::text("both")), Catch::Matchers::StartsWith(kWanted));
  CHECK_THROWS_WITH(numbers_of(list_of({})), Catch::Matchers::StartsWith(kWanted));
  for (const char* wrong : {"-1", "1.5", "1024", "99999999999", "", "one"}) {
    CHECK_THROWS_WITH(numbers_of(list_of({"0", wrong})), Catch::Matchers::StartsWith(kWanted));
  }
  VulkanRenderer::Params params;
  params.devices = list_of({"0", "77"});
  CHECK(error_of(params).starts_with("device: there is no Vulkan device 77; this machine has 0: "));
}

TEST_CASE("several threads send bytes to one device and get their own back", "[vulkan]") {
  if (!test::has_vulkan_device()) return;
  const VulkanDevice& device = test::path_device()->device;
  std::vector<std::future<bool>> threads;
  for (std::uint32_t thread = 0; thread < 6; ++thread) {
    threads.push_back(std::async(std::launch::async, [&device, thread] {
      std::vector<std::uint32_t> words(100'003);
      const VulkanBuffer buffer(device, words.size() * 4, VulkanBuffer::Place::Device, "a test");
      bool is_same = true;
      for (std::uint32_t round = 0; round < 20; ++round) {
        for (std::uint32_t i = 0; i < words.size(); ++i)
          words[i] = i * 7919u + thread * 31u + round;
        device.upload(std::as_bytes(std::span(words)), buffer, 0);
        std::vector<std::uint32_t> back(words.size());
        device.download(buffer, 0, std::as_writable_bytes(std::span(back)));
        is_same = is_same && back == words;
      }
      return is_same;
    }));
  }
  for (auto& thread : threads) CHECK(thread.get());
}

TEST_CASE("a device with a clock says how long its work took", "[vulkan]") {
  if (!test::has_vulkan_device()) return;
  const VulkanDevice& device = test::path_device()->device;
  if (!(device.info().nanoseconds_per_tick > 0.0)) return;
  const VulkanBuffer buffer(device, std::size_t(16) << 20, VulkanBuffer::Place::Device, "a test");
  std::array<double, 3> seconds{};
  const auto record = [&](VulkanCommands& commands) {
    for (const std::uint32_t what : {2u, 0u, 2u}) {
      commands.zero(buffer, buffer.size());
      commands.barrier();
      commands.mark(what);
    }
  };
  device.run(record, seconds);
  CHECK(seconds[0] > 0.0);
  CHECK(seconds[1] == 0.0);
  CHECK(seconds[2] > 0.0);
}

TEST_CASE("bytes go to the device and come back", "[vulkan]") {
  if (!test::has_vulkan_device()) return;
  const VulkanDevice device(0);
  // More than fits the transfer buffer, and no multiple of anything.
  std::vector<std::byte> bytes((std::size_t(33) << 20) + 5);
  for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = std::byte((i * 2654435761u) >> 13);
  const VulkanBuffer buffer(device, bytes.size() + 16, VulkanBuffer::Place::Device, "a test");
  device.upload(bytes, buffer, 16);
  std::vector<std::byte> back(bytes.size());
  device.download(buffer, 16, back);
  CHECK(back == bytes);
}

TEST_CASE("a device that ends long loops is found out", "[vulkan]") {
  if (!test::has_vulkan_device()) return;
  const VulkanDevice& device = test::path_device()->device;
  const std::uint32_t limit = test::path_device()->kernels.iteration_limit;
  const bool is_old_lavapipe =
      device.info().is_processor && device.info().driver.find("Mesa 22.3") != std::string::npos;
  // 65,535 rounds, less what is left for a kernel's small loops.
  if (is_old_lavapipe) {
    CHECK(limit == 65535 - 512);
  } else {
    CHECK(limit > 65535 - 513);
  }
}

TEST_CASE("memory of many things comes from few allocations, and goes back", "[vulkan]") {
  if (!test::has_vulkan_device()) return;
  const VulkanDevice& device = test::path_device()->device;
  const std::uint64_t before = device.held();
  VulkanArena arena(device);
  Rng rng(3);
  std::vector<VulkanRange> ranges;
  std::vector<std::size_t> sizes;
  for (int i = 0; i < 4000; ++i) {
    // Most stay, some go and leave gaps.
    if (i % 3 == 2) {
      const auto gone = std::size_t(rng.uniform() * double(ranges.size()));
      ranges.erase(ranges.begin() + std::ptrdiff_t(gone));
      sizes.erase(sizes.begin() + std::ptrdiff_t(gone));
    }
    sizes.push_back(1 + std::size_t(rng.uniform() * 9000.0));
    ranges.push_back(arena.take(sizes.back(), "a test"));
    CHECK(ranges.back().address() % 16 == 0);
  }
  CHECK(arena.buffer_count() == 1);
  std::vector<std::pair<std::size_t, std::size_t>> places;
  for (std::size_t i = 0; i < ranges.size(); ++i) {
    places.emplace_back(ranges[i].offset(), ranges[i].offset() + sizes[i]);
  }
  std::ranges::sort(places);
  for (std::size_t i = 1; i < places.size(); ++i) {
    REQUIRE(places[i - 1].second <= places[i].first);
  }
  const VulkanRange large = arena.take(std::size_t(40) << 20, "a test");
  CHECK(arena.buffer_count() == 2);
  ranges.clear();
  CHECK(arena.buffer_count() == 1);
  CHECK(device.held() == before + (std::size_t(40) << 20));
}

}  // namespace diorama
