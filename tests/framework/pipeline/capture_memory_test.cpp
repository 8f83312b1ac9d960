// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/capture_memory.h"

#include "support/catch.h"

using namespace diorama;

TEST_CASE("Visits in flight follow from threads as long as there is memory for them", "[memory]") {
  constexpr std::uint64_t kGiB = std::uint64_t(1) << 30;
  const CaptureMemory small{std::size_t(100) << 20, std::size_t(156) << 20};  // 512 MiB a visit
  CHECK(default_visits_in_flight(1, 100 * kGiB, small) == 1);
  CHECK(default_visits_in_flight(2, 100 * kGiB, small) == 2);
  CHECK(default_visits_in_flight(4, 100 * kGiB, small) == 4);
  CHECK(default_visits_in_flight(16, 100 * kGiB, small) == 16);
  CHECK(default_visits_in_flight(16, 4 * kGiB, small) == 4);
  CHECK(default_visits_in_flight(16, kGiB / 8, small) == 1);
  CHECK(default_visits_in_flight(16, 0, small) == 1);
  const CaptureMemory large{std::size_t(7) << 30, std::size_t(768) << 20};  // 8 GiB a visit
  CHECK(default_visits_in_flight(16, 100 * kGiB, large) == 6);
}

TEST_CASE("Captures that wait may fill what threads keep busy, and no more than a quarter",
          "[memory]") {
  constexpr std::uint64_t kMiB = std::uint64_t(1) << 20;
  const CaptureMemory four_cameras{100 * kMiB, 156 * kMiB};
  CHECK(default_queue_bytes(16, 200 * 1024 * kMiB, four_cameras) == 25600 * kMiB);
  CHECK(default_queue_bytes(16, 8 * 1024 * kMiB, four_cameras) == 2048 * kMiB);
  CHECK(default_queue_bytes(2, 100 * 1024 * kMiB, {kMiB, kMiB}) == 256 * kMiB);
  CHECK(default_queue_bytes(16, 0, four_cameras) == 256 * kMiB);
}
