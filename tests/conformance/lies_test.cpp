// SPDX-License-Identifier: Apache-2.0
// Seeded plugins that lie, one promise each: every one is found out, by the check that is meant to.
#include <sched.h>
#include <sys/wait.h>
#include <unistd.h>

#include <map>
#include <set>

#include "framework/conformance/conformance.h"
#include "support/catch.h"

using namespace diorama;
using namespace diorama::conformance;

namespace {

using Expected = std::map<std::string, std::string>;  // component -> check that must fail

constexpr const char* kRays = "channels are what exact rays meet";
constexpr const char* kCoverage = "coverage is what exact rays meet";
constexpr const char* kHistory = "pictures depend on the scene alone, not on pictures before";
constexpr const char* kAnotherProcess = "another process gives the same";
constexpr const char* kLeftAsItWas = "the process is left as it was";
constexpr const char* kStreams = "one node more leaves the draws of the others as they were";
constexpr const char* kAtOnce = "several threads may write at once";
constexpr const char* kFrame = "it sets what it provides and reads what it needs";
constexpr const char* kSameNodes =
    "the same asset gives the same nodes, and nothing else is touched";
constexpr const char* kFalling = "bodies fall onto the floor, all else stays";
constexpr const char* kFreeFall = "a body falls as gravity and its steps have it";
constexpr const char* kReport = "its report says what the bodies do";
constexpr const char* kRoundTrip = "what poses writes comes back as far as it is held";
constexpr const char* kReadInAnyOrder =
    "what poses writes is read in any order, by several threads";
constexpr const char* kFirstCapture = "a frame that shows nothing is survived";

/// Checks a plugin; every component is either honest or fails what is expected.
void expect(const std::string& module, const std::string& kind, const Expected& liars,
            const std::set<std::string>& honest) {
  CheckLimits limits;
  limits.busy_seconds = 5.0;
  limits.idle_seconds = 3.0;
  const std::vector<CheckResult> results = check_plugin(
      DIORAMA_CONFORMANCE_PLUGINS "/" + module + ".so", [](LogLevel, std::string_view) {}, limits);
  std::map<std::string, std::map<std::string, std::string>> failed;
  std::set<std::string> subjects;
  for (const CheckResult& result : results) {
    subjects.insert(result.subject);
    if (result.outcome == Outcome::Failed) failed[result.subject][result.check] = result.message;
  }
  for (const std::string& name : honest) {
    INFO(name);
    CHECK(subjects.contains(kind + "/" + name));
    CHECK(failed[kind + "/" + name] == std::map<std::string, std::string>{});
  }
  std::size_t found = 0;
  for (const auto& [name, check] : liars) {
    std::string told;
    for (const auto& [other, message] : failed[kind + "/" + name]) {
      told += "\n  " + other + ": " + message;
    }
    INFO(name << " should fail '" << check << "', fails" << (told.empty() ? " nothing" : told));
    CHECK(failed[kind + "/" + name].contains(check));
    found += told.empty() ? 0 : 1;
  }
  WARN(kind << "s: " << found << " of " << liars.size() << " liars found out, " << honest.size()
            << " honest");
}

/// Whether a process may see a name of its own: containers often forbid it.
bool can_rename_the_machine() {
  const pid_t child = fork();
  if (child == 0) {
    _exit(unshare(CLONE_NEWUTS) == 0 || unshare(CLONE_NEWUSER | CLONE_NEWUTS) == 0 ? 0 : 1);
  }
  int status = 0;
  return waitpid(child, &status, 0) == child && WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

}  // namespace

TEST_CASE("writers that lie are found out", "[conformance]") {
  Expected liars{{"says_process", kAnotherProcess},
                 {"says_seconds", kAnotherProcess},
                 {"says_address", kAnotherProcess},
                 {"says_heap_order", kAnotherProcess},
                 {"says_user", kAnotherProcess},
                 {"says_time_zone", kAnotherProcess},
                 {"says_batch_job", kAnotherProcess},
                 {"says_thread", "captures may come in any order, on two threads"},
                 {"loops", "a capture without frames is survived"},
                 {"sleeps", "a capture without frames is survived"},
                 {"stops", "a capture without frames is survived"},
                 {"leaves", "a capture without frames is survived"},
                 {"leaves_at_once", "a capture without frames is survived"},
                 {"overflows", "a capture without frames is survived"},
                 {"goes_elsewhere", kLeftAsItWas},
                 {"opens_rights", kLeftAsItWas},
                 {"speaks_differently", kLeftAsItWas},
                 {"sets_variable", kLeftAsItWas},
                 {"ignores_interrupts", kLeftAsItWas},
                 {"blocks_terminations", kLeftAsItWas},
                 {"leaves_a_file_open", kLeftAsItWas},
                 {"counts_itself", "what finish() writes follows from the records"},
                 {"shares_its_buffer", kAtOnce},
                 {"counts_frames", kAtOnce},
                 {"default_too_large", "defaults are within their ranges"},
                 {"draws_too_large", "defaults are within their ranges"},
                 {"item_too_large", "defaults are within their ranges"},
                 {"default_not_among_words", "defaults are within their ranges"},
                 {"says_it_twice", "parameters are documented"}};
  std::set<std::string> honest{"honest"};
  if (can_rename_the_machine()) {
    liars.emplace("says_machine", kAnotherProcess);
  } else {
    WARN("no other name of the machine here: writers that tell it are not looked for");
    honest.insert("says_machine");
  }
  expect("lying_writers", "writer", liars, honest);
}

TEST_CASE("annotators that lie are found out", "[conformance]") {
  expect("lying_annotators", "annotator",
         {{"overwrites_colour", kFrame},
          {"wrong_size", kFrame},
          {"one_size_for_all", kFrame},
          {"reads_unasked", kFrame},
          {"looks_around", kFrame},
          {"changes_instances", kFrame},
          {"changes_exposure", kFrame},
          {"replaces_the_frame", kFrame},
          {"remembers", "a frame does not depend on the frames before"},
          {"wrong_type", kFrame},
          {"needs_more", "it needs and provides what its plugin lists"},
          {"needs_itself", "it needs and provides what its plugin lists"},
          {"hangs_when_empty", kFirstCapture}},
         {"plain"});
}

TEST_CASE("randomizers that lie are found out", "[conformance]") {
  expect("lying_annotators", "randomizer",
         {{"one_stream", kStreams},
          {"node_numbers", kStreams},
          {"clock", kAnotherProcess},
          {"addresses", kAnotherProcess},
          {"turns_cameras", kStreams},
          {"paints_in_order", kStreams}},
         {"lifts"});
}

TEST_CASE("renderers that lie are found out", "[conformance]") {
  expect("lying_renderers", "renderer",
         {{"picture_left_right", kRays},
          {"picture_upside_down", kRays},
          {"all_left_right", kRays},
          {"rows_from_below", kRays},
          {"masks_all_ones", kCoverage},
          {"masks_of_the_whole_scene", kCoverage},
          {"masks_stop_at_the_image", kCoverage},
          {"depth_along_the_ray", kRays},
          {"distance_along_the_axis", kRays},
          {"cover_depth_along_the_axis", kCoverage},
          {"normals_away", kRays},
          {"normals_in_camera_space", kRays},
          {"normals_in_node_space", kRays},
          {"positions_in_camera_space", kRays},
          {"half_a_pixel_off", kRays},
          {"principal_point_in_the_centre", kRays},
          {"no_distortion", kRays},
          {"no_roll", kRays},
          {"encoded_albedo", kRays},
          {"uv_from_above", kRays},
          {"no_alpha", kRays},
          {"shows_hidden", kRays},
          {"parent_ids", kRays},
          {"one_focal_length", kRays},
          {"sees_too_near", kRays},
          {"camera_without_its_stand", kRays},
          {"culls_back_faces", kRays},
          {"first_material_only", kRays},
          {"no_textures", kRays},
          {"no_colours_of_corners", kRays},
          {"keeps_the_first_poses", kHistory},
          {"keeps_what_was_visible", kHistory},
          {"keeps_the_first_meshes", kHistory},
          {"keeps_the_first_paint", kHistory},
          {"keeps_the_first_lens", kHistory},
          {"counts_pictures", kHistory},
          {"millimetre_distances", kRays}},
         {"honest"});
}

TEST_CASE("loaders that lie are found out", "[conformance]") {
  expect("lying_loaders", "loader",
         {{"moves_the_neighbour", kSameNodes},
          {"relabels_the_neighbour", kSameNodes},
          {"spoils_and_fails", "a missing asset is an error that names it"},
          {"grows", kSameNodes},
          {"reads_its_name", kSameNodes},
          {"counts_threads", kSameNodes},
          {"second_is_broken", kSameNodes},
          {"last_is_missing", kSameNodes},
          {"black_hole", kSameNodes},
          {"invents_files", "the files of its assets are there"},
          {"other_assets", "its assets are the same each time"},
          {"shares_a_counter", "two loaders at work at once give the same"},
          {"of_this_process", kAnotherProcess}},
         {"honest"});
}

TEST_CASE("physics that lies is found out", "[conformance]") {
  expect("lying_physics", "physics",
         {{"on_the_moon", kFreeFall},
          {"says_other_steps", kFreeFall},
          {"counts_calls", "steps add up, however many are taken at once"},
          {"keeps_speeds", "a reset forgets all that was"},
          {"starts_at_rest", "a body starts with the velocity that the scene says"},
          {"hides_speeds", kFreeFall},
          {"draws_all_down", "a body without gravity stays where it is"},
          {"drifts", kFreeFall},
          {"shrinks", kFalling},
          {"relabels", kFalling},
          {"reports_nothing", kReport},
          {"reports_the_floor", kReport},
          {"falls_through", kFalling},
          {"by_threads", "the same scene gives the same bits, for any number of threads"},
          {"by_the_clock", kAnotherProcess},
          {"one_world", "two instances at work at once give the same bits"}},
         {"honest"});
}

TEST_CASE("readers that lie are found out", "[conformance]") {
  expect("lying_readers", "reader",
         {{"in_order_only", kReadInAnyOrder},
          {"first_of_all", kRoundTrip},
          {"shares_its_buffer", kReadInAnyOrder},
          {"leaves_a_note", kReadInAnyOrder},
          {"no_sizes", kReadInAnyOrder},
          {"swaps_cameras", kRoundTrip},
          {"loses_the_last", kRoundTrip},
          {"knows_everything", "an empty folder is refused by name"},
          {"blames_the_program", "files that are not what their names say are survived"}},
         {"honest"});
}
